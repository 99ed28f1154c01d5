"""Members of a batch that fail: what ran is kept, and each one's error has its step and time."""

import numpy as np
import pytest

import hydrograd as hg


def approaching() -> hg.Simulator:
    """Two balls that meet, if they are fast enough."""
    scene = hg.Scene(hg.Fluid(998.0), steps=40)
    for name, x in (("left", 0.0), ("right", 0.25)):
        scene.add(hg.Body(hg.sphere(0.1), name=name, density=1000.0, position=(x, 0.0, 0.0), actuated=True))
    return hg.Simulator(scene, 0.01, fidelity="reduced", faces=80, films=False)


@pytest.fixture(scope="module")
def sim() -> hg.Simulator:
    return approaching()


def speeds(fast):
    v = np.zeros((len(fast), 12))
    v[:, 0] = np.where(fast, 0.5, 0.0)
    v[:, 6] = -v[:, 0]
    return v


def test_a_batch_keeps_what_ran(sim):
    controls = np.zeros((4, 40, 12))
    with pytest.raises(hg.BatchError, match=r"1 of 4 members failed, counted from 0; member 2 in step \d+, from t = ") as info:
        sim.rollout_batch(controls, v=speeds([False, False, True, False]))
    error = info.value
    assert list(error.errors) == [2] and len(error.members) == 4
    failed = error.errors[2]
    assert isinstance(failed, hg.UnresolvedError) and "left" in str(failed)
    assert failed.step > 2 and failed.time == pytest.approx(0.01 * failed.step)
    assert [rollout.steps for rollout in error.members][:2] == [40, 40]
    part = error.members[2]
    assert 0 < part.steps <= failed.step
    alone = sim.rollout(steps=part.steps, v=speeds([True])[0])
    assert np.array_equal(part.q, alone.q)


def test_a_member_that_cannot_begin_has_nothing(sim):
    q = np.tile(sim.initial_q, (2, 1))
    q[1, 7] = -0.15
    with pytest.raises(hg.BatchError) as info:
        sim.rollout_batch(np.zeros((2, 3, 12)), q=q)
    assert info.value.members[0].steps == 3 and info.value.members[1] is None
    assert "overlap" in str(info.value.errors[1])


def test_what_a_controller_raises_comes_out_with_all_that_ran(sim):
    class Late:
        def act(self, seen):
            if seen.time > 0.05 and seen.v[0] > 0.0:
                raise ValueError("late")
            return np.zeros(12)

    with pytest.raises(ValueError, match="^late") as info:
        sim.with_policy(Late()).rollout_batch(np.zeros((3, 10, 12)), v=0.1 * speeds([False, True, False]))
    error = info.value
    assert str(error) == "late"
    assert [rollout.steps for rollout in error.members] == [10, 6, 10] and error.step == 6
    notes = getattr(error, "__notes__", ["member 1"])
    assert any("member 1" in note for note in notes)


def test_gradients_of_a_batch_are_those_of_its_rollouts(sim):
    rollouts = sim.rollout_batch(np.zeros((3, 4, 12)), v=speeds([False, True, False]))
    goal = hg.objective.final_position("right", (0.3, 0.1, 0.0)) + 1e-3 * hg.objective.effort(1.0)
    found = sim.gradient_batch(rollouts, goal)
    assert len(found) == 3
    for one, rollout in zip(found, rollouts):
        right = rollout.gradient(goal)
        assert np.array_equal(one.controls, right.controls)
        assert np.array_equal(one.initial_v, right.initial_v)
    with pytest.raises(hg.InputError, match="gradient_batch: rollout 0.*of another simulator"):
        approaching().gradient_batch(rollouts, goal)


def test_a_batch_on_a_gpu_is_the_cpus(sim):
    try:
        gpu = hg.Simulator(sim.scene, 0.01, fidelity="reduced", faces=80, films=False, backend="gpu")
    except hg.DeviceError:
        pytest.skip("there is no GPU, nor a driver that stands for one")
    controls, v = np.zeros((5, 3, 12)), speeds([False, True, False, True, False])
    goal = hg.objective.final_position("right", (0.3, 0.1, 0.0))
    together = gpu.rollout_batch(controls, v=v)
    gradients = gpu.gradient_batch(together, goal)
    for one, gradient, right in zip(together, gradients, sim.rollout_batch(controls, v=v)):
        assert np.allclose(one.q, right.q, rtol=0.0, atol=1e-11)
        controls = right.gradient(goal).controls
        assert np.allclose(gradient.controls, controls, rtol=0.0, atol=1e-9 * np.abs(controls).max())


def test_bridges_keep_what_ran(sim):
    from hydrograd import _bridge

    physics = _bridge.Physics(sim, ("left.mass",))
    mass = sim.parameters["left.mass"]
    v = speeds([False, True, False])
    q = np.tile(sim.initial_q, (3, 1))
    values = np.array([[mass], [1.1 * mass], [1.2 * mass]])
    with pytest.raises(hg.BatchError, match="member 1") as info:
        _bridge.roll(physics, np.zeros((3, 40, 12)), q, v, values, np.zeros((3, 0)))
    assert list(info.value.errors) == [1] and info.value.errors[1].step > 2
    assert info.value.members[0].steps == 40 and 0 < info.value.members[1].steps < 40


def test_starts_are_checked(sim):
    q = sim.initial_q.copy()
    q[7] = -0.15
    with pytest.raises(hg.UnresolvedError, match="overlap"):
        sim.with_start(q).added_mass()
    q[7] = -0.049
    near = sim.with_start(q)
    assert any("gap" in warning for warning in near.warnings)


def test_a_blow_up_names_its_step(sim):
    with pytest.raises(hg.UnresolvedError, match=r"step \d+, within the step at t = .*q\[3\] of body \"left\""):
        sim.rollout(np.full((3, 12), 1e300))
