"""The swimmer: a fish of four links that has to swim along x.

The links are ellipsoids of the water's density, hinged end to end about z; the head moves in the plane x-y.
Coordinates `q` (…, 6): head x, y (m) and heading (rad), then the angles of the three hinges (rad); `v` their rates.
Controls (3,): the torques of the hinges, N m. World frame. Without effort the fish drifts: the hinges have no springs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

import hydrograd as hg

COORDINATES = ("head.x", "head.y", "head.angle", "link 1.angle", "link 2.angle", "link 3.angle")
"""Names of q."""
LINKS = 4
HALF_LENGTH = 0.1
"""Of a link, m."""
BEND = 1.2
"""At which the hinges stop, rad."""
TIME_STEP = 0.01
"""Of the scene, s."""
STEPS = 1000
"""Of the scene: 10 s."""
RESOLVED_GAP = 0.05
"""To which the water between two links is to be resolved, m: those that aren't neighbours keep 0.19 m apart."""

OUTLINE = (HALF_LENGTH, 0.02)
"""Semi-axes of a link in the plane, m."""

_DENSITY = 998.0
_AXES = (*OUTLINE, 0.06)
# Of the flow across the links, per area; and friction along them, N s/m³: some 0.01 of the dynamic pressure at 0.2 m/s.
_DRAG, _FRICTION = 1.0, 1.0


def scene() -> hg.Scene:
    """The scene, with the fish straight and at rest."""
    out = hg.Scene(hg.Fluid(_DENSITY), name="swimmer", gravity=(0.0, 0.0, 0.0), time_step=TIME_STEP, steps=STEPS)
    shape = hg.ellipsoid(*_AXES, faces=320)
    drag = hg.Drag(linear=_FRICTION, part="tangential", quadratic=_DRAG, quadratic_part="normal")
    out.add(hg.Body(shape, name="head", density=_DENSITY, drag=drag, joint=hg.planar("xy")))
    for k in range(1, LINKS):
        link = hg.Body(
            shape,
            name=f"link {k}",
            parent="head" if k == 1 else f"link {k - 1}",
            overlaps_parent=True,
            density=_DENSITY,
            drag=drag,
            # The hinge is the rear end of the link before, and the front end of this one.
            position=(-HALF_LENGTH if k == 1 else -2.0 * HALF_LENGTH, 0.0, 0.0),
            shape_position=(-HALF_LENGTH, 0.0, 0.0),
            joint=hg.revolute((0.0, 0.0, 1.0)),
            limits=(-BEND, BEND),
            actuated=True,
        )
        out.add(link)
    return out


def centers(q: ArrayLike) -> NDArray[np.float64]:
    """Centres of the links, head first, (…, 4, 2), m."""
    q = np.asarray(q, dtype=float)
    headings = np.cumsum(q[..., 2:], axis=-1)
    along = HALF_LENGTH * np.stack([np.cos(headings), np.sin(headings)], axis=-1)
    found = [q[..., :2]]
    for k in range(1, LINKS):
        found.append(found[-1] - along[..., k - 1, :] - along[..., k, :])
    return np.stack(found, axis=-2)


def center_of_mass(q: ArrayLike) -> NDArray[np.float64]:
    """Of the whole fish, (…, 2), m: its links are equal."""
    return np.asarray(centers(q).mean(-2))
