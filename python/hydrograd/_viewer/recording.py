"""`hydrograd.record`: a rollout as a video, and what the command line makes videos with."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from hydrograd._hydrograd import InputError, Rollout, Simulator
from hydrograd._viewer.video import Video, shoot
from hydrograd._viewer.view import rollouts_of, view


def record(
    rollout: Rollout | Simulator | Sequence[Rollout | Simulator],
    file: str | os.PathLike[str],
    *,
    fps: float = 30.0,
    speed: float = 1.0,
    size: tuple[int, int] = (1280, 720),
    panel: bool = False,
    zoom: float = 1.0,
    follow: str | None = None,
    progress: Callable[[int, int], object] | None = None,
    **look: Any,
) -> Path:
    """Makes a video of a rollout's replay, or of several beside each other, and gives its absolute path.

    `file` ends in .mp4 (H.264) or .webm (VP9); any other is a folder for frame_00000.png, … Pictures are taken one by one, each at its own moment: the first at the start,
    `fps` in a second of the video, in which `speed` simulated seconds pass, and one of the last state. They are `size` pixels wide and high, and the same whenever and wherever they are taken by
    the same browser. They show what `hydrograd.view` shows, whose other arguments `look` takes (`flow`, `streamlines`, `forces`, `pressure`, `colors`, `view_from`, …), seen `zoom` times
    nearer, by a camera that goes along with the body called `follow`; with `panel`, the page's panel and its curve are in them. What takes solves takes them at as many states as there are pictures, unless
    `max_frames` says otherwise. `progress(done, total)` is told of every picture; what it raises ends the work.

    It needs Playwright and PyAV, the extra `video` (pip install playwright av), and Chromium or Chrome: on the path, of Playwright (playwright install chromium), or named by HYDROGRAD_BROWSER. That they are there is seen
    first.
    """
    asked = Video.of(file, fps, speed, size, panel, zoom, follow)
    program = asked.tools()
    rollouts = rollouts_of(rollout)
    names = list(dict.fromkeys(name for one in rollouts for name in one.simulator.body_names))
    if follow is not None and follow not in names:
        raise InputError(f"record: follow: got a body {follow!r}; must be one of {names!r}")
    ends = [one.time for one in rollouts]
    moments = asked.times(float(min(t[0] for t in ends)), float(max(t[-1] for t in ends)))
    look.setdefault("max_frames", max(2, len(moments)))
    page = view(rollouts, **look)
    return shoot(page.html, page.times, asked, program, progress)


class Command:
    """What the command line makes videos with."""

    @staticmethod
    def prepare(
        *, file: Path, fps: float, speed: float, size: tuple[int, int], panel: bool, zoom: float, follow: str | None, **look: Any
    ) -> None:
        """Refuses what can't be made, before the run."""
        Video.of(file, fps, speed, size, panel, zoom, follow).tools()

    @staticmethod
    def record(rollout: Rollout, **asked: Any) -> list[Path]:
        """Makes it, and tells on a terminal how far it is."""
        seen = sys.stderr is not None and sys.stderr.isatty()

        def progress(done: int, total: int) -> None:
            print(f"\rpicture {done} of {total}", end="" if done < total else "\n", file=sys.stderr, flush=True)

        return [record(rollout, progress=progress if seen else None, **asked)]
