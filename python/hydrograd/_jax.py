"""The functions of `hydrograd.jax` that JAX differentiates: calls of the host, their tangents, and the transposes of those.

A tangent is a call of the host too, linear in the tangents that it is given, and its transpose is what a gradient is made of: so both modes of
differentiation work. Both need the record of the forward pass, that can't travel through JAX. Calls must be pure, so they
run the forward pass again unless its record is still at hand.
"""

from __future__ import annotations

import collections
import functools
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from numpy.typing import NDArray

from hydrograd import _bridge
from hydrograd._bridge import Memory, Observed, Physics, Pulled, Stepped
from hydrograd._hydrograd import Rollout, UnsupportedError

Array = jax.Array
Kept = TypeVar("Kept")


class Memo(Generic[Kept]):
    """Forward passes that a backward pass may ask for, the newest of them, by all that they depend on.

    It saves work alone: what isn't here is made again, to the same bit.
    """

    def __init__(self, most: int) -> None:
        self._kept: collections.OrderedDict[Any, Kept] = collections.OrderedDict()
        self._most = most
        self._lock = threading.Lock()

    @staticmethod
    def key(physics: Physics, arrays: Sequence[NDArray[Any]]) -> Any:
        # Arrays of nothing differ by their shapes alone.
        return (physics, *((array.shape, array.tobytes()) for array in arrays))

    def put(self, key: Any, made: Kept) -> None:
        with self._lock:
            self._kept[key] = made
            if len(self._kept) > self._most:
                self._kept.popitem(last=False)

    def __len__(self) -> int:
        return len(self._kept)

    def take(self, key: Any) -> Kept | None:
        with self._lock:
            return self._kept.pop(key, None)


# A gradient takes back what its forward pass left, so this holds only what no gradient was taken of.
rollouts_kept: Memo[list[Rollout]] = Memo(4)
steps_kept: Memo[Stepped] = Memo(1024)


@dataclass(frozen=True)
class Host:
    """Work for the host on arrays with one batch dimension before their `inner` ones; it is told whether they had none.

    Hosts that do the same are equal, so that JAX compiles what calls them once.
    """

    work: Callable[[Physics, Sequence[NDArray[Any]], bool], Sequence[NDArray[Any]]]
    physics: Physics
    inner: tuple[int, ...]

    def __call__(self, *given: Any) -> tuple[NDArray[Any], ...]:
        arrays = [np.asarray(array) for array in given]
        lead = np.broadcast_shapes(*(a.shape[: a.ndim - n] for a, n in zip(arrays, self.inner, strict=True)))
        size = math.prod(lead)
        flat = []
        for array, n in zip(arrays, self.inner, strict=True):
            last = array.shape[array.ndim - n :]
            flat.append(np.broadcast_to(array, (*lead, *last)).reshape((size, *last)))
        return tuple(part.reshape((*lead, *part.shape[1:])) for part in self.work(self.physics, flat, lead == ()))

    def call(self, arrays: Sequence[Array], out: Sequence[tuple[tuple[int, ...], Any]]) -> tuple[Array, ...]:
        """Its result in JAX, given the shape and dtype of each part."""
        return tuple(host_call.bind(*arrays, host=self, out=tuple(out)))  # type: ignore[no-untyped-call]


# `jax.pure_callback` would do, but it hands the host arrays of JAX: those over 100 kB are copied by the threads that
# run callbacks, and once all of these wait in callbacks for such copies, the program stands still. Here the host reads
# what XLA holds.
host_call = Primitive("hydrograd")
host_call.multiple_results = True


@host_call.def_impl  # type: ignore[untyped-decorator]
def _now(*arrays: Array, host: Host, out: Any) -> list[Array]:
    return [jnp.asarray(part) for part in host(*arrays)]


