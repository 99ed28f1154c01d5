"""Rollouts and steps as functions of PyTorch, differentiable by its autograd.

    import hydrograd.torch as ht

    trajectory = ht.rollout(sim, controls)                  # controls: (steps, control_size), float64
    trajectory.positions[-1, 0].square().sum().backward()

Tensors are float64 on the CPU, in SI units. Any leading dimensions are a batch, that runs on all cores: each of its
members is what it would be alone, to the bit. Quaternions (w, x, y, z) in q may be off length 1 by up to 1 %: they are
divided by their length, and gradients are those of the entries before that. docs/autodiff.md has more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

try:
    import torch
    from torch.autograd.function import once_differentiable
except ImportError as error:
    raise ImportError("hydrograd.torch needs PyTorch: pip install torch") from error

from hydrograd import _bridge
from hydrograd._bridge import Memory, Observed, Physics, Pulled
from hydrograd._charts import Array
from hydrograd._hydrograd import InputError, Rollout, Simulator

__all__ = ["State", "Trajectory", "initial_state", "rollout", "step"]

Tensor = torch.Tensor
# What is taken for a tensor.
Numbers = Tensor | Array | Sequence[Any] | float


class Trajectory(NamedTuple):
    """What was observed at the states 0 … N of rollouts with the leading dimensions (…) of a batch, or none."""

    positions: Tensor
    """Of the bodies' origins, (…, N + 1, bodies, 3), m, world axes."""
    rotations: Tensor
    """Matrices of the bodies, body to world, (…, N + 1, bodies, 3, 3)."""
    q: Tensor
    """Joint coordinates, (…, N + 1, q_size), m, rad and unit quaternions (w, x, y, z)."""
    v: Tensor
    """Generalised velocities, (…, N + 1, v_size), m/s and rad/s."""
    rollouts: list[Rollout]
    """The rollouts behind them, with their warnings, energies and gaps, in the order of the flattened batch."""


class State(NamedTuple):
    """A state between two steps, or a batch (…) of them; `(q, v)` alone is a state at the start."""

    q: Tensor
    """Joint coordinates, (…, q_size), m, rad and quaternions (w, x, y, z)."""
    v: Tensor
    """Generalised velocity, (…, v_size), m/s and rad/s."""
    step: Tensor | int = 0
    """Number of steps made, (…), int64: driven joints and the scene's controller go by the time."""
    mode: Tensor | int = 0
    """What the scene's controller remembers, (…), int64; 0 without one."""
    held: Tensor | bool = False
    """Bodies whose joints the scene's controller held in the step that led here, (…, bodies), bool."""


def rollout(
    sim: Simulator,
    controls: Numbers,
    q: Numbers | None = None,
    v: Numbers | None = None,
    parameters: Mapping[str, Numbers] | None = None,
    gains: Numbers | None = None,
) -> Trajectory:
    """Runs a simulator, differentiably in all that is given as tensors.

    `controls` (…, steps, control_size), N and N m, are added to what the scene's controller does. `q` (…, q_size) and
    `v` (…, v_size) are where the run begins, by default where the simulator does. `parameters` maps names of
    `sim.parameters` to values (…), `gains` (…, gains) are those of the scene's controller; what isn't given stays as it
    is in `sim`. Leading dimensions are broadcast.
    """
    physics = _bridge.physics_of("rollout", sim, parameters)
    parts: Parts = {
        "controls": (_tensor("rollout: controls", controls), ("steps", sim.control_size)),
        "q": (_tensor("rollout: q", sim.initial_q if q is None else q), (sim.q_size,)),
        "v": (_tensor("rollout: v", sim.initial_v if v is None else v), (sim.v_size,)),
        **_bridge.adjustable("rollout", sim, parameters, gains, _value),
    }
    lead, flat = _flat("rollout", physics, parts)
    made = _Rollout.apply(physics, *flat)
    positions, rotations, q_after, v_after = (part.reshape((*lead, *part.shape[1:])) for part in made[:4])
    return Trajectory(positions, rotations, q_after, v_after, made[4])


def initial_state(sim: Simulator, q: Numbers | None = None, v: Numbers | None = None) -> State:
    """The state at `q` (…, q_size) and `v` (…, v_size), by default those where the simulator starts, after no steps."""
    first = _tensor("initial_state: q", sim.initial_q if q is None else q)
    second = _tensor("initial_state: v", sim.initial_v if v is None else v)
    inner = {"q": (tuple(first.shape), (sim.q_size,)), "v": (tuple(second.shape), (sim.v_size,))}
    lead = _bridge.leading("initial_state", inner)
    count = torch.zeros(lead, dtype=torch.int64)
    held = torch.zeros(*lead, len(sim.body_names), dtype=torch.bool)
    return State(first.expand(*lead, -1), second.expand(*lead, -1), count, count.clone(), held)


def step(
    sim: Simulator,
    state: State | tuple[Tensor, Tensor],
    u: Numbers | None = None,
    parameters: Mapping[str, Numbers] | None = None,
    gains: Numbers | None = None,
) -> State:
    """The state one step later, differentiable in `state.q`, `state.v`, the controls `u` (…, control_size), N and N m,
    and `parameters` and `gains` as in `rollout`.

    It is a function of what it is given alone. Steps are those of a rollout up to rounding (relative 1e-15 or so): a
    state holds the velocity, and most integrators carry the momentum.
    """
    physics = _bridge.physics_of("step", sim, parameters)
    state = State(*state)
    parts: Parts = {
        "u": (_tensor("step: u", np.zeros(sim.control_size) if u is None else u), (sim.control_size,)),
        "state.q": (_tensor("step: state.q", state.q), (sim.q_size,)),
        "state.v": (_tensor("step: state.v", state.v), (sim.v_size,)),
        **_bridge.adjustable("step", sim, parameters, gains, _value),
    }
    lead, flat = _flat("step", physics, parts)
    memory = _memory(state, lead, physics)
    made = _Step.apply(physics, memory, *flat)
    return State(*(part.reshape((*lead, *part.shape[1:])) for part in made))


