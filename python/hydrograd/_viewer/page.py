"""The page: its parts in one text of HTML."""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

# In the order in which they need each other.
SCRIPTS = ("moment.js", "frames.js", "stage.js", "actors.js", "arrows.js", "torques.js", "streamlines.js", "pressure.js", "plot.js", "player.js", "panel.js", "link.js", "video.js", "main.js")
SCRIPTS_BESIDE = ("moment.js", "beside.js")


@lru_cache
def asset(name: str) -> str:
    """The text of a file of the viewer."""
    return resources.files("hydrograd").joinpath("_viewer", "assets", name).read_text(encoding="utf-8")


def packed(array: ArrayLike, kind: str) -> dict[str, Any]:
    """An array for JavaScript: `kind` is "f4", "f8", "i4" or "i1"; its numbers in base64, little end first."""
    numbers = np.ascontiguousarray(array, dtype="<" + kind)
    return {
        "type": kind,
        "shape": list(numbers.shape),
        "data": base64.b64encode(numbers.tobytes()).decode("ascii"),
    }


def page(title: str, note: str, data: Mapping[str, Any], place: int | None = None) -> str:
    """The page with this title, a note on what it shows, and its data; of several beside each other, with its place among them."""
    # A name in the data could otherwise end the element that it stands in.
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    parts = {
        "title": html.escape(title),
        "style": asset("style.css"),
        "note": html.escape(note),
        "data": text,
        "place": "" if place is None else str(place),
        "library": asset("three.bundle.js"),
        "scripts": joined(SCRIPTS),
    }
    return filled("page.html", parts)


def beside(title: str, titles: Sequence[str], pages: Sequence[str]) -> str:
    """Pages beside each other in one, which does to all what is done to one; `titles` are theirs."""
    # In a sandbox, as in a notebook: they reach each other by messages alone.
    frames = [
        f'<iframe sandbox="allow-scripts allow-downloads" title="{html.escape(of)}" srcdoc="{html.escape(text)}"></iframe>'
        for of, text in zip(titles, pages, strict=True)
    ]
    return filled("beside.html", {"title": html.escape(title), "frames": "\n".join(frames), "scripts": joined(SCRIPTS_BESIDE)})


def joined(scripts: Sequence[str]) -> str:
    """Their texts in one."""
    return "\n".join(asset(name) for name in scripts)


def filled(name: str, parts: Mapping[str, str]) -> str:
    """A page of the viewer with its places filled, in one pass: nothing within a part is taken for a place."""
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], asset(name))
