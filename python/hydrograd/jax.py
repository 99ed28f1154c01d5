"""Rollouts and steps as functions of JAX, right under `jit`, `grad` and `vmap`.

    import jax
    jax.config.update("jax_enable_x64", True)
    import hydrograd.jax as hj

    def cost(controls):                                     # (steps, control_size), float64
        return jax.numpy.sum(hj.rollout(sim, controls).positions[-1, 0] ** 2)

    value, gradient = jax.jit(jax.value_and_grad(cost))(controls)

Arrays are float64, in SI units. Any leading dimensions, written out or made by `vmap`, are a batch, that runs on all
cores of the host: each of its members is what it would be alone, to the bit. A simulator is a constant of what is
traced. Quaternions (w, x, y, z) in q may be off length 1 by up to 1 %: they are divided by their length, and gradients
are those of the entries before that. docs/autodiff.md has more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

try:
    import jax
    import jax.numpy as jnp

    from hydrograd import _jax
except ImportError as error:
    raise ImportError("hydrograd.jax needs JAX, 0.4.38 or later: pip install jax") from error

from hydrograd import _bridge
from hydrograd._bridge import Physics
from hydrograd._charts import Array as NumpyArray
from hydrograd._hydrograd import InputError, Simulator

__all__ = ["State", "Trajectory", "initial_state", "rollout", "step"]

Array = jax.Array
# What is taken for an array.
Numbers = Array | NumpyArray | Sequence[Any] | float


class Trajectory(NamedTuple):
    """What was observed at the states 0 … N of rollouts with the leading dimensions (…) of a batch, or none."""

    positions: Array
    """Of the bodies' origins, (…, N + 1, bodies, 3), m, world axes."""
    rotations: Array
    """Matrices of the bodies, body to world, (…, N + 1, bodies, 3, 3)."""
    q: Array
    """Joint coordinates, (…, N + 1, q_size), m, rad and unit quaternions (w, x, y, z)."""
    v: Array
    """Generalised velocities, (…, N + 1, v_size), m/s and rad/s."""
    applied_controls: Array
    """Controls that acted in the steps, `controls` and what the scene's controller added, (…, N, control_size), N and N m."""


class State(NamedTuple):
    """A state between two steps, or a batch (…) of them; `(q, v)` alone is a state at the start."""

    q: Array
    """Joint coordinates, (…, q_size), m, rad and quaternions (w, x, y, z)."""
    v: Array
    """Generalised velocity, (…, v_size), m/s and rad/s."""
    step: Array | int = 0
    """Number of steps made, (…), int64: driven joints and the scene's controller go by the time."""
    mode: Array | int = 0
    """What the scene's controller remembers, (…), int64; 0 without one."""
    held: Array | bool = False
    """Bodies whose joints the scene's controller held in the step that led here, (…, bodies), bool."""


def rollout(
    sim: Simulator,
    controls: Numbers,
    q: Numbers | None = None,
    v: Numbers | None = None,
    parameters: Mapping[str, Numbers] | None = None,
    gains: Numbers | None = None,
) -> Trajectory:
    """Runs a simulator, differentiably in all that is given.

    `controls` (…, steps, control_size), N and N m, are added to what the scene's controller does. `q` (…, q_size) and
    `v` (…, v_size) are where the run begins, by default where the simulator does. `parameters` maps names of
    `sim.parameters` to values (…), `gains` (…, gains) are those of the scene's controller; what isn't given stays as it
    is in `sim`. Leading dimensions are broadcast.
    """
    physics = _bridge.physics_of("rollout", sim, parameters)
    parts: Parts = {
        "controls": (_array("rollout: controls", controls), ("steps", sim.control_size)),
        "q": (_array("rollout: q", sim.initial_q if q is None else q), (sim.q_size,)),
        "v": (_array("rollout: v", sim.initial_v if v is None else v), (sim.v_size,)),
        **_bridge.adjustable("rollout", sim, parameters, gains, _array),
    }
    _, spread = _spread("rollout", physics, parts)
    return Trajectory(*_jax.rollout(physics, *spread))


