"""Controllers written in Python: they act, are differentiated, and what they raise comes out."""

import gc
import os
import pathlib
import pickle
import subprocess
import sys
import threading
import weakref

import numpy as np
import pytest

import hydrograd as hg


def scene():
    scene = hg.Scene(steps=6)
    ball = hg.Body(
        hg.sphere(0.05), name="ball", density=1100.0, joint=hg.planar("xy"), position=(-0.12, 0, 0), actuated=True
    )
    scene.add(ball)
    scene.add(hg.Body(hg.ellipsoid(0.02, 0.04, 0.04), name="coin", density=1050.0))
    return scene


class Spring:
    """Pulls the ball towards a place: proportional and derivative, with two gains; q and v are (x, y, angle)."""

    home = np.array([0.05, -0.03])

    def __init__(self, gains=(3.0, 0.4)):
        self.gains = np.asarray(gains, dtype=float)

    def act(self, seen):
        stiffness, damping = self.gains
        return np.append(stiffness * (self.home - seen.q[:2]) - damping * seen.v[:2], 0.0)

    def act_vjp(self, seen, control_bar):
        stiffness, damping = self.gains
        q_bar, v_bar = np.zeros_like(seen.v), np.zeros_like(seen.v)
        q_bar[:2], v_bar[:2] = -stiffness * control_bar[:2], -damping * control_bar[:2]
        return q_bar, v_bar, [control_bar[:2] @ (self.home - seen.q[:2]), -control_bar[:2] @ seen.v[:2]]

    def with_gains(self, gains):
        return Spring(gains)


@pytest.fixture(scope="module")
def planar():
    return hg.Simulator(scene(), 0.02, fidelity="full", faces=80, tolerance=1e-12)


def test_a_policy_that_holds_its_simulator_is_collected():
    class Holds:
        def act(self, observation):
            return np.zeros(6)

    scene = hg.Scene()
    scene.add(hg.Body(hg.sphere(0.1), density=1000.0, actuated=True))
    bare = hg.Simulator(scene, fidelity="isolated")

    def cycle():
        policy = Holds()
        policy.sim = bare.with_policy(policy)
        policy.rollout = policy.sim.rollout(steps=2)
        policy.state, policy.record = policy.sim.step(policy.sim.state())
        return weakref.ref(policy)

    gone = [cycle() for _ in range(3)]
    gc.collect()
    assert [at() for at in gone] == [None] * 3
    # It lives on in whatever still needs it.
    policy = Holds()
    record = bare.with_policy(policy).step(bare.state())[1]
    rollout = bare.with_policy(policy).rollout(steps=2)
    del policy
    gc.collect()
    assert rollout.simulator.policy is not None
    with pytest.raises(hg.UnsupportedError, match="act_vjp"):
        rollout.vjp(v=np.zeros((3, 6)))
    with pytest.raises(hg.UnsupportedError, match="act_vjp"):
        record.vjp(v=np.zeros(6))


def test_a_class_is_no_policy(planar):
    with pytest.raises(hg.InputError, match=r"the class Spring; must be a controller: make one"):
        planar.with_policy(Spring)


def test_a_policy_that_cannot_be_pointed_at():
    class Slots:
        __slots__ = ()

        def act(self, observation):
            return np.full(6, 0.1)

    scene = hg.Scene()
    scene.add(hg.Body(hg.sphere(0.1), density=1000.0, actuated=True))
    sim = hg.Simulator(scene, fidelity="isolated").with_policy(Slots())
    assert sim.rollout(steps=2).v[-1, 0] > 0.0


def test_it_acts_as_the_same_controls_would(planar):
    policy = Spring()
    rollout = planar.with_policy(policy).rollout()
    seen = [hg.Observation(n, 0.02 * n, q, v) for n, (q, v) in enumerate(zip(rollout.q, rollout.v))]
    controls = np.array([policy.act(s) for s in seen[:-1]])
    assert np.array_equal(planar.rollout(controls).q, rollout.q)
    assert np.array_equal(rollout.applied_controls, controls) and not rollout.controls.any()
    assert np.linalg.norm(rollout.q[-1] - rollout.q[0]) > 1e-4


