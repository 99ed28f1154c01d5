"""Pictures of a page, one after the other, by a browser without a screen."""

from __future__ import annotations

import asyncio
import importlib
import math
import os
import shutil
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from hydrograd._hydrograd import FileError, InputError, UnsupportedError
from hydrograd._viewer.encode import KINDS, Encoded, Pictures

if TYPE_CHECKING:
    from playwright.sync_api import Page

Made = TypeVar("Made")

# Names of browsers that Playwright drives, and the variable that names another.
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
VARIABLE = "HYDROGRAD_BROWSER"
# Drawn by software, so that pictures don't depend on the machine; nothing is fetched.
OPTIONS = (
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--force-color-profile=srgb",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
EXTRA = "pip install playwright av, which are its extra \"video\""
# Most pictures: an hour at 30 a second.
MOST = 108_000
# Longest side, pixels.
WIDEST = 7680
# How long a page may take until it is drawn, ms: what it holds may be large, the machine busy.
PATIENCE = 180_000


@dataclass(frozen=True)
class Video:
    """What is made of a page."""

    path: Path
    """A file called .mp4 or .webm, or a folder of pictures."""
    fps: float
    """Pictures in a second of the video."""
    speed: float
    """Simulated seconds in one of the video."""
    size: tuple[int, int]
    """Width and height, pixels."""
    panel: bool
    """Whether the page's panel is in them."""
    zoom: float
    """How many times nearer the camera is."""
    follow: str | None
    """The body that the camera goes along with."""

    @staticmethod
    def of(
        file: str | os.PathLike[str],
        fps: float,
        speed: float,
        size: tuple[int, int],
        panel: bool,
        zoom: float,
        follow: str | None,
    ) -> Video:
        """Checked, but for the body's name."""
        path = Path(file).absolute()
        folder = str(os.fspath(file)).endswith(("/", os.sep)) or path.is_dir()
        if not folder and path.suffix and path.suffix.lower() not in KINDS:
            raise InputError(
                f"record: file: got {str(path)!r}; must end in {' or '.join(KINDS)}, or be a folder for PNG frames: without an ending, or with a / at the end"
            )
        if folder and path.suffix.lower() in KINDS:
            raise InputError(f"record: file: got {str(path)!r}, a folder; a video can't take its place")
        for place, given, unit in (("fps", fps, "per second"), ("speed", speed, "simulated seconds a second"), ("zoom", zoom, "times")):
            if isinstance(given, bool) or not isinstance(given, (int, float, np.integer, np.floating)) or not 0.0 < given < np.inf:
                raise InputError(f"record: {place}: got {given!r}; must be finite and positive, {unit}")
        video = path.suffix.lower() in KINDS
        return Video(path, float(fps), float(speed), _size(size, even=video), bool(panel), float(zoom), _follow(follow))

    @property
    def encoded(self) -> bool:
        """Whether it is one, and not a folder."""
        return self.path.suffix.lower() in KINDS

    def times(self, first: float, last: float) -> list[float]:
        """Moments of the pictures, s: the first, then evenly on, and the last."""
        every = self.speed / self.fps
        count = (last - first) / every
        if count > MOST:
            raise InputError(f"record: fps: got {self.fps} and a speed of {self.speed}, {count:.3g} pictures; must be {MOST} at most: give fewer fps or more speed")
        # What a picture is short of the end by rounding alone has reached it.
        whole = math.ceil(count - 1e-6)
        return [min(first + k * every, last) for k in range(whole)] + [last]

    def tools(self) -> str:
        """The browser's program, once all that is needed is found; the folder of what is made is there afterwards."""
        _needs("playwright.sync_api", "playwright")
        if self.encoded:
            _needs("av", "av")
        found = browser()
        folder = self.path.parent if self.encoded else self.path
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise FileError(f"record: file: {self.path} can't be written: {error.strerror}") from error
        return found


def _size(given: tuple[int, int], even: bool) -> tuple[int, int]:
    """Width and height."""
    try:
        width, height = given
    except (TypeError, ValueError):
        width = height = 0
    whole = all(isinstance(n, (int, np.integer)) and not isinstance(n, bool) and 16 <= n <= WIDEST for n in (width, height))
    if not whole:
        raise InputError(f"record: size: got {given!r}; must be width and height, whole numbers of pixels from 16 to {WIDEST}")
    if even and (width % 2 or height % 2):
        raise InputError(f"record: size: got {given!r}; must be even numbers for a video, whose colours have half as many pixels each way")
    return int(width), int(height)


def _follow(given: str | None) -> str | None:
    """A name, if there is one."""
    if given is not None and not isinstance(given, str):
        raise InputError(f"record: follow: got {given!r}; must be the name of a body, or None")
    return given


def _needs(module: str, package: str) -> Any:
    """A module that comes with the extra."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(f"hydrograd.record needs {package}: {EXTRA}") from error


def browser() -> str:
    """The program of Chromium or Chrome: what the variable names, one on the path, or Playwright's own."""
    named = os.environ.get(VARIABLE)
    if named:
        found = shutil.which(named)
        if found is None:
            raise UnsupportedError(f"record: {VARIABLE}: got {named!r}; must be the program of Chromium or Chrome, and there is none there")
        return found
    for name in BROWSERS:
        if found := shutil.which(name):
            return found

    def own() -> str:
        with _needs("playwright.sync_api", "playwright").sync_playwright() as playwright:
            return str(playwright.chromium.executable_path)

    found = _apart(own)
    if not Path(found).is_file():
        raise UnsupportedError(
            f"record: needs Chromium or Chrome, and none of {', '.join(BROWSERS)} is on the path: apt-get install chromium (Debian), "
            f"playwright install chromium, or set {VARIABLE} to its program"
        )
    return found


def _apart(work: Callable[[], Made]) -> Made:
    """In a thread of its own where an event loop runs, as in a notebook: Playwright refuses to wait within one."""
    if asyncio._get_running_loop() is None:
        return work()
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work).result()