def initial_state(sim: Simulator, q: Numbers | None = None, v: Numbers | None = None) -> State:
    """The state at `q` (…, q_size) and `v` (…, v_size), by default those where the simulator starts, after no steps."""
    first = _array("initial_state: q", sim.initial_q if q is None else q)
    second = _array("initial_state: v", sim.initial_v if v is None else v)
    lead = _bridge.leading("initial_state", {"q": (first.shape, (sim.q_size,)), "v": (second.shape, (sim.v_size,))})
    count = jnp.zeros(lead, dtype=jnp.int64)
    held = jnp.zeros((*lead, len(sim.body_names)), dtype=bool)
    return State(
        jnp.broadcast_to(first, (*lead, sim.q_size)), jnp.broadcast_to(second, (*lead, sim.v_size)), count, count, held
    )


def step(
    sim: Simulator,
    state: State | tuple[Array, Array],
    u: Numbers | None = None,
    parameters: Mapping[str, Numbers] | None = None,
    gains: Numbers | None = None,
) -> State:
    """The state one step later, differentiable in `state.q`, `state.v`, the controls `u` (…, control_size), N and N m,
    and `parameters` and `gains` as in `rollout`.

    It is a function of what it is given alone, and a state may be what `jax.lax.scan` carries. Steps are those of a
    rollout up to rounding (relative 1e-15 or so): a state holds the velocity, and most integrators carry the momentum.
    """
    physics = _bridge.physics_of("step", sim, parameters)
    state = State(*state)
    parts: Parts = {
        "u": (_array("step: u", np.zeros(sim.control_size) if u is None else u), (sim.control_size,)),
        "state.q": (_array("step: state.q", state.q), (sim.q_size,)),
        "state.v": (_array("step: state.v", state.v), (sim.v_size,)),
        **_bridge.adjustable("step", sim, parameters, gains, _array),
    }
    lead, spread = _spread("step", physics, parts)
    memory = (
        _whole("step", state.step, lead, jnp.int64),
        _whole("mode", state.mode, lead, jnp.int64),
        _whole("held", state.held, (*lead, physics.bodies), jnp.bool_),
    )
    return State(*_jax.step(physics, memory, *spread))


def _array(place: str, given: Numbers) -> Array:
    """A float64 array; whole numbers, and lists of numbers, are converted, other precisions refused."""
    if not jax.config.jax_enable_x64:  # type: ignore[attr-defined]
        raise InputError(
            f'{place}: got 32-bit JAX; must have 64-bit numbers: jax.config.update("jax_enable_x64", True) at the '
            "start of the program"
        )
    try:
        array = given if isinstance(given, Array) else jnp.asarray(np.asarray(given))
    except (TypeError, ValueError) as error:
        raise InputError(f"{place}: got a value of type {type(given).__name__}; must be an array or numbers") from error
    if jnp.issubdtype(array.dtype, jnp.inexact) and array.dtype != jnp.float64:
        raise InputError(f"{place}: got dtype {array.dtype}; must be float64: take .astype(jnp.float64)")
    if not isinstance(array, jax.core.Tracer):
        _bridge.finite(place, np.asarray(array))
    return array.astype(jnp.float64)


def _whole(name: str, given: Array | int, shape: tuple[int, ...], dtype: Any) -> Any:
    array = jnp.asarray(given)
    if jnp.issubdtype(array.dtype, jnp.inexact):
        raise InputError(f"step: state.{name}: got dtype {array.dtype}; must be whole numbers")
    try:
        return jnp.broadcast_to(array, shape).astype(dtype)
    except ValueError:
        raise InputError(f"step: state.{name}: got shape {array.shape}; must go with {shape}") from None


Parts = dict[str, tuple[Array, _bridge.Ending]]


def _spread(place: str, physics: Physics, parts: Parts) -> tuple[tuple[int, ...], list[Array]]:
    """Leading dimensions, and the arrays with all of them: controls, q, v, values, gains."""
    lead = _bridge.leading(place, {name: (array.shape, inner) for name, (array, inner) in parts.items()})
    spread = [
        jnp.broadcast_to(array, (*lead, *array.shape[array.ndim - len(inner) :])) for array, inner in parts.values()
    ]
    count = len(physics.names)
    none = jnp.zeros((*lead, 0))
    values = jnp.stack(spread[3 : 3 + count], axis=-1) if count else none
    return lead, [*spread[:3], values, spread[3 + count] if len(spread) > 3 + count else none]
