"""Where pictures go: a folder of PNG files, or a video."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import re
import tempfile
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

from hydrograd._hydrograd import FileError, UnsupportedError

# By its ending: the container, the encoder, and its settings for pictures that nobody tells from their originals.
KINDS: dict[str, tuple[str, str, dict[str, str]]] = {
    ".mp4": ("mp4", "libx264", {"crf": "18", "preset": "medium", "movflags": "+faststart"}),
    ".webm": ("webm", "libvpx-vp9", {"crf": "24", "b": "0", "deadline": "good", "cpu-used": "4", "row-mt": "1"}),
}


class Pictures:
    """A folder of files frame_00000.png, …"""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.count = 0

    def __enter__(self) -> Pictures:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        return None

    def add(self, png: bytes) -> None:
        """One more."""
        path = self.folder / f"frame_{self.count:05}.png"
        try:
            path.write_bytes(png)
        except OSError as error:
            raise FileError(f"record: file: {path} can't be written: {error.strerror}") from error
        self.count += 1

    def finish(self) -> None:
        """Removes what a longer one left there: a series with it would be another's at its end."""
        for path in self.folder.iterdir():
            found = re.fullmatch(r"frame_(\d{5,})\.png", path.name)
            if found and int(found[1]) >= self.count:
                path.unlink()


class Encoded:
    """A video that appears whole, once it is finished."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        self.path, self.size, self.count = path, size, 0
        # As a fraction with a denominator that containers hold: 29.97 is 2997 / 100.
        self.rate = Fraction(fps).limit_denominator(10_000)
        self.part: Path | None = None
        self.av: Any = None
        self.container: Any = None
        self.stream: Any = None

    def __enter__(self) -> Encoded:
        self.av = importlib.import_module("av")
        form, codec, options = KINDS[self.path.suffix.lower()]
        handle, name = tempfile.mkstemp(prefix=f".{self.path.stem}-", dir=self.path.parent)
        os.close(handle)
        self.part = Path(name)
        own = {name: options[name] for name in options if name == "movflags"}
        try:
            self.container = self.av.open(name, "w", format=form, options=own)
            self.stream = self.container.add_stream(codec, rate=self.rate, options={k: v for k, v in options.items() if k not in own})
            self.stream.width, self.stream.height = self.size
            self.stream.pix_fmt = "yuv420p"
            if "b" in options:
                # The quality alone decides.
                self.stream.bit_rate = 0
        except BaseException as error:
            # Whoever fails to enter isn't exited.
            with contextlib.suppress(Exception):
                self._drop()
            if not isinstance(error, Exception):
                raise
            raise UnsupportedError(
                f"record: a {form} by {codec} is not available: PyAV says {error}; install a PyAV that has the encoder, or record frames "
                "into a folder"
            ) from error
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        # Not finished: nothing is left of it.
        if self.part is not None:
            self._drop()

    def _drop(self) -> None:
        try:
            if self.container is not None:
                self.container.close()
        finally:
            if self.part is not None:
                self.part.unlink(missing_ok=True)

    def add(self, png: bytes) -> None:
        """One more picture."""
        with self.av.open(io.BytesIO(png), format="png_pipe") as source:
            picture = next(source.decode(video=0)).reformat(format="yuv420p", dst_colorspace="ITU709")
        # Each picture comes from a file of its own, with a time of its own.
        # To be coded by what it shares with others, and not whole because a PNG is.
        picture.pict_type = self.av.video.frame.PictureType.NONE
        picture.pts, picture.time_base = self.count, 1 / self.rate
        self.container.mux(self.stream.encode(picture))
        self.count += 1

    def finish(self) -> None:
        """Puts it into its place."""
        self.container.mux(self.stream.encode(None))
        self.container.close()
        assert self.part is not None
        try:
            # As other files that are made here, and not for its owner alone.
            mask = os.umask(0)
            os.umask(mask)
            self.part.chmod(0o666 & ~mask)
            self.part.replace(self.path)
        except OSError as error:
            raise FileError(f"record: file: {self.path} can't be written: {error.strerror}") from error
        self.part = None
