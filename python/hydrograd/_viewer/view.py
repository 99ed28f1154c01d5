"""`hydrograd.view`: a rollout as a page, in a file, a browser or a notebook."""

from __future__ import annotations

import html
import os
import re
import sys
import tempfile
import warnings
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrograd._hydrograd import FileError, InputError, Rollout, Simulator
from hydrograd._viewer.data import Look, Room, page_data, share_scales
from hydrograd._viewer.frames import Frames
from hydrograd._viewer.page import beside, page
from hydrograd._viewer.pressure import pressure_data
from hydrograd._viewer.streamlines import Lines
from hydrograd._viewer.video import Video, shoot

Array = NDArray[np.float64]


class View:
    """A replay: shown by itself at the end of a notebook's cell, `save`d to a file, or `open`ed in a browser."""

    def __init__(self, html: str, title: str, height: int, times: tuple[float, float] = (0.0, 0.0)) -> None:
        self.html = html
        """The page: one text of HTML that needs nothing else."""
        self.title = title
        """What it is headed."""
        self.height = height
        """Height in a notebook, pixels."""
        self.times = times
        """First and last moment, s."""
        self.file: Path | None = None
        """Where it was last saved, if it was."""

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Writes the page, and gives its absolute path."""
        path = Path(file).absolute()
        try:
            path.write_text(self.html, encoding="utf-8")
        except OSError as error:
            raise FileError(f"view: file: {path} can't be written: {error.strerror}") from error
        self.file = path
        return path

    def open(self) -> bool:
        """Opens the page in a browser, from a file for the time being if it wasn't saved. False where there is no browser."""
        if self.file is None:
            handle, name = tempfile.mkstemp(prefix="hydrograd-", suffix=".html")
            os.close(handle)
            self.save(name)
        assert self.file is not None
        return has_browser() and webbrowser.open(self.file.as_uri())

    def record(
        self,
        file: str | os.PathLike[str],
        *,
        fps: float = 30.0,
        speed: float = 1.0,
        size: tuple[int, int] = (1280, 720),
        panel: bool = False,
        zoom: float = 1.0,
        follow: str | None = None,
        progress: Callable[[int, int], object] | None = None,
    ) -> Path:
        """Makes a video of the page, and gives its absolute path; all is as `hydrograd.record` has it."""
        asked = Video.of(file, fps, speed, size, panel, zoom, follow)
        return shoot(self.html, self.times, asked, asked.tools(), progress)

    def _repr_html_(self) -> str:
        # In a sandbox: the page's scripts can't reach the notebook.
        return (
            f'<iframe sandbox="allow-scripts" title="{html.escape(self.title)}" srcdoc="{html.escape(self.html)}" '
            f'style="width: 100%; height: {self.height}px; border: 0"></iframe>'
        )

    def __repr__(self) -> str:
        where = "" if self.file is None else f", file={str(self.file)!r}"
        return f"View({self.title!r}{where})"


