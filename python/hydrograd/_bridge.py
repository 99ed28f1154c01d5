"""What the bridges to torch and JAX share: batches of rollouts and steps on NumPy arrays, and their transposes.

Every array has one leading batch dimension here. Batches run on all cores, and each of their members is what it would
be alone, to the bit.
"""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from hydrograd._charts import Array, Charts, charts, cross
from hydrograd._hydrograd import BatchError, Error, InputError, Record, Rollout, Simulator, State, _nested

Made = TypeVar("Made")


class Physics(NamedTuple):
    """A simulator, and which of its parameters are given by value, by name."""

    sim: Simulator
    names: tuple[str, ...]

    @property
    def charts(self) -> Charts:
        """Where its quaternions are."""
        return charts(tuple(self.sim.q_names))

    @property
    def bodies(self) -> int:
        """Number of its bodies."""
        return len(self.sim.body_names)

    def variants(self, values: Array, gains: Array) -> list[Simulator]:
        """Simulators with these parameters (batch, names) and gains (batch, gains); equal rows share one."""
        return [_variant(self, row.tobytes(), gain.tobytes()) for row, gain in zip(values, gains, strict=True)]


class Observed(NamedTuple):
    """What is read off rollouts, or cotangents of it; a cotangent that is None is zero."""

    positions: Array | None
    rotations: Array | None
    q: Array | None
    v: Array | None
    applied_controls: Array | None


class Pulled(NamedTuple):
    """Cotangents of what rollouts or steps begin with, each with its batch dimension; `q` of its entries."""

    controls: Array
    q: Array
    v: Array
    values: Array
    gains: Array


def _variant(physics: Physics, values: bytes, gains: bytes) -> Simulator:
    return _changed(physics, values, gains) if values or gains else physics.sim


# Steps of one rollout ask for the same variant one after the other.
@functools.lru_cache(maxsize=32)
def _changed(physics: Physics, values: bytes, gains: bytes) -> Simulator:
    sim = physics.sim
    if values:
        sim = sim.with_parameters(dict(zip(physics.names, np.frombuffer(values).tolist(), strict=True)))
    return sim.with_gains(np.frombuffer(gains)) if gains else sim


def physics_of(place: str, sim: Simulator, parameters: Mapping[str, object] | None) -> Physics:
    """Checks the names of the parameters given."""
    if not isinstance(sim, Simulator):
        raise InputError(f"{place}: sim: got a value of type {type(sim).__name__}; must be a hydrograd.Simulator")
    names = tuple(parameters or ())
    known = sim.parameters if names else {}
    for name in names:
        if name not in known:
            raise InputError(f"{place}: parameters: got {name!r}; must be one of {list(known)}")
    return Physics(sim, names)


def leading(place: str, shapes: Mapping[str, tuple[tuple[int, ...], tuple[int | str, ...]]]) -> tuple[int, ...]:
    """The leading dimensions that all arrays share by broadcasting, from each one's shape and what it must end in.

    A name in place of a number stands for any number.
    """
    lead: tuple[int, ...] = ()
    for name, (shape, inner) in shapes.items():
        last = shape[len(shape) - len(inner) :]
        fits = len(shape) >= len(inner) and all(isinstance(n, str) or m == n for m, n in zip(last, inner, strict=True))
        if not fits:
            wanted = ", ".join(str(n) for n in inner)
            raise InputError(f"{place}: {name}: got an array of shape {shape}; must have the shape (..., {wanted})")
        try:
            lead = np.broadcast_shapes(lead, shape[: len(shape) - len(inner)])
        except ValueError:
            raise InputError(
                f"{place}: {name}: got an array of shape {shape}; its leading dimensions must go with {lead}, those of "
                f"the others"
            ) from None
    if 0 in lead:
        raise InputError(f"{place}: got a batch of the shape {lead}; must hold at least one")
    return lead


Ending = tuple["int | str", ...]
"""What a shape must end in; a name stands for any number."""


