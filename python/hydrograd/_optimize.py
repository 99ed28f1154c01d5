"""What descents, optimal control and the recipe for grasps come to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from hydrograd._hydrograd import Rollout, Tracking


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


@dataclass(frozen=True, eq=False)
class Point:
    """A knot of a trajectory, as a cost of your own sees it."""

    knot: int
    """Number of the knot."""
    time: float
    """Time, s."""
    q: NDArray[np.float64]
    """Joint coordinates, (q_size,)."""
    v: NDArray[np.float64]
    """Generalised velocity, (v_size,)."""
    control: NDArray[np.float64] | None
    """Open-loop controls from there to the next knot, (control_size,); None at the end."""


@dataclass(frozen=True)
class IlqrProgress:
    """State of iLQR after an iteration."""

    iteration: int
    """Iterations made."""
    cost: float
    """Cost."""
    expected: float
    """Fall of the cost that the model of the iteration expected."""
    part: float
    """Part of the step that was taken; 0: none, the regularisation grew instead."""
    regularisation: float
    """Regularisation of the iteration."""
    gradient: float
    """Largest entry of the gradient by the controls, where no limit holds them, at the start of the iteration."""


@dataclass(frozen=True, eq=False)
class Plan:
    """Controls over a horizon, the trajectory that they make, and the feedback about it."""

    controls: NDArray[np.float64]
    """The controls, (knots, control_size), N and N m."""
    rollout: Rollout
    """The trajectory."""
    gains: NDArray[np.float64]
    """How each knot's controls best answer to a change of its state, (knots, control_size, 2 v_size): coordinates in their tangent space, then velocity. Rows of controls that a
    limit holds are zero."""
    steps: NDArray[np.float64]
    """The step by which the last model would change the controls, (knots, control_size)."""
    tracking: Tracking
    """The feedback that holds a robot to it: a policy, for `Simulator.with_policy`."""
    cost: float
    """Cost of the trajectory."""
    costs: NDArray[np.float64]
    """Cost of the start and after every iteration, (iterations + 1,)."""
    gradient: float
    """Largest entry of the gradient by the controls, where no limit holds them."""
    regularisation: float
    """Regularisation of the last model."""
    iterations: int
    """Iterations made."""
    stop: Literal["stationary", "cost", "target", "stuck", "budget", "asked"]
    """Why it ended: nothing is to be gained by the model, a whole step lowered the cost by too little, the target was reached, no step lowered the cost, the iterations were used
    up, or `progress` asked for it."""
    seconds: dict[str, float]
    """Where the time went, s: "rollouts", "derivatives", "sweeps", and in "total"."""

    @property
    def rate(self) -> float:
        """Iterations a second."""
        return self.iterations / self.seconds["total"]


@dataclass(frozen=True)
class Replan:
    """One plan of model-predictive control."""

    time: float
    """Time of the plant, s."""
    iterations: int
    """Iterations made."""
    cost: float
    """Cost of the plan by the model; that of the plan before where this one failed."""
    stop: str | None
    """Why it ended, as in `Plan`; None where it failed."""
    seconds: float
    """Time that it took, s."""
    failure: str | None
    """Why it failed; the plan before then goes on."""


@dataclass(frozen=True, eq=False)
class MpcRun:
    """What became of a plant under model-predictive control."""

    rollout: Rollout
    """Its trajectory; the controls are those that were applied."""
    rates: NDArray[np.float64]
    """The running cost at each of its states but the last, (steps,), 1/s."""
    cost: float
    """Their integral over time, with the last terms at the end."""
    replans: list[Replan]
    """The plans that were made for it."""
