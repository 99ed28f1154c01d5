"""The data of a page: what its scripts draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hydrograd._viewer.flow import flow_data
from hydrograd._viewer.forces import force_data
from hydrograd._viewer.frames import Frames, quaternions
from hydrograd._viewer.page import packed
from hydrograd._viewer.streamlines import Lines, streamline_data

if TYPE_CHECKING:
    from hydrograd._hydrograd import Rollout

Array = NDArray[np.float64]

# Told apart also by most who see few colours; none is the red of the forces.
PALETTE = ("#3f74b5", "#e6a23c", "#3a9d78", "#8f6bb3", "#59b4c9", "#a9714b", "#8a949c", "#b9b545")


@dataclass(frozen=True)
class Look:
    """How it is drawn."""

    up: Array
    """Unit vector, (3,)."""
    view_from: Array
    """Direction from the scene to where it is seen from, unit vector, (3,)."""
    colors: Mapping[str, str]
    """Given ones, #rrggbb, by the names of bodies."""
    contacts: bool
    """Whether contacts are there."""
    force_scale: float | None
    """Length of the arrow of a newton, m/N; None: lengths go with the logarithm."""
    flow: Array | None
    """Points where the water's velocity is drawn, (n, 3), m."""
    flow_scale: float | None
    """Length of the arrow of a speed, m per m/s; None: it is chosen."""
    forces: bool
    """Whether the forces of the flow are there."""
    streamlines: Lines | None
    """Lines along the water's velocity, if they are there."""
    pressure: str | None
    """What colours the faces of bodies: the "flow"'s pressure, "hydrostatic" with that of the water at rest, or nothing."""


def colors(names: Sequence[str], given: Mapping[str, str]) -> list[str]:
    """A colour for each body: that given by its name, or the next of the palette."""
    return [given.get(name, PALETTE[i % len(PALETTE)]) for i, name in enumerate(names)]


def contact_data(rollout: Rollout, frames: Frames, center: Array, look: Look) -> dict[str, Any]:
    """Contacts of the steps that begin at the frames."""
    starts = [0]
    positions, forces = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for step in frames.steps.tolist():
        count = 0
        if look.contacts and step < rollout.steps:
            found = rollout.contacts(step)
            positions.append(found.positions - center)
            forces.append(found.forces)
            count = len(found)
        starts.append(starts[-1] + count)
    force = np.concatenate(forces)
    return {
        "starts": packed(starts, "i4"),
        "positions": packed(np.concatenate(positions), "f4"),
        "forces": packed(force, "f4"),
        "scale": look.force_scale,
        "largest": float(np.linalg.norm(force, axis=1).max(initial=0.0)),
    }


def series_data(rollout: Rollout, frames: Frames) -> list[dict[str, Any]]:
    """Quantities against time: those that are there."""
    kinetic, potential = rollout.kinetic_energy, rollout.potential_energy
    columns = [("kinetic energy", "J", kinetic)]
    if np.any(potential != 0.0):
        columns += [("potential energy", "J", potential), ("energy", "J", kinetic + potential)]
    gap = rollout.min_gap
    if np.any(np.isfinite(gap)):
        columns.insert(0, ("smallest gap", "m", gap))
    # Single precision would lose what little an energy changes beside its size; its range ends at 1e38.
    return [{"name": name, "unit": unit, "values": packed(c[frames.steps], "f8")} for name, unit, c in columns]


def wall_data(rollout: Rollout, center: Array) -> list[dict[str, Any]]:
    """The walls: for each the point nearest to the scene's centre, and the unit normal into the water."""
    out = []
    for point, normal, surface in rollout.simulator.scene.walls:
        unit = np.asarray(normal) / np.linalg.norm(normal)
        near = unit * (unit @ (np.asarray(point) - center))
        out.append({"point": near.tolist(), "normal": unit.tolist(), "surface": surface})
    return out


def body_data(names: Sequence[str], frames: Frames, look: Look) -> list[dict[str, Any]]:
    """The bodies: names, colours, and surfaces in their own frames."""
    out = []
    for name, color, surface in zip(names, colors(names, look.colors), frames.surfaces, strict=True):
        body: dict[str, Any] = {"name": name, "color": color, "middle": [0.0, 0.0, 0.0], "vertices": None}
        if surface is not None:
            body["middle"] = surface.middle.tolist()
            body["vertices"] = packed(surface.vertices, "f4")
            body["faces"] = packed(surface.faces, "i4")
        out.append(body)
    return out


@dataclass(frozen=True)
class Room:
    """What all pages beside each other show: where and when."""

    low: Array
    """Corner of a box around all bodies at all times, (3,), m."""
    high: Array
    """The other corner."""
    range: tuple[float, float]
    """First and last time, s."""

    @staticmethod
    def of(all_frames: Sequence[Frames]) -> Room:
        """Room for all of them."""
        boxes = [frames.box() for frames in all_frames]
        return Room(
            low=np.min([low for low, _ in boxes], axis=0),
            high=np.max([high for _, high in boxes], axis=0),
            range=(min(float(f.time[0]) for f in all_frames), max(float(f.time[-1]) for f in all_frames)),
        )


def share_scales(pages: Sequence[dict[str, Any]], look: Look) -> None:
    """Arrows that are as long stand for as much on all pages, whose scales were chosen one by one."""
    largest = max(data["contacts"]["largest"] for data in pages)
    for data in pages:
        data["contacts"]["largest"] = largest
    forces = [data["forces"] for data in pages if data["forces"] is not None]
    lines = [data["streamlines"] for data in pages if data["streamlines"] is not None]
    for some, key in ((forces, "largest"), (forces, "largest_torque"), (lines, "fastest")):
        most = max((each[key] for each in some), default=0.0)
        for of in some:
            of[key] = most
    flows = [data["flow"] for data in pages if data["flow"] is not None]
    if look.flow_scale is None and flows:
        moving = [flow["scale"] for flow in flows if flow["scale"] > 0.0]
        for flow in flows:
            flow["scale"] = min(moving, default=0.0)


def page_data(rollout: Rollout, frames: Frames, room: Room, look: Look) -> dict[str, Any]:
    """All of it. Positions are counted from the middle of the scene, so that single precision does."""
    low, high = room.low, room.high
    center = 0.5 * (low + high)
    size = float(np.linalg.norm(high - low)) or 1.0
    flow = None
    if look.flow is not None:
        flow = flow_data(rollout, frames, look.flow, center, size, look.flow_scale)
    return {
        "flow": flow,
        "forces": force_data(rollout, frames) if look.forces else None,
        "streamlines": None if look.streamlines is None else streamline_data(rollout, frames, look.streamlines, center, size),
        "pressure": None,
        "up": look.up.tolist(),
        "view_from": look.view_from.tolist(),
        "center": center.tolist(),
        "size": size,
        "lowest": -float(0.5 * (high - low) @ np.abs(look.up)),
        "range": list(room.range),
        "time": packed(frames.time, "f8"),
        "steps": packed(frames.steps, "i4"),
        "positions": packed(frames.positions - center, "f4"),
        "rotations": packed(quaternions(frames.rotations), "f4"),
        "bodies": body_data(rollout.simulator.body_names, frames, look),
        "walls": wall_data(rollout, center),
        "contacts": contact_data(rollout, frames, center, look),
        "series": series_data(rollout, frames),
    }
