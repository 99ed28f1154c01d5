"""What a reverse sweep yields, and forward mode."""

from __future__ import annotations

from dataclasses import dataclass, field

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
    warnings: list[str] = field(default_factory=list)
    """What one should know of it: that it grew out of all proportion."""


@dataclass(frozen=True, eq=False)
class Tangents:
    """How a rollout changes along a direction, or along many: then all arrays have one more index before the others."""

    q: NDArray[np.float64]
    """Of the coordinates in their tangent space, (N + 1, v_size): for a quaternion the rotation vector δθ, rad."""
    v: NDArray[np.float64]
    """Of the generalised velocities, (N + 1, v_size)."""
    positions: NDArray[np.float64]
    """Of the bodies' origins, (N + 1, bodies, 3), world axes."""
    rotations: NDArray[np.float64]
    """Of the bodies' rotations, (N + 1, bodies, 3): δθ of δR = δθ × R, rad, world axes."""
    applied_controls: NDArray[np.float64]
    """Of the controls that acted, those of the controller included, (N, control_size)."""
    observables: dict[str, NDArray[np.float64]]
    """Of the other observables that were asked for, by name, (N + 1, …); "site_rotations" as `rotations`, (N + 1, sites, 3)."""


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