def shoot(html: str, times: tuple[float, float], asked: Video, program: str, progress: Callable[[int, int], object] | None) -> Path:
    """Takes all pictures of a page, by this browser's program."""
    moments = asked.times(*times)
    return _apart(lambda: _shoot(html, moments, asked, program, progress))


def _shoot(html: str, moments: list[float], asked: Video, program: str, progress: Callable[[int, int], object] | None) -> Path:
    api = importlib.import_module("playwright.sync_api")
    width, height = asked.size
    writer = Encoded(asked.path, asked.size, asked.fps) if asked.encoded else Pictures(asked.path)
    with tempfile.TemporaryDirectory(prefix="hydrograd-") as folder, api.sync_playwright() as playwright, writer:
        file = Path(folder) / "replay.html"
        file.write_text(html, encoding="utf-8")
        try:
            chromium = playwright.chromium.launch(executable_path=program, args=list(OPTIONS))
        except api.Error as error:
            raise UnsupportedError(f"record: {program} doesn't start: {str(error).strip().splitlines()[0]}; {VARIABLE} names another") from error
        try:
            page = chromium.new_page(viewport={"width": width, "height": height}, color_scheme="light", device_scale_factor=1)
            page.set_default_timeout(PATIENCE)
            page.goto(file.as_uri())
            prepare(page, asked)
            for k, moment in enumerate(moments):
                for frame in replays(page):
                    frame.evaluate("(time) => hydrograd.shoot(time)", moment)
                # What was drawn is shown with the picture after the next.
                page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
                writer.add(page.screenshot(type="png"))
                if progress is not None:
                    progress(k + 1, len(moments))
        except api.Error as error:
            raise UnsupportedError(f"record: the browser ended: {str(error).strip().splitlines()[0]}") from error
        finally:
            chromium.close()
        writer.finish()
    return asked.path


def replays(page: Page) -> list[Any]:
    """The replays of a page: itself, or those beside each other in it."""
    return page.frames[1:] or page.frames


def prepare(page: Page, asked: Video) -> None:
    """Waits until all is drawn, and hides what a hand could use."""
    page.wait_for_selector("body[data-status]")
    for frame in replays(page):
        status = frame.evaluate("() => [document.body.dataset.status, document.getElementById('note').textContent]")
        if status[0] != "drawn":
            raise UnsupportedError(f"record: {status[1]}")
    for frame in replays(page):
        frame.evaluate("(video) => hydrograd.pose(video)", {"panel": asked.panel, "zoom": asked.zoom, "follow": asked.follow})
