"""Controllers written in Python."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Observation(NamedTuple):
    """What a controller sees at the start of a step."""

    step: int
    """Number of steps made."""
    time: float
    """Time, s."""
    q: NDArray[np.float64]
    """Joint coordinates, (q_size,), m, rad and unit quaternions (w, x, y, z)."""
    v: NDArray[np.float64]
    """Generalised velocity, (v_size,), m/s and rad/s."""


class Policy(Protocol):
    """A controller: a pure function of what it observes, so that a rollout can be replayed.

    `act` is all that a rollout needs. A gradient needs `act_vjp(observation, control_bar)` too, the transpose of
    `act`: from the cotangent of the controls (control_size,) the cotangents `(q_bar, v_bar)` or, with gains,
    `(q_bar, v_bar, gains_bar)`; `q_bar` is in the tangent space of the coordinates and `v_bar` like v, both (v_size,),
    and None is zero. A controller with adjustable `gains` (gains,) finds their gradient in `Gradient.gains`;
    `Simulator.with_gains` asks it for `with_gains(gains)`, the same controller with others.
    """

    def act(self, observation: Observation, /) -> ArrayLike:
        """The controls, (control_size,), N and N m; the rollout's open-loop controls are added to them."""
        ...