def test_what_acted_is_the_controllers_and_what_was_added(planar):
    more = np.random.default_rng(0).normal(size=(6, planar.control_size))
    rollout = planar.with_policy(Spring()).rollout(more)
    seen = [hg.Observation(n, 0.02 * n, q, v) for n, (q, v) in enumerate(zip(rollout.q, rollout.v))]
    controls = np.array([Spring().act(s) for s in seen[:-1]])
    assert np.array_equal(rollout.applied_controls, more + controls) and np.array_equal(rollout.controls, more)


def test_gains_without_a_cotangent_are_told(planar):
    class Forgets(Spring):
        def act_vjp(self, seen, control_bar):
            return super().act_vjp(seen, control_bar)[:2]

    rollout = planar.with_policy(Forgets()).rollout()
    with pytest.raises(hg.InputError, match=r"a tuple of 2; must be a tuple \(q_bar, v_bar, gains_bar\), for it has 2 gains"):
        rollout.vjp(v=np.ones_like(rollout.v))


def test_gradcheck_asks_the_controller_for_other_gains(planar):
    report = planar.with_policy(Spring()).gradcheck(3, directions=2)
    assert report["max_rel_error"] < 1e-6 and any(d["group"] == "gains" for d in report["directions"])


def test_its_gradient_is_that_of_differences(planar):
    sim = planar.with_policy(Spring())
    rollout = sim.rollout()
    seed = np.zeros_like(rollout.v)
    seed[-1] = np.linspace(1.0, 2.0, seed.shape[1])
    gradient = rollout.vjp(v=seed)
    assert gradient.gains.shape == (2,)

    def value(gains, v):
        return seed[-1] @ sim.with_gains(gains).rollout(v=v).v[-1]

    h = 1e-5
    for k in range(2):
        d = h * np.eye(2)[k]
        slope = (value(sim.gains + d, sim.initial_v) - value(sim.gains - d, sim.initial_v)) / (2 * h)
        assert gradient.gains[k] == pytest.approx(slope, rel=1e-6)
    for k in range(3):
        d = h * np.eye(sim.v_size)[k]
        slope = (value(sim.gains, sim.initial_v + d) - value(sim.gains, sim.initial_v - d)) / (2 * h)
        assert gradient.initial_v[k] == pytest.approx(slope, rel=1e-6)


def test_what_it_raises_comes_out(planar):
    class Fails(Spring):
        def act(self, seen):
            if seen.step == 3:
                raise RuntimeError("the motor is gone")
            return super().act(seen)

    sim = planar.with_policy(Fails())
    with pytest.raises(RuntimeError, match="the motor is gone"):
        sim.rollout(steps=50)
    with pytest.raises(RuntimeError, match="the motor is gone"):
        sim.rollout_batch(np.zeros((4, 50, 3)))
    # The thread that raised it is as it was.
    assert planar.rollout(steps=5).steps == 5
    state, _ = sim.step(sim.state())
    assert state.step == 1
    with pytest.raises(RuntimeError, match="the motor is gone"):
        sim.step(sim.state(step=3))


def test_what_its_transpose_raises_comes_out(planar):
    class Broken(Spring):
        def act_vjp(self, seen, control_bar):
            raise RuntimeError("no derivative today")

    rollout = planar.with_policy(Broken()).rollout()
    with pytest.raises(RuntimeError, match="no derivative today"):
        rollout.vjp(v=np.ones_like(rollout.v))


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (lambda seen: np.zeros(5), r"policy: act"),
        (lambda seen: [np.nan, 0.0, 0.0], r"policy: act"),
        (lambda seen: "push", r"policy: act"),
        (lambda seen: None, r"policy: act"),
    ],
)
def test_controls_that_are_none(planar, act, message):
    policy = Spring()
    policy.act = act
    with pytest.raises(hg.InputError, match=message):
        planar.with_policy(policy).rollout()


