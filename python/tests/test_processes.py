"""Batches over threads, and pickles to other processes."""

import multiprocessing
import os
import pickle
import select

import numpy as np
import pytest

import hydrograd as hg


def test_a_batch_is_the_same_to_the_bit(sim):
    random = np.random.default_rng(1)
    controls = random.normal(scale=0.1, size=(5, 4, 6))
    together = sim.rollout_batch(controls)
    assert len(together) == 5
    for one, u in zip(together, controls):
        alone = sim.rollout(u)
        assert np.array_equal(one.q, alone.q) and np.array_equal(one.v, alone.v)
        seed = np.ones_like(one.positions)
        assert np.array_equal(one.vjp(positions=seed).controls, alone.vjp(positions=seed).controls)
    v = random.normal(scale=0.05, size=(5, 12))
    for one, u, start in zip(sim.rollout_batch(controls, v=v), controls, v):
        assert np.array_equal(one.q, sim.rollout(u, v=start).q)
    assert sim.rollout_batch(np.zeros((0, 4, 6))) == []
    with pytest.raises(hg.InputError, match=r"\(batch, steps, 6\)"):
        sim.rollout_batch(controls[0])


def test_pickles(sim, controls):
    changed = sim.with_parameters({"ball.mass": 0.7}).with_start(v=sim.initial_v + 0.01)
    rollout = changed.rollout(controls)
    again = pickle.loads(pickle.dumps(rollout))
    assert np.array_equal(again.q, rollout.q) and np.array_equal(again.controls, controls)
    assert again.simulator.parameters == changed.parameters and again.simulator.dt == sim.dt
    scene = pickle.loads(pickle.dumps(sim.scene))
    assert scene == sim.scene
    state = pickle.loads(pickle.dumps(rollout.state(3)))
    assert state.step == 3
    one, other = again.simulator.step(state, controls[3])[0], changed.step(rollout.state(3), controls[3])[0]
    assert np.array_equal(one.q, other.q) and np.array_equal(one.q, rollout.q[4])
    gradient = rollout.vjp(v=np.ones_like(rollout.v))
    assert np.array_equal(pickle.loads(pickle.dumps(gradient)).controls, gradient.controls)
    assert pickle.loads(pickle.dumps(hg.Fluid(2.0))) == hg.Fluid(2.0)


def final_position(work):
    """In another process."""
    simulator, controls = work
    return simulator.rollout(controls).positions[-1]


def test_other_processes(sim, controls):
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.map(final_position, [(sim, controls), (sim, 2 * controls)])
    assert np.array_equal(found[0], sim.rollout(controls).positions[-1])
    assert np.array_equal(found[1], sim.rollout(2 * controls).positions[-1])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_is_told_so(sim, controls):
    sim.rollout(controls)
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        # Whatever happens, the tests don't go on here.
        try:
            sim.rollout(controls)
            said = "it ran"
        except hg.UnsupportedError as error:
            said = str(error)
        except BaseException as error:  # noqa: BLE001
            said = repr(error)
        os.write(write, said.encode())
        os._exit(0)
    os.close(write)
    assert select.select([read], [], [], 20.0)[0], "the child hangs"
    said = os.read(read, 10_000).decode()
    os.close(read)
    os.waitpid(child, 0)
    assert "fork" in said and "spawn" in said, said


def test_joblib(sim, controls):
    """Its workers are processes of their own, which get the simulator pickled."""
    joblib = pytest.importorskip("joblib")
    work = [(sim, controls), (sim, 2 * controls), (sim, -controls)]
    found = joblib.Parallel(n_jobs=2)(joblib.delayed(final_position)(w) for w in work)
    for positions, (_, u) in zip(found, work):
        assert np.array_equal(positions, sim.rollout(u).positions[-1])