def adjustable(
    place: str,
    sim: Simulator,
    parameters: Mapping[str, Any] | None,
    gains: Any,
    convert: Callable[[str, Any], Made],
) -> dict[str, tuple[Made, Ending]]:
    """Parameters and gains, converted, each with what its shape must end in."""
    out: dict[str, tuple[Made, Ending]] = {}
    for name, value in (parameters or {}).items():
        where = f"parameters[{name!r}]"
        out[where] = convert(f"{place}: {where}", value), ()
    if gains is not None:
        out["gains"] = convert(f"{place}: gains", gains), (len(sim.gains),)
    return out


def finite(place: str, array: Array) -> None:
    """Refuses what isn't finite."""
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        at = tuple(bad[0])
        raise InputError(f"{place}{[int(i) for i in at]}: got {array[at]}; must be finite")


class _Left(Exception):
    """Ends work for a batch that nobody waits for any more."""


def each(work: Callable[..., Made], given: Iterable[Any], *, alone: bool = False, stops: bool = False) -> list[Made]:
    """Does work that leaves the interpreter's lock on all cores; results in order.

    Where some fail, all are done all the same, and the `BatchError` has what they came to; one that is `alone` is no
    batch of one, and fails by itself. What else is raised, Ctrl-C among it, ends the batch and comes out: what waits is
    left undone, and with `stops` what runs ends too, by the `progress` that it is given.
    """
    listed, left = list(given), threading.Event()

    def stop(done: int, total: int) -> None:
        if left.is_set():
            raise _Left

    do = functools.partial(work, progress=stop) if stops else work
    if alone and len(listed) == 1:
        return [do(listed[0])]
    futures: list[Future[Made]] = []
    members: list[Any] = []
    errors: dict[int, Error] = {}
    try:
        # A controller of a batch that has batches of its own: the threads are taken by members that wait for it, so
        # it does the work itself.
        if len(listed) > 1 and not _nested():
            for one in listed:
                futures.append(_pool(os.getpid()).submit(do, one))
        for b, one in enumerate(listed):
            try:
                members.append(futures[b].result() if futures else do(one))
            except BatchError as error:
                # A batch of one.
                errors[b] = error.errors[0]
                members += error.members
            except Error as error:
                errors[b] = error
                members.append(None)
    except BaseException:
        left.set()
        for future in futures:
            future.cancel()
        raise
    if errors:
        b, first = next(iter(errors.items()))
        failed = BatchError(f"{len(errors)} of {len(listed)} members failed, counted from 0; member {b}: {first}")
        failed.errors, failed.members = errors, members
        raise failed
    return members


@functools.lru_cache(maxsize=1)
def _pool(process: int) -> ThreadPoolExecutor:
    # By process: threads don't survive a fork.
    return ThreadPoolExecutor(os.cpu_count() or 1, thread_name_prefix="hydrograd")


def roll(
    physics: Physics, controls: Array, q: Array, v: Array, values: Array, gains: Array, alone: bool = False
) -> list[Rollout]:
    """Rollouts of controls (batch, steps, control_size) from unit q (batch, q_size) and v (batch, v_size); one that is
    `alone` is no batch of one."""
    sims = physics.variants(values, gains)
    if alone and len(sims) == 1:
        return [sims[0].rollout(controls[0], q=q[0], v=v[0])]
    if sims and all(sim is sims[0] for sim in sims):
        return sims[0].rollout_batch(controls, q=q, v=v)

    def one(b: int, progress: Callable[[int, int], None]) -> Rollout:
        this = slice(b, b + 1)
        return sims[b].rollout_batch(controls[this], q=q[this], v=v[this], progress=progress)[0]

    return each(one, range(len(sims)), stops=True)


