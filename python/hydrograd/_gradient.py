"""What a reverse sweep yields."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Gradient:
    """Derivatives of a scalar of a rollout.

    Parameters are named as in `Simulator.parameters`; units are those of the scalar over those of what it is
    differentiated with respect to.
    """

    controls: NDArray[np.float64]
    """Of the open-loop controls, (steps, control_size)."""
    initial_q: NDArray[np.float64]
    """Of the initial coordinates in their tangent space, (v_size,): for a quaternion the rotation vector δθ, rad."""
    initial_v: NDArray[np.float64]
    """Of the initial generalised velocity, (v_size,)."""
    parameters: dict[str, float]
    """Of the physical parameters, by name."""
    gains: NDArray[np.float64]
    """Of the gains of the scene's controller, (gains,)."""


@dataclass(frozen=True, eq=False)
class StepGradient:
    """Derivatives of a scalar of the state after one step."""

    q: NDArray[np.float64]
    """Of the coordinates before the step in their tangent space, (v_size,)."""
    v: NDArray[np.float64]
    """Of the generalised velocity before the step, (v_size,)."""
    controls: NDArray[np.float64]
    """Of the step's controls, (control_size,)."""
    parameters: dict[str, float]
    """Of the physical parameters, by name."""
    gains: NDArray[np.float64]
    """Of the gains of the scene's controller, (gains,)."""
