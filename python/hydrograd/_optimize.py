"""What descents, optimal control and the recipe for grasps come to."""

from __future__ import annotations

import json
import math
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
    """Part of the step that was taken; 0: none. The regularisation grows after none, and after an eighth or less."""
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
    """Why it failed, what a cost or a controller of your own raised included; the plan before then goes on."""


@dataclass(frozen=True, eq=False)
class MpcRun:
    """What became of a plant under model-predictive control."""

    rollout: Rollout
    """Its trajectory; the controls are those that were applied."""
    rates: NDArray[np.float64]
    """The running cost at each of its states but the last, (steps,), 1/s; changes of controls are those since a knot's time before."""
    cost: float
    """Their integral over time, with the last terms at the end."""
    replans: list[Replan]
    """The plans that were made for it."""


@dataclass(frozen=True)
class IdentifyProgress:
    """State of `identify` after an iteration."""

    iteration: int
    """Iterations made."""
    cost: float
    """Misfit."""
    taken: bool
    """Whether the step was taken."""
    step: float
    """Largest change of an unknown, in its standard errors."""
    simulations: int
    """Simulations so far, those of all experiments."""


@dataclass(frozen=True)
class Fitted:
    """One unknown."""

    name: str
    """Its name."""
    value: float
    """Its value, in its unit."""
    standard_error: float
    """Its standard error by the deviations that were given, in its unit; infinite where nothing tells it, zero at a bound."""
    start: float
    """Where the search began."""
    at_bound: bool
    """Whether a bound holds it; what is said of the others then takes it as known."""
    of_prior: float | None
    """Its standard error in parts of what was known beforehand; about 1: the recordings tell nothing of it. None at a bound, and where nothing was known."""
    sets: dict[str, float]
    """The parameters that it sets, and what each is of it."""
    starts: dict[str, float]
    """The coordinates of the start that it sets, and what each is of it."""


@dataclass(frozen=True)
class SeriesFit:
    """How one entry of an experiment was met."""

    experiment: str
    """The experiment."""
    observable: str
    """The observable."""
    label: str
    """The entry's label."""
    rms: float
    """Root mean square of simulated less recorded, in the observable's unit."""
    autocorrelation: float
    """Correlation of one residual with the next: noise has none, what the model lacks has."""


@dataclass(frozen=True)
class Profile:
    """The misfit at a point along a direction."""

    deviations: float
    """How far from the best point, in standard deviations along the direction."""
    rise: float | None
    """How much the misfit rises; None where the simulation fails."""
    expected: float
    """How much it would if it were a parabola."""


@dataclass(frozen=True)
class WeakDirection:
    """A direction in which the unknowns are told least."""

    change: list[float]
    """Change of each unknown by one standard deviation along it, in its unit."""
    deviation: float
    """The standard deviation along it, in parts of the unknowns' sizes; infinite where nothing tells it."""
    profile: list[Profile]
    """The misfit along it; empty where the deviation is infinite."""


@dataclass(frozen=True, eq=False)
class Identified:
    """What `identify` found."""

    unknowns: list[Fitted]
    """The unknowns, in order."""
    inertias: dict[str, float]
    """Inertias whose roots were unknown (`Unknown.inertia`), as parameters, in the first experiment."""
    correlations: NDArray[np.float64]
    """Correlations of their errors, (n, n)."""
    starts: list[tuple[NDArray[np.float64], NDArray[np.float64]]]
    """Initial coordinates and velocity of each experiment."""
    series: list[SeriesFit]
    """How each series was met."""
    cost: float
    """The misfit."""
    chi_squared: float
    """Sum of squared residuals, weighed by the loss, over the degrees of freedom that the recordings have left: 1 for noise as large as it is said to be."""
    inflation: float
    """What standard errors are to be multiplied by where residuals aren't that noise."""
    weak: list[WeakDirection]
    """The directions that are told least, the least one first."""
    iterations: int
    """Iterations made."""
    simulations: int
    """Simulations, those of all experiments, profiles included."""
    jacobians: int
    """Jacobians of all experiments."""
    failures: int
    """Trials whose simulation failed."""
    stop: Literal["cost", "step", "stuck", "budget", "asked"]
    """Why it ended: the misfit fell by too little, the unknowns moved by too little, no step lowered it, the iterations were used up, or `progress` asked for it."""

    @property
    def values(self) -> dict[str, float]:
        """Values by name."""
        return {u.name: u.value for u in self.unknowns}

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters that the unknowns set, for `Simulator.with_parameters`; an experiment's own scales aren't in them."""
        return {name: factor * u.value for u in self.unknowns for name, factor in u.sets.items()} | self.inertias


def _identified(text: str) -> Identified:
    """From the JSON of the Rust side, which has no infinity."""
    found = json.loads(text)

    def or_infinite(x: float | None) -> float:
        return math.inf if x is None else x

    for u in found["unknowns"]:
        u["standard_error"] = or_infinite(u["standard_error"])
        u["sets"], u["starts"] = dict(u["sets"]), dict(u["starts"])
    for w in found["weak"]:
        w["deviation"] = or_infinite(w["deviation"])
        w["profile"] = [Profile(**p) for p in w["profile"]]
    found["inertias"] = dict(found["inertias"])
    found["unknowns"] = [Fitted(**u) for u in found["unknowns"]]
    found["series"] = [SeriesFit(**s) for s in found["series"]]
    found["weak"] = [WeakDirection(**w) for w in found["weak"]]
    found["correlations"] = np.array(found["correlations"], dtype=float)
    found["starts"] = [(np.array(q), np.array(v)) for q, v in found["starts"]]
    return Identified(**found)
