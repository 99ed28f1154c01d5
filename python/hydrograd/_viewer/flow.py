"""The water's velocity where it is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hydrograd._hydrograd import InputError
from hydrograd._viewer.frames import Frames
from hydrograd._viewer.page import packed

if TYPE_CHECKING:
    from hydrograd._hydrograd import Rollout

Array = NDArray[np.float64]

# Most velocities that a page holds: 48 MB of it.
MOST = 3_000_000


def spacing(points: Array) -> float:
    """The distance of neighbours, m: the median over up to 200 of the points; zero without neighbours."""
    some = points[:: max(1, len(points) // 200)]
    nearest = [np.linalg.norm(points - x, axis=1) for x in some]
    positive = [float(d[d > 0.0].min()) for d in nearest if np.any(d > 0.0)]
    return float(np.median(positive)) if positive else 0.0


def flow_data(
    rollout: Rollout, frames: Frames, points: Array, center: Array, size: float, scale: float | None
) -> dict[str, Any]:
    """Velocities at the points at every frame, a solve each; zeros within bodies and too near to them."""
    count = len(points) * len(frames.steps)
    if count > MOST:
        raise InputError(
            f"view: flow: got {len(points)} points at {len(frames.steps)} frames; must be {MOST} velocities at most: "
            "give fewer points or max_frames"
        )
    velocities = np.zeros((len(frames.steps), *points.shape))
    for frame, step in enumerate(frames.steps.tolist()):
        velocities[frame], _ = rollout.known_flow(step, points)
    speeds = np.linalg.norm(velocities, axis=-1)
    moving = speeds[speeds > 0.0]
    room = spacing(points) or 0.05 * size
    # Most arrows end before the next begins.
    chosen = room / np.quantile(moving, 0.95) if len(moving) else 0.0
    return {
        "points": packed(points - center, "f4"),
        "velocities": packed(velocities, "f4"),
        "scale": float(chosen) if scale is None else scale,
        "longest": 1.5 * room,
    }
