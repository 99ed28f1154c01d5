"""Columns of numbers from a CSV file, for the examples that read recordings."""

import csv
import math

import numpy as np


class Wrong(Exception):
    """What can't be used, and what would be right."""


def read(path, names, least, may_lack=()):
    """The columns `names` of a file with a header and at least `least` lines. Those in `may_lack` may have empty cells, NaN; all else must be finite numbers."""
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise Wrong(f"{path}: can't be read: {error}") from None
    while rows and not any(rows[-1]):
        rows.pop()
    if len(rows) <= least:
        raise Wrong(f"{path}: {len(rows)} lines; a header and {least} at least are wanted")
    header, lines = rows[0], rows[1:]
    columns = {}
    for name in names:
        if name not in header:
            raise Wrong(f"{path}: column {name!r} is missing; the file has {', '.join(header)}")
        k = header.index(name)
        values = columns[name] = np.empty(len(lines))
        for i, row in enumerate(lines):
            text = row[k] if k < len(row) else ""
            lacks = text == "" and name in may_lack
            try:
                values[i] = math.nan if lacks else float(text)
            except ValueError:
                raise Wrong(f"{path}: column {name!r}, line {i + 2}: {text!r} isn't a number") from None
            if not (lacks or math.isfinite(values[i])):
                raise Wrong(f"{path}: column {name!r}, line {i + 2}: {text} isn't finite")
    return columns
