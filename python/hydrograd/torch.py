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
from hydrograd._bridge import Memory, Observed, Physics, Pulled, Stepped
from hydrograd._charts import Array
from hydrograd._hydrograd import InputError, Record, Rollout, Simulator, UnsupportedError

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
    rollouts: list[Rollout] = []
    made = _Rollout.apply(physics, rollouts, *flat)
    return Trajectory(*(part.reshape((*lead, *part.shape[1:])) for part in made), rollouts)


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
    made = _Step.apply(physics, [], memory, *flat)
    return State(*(part.reshape((*lead, *part.shape[1:])) for part in made))


class _Rollout(torch.autograd.Function):
    """Rollouts of a flat batch, that are put into the list `made`."""

    @staticmethod
    def forward(physics: Physics, made: list[Rollout], *tensors: Tensor) -> tuple[Tensor, ...]:
        controls, q, v, values, gains = _arrays(tensors)
        begin, _ = physics.charts.normalise("rollout", q)
        made[:] = _bridge.roll(physics, controls, begin, v, values, gains)
        seen = _bridge.seen(_bridge.observe(physics, controls.shape[1], made))
        return tuple(torch.from_numpy(part) for part in seen)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Tensor, ...]) -> None:
        physics, made, *tensors = inputs
        ctx.set_materialize_grads(False)
        ctx.shapes = [tensor.shape for tensor in tensors]
        ctx.linear = _RolloutMaps(physics, list(made), *physics.charts.normalise("rollout", _arrays(tensors)[1]))

    @staticmethod
    def jvp(ctx: Any, *along: Tensor | None) -> Any:
        return _Push.apply(ctx.linear, *_filled(along[2:], ctx.shapes))

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *bars: Tensor | None) -> tuple[Tensor | None, ...]:
        pulled = _Pull.apply(ctx.linear, *bars)
        return None, None, *_wanted(ctx.needs_input_grad[2:], pulled)

    @staticmethod
    def vmap(info: Any, dims: Sequence[int | None], physics: Physics, made: list[Rollout], *tensors: Tensor) -> Any:
        given = _joined(info.batch_size, dims[2:], tensors)
        return _parted(info.batch_size, _Rollout.apply(physics, made, *given))


class _Step(torch.autograd.Function):
    """One step of each state of a flat batch; the list `made` gets what it leaves."""

    @staticmethod
    def forward(physics: Physics, made: list[Stepped], memory: Memory, *tensors: Tensor) -> tuple[Tensor, ...]:
        controls, q, v, values, gains = _arrays(tensors)
        begin, _ = physics.charts.normalise("step", q)
        after = _bridge.advance(physics, begin, v, controls, values, gains, memory)
        # A copy: what leaves may be changed in place.
        made[:] = [after._replace(q=after.q.copy())]
        return tuple(torch.from_numpy(part) for part in (after.q, after.v, *after.memory))

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Tensor, ...]) -> None:
        physics, made, _, *tensors = inputs
        ctx.set_materialize_grads(False)
        ctx.mark_non_differentiable(*output[2:])
        ctx.shapes = [tensor.shape for tensor in tensors]
        begin, lengths = physics.charts.normalise("step", _arrays(tensors)[1])
        ctx.linear = _StepMaps(physics, made[0].records, begin, lengths, made[0].q)

    @staticmethod
    def jvp(ctx: Any, *along: Tensor | None) -> Any:
        return (*_Push.apply(ctx.linear, *_filled(along[3:], ctx.shapes)), None, None, None)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *bars: Tensor | None) -> tuple[Tensor | None, ...]:
        pulled = _Pull.apply(ctx.linear, *bars[:2])
        return None, None, None, *_wanted(ctx.needs_input_grad[3:], pulled)

    @staticmethod
    def vmap(
        info: Any, dims: Sequence[Any], physics: Physics, made: list[Stepped], memory: Memory, *tensors: Tensor
    ) -> Any:
        size = info.batch_size
        given = _joined(size, dims[3:], tensors)
        all_memory = Memory(*(np.concatenate([part] * size) for part in memory))
        return _parted(size, _Step.apply(physics, made, all_memory, *given))


class _RolloutMaps(NamedTuple):
    """Rollouts with where they began: their tangents and transposes, row by row of a flat batch."""

    physics: Physics
    made: list[Rollout]
    begin: Array
    lengths: Array

    def repeated(self, times: int) -> _RolloutMaps:
        """The same rows so many times, one after the other."""
        begin, lengths = (np.concatenate([part] * times) for part in (self.begin, self.lengths))
        return self._replace(made=self.made * times, begin=begin, lengths=lengths)

    def push(self, along: Sequence[Array]) -> Sequence[Array]:
        made = _bridge.push(self.physics, self.made, self.begin, self.lengths, Pulled(*along))
        return _bridge.seen(made)

    def pull(self, bars: Sequence[Array | None]) -> Pulled:
        return _bridge.pull(self.physics, self.made, self.begin, self.lengths, Observed(*bars))


