"""The page: its parts in one text of HTML."""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Mapping
from functools import lru_cache
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

# In the order in which they need each other.
SCRIPTS = ("frames.js", "stage.js", "actors.js", "arrows.js", "plot.js", "player.js", "panel.js", "main.js")


@lru_cache
def asset(name: str) -> str:
    """The text of a file of the viewer."""
    return resources.files("hydrograd").joinpath("_viewer", "assets", name).read_text(encoding="utf-8")


def packed(array: ArrayLike, kind: str) -> dict[str, Any]:
    """An array for JavaScript: `kind` is "f4", "f8" or "i4"; its numbers in base64, little end first."""
    numbers = np.ascontiguousarray(array, dtype="<" + kind)
    return {
        "type": kind,
        "shape": list(numbers.shape),
        "data": base64.b64encode(numbers.tobytes()).decode("ascii"),
    }


def page(title: str, note: str, data: Mapping[str, Any]) -> str:
    """The page with this title, a note on what it shows, and its data."""
    # A name in the data could otherwise end the element that it stands in.
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    parts = {
        "title": html.escape(title),
        "style": asset("style.css"),
        "note": html.escape(note),
        "data": text,
        "library": asset("three.bundle.js"),
        "scripts": "\n".join(asset(name) for name in SCRIPTS),
    }
    # In one pass: nothing within a part is taken for a place.
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], asset("page.html"))
