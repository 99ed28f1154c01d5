"""Lines along the water's velocity, at a moment each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hydrograd._hydrograd import InputError
from hydrograd._viewer.frames import Frames
from hydrograd._viewer.page import packed

if TYPE_CHECKING:
    from hydrograd._hydrograd import Rollout

Array = NDArray[np.float64]

# Most points of lines that a page holds: 43 MB of it.
MOST = 2_000_000

# A step in the size of the smallest body, half the diagonal of the box around it, and the most of them along a line in each direction.
STEP = 0.2
MOST_STEPS = 40
# Points of a line in each step of its integration: cubics through its ends, along the flow there.
BETWEEN = 4
# How often a step is halved where it would end in a body.
HALVINGS = 4
# Reach of a line in each direction, in the size of the largest body, unless it is given.
REACH = 3.0
# What is slower than this part of the fastest body is still.
STILL = 1e-4


@dataclass(frozen=True)
class Lines:
    """Which lines."""

    seeds: Array | None
    """Points that they go through, (n, 3), m; None: places around every body that go with it."""
    length: float | None
    """How far they go from there in each direction, m; None: it is chosen."""


def around(count: int) -> Array:
    """`count` directions, evenly spread (Fibonacci's lattice on a sphere), (count, 3)."""
    k = np.arange(count) + 0.5
    height, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    level = np.sqrt(1.0 - height**2)
    return np.stack([level * np.cos(turn), level * np.sin(turn), height], axis=1)


def seeds_around(frames: Frames, frame: int) -> Array:
    """Places around every body with a shape, on an ellipsoid that its box doesn't reach: (n, 3), m."""
    bodies = [body for body, surface in enumerate(frames.surfaces) if surface is not None]
    directions = around(int(np.clip(96 // max(len(bodies), 1), 4, 16)))
    out = [np.zeros((0, 3))]
    for body in bodies:
        surface = frames.surfaces[body]
        assert surface is not None
        # Plates are gone around at their edges, too.
        reach = np.maximum(surface.reach, 0.3 * surface.reach.max())
        local = surface.middle + 1.05 * np.sqrt(3.0) * reach * directions
        out.append(frames.positions[frame, body] + local @ frames.rotations[frame, body].T)
    return np.concatenate(out)


def traced(rollout: Rollout, state: int, seeds: Array, length: float, step: float, still: float) -> list[tuple[Array, Array]]:
    """The lines through the seeds at a state, up to `length` from there in each direction: points (k, 3), m, and the water's speed there (k,), m/s. A line ends where the water is slower than `still`, at
    bodies and walls; one without a step is left out.

    Runge and Kutta's classical steps of `step` along the direction of the velocity, of all lines at once, four solves each. A step that would end where the flow isn't known is halved.
    """

    def flow(points: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        velocities, known = rollout.known_flow(state, points)
        speeds = np.linalg.norm(velocities, axis=1)
        moves = known & (speeds > still)
        return np.divide(velocities, speeds[:, None], out=np.zeros_like(velocities), where=moves[:, None]), speeds, moves

    along, speeds, moves = flow(seeds)
    start = np.flatnonzero(moves)
    # Downstream, then upstream.
    sign = np.repeat([1.0, -1.0], len(start))[:, None]
    at, direction = np.tile(seeds[start], (2, 1)), sign * np.tile(along[start], (2, 1))
    paths = [[(at[i].copy(), direction[i].copy(), speeds[start[i % len(start)]])] for i in range(len(at))]
    own, left = np.full(len(at), step), np.full(len(at), length)
    goes = np.arange(len(at))
    # Lines that wind their way past bodies in short steps end where others have long ended.
    for _ in range(3 * int(np.ceil(length / step))):
        if not len(goes):
            break
        h = np.minimum(own[goes], left[goes])[:, None]
        x, k1, side = at[goes], direction[goes], sign[goes]
        k2, _, ok2 = flow(x + 0.5 * h * k1)
        k3, _, ok3 = flow(x + 0.5 * h * side * k2)
        k4, _, ok4 = flow(x + h * side * k3)
        end = x + h / 6.0 * (k1 + side * (2.0 * k2 + 2.0 * k3 + k4))
        after, speed, ok = flow(end)
        ok &= ok2 & ok3 & ok4
        # Past a place where the flow parts or meets its direction turns back: no step goes there.
        ok &= np.sum(after * side * k1, axis=1) > 0.0
        done = goes[ok]
        at[done], direction[done] = end[ok], (side * after)[ok]
        left[done] -= h[ok, 0]
        own[done] = np.minimum(step, 2.0 * own[done])
        own[goes[~ok]] = 0.5 * h[~ok, 0]
        for i, v in zip(done.tolist(), speed[ok].tolist(), strict=True):
            paths[i].append((at[i].copy(), direction[i].copy(), v))
        goes = goes[(left[goes] > 1e-9 * length) & (own[goes] > 0.9 * step / 2**HALVINGS)]
    out = []
    for i in range(len(start)):
        down, up = paths[i], paths[i + len(start)]
        whole = [(x, -t, v) for x, t, v in reversed(up[1:])] + down
        if len(whole) > 1:
            out.append(smoothed(*(np.array(part) for part in zip(*whole, strict=True))))
    return out


def smoothed(points: Array, directions: Array, speeds: Array) -> tuple[Array, Array]:
    """Points between those of the steps, by cubics that have the flow's direction there, and speeds in proportion."""
    t = (np.arange(BETWEEN) / BETWEEN)[None, :, None]
    a, b = points[:-1, None], points[1:, None]
    chord = np.linalg.norm(b - a, axis=-1, keepdims=True)
    from_a, from_b = chord * directions[:-1, None], chord * directions[1:, None]
    cubic = (1 + 2 * t) * (1 - t) ** 2 * a + t * (1 - t) ** 2 * from_a + t**2 * (3 - 2 * t) * b + t**2 * (t - 1) * from_b
    places = np.arange(BETWEEN * (len(points) - 1) + 1) / BETWEEN
    return np.concatenate([cubic.reshape(-1, 3), points[-1:]]), np.interp(places, np.arange(len(points)), speeds)


def fastest_body(rollout: Rollout, size: float) -> float:
    """Of all bodies at all states, by their origins and by turning, m/s."""
    velocities = rollout.velocities
    linear, angular = (np.linalg.norm(part, axis=-1).max(initial=0.0) for part in (velocities[..., :3], velocities[..., 3:]))
    return float(linear + size * angular)


def streamline_data(rollout: Rollout, frames: Frames, lines: Lines, center: Array, room: float) -> dict[str, Any]:
    """Lines at every frame, at the price of many solves each; none where the water is still."""
    bodies = frames.sizes or [0.1 * room]
    length = REACH * max(bodies) if lines.length is None else lines.length
    step = max(STEP * min(bodies), length / MOST_STEPS)
    still = STILL * fastest_body(rollout, max(bodies))
    count = len(seeds_around(frames, 0)) if lines.seeds is None else len(lines.seeds)
    most = count * len(frames.steps) * (2 * BETWEEN * int(np.ceil(length / step)) + 1)
    if most > MOST:  # before anything is solved
        raise InputError(
            f"view: streamlines: got {count} lines at {len(frames.steps)} frames, up to {most} points; must be {MOST} points at most: give fewer points to start from, max_frames, or a shorter streamline_length"
        )
    points, speeds, ends, starts = [np.zeros((0, 3))], [np.zeros(0)], [0], [0]
    for frame, state in enumerate(frames.steps.tolist()):
        seeds = seeds_around(frames, frame) if lines.seeds is None else lines.seeds
        found = traced(rollout, state, seeds, length, step, still)
        for line, speed in found:
            points.append(line - center)
            speeds.append(speed)
            ends.append(ends[-1] + len(line))
        starts.append(starts[-1] + len(found))
    speed = np.concatenate(speeds)
    return {
        "points": packed(np.concatenate(points), "f4"),
        "speeds": packed(speed, "f4"),
        "lines": packed(ends, "i4"),
        "frames": packed(starts, "i4"),
        "fastest": float(speed.max(initial=0.0)),
    }
