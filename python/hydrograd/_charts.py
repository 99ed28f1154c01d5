"""Coordinates with unit quaternions and their tangent space, for frameworks that know only arrays.

The simulator differentiates with respect to a rotation vector δθ (rad, R ← exp(δθ) R, axes of the joint's frame).
Arrays of coordinates hold quaternions (w, x, y, z) in four entries, that a framework may move one by one: what is
differentiated then is the rotation of the quaternion divided by its length.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hydrograd._hydrograd import InputError

Array = NDArray[np.float64]

# A quaternion that is longer or shorter than one by more than this was hardly meant as one.
LENGTH_TOLERANCE = 0.01
# Rounding of one division by the length: such quaternions are left as they are, to the bit.
ROUNDING = 4 * np.finfo(np.float64).eps


def cross(a: Array, b: Array) -> Array:
    """Cross products along the last axis; `numpy.cross` takes twice as long for a few."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return out


class Charts:
    """Where the quaternions of a simulator stand in q (…, q_size), and their rotation vectors in v (…, v_size)."""

    def __init__(self, q_names: Sequence[str]) -> None:
        plain: list[tuple[int, int]] = []
        turns: list[tuple[int, int]] = []
        i = j = 0
        while i < len(q_names):
            # A quaternion's names end in qw, qx, qy and qz, and no other coordinate's do.
            if q_names[i].rsplit(".", 1)[-1] == "qw":
                turns.append((i, j))
                i, j = i + 4, j + 3
            else:
                plain.append((i, j))
                i, j = i + 1, j + 1
        self.plain_q = [i for i, _ in plain]
        self.plain_v = [j for _, j in plain]
        self.turn_q = np.array([range(i, i + 4) for i, _ in turns], dtype=np.intp).reshape(-1, 4)
        self.turn_v = np.array([range(j, j + 3) for _, j in turns], dtype=np.intp).reshape(-1, 3)
        self.v_size = j

    def normalise(self, place: str, q: Array) -> tuple[Array, Array]:
        """Coordinates (batch, q_size) with unit quaternions, and the lengths (batch, quaternions) that they had."""
        if not len(self.turn_q):
            return q.copy(), np.ones((len(q), 0))
        given = q[:, self.turn_q]
        lengths = np.sqrt(np.sum(given * given, axis=-1))
        bad = np.argwhere(~(np.abs(lengths - 1.0) <= LENGTH_TOLERANCE) & np.isfinite(lengths))
        if len(bad):
            batch, turn = bad[0]
            first = self.turn_q[turn, 0]
            raise InputError(
                f"{place}: quaternion (w, x, y, z) at q[{first}:{first + 4}]: got length {lengths[batch, turn]}; must "
                f"be within {LENGTH_TOLERANCE:.0%} of length 1: divide it by its length"
            )
        lengths[np.abs(lengths - 1.0) <= ROUNDING] = 1.0
        out = q.copy()
        out[:, self.turn_q] = given / lengths[..., None]
        return out, lengths

    def tangent(self, q: Array, q_bar: Array) -> Array:
        """Cotangents (…, v_size) in the tangent space from those (…, q_size) of the entries of `q`.

        A turn by δθ moves a quaternion by ½ δθ ⊗ q, so its cotangent is half the vector part of q̄ ⊗ q*.
        """
        if not len(self.turn_q):
            return q_bar
        out = np.zeros((*q.shape[:-1], self.v_size))
        out[..., self.plain_v] = q_bar[..., self.plain_q]
        turn, bar = q[..., self.turn_q], q_bar[..., self.turn_q]
        w, u, a, b = turn[..., :1], turn[..., 1:], bar[..., :1], bar[..., 1:]
        out[..., self.turn_v] = 0.5 * (w * b - a * u + cross(u, b))
        return out

    def turned(self, q: Array, lengths: Array, dq: Array) -> Array:
        """Tangents (batch, v_size) in the tangent space from those of the entries that `normalise` was given; the transpose of `entries`."""
        if not len(self.turn_q):
            return dq
        out = np.zeros((len(q), self.v_size))
        out[:, self.plain_v] = dq[:, self.plain_q]
        turn, along = q[:, self.turn_q], dq[:, self.turn_q]
        w, u, a, b = turn[..., :1], turn[..., 1:], along[..., :1], along[..., 1:]
        out[:, self.turn_v] = 2.0 * (w * b - a * u + cross(u, b)) / lengths[..., None]
        return out

    def moved(self, q: Array, tangent: Array) -> Array:
        """Tangents (…, q_size) of the entries of `q` from those (…, v_size) in the tangent space; the transpose of `tangent`."""
        if not len(self.turn_q):
            return tangent
        out = np.zeros((*tangent.shape[:-1], q.shape[-1]))
        out[..., self.plain_q] = tangent[..., self.plain_v]
        turn, theta = q[..., self.turn_q], tangent[..., self.turn_v]
        w, u = turn[..., :1], turn[..., 1:]
        scalar = -np.sum(u * theta, axis=-1, keepdims=True)
        out[..., self.turn_q] = 0.5 * np.concatenate([scalar, w * theta + cross(theta, u)], axis=-1)
        return out

    def entries(self, q: Array, lengths: Array, bar: Array) -> Array:
        """Cotangents (batch, q_size) of the entries that `normalise` was given, from those in the tangent space.

        `q` and `lengths` are what it returned. The turn of a change dq of a quaternion is twice the vector part of
        dq ⊗ q*, over its length; a change of the length alone turns nothing.
        """
        if not len(self.turn_q):
            return bar
        out = np.zeros_like(q)
        out[:, self.plain_q] = bar[:, self.plain_v]
        turn, theta = q[:, self.turn_q], bar[:, self.turn_v]
        w, u = turn[..., :1], turn[..., 1:]
        scalar = -np.sum(u * theta, axis=-1, keepdims=True)
        out[:, self.turn_q] = (
            2.0 * np.concatenate([scalar, w * theta + cross(theta, u)], axis=-1) / lengths[..., None]
        )
        return out


@functools.lru_cache(maxsize=64)
def charts(q_names: tuple[str, ...]) -> Charts:
    """The charts of coordinates with these names."""
    return Charts(q_names)
