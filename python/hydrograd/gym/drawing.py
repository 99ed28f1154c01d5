"""Pictures of bodies in a plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import hydrograd as hg

_Array = NDArray[np.float64]


def picture(
    polygons: Sequence[_Array],
    ellipses: Sequence[tuple[_Array, float, tuple[float, float]]],
    across: tuple[float, float],
    up: tuple[float, float],
    labels: tuple[str, str],
    time: float,
) -> NDArray[np.uint8]:
    """Polygons (n, 2) and ellipses (centre, angle of the first axis in rad, semi-axes) in a window (m), at a time (s):
    an image (360, 480, 3).
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from matplotlib.patches import Ellipse, Polygon
    except ImportError as missing:
        raise hg.UnsupportedError("render_mode 'rgb_array' needs Matplotlib: pip install matplotlib") from missing
    figure = Figure(figsize=(4.8, 3.6), dpi=100, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot(aspect="equal", xlim=across, ylim=up, xlabel=labels[0], ylabel=labels[1])
    axes.set_title(f"{time:.2f} s", fontsize=9)
    for corners in polygons:
        axes.add_patch(Polygon(corners, facecolor="lightsteelblue", edgecolor="black"))
    for center, angle, (first, second) in ellipses:
        place = (float(center[0]), float(center[1]))
        axes.add_patch(
            Ellipse(place, 2.0 * first, 2.0 * second, angle=np.degrees(angle), facecolor="goldenrod", edgecolor="black")
        )
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[no-untyped-call]
