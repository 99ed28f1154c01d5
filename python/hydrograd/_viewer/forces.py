"""The force of the water's flow on every body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hydrograd._viewer.frames import Frames
from hydrograd._viewer.page import packed

if TYPE_CHECKING:
    from hydrograd._hydrograd import Rollout

# What `Rollout.loads` calls it.
KIND = "water"


def force_data(rollout: Rollout, frames: Frames) -> dict[str, Any]:
    """Forces at every frame, a solve each; zeros where there is no water."""
    forces = np.zeros(frames.positions.shape)
    for frame, step in enumerate(frames.steps.tolist()):
        loads = rollout.loads(step)
        if KIND in loads.kinds:
            forces[frame] = loads.wrenches(KIND)[:, :3]
    return {"forces": packed(forces, "f4"), "largest": float(np.linalg.norm(forces, axis=-1).max(initial=0.0))}