def observe(physics: Physics, steps: int, rollouts: Sequence[Rollout]) -> Observed:
    """What was observed of rollouts of `steps` steps."""
    out = _empty(physics, len(rollouts), steps)
    for name, array in out._asdict().items():
        for b, rollout in enumerate(rollouts):
            array[b] = getattr(rollout, name)
    return out


def _empty(physics: Physics, batch: int, steps: int) -> Observed:
    sim, states = physics.sim, steps + 1
    return Observed(
        np.empty((batch, states, physics.bodies, 3)),
        np.empty((batch, states, physics.bodies, 3, 3)),
        np.empty((batch, states, sim.q_size)),
        np.empty((batch, states, sim.v_size)),
        np.empty((batch, steps, sim.control_size)),
    )


def seen(observed: Observed) -> list[Array]:
    """The arrays of what was observed."""
    return [array for array in observed if array is not None]


def pull(
    physics: Physics, rollouts: Sequence[Rollout], q: Array, lengths: Array, bar: Observed, alone: bool = False
) -> Pulled:
    """Transpose of rollouts that began at `q`, with the `lengths` that its quaternions were given with."""

    def one(b: int, progress: Callable[[int, int], None]) -> tuple[Array, Array, Array, list[float], Array]:
        rollout, chart = rollouts[b], physics.charts
        seeds: dict[str, Array] = {}
        if bar.positions is not None:
            seeds["positions"] = bar.positions[b]
        if bar.rotations is not None:
            # δR = δθ × R, column by column.
            columns = np.swapaxes(rollout.rotations, -1, -2), np.swapaxes(bar.rotations[b], -1, -2)
            seeds["rotations"] = cross(*columns).sum(axis=-2)
        if bar.q is not None:
            seeds["q"] = chart.tangent(rollout.q, bar.q[b])
        if bar.v is not None:
            seeds["v"] = bar.v[b]
        if bar.applied_controls is not None:
            seeds["applied_controls"] = bar.applied_controls[b]
        made = rollout.vjp(**seeds, progress=progress)
        values = [made.parameters[name] for name in physics.names]
        return made.controls, made.initial_q, made.initial_v, values, made.gains

    return _stacked(physics, each(one, range(len(rollouts)), alone=alone, stops=True), q, lengths)


def push(
    physics: Physics, rollouts: Sequence[Rollout], q: Array, lengths: Array, along: Pulled, alone: bool = False
) -> Observed:
    """Tangents of rollouts that began at `q`, a row for each of `along`; rows of the same rollout share its work."""
    chart, rows = physics.charts, _together(rollouts)
    turned = chart.turned(q, lengths, along.q)

    def one(first: int) -> Observed:
        rollout, of = rollouts[first], rows[first]
        made = rollout.jvp(controls=along.controls[of], q=turned[of], v=along.v[of], **_named(physics, along, of))
        columns = np.swapaxes(rollout.rotations, -1, -2)
        spun = np.swapaxes(cross(made.rotations[..., None, :], columns), -1, -2)
        return Observed(made.positions, spun, chart.moved(rollout.q, made.q), made.v, made.applied_controls)

    out = _empty(physics, len(rollouts), rollouts[0].steps)
    for of, made in zip(rows.values(), each(one, rows, alone=alone), strict=True):
        for array, part in zip(seen(out), seen(made), strict=True):
            array[of] = part
    return out


def push_step(
    physics: Physics,
    records: Sequence[Record],
    q: Array,
    lengths: Array,
    after: Array,
    along: Pulled,
    alone: bool = False,
) -> tuple[Array, Array]:
    """Tangents of q and v after steps from `q` to `after`, a row for each of `along`."""
    turned, rows = physics.charts.turned(q, lengths, along.q), _together(records)

    def one(first: int) -> tuple[Array, Array]:
        of = rows[first]
        return records[first].jvp(q=turned[of], v=along.v[of], u=along.controls[of], **_named(physics, along, of))

    dq, dv = np.empty_like(after), np.empty_like(along.v)
    for of, (q_part, v_part) in zip(rows.values(), each(one, rows, alone=alone), strict=True):
        dq[of], dv[of] = physics.charts.moved(after[of], q_part), v_part
    return dq, dv