class _Rollout(torch.autograd.Function):
    """Rollouts of a flat batch."""

    @staticmethod
    def forward(ctx: Any, physics: Physics, *tensors: Tensor) -> tuple[Any, ...]:
        controls, q, v, values, gains = (tensor.detach().numpy() for tensor in tensors)
        begin, lengths = physics.charts.normalise("rollout", q)
        rollouts = _bridge.roll(physics, controls, begin, v, values, gains)
        ctx.set_materialize_grads(False)
        if any(ctx.needs_input_grad):
            ctx.kept = (physics, rollouts, begin, lengths)
        seen = _bridge.seen(_bridge.observe(physics, controls.shape[1], rollouts))
        return (*(torch.from_numpy(part) for part in seen), rollouts)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *bars: Tensor | None) -> tuple[Tensor | None, ...]:
        physics, rollouts, begin, lengths = ctx.kept
        bar = Observed(*(None if part is None else part.numpy() for part in bars[:4]))
        return None, *_wanted(ctx.needs_input_grad[1:], _bridge.pull(physics, rollouts, begin, lengths, bar))


class _Step(torch.autograd.Function):
    """One step of each state of a flat batch."""

    @staticmethod
    def forward(ctx: Any, physics: Physics, memory: Memory, *tensors: Tensor) -> tuple[Tensor, ...]:
        controls, q, v, values, gains = (tensor.detach().numpy() for tensor in tensors)
        begin, lengths = physics.charts.normalise("step", q)
        after = _bridge.advance(physics, begin, v, controls, values, gains, memory)
        ctx.set_materialize_grads(False)
        if any(ctx.needs_input_grad):
            # A copy: what leaves may be changed in place.
            ctx.kept = (physics, after.records, begin, lengths, after.q.copy())
        remembered = [torch.from_numpy(part) for part in after.memory]
        ctx.mark_non_differentiable(*remembered)
        return (torch.from_numpy(after.q), torch.from_numpy(after.v), *remembered)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *bars: Tensor | None) -> tuple[Tensor | None, ...]:
        physics, records, begin, lengths, end = ctx.kept
        q_bar, v_bar = (None if part is None else part.numpy() for part in bars[:2])
        pulled = _bridge.pull_step(physics, records, begin, lengths, end, q_bar, v_bar)
        return None, None, *_wanted(ctx.needs_input_grad[2:], pulled)


def _wanted(needed: Sequence[bool], pulled: Pulled) -> tuple[Tensor | None, ...]:
    return tuple(torch.from_numpy(part) if need else None for need, part in zip(needed, pulled, strict=True))


def _tensor(place: str, given: Numbers) -> Tensor:
    """A float64 tensor; whole numbers, and lists and arrays of them, are converted, other precisions refused."""
    try:
        tensor = given if isinstance(given, Tensor) else torch.as_tensor(np.array(given))
    except (TypeError, ValueError) as error:
        raise InputError(f"{place}: got a value of type {type(given).__name__}; must be a tensor or numbers") from error
    if tensor.device.type != "cpu":
        raise InputError(f"{place}: got a tensor on {tensor.device}; must be on the CPU: take .cpu()")
    if tensor.is_complex() or (tensor.is_floating_point() and tensor.dtype != torch.float64):
        raise InputError(f"{place}: got dtype {tensor.dtype}; must be torch.float64: take .double()")
    return tensor.to(torch.float64)


def _value(place: str, given: Numbers) -> Tensor:
    """A tensor of finite numbers: values that a simulator is made anew with."""
    tensor = _tensor(place, given)
    _bridge.finite(place, tensor.detach().numpy())
    return tensor


Parts = dict[str, tuple[Tensor, _bridge.Ending]]


def _flat(place: str, physics: Physics, parts: Parts) -> tuple[tuple[int, ...], list[Tensor]]:
    """Leading dimensions, and the tensors with one batch dimension instead: controls, q, v, values, gains."""
    lead = _bridge.leading(place, {name: (tuple(tensor.shape), inner) for name, (tensor, inner) in parts.items()})
    batch = math.prod(lead)
    spread = []
    for tensor, inner in parts.values():
        last = tensor.shape[tensor.dim() - len(inner) :]
        spread.append(tensor.expand((*lead, *last)).reshape((batch, *last)))
    count = len(physics.names)
    values = torch.stack(spread[3 : 3 + count], dim=1) if count else spread[0].new_zeros(batch, 0)
    gains = spread[3 + count] if len(spread) > 3 + count else spread[0].new_zeros(batch, 0)
    return lead, [*spread[:3], values, gains]


def _memory(state: State, lead: tuple[int, ...], physics: Physics) -> Memory:
    def flat(name: str, given: Tensor | float, *inner: int) -> Any:
        tensor = torch.as_tensor(given)
        if tensor.is_floating_point() or tensor.is_complex():
            raise InputError(f"step: state.{name}: got dtype {tensor.dtype}; must be whole numbers")
        try:
            return tensor.expand((*lead, *inner)).reshape((math.prod(lead), *inner)).numpy()
        except RuntimeError:
            wanted = (*lead, *inner)
            raise InputError(f"step: state.{name}: got shape {tuple(tensor.shape)}; must go with {wanted}") from None

    return Memory(
        flat("step", state.step).astype(np.int64),
        flat("mode", state.mode).astype(np.int64),
        flat("held", state.held, physics.bodies).astype(np.bool_),
    )
