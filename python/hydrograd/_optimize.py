"""What descents and the recipe for grasps come to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from hydrograd._hydrograd import Rollout


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where a descent ended: the best point that it saw."""

    x: NDArray[np.float64]
    """The point, (n,)."""
    cost: float
    """Its cost."""
    gradient: float
    """Length of its gradient, after `clip`."""
    iterations: int
    """Iterations made."""
    evaluations: int
    """Costs with gradients evaluated, those that failed included."""
    failures: int
    """Evaluations that failed."""
    stop: Literal["target", "gradient", "cost", "budget"]
    """Why it ended: the cost reached `target`, the gradient or the fall of the cost got too small, or what it may spend was used up."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A function and its gradient, averaged over a neighbourhood."""

    cost: float
    """Mean of the function."""
    deviation: float
    """Standard deviation of the function over the neighbourhood."""
    gradient: NDArray[np.float64]
    """Both estimates below, each weighted by the inverse of its variance, (n,); that of order zero alone where they differ by more than
    chance, which is what jumps do."""
    first: NDArray[np.float64]
    """Mean of its gradients, (n,)."""
    first_variance: NDArray[np.float64]
    """Variance of each entry, as a mean of so many directions, (n,)."""
    zeroth: NDArray[np.float64]
    """Slope of its values, which sees jumps, (n,)."""
    zeroth_variance: NDArray[np.float64]
    """Variance of each entry, (n,)."""
    failures: int
    """Samples that failed; their directions are left out."""


@dataclass(frozen=True, eq=False)
class Grasp:
    """The best grasp that was seen."""

    caught: bool
    """Whether the object is held for as long as was asked."""
    held_since: float | None
    """Since when it is held at the end, s; None if it isn't."""
    cost: float
    """Of the hold: a sum of squares in radii of the object, speeds and forces over tolerable ones."""
    stage: Literal["push", "descent", "search"]
    """What found it."""
    controls: NDArray[np.float64]
    """The controls, (steps, control_size), N and N m, for a simulator without a controller."""
    rollout: Rollout
    """The run with them; its `simulator` has no controller."""
    pushes_caught: int
    """Pushes that caught the object."""
    simulations: int
    """Simulations, those with a gradient included."""
    gradients: int
    """Gradients."""
    failures: int
    """Simulations that failed."""