@host_call.def_abstract_eval  # type: ignore[untyped-decorator]
def _shapes(*arrays: Any, host: Host, out: Sequence[tuple[tuple[int, ...], Any]]) -> list[Any]:
    return [jax.core.ShapedArray(shape, dtype) for shape, dtype in out]


def _lowered(ctx: Any, *operands: Any, host: Host, out: Any) -> Any:
    results, *_ = mlir.emit_python_callback(
        ctx, host, None, list(operands), ctx.avals_in, ctx.avals_out, has_side_effect=False
    )
    return results


def _batched(arrays: Sequence[Any], axes: Sequence[int | None], *, host: Host, out: Any) -> Any:
    size, moved = _in_front(arrays, axes)
    results = host.call(moved, [((size, *shape), dtype) for shape, dtype in out])
    return results, [0] * len(results)


def _in_front(arrays: Sequence[Any], axes: Sequence[int | None]) -> tuple[int, list[Any]]:
    """The size of a batch, and the arrays with it in front: one call with all members, which run on all cores. Arrays that are the same for all have 1 there."""
    size = next(array.shape[axis] for array, axis in zip(arrays, axes, strict=True) if axis is not None)
    return size, [
        jnp.expand_dims(array, 0) if axis is None else jnp.moveaxis(array, axis, 0)
        for array, axis in zip(arrays, axes, strict=True)
    ]


mlir.register_lowering(host_call, _lowered)
batching.primitive_batchers[host_call] = _batched


# A call that is linear in the last of its arrays, `back` being its transpose: with the first `fixed` arrays as they are, and a cotangent for each result.
linear_call = Primitive("hydrograd_linear")
linear_call.multiple_results = True


@linear_call.def_impl  # type: ignore[untyped-decorator]
def _linear_now(*arrays: Array, host: Host, back: Host, fixed: int, out: Any) -> list[Array]:
    return _now(*arrays, host=host, out=out)


@linear_call.def_abstract_eval  # type: ignore[untyped-decorator]
def _linear_shapes(*arrays: Any, host: Host, back: Host, fixed: int, out: Any) -> list[Any]:
    return _shapes(*arrays, host=host, out=out)


def _linear_lowered(ctx: Any, *operands: Any, host: Host, back: Host, fixed: int, out: Any) -> Any:
    return _lowered(ctx, *operands, host=host, out=out)


def _linear_batched(
    arrays: Sequence[Any], axes: Sequence[int | None], *, host: Host, back: Host, fixed: int, out: Any
) -> Any:
    size, moved = _in_front(arrays, axes)
    whole = [((size, *shape), dtype) for shape, dtype in out]
    # A linear array has the size of the batch, for its cotangent will have.
    moved[fixed:] = [jnp.broadcast_to(array, (size, *array.shape[1:])) for array in moved[fixed:]]
    results = linear_call.bind(*moved, host=host, back=back, fixed=fixed, out=tuple(whole))  # type: ignore[no-untyped-call]
    return results, [0] * len(results)


def _linear_transposed(bars: Sequence[Any], *arrays: Any, host: Host, back: Host, fixed: int, out: Any) -> Any:
    whole = [jnp.zeros(*shape) if type(bar) is ad.Zero else bar for bar, shape in zip(bars, out, strict=True)]
    wanted = [array.aval if ad.is_undefined_primal(array) else None for array in arrays[fixed:]]
    shapes = [(jnp.shape(a), a.dtype) if w is None else (w.shape, w.dtype) for a, w in zip(arrays[fixed:], wanted, strict=True)]
    made = back.call((*arrays[:fixed], *whole), shapes)
    return [None] * fixed + [None if w is None else part for w, part in zip(wanted, made, strict=True)]


def _once(*_: Any, **__: Any) -> Any:
    raise UnsupportedError(
        "derivatives of derivatives of a rollout or step are not available: hydrograd has the first ones; take differences "
        "of gradients"
    )


