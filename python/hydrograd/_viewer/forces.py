"""The force and the torque of the water's flow on every body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hydrograd._viewer.frames import Frames
from hydrograd._viewer.page import packed

if TYPE_CHECKING:
    from hydrograd._hydrograd import Rollout

# What `Rollout.loads` calls it.
KIND = "water"

# Torques are none below this part of the forces, at half the diagonal of the largest body.
NONE = 1e-4


def force_data(rollout: Rollout, frames: Frames) -> dict[str, Any]:
    """Forces, and torques about the bodies' origins, at every frame, a solve each; zeros where there is no water."""
    wrenches = np.zeros((*frames.positions.shape[:2], 6))
    for frame, step in enumerate(frames.steps.tolist()):
        loads = rollout.loads(step)
        if KIND in loads.kinds:
            wrenches[frame] = loads.wrenches(KIND)
    forces, torques = wrenches[..., :3], wrenches[..., 3:]
    largest = [float(np.linalg.norm(each, axis=-1).max(initial=0.0)) for each in (forces, torques)]
    # What a mesh's error makes of none, on a ball say, isn't drawn as if it were one.
    if largest[1] < NONE * largest[0] * max(frames.sizes, default=0.0):
        torques, largest[1] = 0.0 * torques, 0.0
    return {"forces": packed(forces, "f4"), "largest": largest[0], "torques": packed(torques, "f4"), "largest_torque": largest[1]}