class _StepMaps(NamedTuple):
    """The same of steps."""

    physics: Physics
    made: list[Record]
    begin: Array
    lengths: Array
    end: Array

    def repeated(self, times: int) -> _StepMaps:
        """The same rows so many times, one after the other."""
        begin, lengths, end = (np.concatenate([part] * times) for part in (self.begin, self.lengths, self.end))
        return self._replace(made=self.made * times, begin=begin, lengths=lengths, end=end)

    def push(self, along: Sequence[Array]) -> Sequence[Array]:
        return _bridge.push_step(self.physics, self.made, self.begin, self.lengths, self.end, Pulled(*along))

    def pull(self, bars: Sequence[Array | None]) -> Pulled:
        q_bar, v_bar = bars
        return _bridge.pull_step(self.physics, self.made, self.begin, self.lengths, self.end, q_bar, v_bar)


class _Linear(torch.autograd.Function):
    """What both maps share: they are calls of their own, so that vmap sees them, and have no derivatives."""

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Tensor, ...]) -> None:
        pass

    @staticmethod
    def jvp(ctx: Any, *along: Tensor | None) -> Any:
        raise UnsupportedError(_FIRST)

    @staticmethod
    def backward(ctx: Any, *bars: Tensor | None) -> Any:
        raise UnsupportedError(_FIRST)


_FIRST = (
    "derivatives of derivatives of a rollout or step are not available: hydrograd has the first ones; take differences of "
    "gradients"
)


class _Push(_Linear):
    """Tangents along those of a flat batch."""

    @staticmethod
    def forward(linear: _RolloutMaps | _StepMaps, *along: Tensor) -> tuple[Tensor, ...]:
        return tuple(torch.from_numpy(part) for part in linear.push(_arrays(along)))

    @staticmethod
    def vmap(info: Any, dims: Sequence[int | None], linear: _RolloutMaps | _StepMaps, *along: Tensor) -> Any:
        given = _joined(info.batch_size, dims[1:], along)
        return _parted(info.batch_size, _Push.apply(linear.repeated(info.batch_size), *given))


class _Pull(_Linear):
    """Cotangents of a flat batch pulled back; one that is None is zero."""

    @staticmethod
    def forward(linear: _RolloutMaps | _StepMaps, *bars: Tensor | None) -> tuple[Tensor, ...]:
        given = [None if bar is None else bar.detach().numpy() for bar in bars]
        return tuple(torch.from_numpy(part) for part in linear.pull(given))

    @staticmethod
    def vmap(info: Any, dims: Sequence[int | None], linear: _RolloutMaps | _StepMaps, *bars: Tensor | None) -> Any:
        size = info.batch_size
        given = [None if bar is None else _joined(size, [d], [bar])[0] for d, bar in zip(dims[1:], bars, strict=True)]
        return _parted(size, _Pull.apply(linear.repeated(size), *given))


def _arrays(tensors: Sequence[Tensor]) -> list[Array]:
    return [tensor.detach().numpy() for tensor in tensors]


def _filled(along: Sequence[Tensor | None], shapes: Sequence[torch.Size]) -> list[Tensor]:
    """Zeros where nothing changes."""
    zeros = (torch.zeros(shape, dtype=torch.float64) for shape in shapes)
    return [zero if part is None else part for part, zero in zip(along, zeros, strict=True)]


def _joined(size: int, dims: Sequence[int | None], tensors: Sequence[Tensor]) -> list[Tensor]:
    """Flat batches that vmap has so many of, one after the other as one."""
    front = [
        tensor.expand(size, *tensor.shape) if dim is None else tensor.movedim(dim, 0)
        for dim, tensor in zip(dims, tensors, strict=True)
    ]
    return [tensor.reshape(size * tensor.shape[1], *tensor.shape[2:]) for tensor in front]


def _parted(size: int, tensors: Sequence[Tensor]) -> tuple[tuple[Tensor, ...], tuple[int, ...]]:
    """The inverse, with where vmap's dimension is."""
    return tuple(t.reshape(size, len(t) // size, *t.shape[1:]) for t in tensors), (0,) * len(tensors)


def _wanted(needed: Sequence[bool], pulled: Sequence[Tensor]) -> tuple[Tensor | None, ...]:
    return tuple(part if need else None for need, part in zip(needed, pulled, strict=True))


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
