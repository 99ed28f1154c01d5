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
from numpy.typing import NDArray

try:
    import torch
except ImportError as error:
    raise ImportError("hydrograd.torch needs PyTorch: pip install torch") from error

from hydrograd import _bridge
from hydrograd._bridge import Memory, Observed, Physics, Pulled
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
    applied_controls: Tensor
    """Controls that acted in the steps, `controls` and what the scene's controller added, (…, N, control_size), N and N m."""
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
    work = _Rolling(physics, lead == ())
    made = _Run.apply(work, *flat)
    return Trajectory(*(part.reshape((*lead, *part.shape[1:])) for part in made), work.rollouts)


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
    made = _Run.apply(_Stepping(physics, lead == ()), *flat, *memory)
    return State(*(part.reshape((*lead, *part.shape[1:])) for part in made))


Key = tuple[bytes, ...]


class _Rolling:
    """Rollouts of flat batches of controls, q, v, values and gains; what was run is kept, by all that it depends on."""

    # Arrays that it is given, and those that it gives with derivatives.
    given, differentiable = 5, 5

    def __init__(self, physics: Physics, alone: bool) -> None:
        self.physics, self.alone = physics, alone
        self.rollouts: list[Rollout] = []
        self._made: dict[Key, Rollout] = {}

    def run(self, arrays: Sequence[Array]) -> Sequence[NDArray[Any]]:
        """What is observed of the rollouts."""
        physics, (controls, q, v, values, gains) = self.physics, arrays
        begin, _ = physics.charts.normalise("rollout", q)
        self.rollouts = _bridge.roll(physics, controls, begin, v, values, gains, self.alone)
        self._made.update(zip(_keys(arrays), self.rollouts, strict=True))
        return _bridge.seen(_bridge.observe(physics, controls.shape[1], self.rollouts))

    def _of(self, arrays: Sequence[Array]) -> tuple[list[Rollout], Array, Array]:
        keys = _keys(arrays)
        missing = [b for b, key in enumerate(keys) if key not in self._made]
        if missing:
            self.run([array[missing] for array in arrays])
        return [self._made[key] for key in keys], *self.physics.charts.normalise("rollout", arrays[1])

    def push(self, arrays: Sequence[Array], along: Sequence[Array]) -> Sequence[Array]:
        """Tangents of what is observed."""
        return _bridge.seen(_bridge.push(self.physics, *self._of(arrays), Pulled(*along), self.alone))

    def pull(self, arrays: Sequence[Array], bars: Sequence[Array | None]) -> Pulled:
        """Cotangents of what the rollouts begin with."""
        return _bridge.pull(self.physics, *self._of(arrays), Observed(*bars), self.alone)


class _Stepping:
    """Single steps in the same way; the states' memory comes last."""

    given, differentiable = 8, 2

    def __init__(self, physics: Physics, alone: bool) -> None:
        self.physics, self.alone = physics, alone
        self._made: dict[Key, tuple[Record, Array]] = {}

    def run(self, arrays: Sequence[NDArray[Any]]) -> Sequence[NDArray[Any]]:
        """q, v and memory after the steps."""
        controls, q, v, values, gains, *memory = arrays
        begin, _ = self.physics.charts.normalise("step", q)
        after = _bridge.advance(self.physics, begin, v, controls, values, gains, Memory(*memory), self.alone)
        # A copy: what leaves may be changed in place.
        made = zip(after.records, after.q.copy(), strict=True)
        self._made.update(zip(_keys(arrays), made, strict=True))
        return after.q, after.v, *after.memory

    def _of(self, arrays: Sequence[NDArray[Any]]) -> tuple[list[Record], Array, Array, Array]:
        keys = _keys(arrays)
        missing = [b for b, key in enumerate(keys) if key not in self._made]
        if missing:
            self.run([array[missing] for array in arrays])
        made = [self._made[key] for key in keys]
        begin, lengths = self.physics.charts.normalise("step", arrays[1])
        return [record for record, _ in made], begin, lengths, np.array([end for _, end in made])

    def push(self, arrays: Sequence[NDArray[Any]], along: Sequence[Array]) -> Sequence[Array]:
        """Tangents of q and v."""
        return _bridge.push_step(self.physics, *self._of(arrays), Pulled(*along), self.alone)

    def pull(self, arrays: Sequence[NDArray[Any]], bars: Sequence[Array | None]) -> Pulled:
        """Cotangents of what the steps begin with."""
        q_bar, v_bar = bars
        return _bridge.pull_step(self.physics, *self._of(arrays), q_bar, v_bar, self.alone)


Work = _Rolling | _Stepping


def _keys(arrays: Sequence[NDArray[Any]]) -> list[Key]:
    """All that each member of a flat batch depends on."""
    return [tuple(array[b].tobytes() for array in arrays) for b in range(len(arrays[0]))]


