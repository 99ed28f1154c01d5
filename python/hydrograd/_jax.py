"""The functions of `hydrograd.jax` that JAX differentiates: calls of the host, and their transposes.

A transpose needs the record of its forward pass, that can't travel through JAX. Calls must be pure, so the transpose
runs the forward pass again unless its record is still at hand.
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
from jax.interpreters import batching, mlir
from numpy.typing import NDArray

from hydrograd import _bridge
from hydrograd._bridge import Memory, Observed, Physics, Pulled, Stepped
from hydrograd._hydrograd import Rollout

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
        return (physics, *(array.tobytes() for array in arrays))

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
    """Work for the host on arrays with one batch dimension before their `inner` ones.

    Hosts that do the same are equal, so that JAX compiles what calls them once.
    """

    work: Callable[[Physics, Sequence[NDArray[Any]]], Sequence[NDArray[Any]]]
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
        return tuple(part.reshape((*lead, *part.shape[1:])) for part in self.work(self.physics, flat))

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
    # One call with all members, which run on all cores; arrays that are the same for all have 1 there.
    size = next(array.shape[axis] for array, axis in zip(arrays, axes, strict=True) if axis is not None)
    moved = [
        jnp.expand_dims(array, 0) if axis is None else jnp.moveaxis(array, axis, 0)
        for array, axis in zip(arrays, axes, strict=True)
    ]
    results = host.call(moved, [((size, *shape), dtype) for shape, dtype in out])
    return results, [0] * len(results)


mlir.register_lowering(host_call, _lowered)
batching.primitive_batchers[host_call] = _batched


# Dimensions of controls, q, v, values and gains without the batch's; then those of cotangents or of a state's memory.
ROLLOUT, OBSERVED = (2, 1, 1, 1, 1), (3, 4, 2, 2)
STEP, MEMORY = (1, 1, 1, 1, 1), (0, 0, 1)


@functools.partial(jax.custom_vjp, nondiff_argnums=(0,))
def rollout(physics: Physics, *arrays: Array) -> tuple[Array, ...]:
    """Positions, rotations, q and v of rollouts of controls, q, v, values and gains with the same leading
    dimensions."""
    return Host(_roll, physics, ROLLOUT).call(arrays, _observed(physics, arrays))


def _rollout_forward(physics: Physics, *arrays: Array) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    return Host(_roll_and_keep, physics, ROLLOUT).call(arrays, _observed(physics, arrays)), arrays


def _rollout_backward(physics: Physics, arrays: tuple[Array, ...], bars: tuple[Array, ...]) -> tuple[Array, ...]:
    host = Host(_pull, physics, ROLLOUT + OBSERVED)
    return host.call((*arrays, *bars), [(array.shape, array.dtype) for array in arrays])


rollout.defvjp(_rollout_forward, _rollout_backward)


def _observed(physics: Physics, arrays: Sequence[Array]) -> list[tuple[tuple[int, ...], Any]]:
    controls, q, v, *_ = arrays
    lead = (*q.shape[:-1], controls.shape[-2] + 1)
    inner = [(physics.bodies, 3), (physics.bodies, 3, 3), q.shape[-1:], v.shape[-1:]]
    return [((*lead, *shape), q.dtype) for shape in inner]


def _roll(physics: Physics, flat: Sequence[NDArray[Any]]) -> Sequence[NDArray[Any]]:
    return _bridge.seen(_bridge.observe(physics, flat[0].shape[1], _rolled(physics, flat)))


def _roll_and_keep(physics: Physics, flat: Sequence[NDArray[Any]]) -> Sequence[NDArray[Any]]:
    rollouts = _rolled(physics, flat)
    rollouts_kept.put(Memo.key(physics, flat), rollouts)
    return _bridge.seen(_bridge.observe(physics, flat[0].shape[1], rollouts))


def _rolled(physics: Physics, flat: Sequence[NDArray[Any]]) -> list[Rollout]:
    controls, q, v, values, gains = flat
    begin, _ = physics.charts.normalise("rollout", q)
    return _bridge.roll(physics, controls, begin, v, values, gains)


def _pull(physics: Physics, flat: Sequence[NDArray[Any]]) -> Sequence[NDArray[Any]]:
    began, bar = flat[:5], Observed(*flat[5:])
    rollouts = rollouts_kept.take(Memo.key(physics, began)) or _rolled(physics, began)
    begin, lengths = physics.charts.normalise("rollout", began[1])
    return _given(_bridge.pull(physics, rollouts, begin, lengths, bar), began[4])


@functools.partial(jax.custom_vjp, nondiff_argnums=(0,))
def step(physics: Physics, memory: tuple[Array, ...], *arrays: Array) -> tuple[Array, ...]:
    """q, v and memory one step after q and v with controls, values and gains; the same leading dimensions in all."""
    given = (*arrays, *memory)
    return Host(_advance, physics, STEP + MEMORY).call(given, _next(given))


def _step_forward(
    physics: Physics, memory: tuple[Array, ...], *arrays: Array
) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    given = (*arrays, *memory)
    return Host(_advance_and_keep, physics, STEP + MEMORY).call(given, _next(given)), given


def _step_backward(physics: Physics, given: tuple[Array, ...], bars: tuple[Array, ...]) -> tuple[Array | None, ...]:
    host = Host(_pull_step, physics, STEP + MEMORY + (1, 1))
    return None, *host.call((*given, *bars[:2]), [(array.shape, array.dtype) for array in given[:5]])


step.defvjp(_step_forward, _step_backward)


def _next(given: Sequence[Array]) -> list[tuple[tuple[int, ...], Any]]:
    _, q, v, _, _, *memory = given
    return [(array.shape, array.dtype) for array in (q, v, *memory)]


def _advance(physics: Physics, flat: Sequence[NDArray[Any]]) -> Sequence[NDArray[Any]]:
    after = _advanced(physics, flat)
    return after.q, after.v, *after.memory


def _advance_and_keep(physics: Physics, flat: Sequence[NDArray[Any]]) -> Sequence[NDArray[Any]]:
    after = _advanced(physics, flat)
    steps_kept.put(Memo.key(physics, flat), after)
    return after.q, after.v, *after.memory


def _advanced(physics: Physics, flat: Sequence[NDArray[Any]]) -> Stepped:
    controls, q, v, values, gains, *memory = flat
    begin, _ = physics.charts.normalise("step", q)
    return _bridge.advance(physics, begin, v, controls, values, gains, Memory(*memory))


def _pull_step(physics: Physics, flat: Sequence[NDArray[Any]]) -> Sequence[NDArray[Any]]:
    began, (q_bar, v_bar) = flat[:8], flat[8:]
    after = steps_kept.take(Memo.key(physics, began)) or _advanced(physics, began)
    begin, lengths = physics.charts.normalise("step", began[1])
    return _given(_bridge.pull_step(physics, after.records, begin, lengths, after.q, q_bar, v_bar), began[4])


def _given(pulled: Pulled, gains: NDArray[Any]) -> Pulled:
    """Cotangents of as many gains as were given: all or none."""
    return pulled._replace(gains=pulled.gains[:, : gains.shape[1]])
