"""A browser without a screen, and the pictures that it takes."""

import contextlib
import importlib
import os
import pathlib
import re
import shutil
import struct
import subprocess
import zlib

import numpy as np
import pytest

WIDTH, HEIGHT = 1000, 540  # pixels
OPTIONS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    # One process, whose clock stands still while a frame in a sandbox is behind.
    "--disable-features=IsolateSandboxedIframes",
    f"--window-size={WIDTH},{HEIGHT}",
]


def find() -> str:
    """The browser; without one the test is skipped, or fails where HYDROGRAD_REQUIRE_BROWSER is 1."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if found := shutil.which(name):
            return found
    reason = "needs Chromium (Debian: apt-get install chromium)"
    if os.environ.get("HYDROGRAD_REQUIRE_BROWSER") == "1":
        pytest.fail(reason)
    pytest.skip(reason)


def _run(file: pathlib.Path, after: str, *more: str, clock: int = 3000) -> str:
    profile = file.with_suffix(".profile")
    command = [find(), *OPTIONS, f"--user-data-dir={profile}", f"--virtual-time-budget={clock}", *more, file.as_uri() + after]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return done.stdout


def body(file: pathlib.Path, after: str = "", *more: str, clock: int = 3000) -> tuple[dict[str, str], str]:
    """What the page says on its body (`data-…`), and all of the page after its scripts ran for so many ms of its own clock."""
    page = _run(file, after, "--dump-dom", *more, clock=clock)
    found = re.search(r"<body([^>]*)>", page)
    assert found
    return dict(re.findall(r'data-(\w+)="([^"]*)"', found[1])), page


def picture(file: pathlib.Path, after: str = "", clock: int = 3000) -> np.ndarray:
    """The page as pixels, (HEIGHT, WIDTH, 3), 0 to 255, after so many ms of its own clock."""
    png = file.with_suffix(".png")
    _run(file, after, f"--screenshot={png}", clock=clock)
    return pixels(png.read_bytes())


@contextlib.contextmanager
def opened(file: pathlib.Path):
    """The page, as Playwright drives it: by the clock of the world, for what has to be waited for."""
    program = find()
    if os.environ.get("HYDROGRAD_REQUIRE_BROWSER") != "1":
        pytest.importorskip("playwright")
    api = importlib.import_module("playwright.sync_api")
    with api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=program, args=OPTIONS)
        try:
            page = chromium.new_page(viewport={"width": WIDTH, "height": HEIGHT})
            page.set_default_timeout(180_000)
            page.goto(file.as_uri())
            yield page
        finally:
            chromium.close()


def pixels(png: bytes) -> np.ndarray:
    """The pixels of a PNG file with 8 bits a channel, (rows, columns, 3)."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    at, packed, head = 8, b"", b""
    while at < len(png):
        size, kind = struct.unpack(">I4s", png[at : at + 8])
        part = png[at + 8 : at + 8 + size]
        head, packed = (part, packed) if kind == b"IHDR" else (head, packed + part * (kind == b"IDAT"))
        at += size + 12
    columns, rows, depth, kind = struct.unpack(">IIBB", head[:10])
    channels = {2: 3, 6: 4}[kind]
    assert depth == 8 and head[12] == 0
    lines = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(rows, 1 + columns * channels)
    out = np.zeros((rows + 1, columns + 1, channels), np.int64)  # with a row and a column of zeros before
    for row, line in enumerate(lines):
        change = line[1:].reshape(columns, channels).astype(np.int64)
        above, now = out[row], out[row + 1]
        if line[0] == 0:
            now[1:] = change
        elif line[0] == 1:
            now[1:] = np.cumsum(change, axis=0) % 256
        elif line[0] == 2:
            now[1:] = (change + above[1:]) % 256
        else:
            predict = _average if line[0] == 3 else _paeth
            for c in range(channels):
                left, row_above, deltas = 0, above[:, c].tolist(), change[:, c].tolist()
                for x, delta in enumerate(deltas):
                    left = (delta + predict(left, row_above[x + 1], row_above[x])) % 256
                    now[x + 1, c] = left
    return out[1:, 1:, :3].astype(np.uint8)


def _average(left: int, above: int, _: int) -> int:
    return (left + above) // 2


def _paeth(left: int, above: int, corner: int) -> int:
    guess = left + above - corner
    return min((abs(guess - left), 0, left), (abs(guess - above), 1, above), (abs(guess - corner), 2, corner))[2]