def has_browser() -> bool:
    """Whether there is a browser with a screen to show it on."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    if sys.platform.startswith(("linux", "freebsd")) and not any(os.environ.get(name) for name in screens):
        return False
    try:
        webbrowser.get()
    except webbrowser.Error:
        return False
    return True


def _direction(place: str, given: ArrayLike) -> Array:
    """A unit vector."""
    try:
        vector = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)) or not np.any(vector):
        raise InputError(f"view: {place}: got {given!r}; must be a direction: three finite numbers, not all zero")
    vector = vector / np.abs(vector).max()
    out: Array = vector / np.linalg.norm(vector)
    return out


def _beside(up: Array) -> Array:
    """Where a scene is seen from unless told otherwise: from the front, a little from the right and from above."""
    ahead = np.array([0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [0.0, 0.0, -1.0])
    right = np.cross(ahead, up)
    right /= np.linalg.norm(right)
    return _direction("view_from", right - 1.6 * np.cross(up, right) + 0.9 * up)


def _colors(names: Sequence[str], given: Mapping[str, str] | None) -> dict[str, str]:
    """The colours given, by the names of bodies."""
    wanted = dict(given or {})
    for name, color in wanted.items():
        if name not in names:
            raise InputError(f"view: colors: got a body {name!r}; must be one of {names!r}")
        if not isinstance(color, str) or not re.fullmatch(r"#[0-9a-fA-F]{6}", color):
            raise InputError(f'view: colors[{name!r}]: got {color!r}; must be written "#rrggbb"')
    return wanted


def rollouts_of(given: Rollout | Simulator | Sequence[Rollout | Simulator]) -> list[Rollout]:
    """Those that are shown beside each other, one at least."""
    some = list(given) if isinstance(given, (list, tuple)) else [given]
    if not some:
        raise InputError("view: rollout: got none; must be a Rollout or a Simulator, or several in a list")
    for one in some:
        if not isinstance(one, (Rollout, Simulator)):
            kind = type(one).__name__
            raise InputError(f"view: rollout: got a value of type {kind}; must be a Rollout or a Simulator, or several in a list")
    return [one.rollout(steps=0) if isinstance(one, Simulator) else one for one in some]


def _titles(rollouts: Sequence[Rollout], given: str | Sequence[str] | None) -> list[str]:
    """A title for each."""
    if given is None:
        return [rollout.simulator.scene.name or "rollout" for rollout in rollouts]
    titles = [str(given)] * len(rollouts) if not isinstance(given, (list, tuple)) else [str(title) for title in given]
    if len(titles) != len(rollouts):
        raise InputError(f"view: title: got {len(titles)} of them; must be one for each of {len(rollouts)} rollouts")
    return titles


def _whole(place: str, given: int, least: int) -> int:
    """A whole number that isn't too small."""
    if isinstance(given, bool) or not isinstance(given, (int, np.integer)) or given < least:
        raise InputError(f"view: {place}: got {given!r}; must be a whole number, {least} or more")
    return int(given)


def _scale(place: str, given: float | None, unit: str) -> float | None:
    """A positive number, if one is given."""
    if given is None:
        return None
    if not isinstance(given, (int, float, np.integer, np.floating)) or not 0.0 < given < np.inf:
        raise InputError(f"view: {place}: got {given!r}; must be finite and positive, in {unit}")
    return float(given)


def _points(place: str, given: ArrayLike, expected: str = "must be points (n, 3), in m") -> Array:
    """Points of space, (n, 3)."""
    try:
        points = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"view: {place}: got a value of type {type(given).__name__}; {expected}") from None
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError(f"view: {place}: got an array of shape {points.shape}; {expected}")
    if not np.all(np.isfinite(points)):
        raise InputError(f"view: {place}: got numbers that aren't finite; {expected}")
    return points


def _lines(given: bool | ArrayLike, length: float | None) -> Lines | None:
    """Which lines along the flow, if any."""
    if isinstance(given, (bool, np.bool_)):
        return Lines(None, length) if given else None
    return Lines(_points("streamlines", given, "must be True, False or points (n, 3) that they go through, in m"), length)


def _pressure(given: bool | str) -> str | None:
    """Which pressure, if any."""
    if isinstance(given, (bool, np.bool_)):
        return "flow" if given else None
    if not isinstance(given, str) or given != "hydrostatic":
        raise InputError(f'view: pressure: got {given!r}; must be True, False or "hydrostatic"')
    return given


def _noted(frames: Frames, states: int) -> str:
    """What is said of the states that are left out."""
    shown = len(frames.steps)
    if shown == states:
        return f"all {states} states"
    return f"{shown} of {states} states, in between interpolated"