def _together(made: Sequence[object]) -> dict[int, list[int]]:
    """Rows that are of one and the same, by the first of them."""
    first: dict[int, int] = {}
    rows: dict[int, list[int]] = {}
    for b, one in enumerate(made):
        rows.setdefault(first.setdefault(id(one), b), []).append(b)
    return rows


def _named(physics: Physics, along: Pulled, of: list[int]) -> dict[str, Any]:
    """Tangents of parameters and gains, as `jvp` takes them."""
    parameters = {name: along.values[of, i] for i, name in enumerate(physics.names)}
    return {"parameters": parameters, "gains": along.gains[of] if along.gains.shape[1] else None}


def _stacked(
    physics: Physics, made: Sequence[tuple[Array, Array, Array, list[float], Array]], q: Array, lengths: Array
) -> Pulled:
    controls, tangents, v, values, gains = (np.array(part, dtype=np.float64) for part in zip(*made, strict=True))
    return Pulled(controls, physics.charts.entries(q, lengths, tangents), v, values, gains)


class Memory(NamedTuple):
    """What a state carries beyond q and v: it isn't differentiated.

    Numbers of steps made (batch,), modes of the scene's controller (batch,), and which joints it held in the step
    before (batch, bodies).
    """

    step: NDArray[np.int64]
    mode: NDArray[np.int64]
    held: NDArray[np.bool_]


class Stepped(NamedTuple):
    """Where steps led to, and the keys to their derivatives."""

    q: Array
    v: Array
    memory: Memory
    records: list[Record]


def _state(sim: Simulator, q: Array, v: Array, step: int, mode: int, held: NDArray[np.bool_]) -> State:
    for name, number in (("step", step), ("mode", mode)):
        if number < 0:
            raise InputError(f"step: state.{name}: got {number}; must be at least 0")
    return sim.state(q, v, step=step, mode=mode, held=held.tolist() if held.any() else None)


def advance(
    physics: Physics,
    q: Array,
    v: Array,
    controls: Array,
    values: Array,
    gains: Array,
    memory: Memory,
    alone: bool = False,
) -> Stepped:
    """One step of each state, from unit q (batch, q_size) and v (batch, v_size) with controls (batch, control_size)."""
    sims = physics.variants(values, gains)

    def one(b: int) -> tuple[State, Record]:
        state = _state(sims[b], q[b], v[b], int(memory.step[b]), int(memory.mode[b]), memory.held[b])
        return sims[b].step(state, controls[b])

    made = each(one, range(len(sims)), alone=alone)
    fresh = Memory(np.zeros_like(memory.step), np.zeros_like(memory.mode), np.zeros_like(memory.held))
    after = Stepped(np.empty_like(q), np.empty_like(v), fresh, [record for _, record in made])
    for b, (state, _) in enumerate(made):
        after.q[b], after.v[b] = state.q, state.v
        fresh.step[b], fresh.mode[b], fresh.held[b] = state.step, state.mode, state.held
    return after


def pull_step(
    physics: Physics,
    records: Sequence[Record],
    q: Array,
    lengths: Array,
    after: Array,
    q_bar: Array | None,
    v_bar: Array | None,
    alone: bool = False,
) -> Pulled:
    """Transpose of steps from `q` to `after`, with the `lengths` that the quaternions of `q` were given with."""
    seeds = None if q_bar is None else physics.charts.tangent(after, q_bar)

    def one(b: int) -> tuple[Array, Array, Array, list[float], Array]:
        made = records[b].vjp(q=None if seeds is None else seeds[b], v=None if v_bar is None else v_bar[b])
        return made.controls, made.q, made.v, [made.parameters[name] for name in physics.names], made.gains

    return _stacked(physics, each(one, range(len(records)), alone=alone), q, lengths)
