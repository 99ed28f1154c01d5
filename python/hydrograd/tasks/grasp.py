"""The grasp: a gripper under water that has to catch a coin and hold it.

A column that slides along y carries two fingers that close along z on a coin, which moves in the plane y-z. It is the
scene of `examples/scenes/grasp.toml`, without its controller. Coordinates `q` (…, 6): column y, finger 1 z, finger 2 z,
coin y and z (m), and its angle about x (rad); `v` their rates. Controls (3,): the forces on column and fingers, N.
World frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

import hydrograd as hg
from hydrograd.tasks._planar import ellipse_polygon_gap

# Entries of q and v.
COLUMN = 0
FINGERS = (1, 2)
COIN_Y = 3
COIN_Z = 4
COIN_TURN = 5

COORDINATES = ("column.position", "finger 1.position", "finger 2.position", "coin.y", "coin.z", "coin.angle")
"""Names of q."""
TIME_STEP = 0.01
"""Of the scene, s."""
STEPS = 250
"""Of the scene: 2.5 s."""
COIN_AXES = (0.05, 0.2)
"""Semi-axes of the coin in its plane: across its disc, along body y, and along it, m."""
REACH = 1.6
"""Of the fingers from the column, m."""
GAP = 0.015
"""At which surfaces touch, m."""
START = (0.0, -0.4, 0.4, 1.4, 0.0, 0.4)
"""The scene's q: the inner faces are 0.8 m apart, the coin between the tips."""

_TOUCH = GAP + 3e-3
_STILL = 5e-3
_HOLD = 0.5
# Corners of the lower finger from its joint, y and z, m; the upper one is its mirror image.
_FINGER = ((0.0, -0.06), (1.2, 0.0), (1.6, 0.0), (1.6, -0.32), (0.0, -0.48))


def scene(density: float = 998.0) -> hg.Scene:
    """The scene, in water of a density (kg/m³); 0 is dry land."""
    out = hg.Scene(
        hg.Fluid(density),
        name="grasp",
        gravity=(0.0, 0.0, 0.0),
        contact=hg.Contact(friction=0.65, gap=GAP, dissipation=1000.0),
        time_step=TIME_STEP,
        steps=STEPS,
    )
    column = hg.Body(
        hg.cylinder(0.06, 1.8, faces=684),
        name="column",
        shape_position=(0.0, -0.06, 0.0),
        mass=24.7,
        joint=hg.prismatic((0.0, 1.0, 0.0)),
        actuated=True,
    )
    out.add(column)
    for k, side in ((1, 1.0), (2, -1.0)):
        finger = hg.Body(
            hg.prism([(y, side * z + 0.0) for y, z in _FINGER], 0.8, faces=1056),
            name=f"finger {k}",
            parent="column",
            overlaps_parent=True,
            mass=626.9,
            joint=hg.prismatic((0.0, 0.0, 1.0)),
            limits=(-0.6, -0.05) if k == 1 else (0.05, 0.6),
            actuated=True,
        )
        out.add(finger)
    coin = hg.Body(
        hg.ellipsoid(0.2, 0.05, 0.2, faces=980),
        name="coin",
        mass=10.776,
        inertia=(0.130, 0.236, 0.130),
        joint=hg.planar("yz"),
    )
    out.add(coin)
    out.set_initial(q=START)
    return out


def gaps(q: ArrayLike) -> NDArray[np.float64]:
    """Gaps between the coin and finger 1 and finger 2, (…, 2), m; negative where they overlap."""
    q = np.asarray(q, dtype=float)
    corners = np.array(_FINGER)[::-1]
    along = q[..., COIN_Y] - q[..., COLUMN]
    found = []
    for finger, side in zip(FINGERS, (1.0, -1.0)):
        center = np.stack([along, side * (q[..., COIN_Z] - q[..., finger])], axis=-1)
        found.append(ellipse_polygon_gap(center, side * q[..., COIN_TURN], COIN_AXES, corners))
    return np.stack(found, axis=-1)


def slip(v: ArrayLike) -> NDArray[np.float64]:
    """The fastest that any point of the coin's rim moves against a finger, (…), m/s."""
    v = np.asarray(v, dtype=float)
    spin = max(COIN_AXES) * np.abs(v[..., COIN_TURN])
    along = v[..., COIN_Y] - v[..., COLUMN]
    against = [np.hypot(along, v[..., COIN_Z] - v[..., finger]) for finger in FINGERS]
    return np.asarray(np.maximum(*against) + spin)


def between(q: ArrayLike) -> NDArray[np.bool_]:
    """Whether the coin's centre lies between the fingers, (…)."""
    q = np.asarray(q, dtype=float)
    along, z = q[..., COIN_Y] - q[..., COLUMN], q[..., COIN_Z]
    inside = (along >= 0.0) & (along <= REACH)
    return np.asarray(inside & (q[..., FINGERS[0]] < z) & (z < q[..., FINGERS[1]]))


def held(q: ArrayLike, v: ArrayLike) -> NDArray[np.bool_]:
    """Whether the coin is held, (…): between the fingers, touched by both (to 3 mm), no point of it faster than 5 mm/s
    against a finger.
    """
    touched = (gaps(q) <= _TOUCH).all(-1)
    return np.asarray(between(q) & touched & (slip(v) < _STILL))


def held_since(rollout: hg.Rollout) -> float | None:
    """Since when the coin is held at the end, s; None if it isn't."""
    flags = held(rollout.q, rollout.v)
    if not flags[-1]:
        return None
    lost = np.flatnonzero(~flags)
    return float(rollout.time[lost[-1] + 1 if len(lost) else 0])


def caught(rollout: hg.Rollout) -> bool:
    """Whether it is held for the last half second."""
    since = held_since(rollout)
    return since is not None and bool(rollout.time[-1] - since >= _HOLD - 1e-9)


def finger_outline(q: ArrayLike, finger: int) -> NDArray[np.float64]:
    """Corners of finger 0 or 1 in the world's plane y-z, (5, 2), m."""
    q = np.asarray(q, dtype=float)
    side = (1.0, -1.0)[finger]
    return np.asarray(np.array(_FINGER) * [1.0, side] + [q[COLUMN], q[FINGERS[finger]]])
