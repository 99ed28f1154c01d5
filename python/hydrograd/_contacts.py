"""What presses where surfaces touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class ContactForces:
    """Contacts of a step, n of them; SI units, world axes."""

    first: NDArray[np.int64]
    """Numbers of the bodies that the forces act on, (n,)."""
    second: NDArray[np.int64]
    """Numbers of the others, on which the opposite forces act, (n,); -1 for a wall."""
    positions: NDArray[np.float64]
    """Where, (n, 3), m."""
    normals: NDArray[np.float64]
    """Unit normals towards the first bodies, (n, 3)."""
    gaps: NDArray[np.float64]
    """Signed distances of the surfaces, (n,), m."""
    forces: NDArray[np.float64]
    """Forces on the first bodies, (n, 3), N; zeros where surfaces are near but nothing presses."""

    def __len__(self) -> int:
        return len(self.gaps)
