"""The gap between an ellipse and a convex polygon in a plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Halvings of the cone of normals at a corner, to some 1e-5 rad: the separation is flat where it is largest, and so off
# by the square of that.
_HALVINGS = 18


def ellipse_polygon_gap(
    center: ArrayLike, angle: ArrayLike, axes: tuple[float, float], corners: ArrayLike
) -> NDArray[np.float64]:
    """Distance between an ellipse and a convex polygon, negative where they overlap.

    `center` (…, 2) and `angle` (…), of the first axis (rad), place the ellipse with the semi-axes `axes` in the frame
    of the polygon, whose `corners` (n, 2) run counter-clockwise; m. It is the largest separation along any direction:
    those square to an edge, and at each corner the best one between its edges'.
    """
    points = np.asarray(corners, dtype=float)
    angles = np.asarray(angle, dtype=float)[..., None]
    # The ellipse's centre from each corner, (…, n).
    across, up = np.moveaxis(np.asarray(center, dtype=float)[..., None, :] - points, -1, 0)
    edges = np.roll(points, -1, axis=0) - points
    # Outward normal of the edge that leaves each corner, rad; at a corner the normals run from the entering edge's to
    # it.
    leaving = np.arctan2(-edges[:, 0], edges[:, 1])
    entering = np.roll(leaving, 1)
    width = np.mod(leaving - entering, 2.0 * np.pi)

    def separation(normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far the ellipse lies beyond each corner along a direction, m."""
        support = np.hypot(axes[0] * np.cos(normal - angles), axes[1] * np.sin(normal - angles))
        return np.asarray(across * np.cos(normal) + up * np.sin(normal) - support)

    squares = axes[0] ** 2, axes[1] ** 2
    low = np.broadcast_to(entering, across.shape)
    for halving in range(1, _HALVINGS + 1):
        middle = low + width * 0.5**halving
        turned = middle - angles
        cosine, sine = np.cos(turned), np.sin(turned)
        bulge = (squares[1] - squares[0]) * cosine * sine
        slope = up * np.cos(middle) - across * np.sin(middle)
        rises = slope * np.sqrt(squares[0] * cosine**2 + squares[1] * sine**2) > bulge
        low = np.where(rises, middle, low)
    flat = np.broadcast_to(leaving, across.shape)
    return np.asarray(np.maximum(separation(flat), separation(low)).max(-1))