class _Run(torch.autograd.Function):
    """Work on a flat batch."""

    @staticmethod
    def forward(work: Work, *tensors: Tensor) -> tuple[Tensor, ...]:
        return tuple(torch.from_numpy(part) for part in work.run(_arrays(tensors)))

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Tensor, ...]) -> None:
        work, *tensors = inputs
        ctx.set_materialize_grads(False)
        ctx.mark_non_differentiable(*output[work.differentiable :])
        ctx.work = work
        ctx.save_for_backward(*tensors)
        ctx.save_for_forward(*tensors)

    @staticmethod
    def jvp(ctx: Any, *along: Tensor | None) -> Any:
        began = ctx.saved_tensors
        pairs = zip(began[:_LINEAR], along[1 : _LINEAR + 1], strict=True)
        filled = [torch.zeros_like(x) if part is None else part for x, part in pairs]
        still = (None,) * (3 if isinstance(ctx.work, _Stepping) else 0)
        return (*_Push.apply(ctx.work, *began, *filled), *still)

    @staticmethod
    def backward(ctx: Any, *bars: Tensor | None) -> tuple[Tensor | None, ...]:
        # A function of what was given too: who differentiates it by that gets an error, and not nothing.
        pulled = _Pull.apply(ctx.work, *ctx.saved_tensors, *bars[: ctx.work.differentiable])
        needed = ctx.needs_input_grad[1:]
        still = (None,) * (len(needed) - _LINEAR)
        return None, *(part if need else None for need, part in zip(needed, pulled, strict=False)), *still

    @staticmethod
    def vmap(info: Any, dims: Sequence[int | None], work: Work, *tensors: Tensor) -> Any:
        size, work.alone = info.batch_size, False
        return _parted(size, _Run.apply(work, *_joined(size, dims[1:], tensors)))


class _Linear(torch.autograd.Function):
    """Tangents and transposes are calls of their own, so that vmap sees them; they have no derivatives."""

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
# Controls, q, v, values and gains have derivatives.
_LINEAR = 5


class _Push(_Linear):
    """Tangents of work, from what it was given and the tangents of that."""

    @staticmethod
    def forward(work: Work, *tensors: Tensor) -> tuple[Tensor, ...]:
        arrays = _arrays(tensors)
        return tuple(torch.from_numpy(part) for part in work.push(arrays[: work.given], arrays[work.given :]))

    @staticmethod
    def vmap(info: Any, dims: Sequence[int | None], work: Work, *tensors: Tensor) -> Any:
        size = info.batch_size
        return _parted(size, _Push.apply(work, *_joined(size, dims[1:], tensors)))


class _Pull(_Linear):
    """Cotangents of what work was given, from that and the cotangents of what it made; one that is None is zero."""

    @staticmethod
    def forward(work: Work, *tensors: Tensor | None) -> tuple[Tensor, ...]:
        arrays = [None if tensor is None else tensor.detach().numpy() for tensor in tensors]
        began = [array for array in arrays[: work.given] if array is not None]
        return tuple(torch.from_numpy(part) for part in work.pull(began, arrays[work.given :]))

    @staticmethod
    def vmap(info: Any, dims: Sequence[int | None], work: Work, *tensors: Tensor | None) -> Any:
        size = info.batch_size
        given = [None if t is None else _joined(size, [d], [t])[0] for d, t in zip(dims[1:], tensors, strict=True)]
        return _parted(size, _Pull.apply(work, *given))


def _arrays(tensors: Sequence[Tensor]) -> list[Array]:
    return [tensor.detach().numpy() for tensor in tensors]


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
    try:
        numbers = tensor.detach().numpy()
    except RuntimeError:
        # What a transformation of torch.func goes through: the simulator itself looks at it.
        return tensor
    _bridge.finite(place, numbers)
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
    # Copies: what was given may be changed in place.
    return lead, [part.clone() for part in (*spread[:3], values, gains)]


def _memory(state: State, lead: tuple[int, ...], physics: Physics) -> list[Tensor]:
    def flat(name: str, given: Tensor | float, *inner: int) -> Any:
        tensor = torch.as_tensor(given)
        if tensor.is_floating_point() or tensor.is_complex():
            raise InputError(f"step: state.{name}: got dtype {tensor.dtype}; must be whole numbers")
        try:
            return tensor.expand((*lead, *inner)).reshape((math.prod(lead), *inner))
        except RuntimeError:
            wanted = (*lead, *inner)
            raise InputError(f"step: state.{name}: got shape {tuple(tensor.shape)}; must go with {wanted}") from None

    return [
        flat("step", state.step).to(torch.int64, copy=True),
        flat("mode", state.mode).to(torch.int64, copy=True),
        flat("held", state.held, physics.bodies).to(torch.bool, copy=True),
    ]
