"""The gap between an ellipse and a convex polygon in a plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Halvings of the cone of normals at a corner: to 1e-9 rad.
_HALVINGS = 32


def _separation(normal: NDArray[np.float64], offset: NDArray[np.float64], angle: NDArray[np.float64], axes: tuple[float, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far the ellipse lies beyond a point along the direction `normal` (rad), and the slope of that over the direction."""
    along = np.stack([np.cos(normal), np.sin(normal)], axis=-1)
    across = np.stack([-np.sin(normal), np.cos(normal)], axis=-1)
    turned = normal - angle
    first, second = axes[0] * np.cos(turned), axes[1] * np.sin(turned)
    support = np.hypot(first, second)
    slope = (axes[1] ** 2 - axes[0] ** 2) * np.sin(turned) * np.cos(turned) / support
    return (offset * along).sum(-1) - support, (offset * across).sum(-1) - slope


def ellipse_polygon_gap(
    center: ArrayLike, angle: ArrayLike, axes: tuple[float, float], corners: ArrayLike
) -> NDArray[np.float64]:
    """Distance between an ellipse and a convex polygon, negative where they overlap.

    `center` (…, 2) and `angle` (…), of the first axis (rad), place the ellipse with the semi-axes `axes` in the frame of the
    polygon, whose `corners` (n, 2) run counter-clockwise; m. It is the largest separation along any direction: those
    square to an edge, and at each corner the best one between its edges'.
    """
    points = np.asarray(corners, dtype=float)
    angles = np.asarray(angle, dtype=float)[..., None]
    # (…, n, 2): the ellipse's centre from each corner.
    offset = np.asarray(center, dtype=float)[..., None, :] - points
    edges = np.roll(points, -1, axis=0) - points
    # Outward normal of the edge that leaves each corner, rad; at a corner the normals run from the entering edge's to it.
    leaving = np.arctan2(-edges[:, 0], edges[:, 1])
    entering = np.roll(leaving, 1)
    low = np.broadcast_to(entering, offset.shape[:-1]).copy()
    high = low + np.mod(leaving - entering, 2.0 * np.pi)
    flat = _separation(high, offset, angles, axes)[0]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        rises = _separation(middle, offset, angles, axes)[1] > 0.0
        low, high = np.where(rises, middle, low), np.where(rises, high, middle)
    corner = _separation(low, offset, angles, axes)[0]
    return np.asarray(np.maximum(flat, corner).max(-1))