def test_objects_that_are_no_controllers(planar):
    with pytest.raises(hg.InputError, match=r"act\(observation\)"):
        planar.with_policy(3)

    class Forward:
        def act(self, seen):
            return np.zeros(3)

    sim = planar.with_policy(Forward())
    with pytest.raises(hg.InputError, match="with_gains"):
        sim.with_gains([1.0])
    rollout = sim.rollout()
    with pytest.raises(hg.UnsupportedError, match="act_vjp"):
        rollout.vjp(v=np.ones_like(rollout.v))

    class Odd(Spring):
        def act_vjp(self, seen, control_bar):
            return np.zeros(3)

    rollout = planar.with_policy(Odd()).rollout()
    with pytest.raises(hg.InputError, match="q_bar, v_bar"):
        rollout.vjp(v=np.ones_like(rollout.v))


def test_it_travels_with_its_simulator(planar):
    sim = planar.with_policy(Spring((2.0, 0.1)))
    again = pickle.loads(pickle.dumps(sim))
    assert np.array_equal(again.gains, [2.0, 0.1])
    assert np.array_equal(again.rollout().q, sim.rollout().q)
    batch = sim.rollout_batch(np.zeros((3, 6, 3)))
    assert all(np.array_equal(one.q, sim.rollout().q) for one in batch)


class Looks(Spring):
    """A controller that simulates ahead."""

    def __init__(self, ahead, gains=(3.0, 0.4)):
        super().__init__(gains)
        self.ahead = ahead

    def act(self, seen):
        off = self.ahead.rollout(np.zeros((2, 3)), q=seen.q, v=seen.v).q[-1, :2] - self.home
        return np.append(-self.gains[0] * off, 0.0)


def test_a_controller_may_simulate(planar):
    """With one thread, and with all of them inside a controller: nothing waits for ever."""
    code = """
import sys
import numpy as np
sys.path.insert(0, {folder!r})
import hydrograd as hg
from test_policy import Looks, scene
sim = hg.Simulator(scene(), 0.02, fidelity="reduced")
looks = sim.with_policy(Looks(sim))
one = looks.rollout(steps=3).q
assert all(np.array_equal(r.q, one) for r in looks.rollout_batch(np.zeros((6, 3, 3))))
print(np.abs(one[-1] - one[0]).max())
"""
    folder = str(pathlib.Path(__file__).parent)
    for threads in ("1", "2"):
        environment = {**os.environ, "RAYON_NUM_THREADS": threads}
        command = [sys.executable, "-c", code.format(folder=folder)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)
        assert done.returncode == 0, done.stderr
        assert float(done.stdout) > 1e-6


def test_sweeps_at_the_same_time_on_one_rollout(planar):
    """One that fails doesn't leave its hole in the other's gradient."""

    class Sometimes(Spring):
        def act_vjp(self, seen, control_bar):
            if seen.step == 3 and float(np.abs(control_bar).max()) > 1.0:
                raise RuntimeError("too much")
            return super().act_vjp(seen, control_bar)

    rollout = planar.with_policy(Sometimes()).rollout()
    seed = np.zeros_like(rollout.v)
    seed[-1] = 1e-3
    right = rollout.vjp(v=seed).gains
    outcomes = []

    def sweep(scale):
        for _ in range(10):
            try:
                outcomes.append((scale, rollout.vjp(v=scale * seed).gains))
            except RuntimeError:
                outcomes.append((scale, None))

    threads = [threading.Thread(target=sweep, args=(scale,)) for scale in (1.0, 1e9)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(outcomes) == 20
    for scale, found in outcomes:
        assert found is None or scale == 1.0 and np.array_equal(found, right)
    # What was raised then is over.
    assert np.array_equal(rollout.vjp(v=seed).gains, right)


def test_gains_are_as_many_as_the_controller_has(planar):
    sim = planar.with_policy(Spring())
    assert np.array_equal(sim.with_gains([1.0, 2.0]).gains, [1.0, 2.0])
    with pytest.raises(hg.InputError, match="3 numbers; must be 2 numbers"):
        sim.with_gains([1.0, 2.0, 3.0])
