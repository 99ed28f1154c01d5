"""The added mass of a scene in one call."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hydrograd._hydrograd import Scene, Simulator

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def added_mass(scene: Scene, **settings: Any) -> NDArray[np.float64]:
    """Added mass of a scene's bodies in the water at their start, (6 n, 6 n), world axes: kg, kg m, kg m².

    Per body three rows of force per acceleration of its origin, then three of torque per angular acceleration.
    `settings` are the keywords of `Simulator`.
    """
    return Simulator(scene, **settings).added_mass()
