"""The water's pressure on the faces of bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hydrograd._hydrograd import InputError
from hydrograd._viewer.frames import Frames
from hydrograd._viewer.page import packed

if TYPE_CHECKING:
    from hydrograd._hydrograd import Rollout

Single = NDArray[np.float32]

# Most pressures that a page holds, a byte each: 48 MB of it.
MOST = 36_000_000

# Part of all pressures that the scale has room for: peaks at edges would leave everything else pale.
WITHIN = 0.98

# The largest number that is written; that below its negative is a face whose pressure isn't a number.
STEPS = 127


def pressures(rollout: Rollout, frames: Frames, hydrostatic: bool) -> dict[int, Single]:
    """Pressures of the flow on each body in the water, by its number: (F, faces), Pa; with `hydrostatic` that of the water at rest is added. Solves at every frame."""
    numbers = {name: body for body, name in enumerate(rollout.simulator.body_names)}
    out: dict[int, Single] = {}
    for frame, step in enumerate(frames.steps.tolist()):
        found = {numbers[p.name]: p for p in rollout.pressure(step)}
        if frame == 0:
            counts = {body: len(p.pressures) for body, p in found.items()}
            check(counts, frames)
            out = {body: np.zeros((len(frames.steps), count), np.float32) for body, count in counts.items()}
        for body, rows in out.items():
            of = found[body]
            rows[frame] = of.pressures + of.hydrostatic if hydrostatic else of.pressures
    return out


def check(counts: dict[int, int], frames: Frames) -> None:
    """Refuses more than a page holds, and faces that aren't those that are drawn."""
    faces = sum(counts.values())
    if faces * len(frames.steps) > MOST:
        raise InputError(
            f"view: pressure: got {faces} faces at {len(frames.steps)} frames; must be {MOST} pressures at most: "
            "give fewer max_frames, or make the simulator with fewer faces"
        )
    for body, count in counts.items():
        surface = frames.surfaces[body]
        drawn = 0 if surface is None else len(surface.faces)
        if count != drawn:
            raise InputError(f"view: pressure: got {count} faces of body {body}; must be the {drawn} of its mesh: leave pressure out")


def scale(all_values: Sequence[Single]) -> float:
    """The pressure at the ends of the colours, Pa: what most don't exceed; zero where there is none."""
    sizes = np.concatenate([np.abs(values[np.isfinite(values)]) for values in all_values] or [np.zeros(0, np.float32)])
    if not len(sizes):
        return 0.0
    return float(np.quantile(sizes, WITHIN)) or float(sizes.max())


def codes(values: Single, most: float) -> NDArray[np.int8]:
    """Pressures as whole numbers from -STEPS at -most to STEPS at most, and those beyond at the ends."""
    parts = np.clip(values / most, -1.0, 1.0) if most > 0.0 else 0.0 * values
    known = np.isfinite(values)
    return np.where(known, np.rint(STEPS * np.where(known, parts, 0.0)), -STEPS - 1).astype(np.int8)


def pressure_data(rollouts: Sequence[Rollout], all_frames: Sequence[Frames], hydrostatic: bool) -> list[dict[str, Any]]:
    """Of each rollout, on one scale."""
    found = [pressures(rollout, frames, hydrostatic) for rollout, frames in zip(rollouts, all_frames, strict=True)]
    most = scale([values for bodies in found for values in bodies.values()])
    out = []
    for bodies, frames in zip(found, all_frames, strict=True):
        count = len(frames.steps)
        each = np.concatenate([np.zeros((count, 0), np.float32), *bodies.values()], axis=1)
        ends = np.zeros((count, 2))
        if each.shape[1]:
            ends = np.stack([np.fmin.reduce(each, axis=1), np.fmax.reduce(each, axis=1)], axis=1)
        out.append(
            {
                "bodies": [{"body": body, "codes": packed(codes(values, most), "i1")} for body, values in bodies.items()],
                "scale": most,
                "steps": STEPS,
                "ends": packed(ends, "f4"),
                "hydrostatic": hydrostatic,
            }
        )
    return out