mlir.register_lowering(linear_call, _linear_lowered)
batching.primitive_batchers[linear_call] = _linear_batched
ad.primitive_transposes[linear_call] = _linear_transposed
ad.primitive_jvps[linear_call] = _once
ad.primitive_jvps[host_call] = _once


# Dimensions of controls, q, v, values and gains without the batch's; then those of cotangents or of a state's memory.
ROLLOUT, OBSERVED = (2, 1, 1, 1, 1), (3, 4, 2, 2, 2)
STEP, MEMORY = (1, 1, 1, 1, 1), (0, 0, 1)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def rollout(physics: Physics, *arrays: Array) -> tuple[Array, ...]:
    """Positions, rotations, q, v and applied controls of rollouts of controls, q, v, values and gains with the same leading
    dimensions."""
    return Host(_roll, physics, ROLLOUT).call(arrays, _observed(physics, arrays))


@rollout.defjvp
def _rollout_tangent(
    physics: Physics, arrays: tuple[Array, ...], along: tuple[Array, ...]
) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    out = _observed(physics, arrays)
    host, back = Host(_push, physics, ROLLOUT + ROLLOUT), Host(_pull, physics, ROLLOUT + OBSERVED)
    # First what the tangent looks for.
    made = Host(_roll_and_keep, physics, ROLLOUT).call(arrays, out)
    moved = linear_call.bind(*arrays, *along, host=host, back=back, fixed=len(arrays), out=tuple(out))  # type: ignore[no-untyped-call]
    return made, tuple(moved)


def _observed(physics: Physics, arrays: Sequence[Array]) -> list[tuple[tuple[int, ...], Any]]:
    controls, q, v, *_ = arrays
    lead = (*q.shape[:-1], controls.shape[-2] + 1)
    inner = [(physics.bodies, 3), (physics.bodies, 3, 3), q.shape[-1:], v.shape[-1:]]
    applied = (*q.shape[:-1], *controls.shape[-2:])
    return [*(((*lead, *shape), q.dtype) for shape in inner), (applied, q.dtype)]


def _roll(physics: Physics, flat: Sequence[NDArray[Any]], alone: bool) -> Sequence[NDArray[Any]]:
    return _bridge.seen(_bridge.observe(physics, flat[0].shape[1], _rolled(physics, flat, alone)))


def _roll_and_keep(physics: Physics, flat: Sequence[NDArray[Any]], alone: bool) -> Sequence[NDArray[Any]]:
    rollouts = _rolled(physics, flat, alone)
    rollouts_kept.put(Memo.key(physics, flat), rollouts)
    return _bridge.seen(_bridge.observe(physics, flat[0].shape[1], rollouts))


def _rolled(physics: Physics, flat: Sequence[NDArray[Any]], alone: bool) -> list[Rollout]:
    controls, q, v, values, gains = flat
    begin, _ = physics.charts.normalise("rollout", q)
    return _bridge.roll(physics, controls, begin, v, values, gains, alone)


def _push(physics: Physics, flat: Sequence[NDArray[Any]], alone: bool) -> Sequence[NDArray[Any]]:
    began, first = _together(flat[:5])
    rollouts = rollouts_kept.take(Memo.key(physics, began)) or _rolled(physics, began, alone)
    begin, lengths = physics.charts.normalise("rollout", began[1])
    made = [rollouts[row] for row in first]
    return _bridge.seen(_bridge.push(physics, made, begin[first], lengths[first], Pulled(*flat[5:]), alone))


def _together(arrays: Sequence[NDArray[Any]]) -> tuple[list[NDArray[Any]], list[int]]:
    """Different members of a batch, and which of them each member is: those of one Jacobian are one."""
    members: dict[Any, int] = {}
    first = [members.setdefault(tuple(a[b].tobytes() for a in arrays), len(members)) for b in range(len(arrays[0]))]
    kept = [first.index(row) for row in range(len(members))]
    return [array[kept] for array in arrays], first


