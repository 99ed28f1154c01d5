"""Callbacks that follow a run, and what it says to `logging`."""

import logging
import time

import numpy as np
import pytest

import hydrograd as hg


class Enough(Exception):
    """What a callback ends a run with."""


@pytest.fixture(scope="module")
def long_run() -> tuple[hg.Simulator, np.ndarray]:
    """A simulator, and controls that take it about two seconds."""
    scene = hg.Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(hg.Body(hg.sphere(0.05), density=1100.0, position=(-0.12, 0.0, 0.0), actuated=True))
    scene.add(hg.Body(hg.ellipsoid(0.02, 0.04, 0.04), density=1050.0))
    sim = hg.Simulator(scene, 1e-4, faces=80)
    started = time.perf_counter()
    sim.rollout(steps=200)
    rate = 200 / (time.perf_counter() - started)
    return sim, np.full((int(2.0 * rate) + 200, 6), 1e-4)


def followed(run):
    """What a run gives, and the calls it made, each with its time in s."""
    calls = []
    out = run(lambda done, total: calls.append((time.perf_counter(), done, total)))
    return out, calls


def test_a_rollout_is_followed_and_stays_the_same_to_the_bit(long_run):
    sim, controls = long_run
    rollout, calls = followed(lambda f: sim.rollout(controls, progress=f))
    times, done, total = map(np.array, zip(*calls))
    assert len(calls) > 3 and set(total) == {len(controls)}
    assert (np.diff(done) > 0).all() and done[-1] == len(controls)
    # The last call comes at the end, whenever that is.
    assert np.diff(times)[:-1].min() > 0.045
    assert np.array_equal(rollout.q, sim.rollout(controls).q)


def test_an_exception_ends_a_rollout_and_brings_what_ran(long_run):
    sim, controls = long_run

    def stop(done, total):
        if done > total // 10:
            raise Enough(done)

    with pytest.raises(Enough) as caught:
        sim.rollout(controls, progress=stop)
    partial = caught.value.rollout
    assert caught.value.args[0] <= partial.steps < len(controls)
    assert np.array_equal(partial.q, sim.rollout(controls[: partial.steps]).q)


def test_an_exception_in_the_last_call_loses_nothing(sim, controls):
    def stop(done, total):
        if done == total:
            raise Enough

    with pytest.raises(Enough) as caught:
        sim.rollout(controls, progress=stop)
    assert np.array_equal(caught.value.rollout.q, sim.rollout(controls).q)


def test_a_batch_is_followed_over_all_members(long_run):
    sim, controls = long_run
    batch = np.stack([controls, 2.0 * controls])
    calls = followed(lambda f: sim.rollout_batch(batch, progress=f))[1]
    assert calls[-1][1:] == (2 * len(controls),) * 2

    def stop(done, total):
        if done > total // 4:
            raise Enough

    with pytest.raises(Enough) as caught:
        sim.rollout_batch(batch, progress=stop)
    members = caught.value.members
    assert len(members) == 2 and sum(member.steps for member in members) < 2 * len(controls)
    for member, own in zip(members, batch):
        assert np.array_equal(member.q, sim.rollout(own[: member.steps]).q)


def test_sweeps_back_are_followed(long_run):
    sim, controls = long_run
    rollout = sim.rollout(controls)
    seed = np.zeros_like(rollout.positions)
    seed[-1] = 1.0
    gradient, calls = followed(lambda f: rollout.vjp(positions=seed, progress=f))
    assert calls[-1][1:] == (len(controls),) * 2
    assert np.array_equal(gradient.controls, rollout.vjp(positions=seed).controls)

    def stop(done, total):
        raise Enough

    with pytest.raises(Enough):
        rollout.vjp(positions=seed, progress=stop)


def test_gradients_in_parts_are_followed(long_run):
    sim, controls = long_run
    goal = hg.objective.final_position(1, (0.0, 0.0, 0.0))
    (value, gradient), calls = followed(lambda f: sim.gradient_in_parts(goal, controls, memory=1e6, progress=f))
    assert calls[-1][1] == calls[-1][2] > 2
    assert np.array_equal(gradient.controls, sim.rollout(controls).gradient(goal).controls)

    def stop(done, total):
        if done > total // 4:
            raise Enough

    with pytest.raises(Enough):
        sim.gradient_in_parts(goal, controls, memory=1e6, progress=stop)


def test_parts_need_some_memory(long_run):
    sim, controls = long_run
    goal = hg.objective.final_position(1, (0.0, 0.0, 0.0))
    for memory in (-1.0, 1.0, 1e3, float("nan"), float("inf")):
        with pytest.raises(hg.InputError, match=r"memory of a gradient in parts.*must be at least \d+"):
            sim.gradient_in_parts(goal, controls, memory=memory)


def test_failures_of_the_run_come_first_hand(sim, controls):
    with pytest.raises(hg.InputError, match="rollout: progress: got a value of type int"):
        sim.rollout(controls, progress=3)
    controls = controls.copy()
    controls[3, 0] = 1e300
    messages = []
    for more in ({}, {"progress": lambda done, total: None}):
        with pytest.raises(hg.Error) as caught:
            sim.rollout(controls, **more)
        messages.append(str(caught.value))
    assert messages[0] == messages[1]


def test_what_happens_is_logged(caplog):
    scene = hg.Scene(steps=3)
    scene.add(hg.Body(hg.sphere(0.05), name="ball", density=1000.0))
    with caplog.at_level(logging.INFO, logger="hydrograd"):
        sim = hg.Simulator(scene, 0.01)
        sim.rollout()
        sim.rollout_batch(np.zeros((2, 3, 0)))
    said = [(record.name, record.levelname, record.getMessage()) for record in caplog.records]
    assert {name for name, *_ in said} == {"hydrograd"}
    info = [message for _, level, message in said if level == "INFO"]
    for start in ("simulator: preparing 1 bodies", "simulator: prepared 1 bodies in ", "rollout: 3 steps in "):
        assert any(message.startswith(start) for message in info)
    assert any(message.startswith("rollout_batch: 2 members of 3 steps in ") for message in info)


def test_warnings_of_a_run_are_logged(caplog):
    """A gap of a ten thousandth of the radius: the simulator's and the rollout's own warnings, word for word."""
    scene = hg.Scene(gravity=(0.0, 0.0, 0.0), steps=3)
    for name, x in (("left", 0.0), ("right", 0.100005)):
        scene.add(hg.Body(hg.sphere(0.05, faces=80), name=name, density=1000.0, position=(x, 0.0, 0.0)))
    with caplog.at_level(logging.WARNING, logger="hydrograd"):
        sim = hg.Simulator(scene, 1e-4, fidelity="full", method="mfs-vertex")
        rollout = sim.rollout()
    said = [record.getMessage() for record in caplog.records if record.name == "hydrograd"]
    assert sim.warnings and rollout.warnings
    assert said == [f"simulator: {text}" for text in sim.warnings] + [f"rollout: {text}" for text in rollout.warnings]
    caplog.clear()
    with caplog.at_level(logging.CRITICAL, logger="hydrograd"):
        sim.rollout()
    assert not caplog.records
