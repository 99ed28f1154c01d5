"""What of a rollout is drawn: which of its states, where its bodies go, and how large the scene is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from hydrograd._hydrograd import Rollout

Array = NDArray[np.float64]


def chosen(states: int, most: int) -> NDArray[np.int64]:
    """Numbers of the states that are drawn: all, or `most` of them, evenly spread, with the first and the last."""
    return np.unique(np.linspace(0, states - 1, min(states, most)).round().astype(np.int64))


def quaternions(rotations: Array) -> Array:
    """Unit quaternions (..., 4), x, y, z, w, of rotation matrices (..., 3, 3)."""
    r = rotations
    x, y, z = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    # Four times the products of the components, so that the row of the largest one is exact to rounding.
    products = np.empty((*r.shape[:-2], 4, 4))
    products[..., 0, 0] = 1 + x - y - z
    products[..., 1, 1] = 1 - x + y - z
    products[..., 2, 2] = 1 - x - y + z
    products[..., 3, 3] = 1 + x + y + z
    for i, j in ((0, 1), (0, 2), (1, 2)):
        products[..., i, j] = products[..., j, i] = r[..., i, j] + r[..., j, i]
    for i, (a, b) in enumerate(((2, 1), (0, 2), (1, 0))):
        products[..., i, 3] = products[..., 3, i] = r[..., a, b] - r[..., b, a]
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    row: Array = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    row /= np.linalg.norm(row, axis=-1, keepdims=True)
    return row


@dataclass(frozen=True, eq=False)
class Surface:
    """A body's surface in its frame, and the box around it."""

    vertices: Array
    """(n, 3), m."""
    faces: NDArray[np.int64]
    """Vertex numbers, (m, 3)."""

    @property
    def middle(self) -> Array:
        """Middle of the box, (3,), m."""
        out: Array = 0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0))
        return out

    @property
    def reach(self) -> Array:
        """Half the box, (3,), m."""
        out: Array = 0.5 * (self.vertices.max(axis=0) - self.vertices.min(axis=0))
        return out


@dataclass(frozen=True, eq=False)
class Frames:
    """The states of a rollout that are drawn, F of them; SI units, world axes."""

    steps: NDArray[np.int64]
    """Their numbers, (F,)."""
    time: Array
    """(F,), s."""
    positions: Array
    """Of the bodies' origins, (F, bodies, 3), m."""
    rotations: Array
    """Body to world, (F, bodies, 3, 3)."""
    surfaces: list[Surface | None]
    """Of each body, None without a shape."""

    @staticmethod
    def of(rollout: Rollout, most: int) -> Frames:
        """No more than `most` states of a rollout."""
        steps = chosen(len(rollout), most)
        meshes = rollout.simulator.meshes()
        return Frames(
            steps=steps,
            time=rollout.time[steps],
            positions=rollout.positions[steps],
            rotations=rollout.rotations[steps],
            surfaces=[None if mesh is None else Surface(*mesh) for mesh in meshes],
        )

    @property
    def sizes(self) -> list[float]:
        """Of each body with a shape: half the diagonal of the box around it, m."""
        return [float(np.linalg.norm(surface.reach)) for surface in self.surfaces if surface is not None]

    def box(self) -> tuple[Array, Array]:
        """Corners of a box around all bodies at all times, (3,) each, m."""
        low, high = [self.positions.min(axis=(0, 1))], [self.positions.max(axis=(0, 1))]
        for body, surface in enumerate(self.surfaces):
            if surface is not None:
                turns = self.rotations[:, body]
                middle = self.positions[:, body] + turns @ surface.middle
                reach = np.abs(turns) @ surface.reach
                low.append((middle - reach).min(axis=0))
                high.append((middle + reach).max(axis=0))
        if any(surface is not None for surface in self.surfaces):
            # Origins may lie far from the shapes that move about them.
            low, high = low[1:], high[1:]
        return np.min(low, axis=0), np.max(high, axis=0)