def _pull(physics: Physics, flat: Sequence[NDArray[Any]], alone: bool) -> Sequence[NDArray[Any]]:
    began, bar = flat[:5], Observed(*flat[5:])
    rollouts = rollouts_kept.take(Memo.key(physics, began)) or _rolled(physics, began, alone)
    begin, lengths = physics.charts.normalise("rollout", began[1])
    return _given(_bridge.pull(physics, rollouts, begin, lengths, bar, alone), began[4])


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def step(physics: Physics, memory: tuple[Array, ...], *arrays: Array) -> tuple[Array, ...]:
    """q, v and memory one step after q and v with controls, values and gains; the same leading dimensions in all."""
    given = (*arrays, *memory)
    return Host(_advance, physics, STEP + MEMORY).call(given, _next(given))


@step.defjvp
def _step_tangent(
    physics: Physics, primals: tuple[Any, ...], tangents: tuple[Any, ...]
) -> tuple[tuple[Array, ...], tuple[Any, ...]]:
    (memory, *arrays), (_, *along) = primals, tangents
    given = (*arrays, *memory)
    out = _next(given)
    host, back = Host(_push_step, physics, STEP + MEMORY + STEP), Host(_pull_step, physics, STEP + MEMORY + (1, 1))
    made = Host(_advance_and_keep, physics, STEP + MEMORY).call(given, out)
    moved = linear_call.bind(*given, *along, host=host, back=back, fixed=len(given), out=tuple(out[:2]))  # type: ignore[no-untyped-call]
    # Whole numbers have no tangents.
    still = [np.zeros(shape, dtype=jax.dtypes.float0) for shape, _ in out[2:]]
    return made, (*moved, *still)


def _next(given: Sequence[Array]) -> list[tuple[tuple[int, ...], Any]]:
    _, q, v, _, _, *memory = given
    return [(array.shape, array.dtype) for array in (q, v, *memory)]


def _advance(physics: Physics, flat: Sequence[NDArray[Any]], alone: bool) -> Sequence[NDArray[Any]]:
    after = _advanced(physics, flat, alone)
    return after.q, after.v, *after.memory


def _advance_and_keep(physics: Physics, flat: Sequence[NDArray[Any]], alone: bool) -> Sequence[NDArray[Any]]:
    after = _advanced(physics, flat, alone)
    steps_kept.put(Memo.key(physics, flat), after)
    return after.q, after.v, *after.memory


def _advanced(physics: Physics, flat: Sequence[NDArray[Any]], alone: bool) -> Stepped:
    controls, q, v, values, gains, *memory = flat
    begin, _ = physics.charts.normalise("step", q)
    return _bridge.advance(physics, begin, v, controls, values, gains, Memory(*memory), alone)


def _push_step(physics: Physics, flat: Sequence[NDArray[Any]], alone: bool) -> Sequence[NDArray[Any]]:
    began, first = _together(flat[:8])
    after = steps_kept.take(Memo.key(physics, began)) or _advanced(physics, began, alone)
    begin, lengths = physics.charts.normalise("step", began[1])
    records = [after.records[row] for row in first]
    along = Pulled(*flat[8:])
    return _bridge.push_step(physics, records, begin[first], lengths[first], after.q[first], along, alone)


def _pull_step(physics: Physics, flat: Sequence[NDArray[Any]], alone: bool) -> Sequence[NDArray[Any]]:
    began, (q_bar, v_bar) = flat[:8], flat[8:]
    after = steps_kept.take(Memo.key(physics, began)) or _advanced(physics, began, alone)
    begin, lengths = physics.charts.normalise("step", began[1])
    pulled = _bridge.pull_step(physics, after.records, begin, lengths, after.q, q_bar, v_bar, alone)
    return _given(pulled, began[4])


def _given(pulled: Pulled, gains: NDArray[Any]) -> Pulled:
    """Cotangents of as many gains as were given: all or none."""
    return pulled._replace(gains=pulled.gains[:, : gains.shape[1]])