def view(
    rollout: Rollout | Simulator | Sequence[Rollout | Simulator],
    file: str | os.PathLike[str] | None = None,
    *,
    open: bool = False,
    title: str | Sequence[str] | None = None,
    max_frames: int = 1000,
    contacts: bool = True,
    force_scale: float | None = None,
    flow: ArrayLike | None = None,
    flow_scale: float | None = None,
    streamlines: bool | ArrayLike = False,
    streamline_length: float | None = None,
    forces: bool = False,
    pressure: bool | str = False,
    colors: Mapping[str, str] | None = None,
    up: ArrayLike = (0.0, 0.0, 1.0),
    view_from: ArrayLike | None = None,
    height: int = 520,
) -> View:
    """Makes a replay of a rollout in 3-D: one page of HTML with everything in it, that any browser with WebGL shows. Of a simulator it shows the start, before a run.
    Several in a list are shown beside each other, seen from the same place at the same moment: what is done to one is done to all.

    It is written to `file` if one is given. With `open`, it is shown in a browser, where there is one; without a browser a
    warning tells where the page is. In a notebook, the result shows itself, `height` pixels high.

    Bodies are drawn by the triangles that gaps are measured between, at the poses of the rollout; of a rollout of more than
    `max_frames` states so many, evenly spread, with the first and the last. With `contacts`, points and forces of contact
    are there too, the arrow of a newton `force_scale` (m/N) long; without one, the largest force has an arrow of a quarter of the
    scene's size, and every tenth of it one that is a quarter of that shorter. `flow` are points (n, 3), m, where arrows show the water's velocity,
    `flow_scale` (m per m/s) long, at the price of a solve a frame (`Rollout.flow`). With `streamlines`, lines along the water's velocity at the moment go
    through places around every body, or through the points (n, 3), m, that are given, up to `streamline_length` (m) from there each way, unless given three times the size of the largest body, half the diagonal of the box around it; they take some hundred solves a frame
    (`Rollout.known_flow`). With `forces`, an arrow at each body's origin shows the force of the flow on it and an arc its torque about that point, "water" of `Rollout.loads`, in proportion; the largest force of the rollout has an arrow of a quarter
    of the scene's size, the largest torque an arc about its axis with a radius of an eighth. With `pressure`, the faces of bodies in the water have colours by the pressure of the
    flow there, at the price of solves at every frame (`Rollout.pressure`); with "hydrostatic", by its sum with the pressure of the water at rest. `colors` are
    "#rrggbb" by the names of bodies, `up` is the direction that stays upright and `view_from` the one from the scene to where it
    is seen from at first, world axes. `title` is the scene's name unless given; of several rollouts one for each.
    """
    rollouts = rollouts_of(rollout)
    titles = _titles(rollouts, title)
    names = [name for one in rollouts for name in one.simulator.body_names]
    wanted = _colors(list(dict.fromkeys(names)), colors)
    upward = _direction("up", up)
    look = Look(
        up=upward,
        view_from=_beside(upward) if view_from is None else _direction("view_from", view_from),
        colors=wanted,
        contacts=contacts,
        force_scale=_scale("force_scale", force_scale, "m/N"),
        flow=None if flow is None else _points("flow", flow),
        flow_scale=_scale("flow_scale", flow_scale, "m per m/s"),
        streamlines=_lines(streamlines, _scale("streamline_length", streamline_length, "m")),
        forces=bool(forces),
        pressure=_pressure(pressure),
    )
    most = _whole("max_frames", max_frames, 2)
    height = _whole("height", height, 1)
    frames = [Frames.of(one, most) for one in rollouts]
    room = Room.of(frames)
    data = [page_data(one, its, room, look) for one, its in zip(rollouts, frames, strict=True)]
    share_scales(data, look)
    if look.pressure is not None:
        for its_data, pressed in zip(data, pressure_data(rollouts, frames, look.pressure == "hydrostatic"), strict=True):
            its_data["pressure"] = pressed
    notes = [_noted(its, len(one)) for one, its in zip(rollouts, frames, strict=True)]
    places = range(len(data)) if len(data) > 1 else [None]
    pages = [page(*of) for of in zip(titles, notes, data, places, strict=True)]
    heading = ", ".join(dict.fromkeys(titles))
    out = View(pages[0] if len(pages) == 1 else beside(heading, titles, pages), heading, height, room.range)
    if file is not None:
        out.save(file)
    if open and not out.open():
        warnings.warn(f"no browser was found to show the replay in; it is in {out.file}", stacklevel=2)
    return out
