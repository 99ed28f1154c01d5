"""Descents, averages, and the recipe for grasps."""

import pickle
import signal
import threading
import time

import numpy as np
import pytest

import hydrograd as hg


def pinch(thickness=0.1, drift=0.1, water=0.0):
    """Two fingers on rails, and between them a coin that drifts away."""
    scene = hg.Scene(
        hg.Fluid(water), gravity=(0.0, 0.0, 0.0), contact=hg.Contact(gap=2e-3), time_step=0.01, steps=100
    )
    rail = hg.prismatic((1.0, 0.0, 0.0))
    for name, x in (("left", -0.4), ("right", 0.4)):
        finger = hg.Body(
            hg.box(0.1, 0.4, 0.4, faces=80),
            name=name,
            mass=2.0,
            inertia=(0.1, 0.1, 0.1),
            position=(x, 0.0, 0.0),
            joint=rail,
            actuated=True,
        )
        scene.add(finger)
    coin = hg.Body(
        hg.ellipsoid(thickness, 0.1, 0.1, faces=80),
        name="coin",
        mass=0.5,
        inertia=(2e-3, 2e-3, 2e-3),
        position=(0.02, 0.01, 0.0),
        joint=hg.planar("xy"),
    )
    scene.add(coin)
    scene.set_initial(v=(0.0, 0.0, 0.0, drift, 0.1))
    return scene


TASK = {
    "object": "coin",
    "fingers": [("left", (0.05, 0.0, 0.0)), (1, (-0.05, 0.0, 0.0))],
    "closing": (1.0, -1.0),
    "limits": 20.0,
    "hold": 0.2,
}


def test_a_random_coin_is_caught():
    random = np.random.default_rng(4)
    scene = pinch(random.uniform(0.05, 0.1), random.uniform(-0.1, 0.1), water=998.0)
    sim = hg.Simulator(scene, fidelity="isolated")
    # The fingers carry water.
    limit = 300.0
    found = hg.optimize.grasp(sim, **{**TASK, "limits": limit}, pushes=24)
    assert found.caught and found.held_since <= 0.8
    assert found.simulations >= 24 and found.failures == 0 and found.stage in ("push", "descent", "search")
    again = sim.rollout(found.controls)
    assert np.array_equal(again.q, found.rollout.q) and np.abs(found.controls).max() <= limit
    # Held: the fingers and the coin move as one.
    late = again.v[-20:, :3]
    assert np.ptp(late, axis=1).max() < 5e-3
    # Without forces nothing comes near it.
    assert sim.rollout().min_gap[-1] > 0.1


def test_a_scene_will_do_and_its_controller_is_left_out():
    text = pinch().to_toml() + '\n[controller]\nkind = "playback"\ncontrol = [[5.0, 5.0]]\n'
    scene = hg.Scene.from_toml(text)
    found = hg.optimize.grasp(scene, **TASK, pushes=6, search=0, starts=1, evaluations=2)
    plain = hg.optimize.grasp(pinch(), **TASK, pushes=6, search=0, starts=1, evaluations=2)
    assert np.array_equal(found.controls, plain.controls)
    kept = pickle.loads(pickle.dumps(found.rollout))
    assert np.array_equal(kept.q, found.rollout.q)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"object": "coim"}, "object.*coim.*coin"),
        ({"object": 7}, "object.*7.*coin"),
        ({"fingers": [("left", (0, 0, 0)), ("thumb", (0, 0, 0))]}, "finger.*thumb.*right"),
        ({"fingers": [("left", (0, 0)), (1, (0, 0, 0))]}, "point of a finger.*shape"),
        ({"fingers": [("left", (0, 0, 0))]}, "fingers.*at least 2"),
        ({"fingers": [("left", (0, 0, 0)), ("coin", (0, 0, 0))]}, "finger.*coin.*another body than the object"),
        ({"fingers": [("left", (0, 0, 0)), (0, (0, 0, 0))]}, "finger.*left.*another finger has"),
        ({"fingers": [("left", (0, 0, 0)), ("right", (-10, 0, 0))]}, "pad of finger.*right.*10.* m from its middle"),
        ({"closing": (1.0,)}, "closing.*2 numbers"),
        ({"limits": (1.0, -1.0)}, "limits.*positive"),
        ({"hold": 9.0}, "hold.*less than"),
        ({"softness": [2.0]}, "softness.*end in 1"),
        ({"pushes": 0}, "pushes.*at least 1"),
    ],
)
def test_tasks_that_do_not_fit_are_refused(wrong, words):
    with pytest.raises(hg.InputError, match=words):
        hg.optimize.grasp(hg.Simulator(pinch(), fidelity="isolated"), **{**TASK, **wrong})


def test_a_simulator_is_needed():
    with pytest.raises(hg.InputError, match="Simulator or a Scene"):
        hg.optimize.grasp("scene", **TASK)


def rosenbrock(x):
    a, b = 1.0 - x[0], x[1] - x[0] ** 2
    return a * a + 100.0 * b * b, np.array([-2.0 * a - 400.0 * x[0] * b, 200.0 * b])


@pytest.mark.parametrize("how", ["grasp", "minimise"])
def test_ctrl_c_ends_it(how):
    sim = hg.Simulator(pinch(), fidelity="isolated")

    def slow(x):
        # Dozens of evaluations, of which there is time for eight.
        time.sleep(0.05)
        return rosenbrock(x)

    def run():
        if how == "grasp":
            hg.optimize.grasp(sim, **TASK, pushes=20_000)
        else:
            hg.optimize.minimise(slow, [-1.2, 1.0], evaluations=10**6, iterations=10**6)
            raise AssertionError("it ended by itself")

    # Where the tests run in the background, the signal may be ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    main = threading.main_thread().ident
    threading.Timer(0.4, lambda: signal.pthread_kill(main, signal.SIGINT)).start()
    begun = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        run()
    assert time.perf_counter() - begun < 3.0
    signal.signal(signal.SIGINT, before)


def test_minimise():
    found = hg.optimize.minimise(rosenbrock, [-1.2, 1.0])
    assert np.allclose(found.x, 1.0, atol=1e-3) and found.cost < 1e-6 and found.failures == 0
    assert hg.optimize.minimise(rosenbrock, [-1.2, 1.0], target=1.0).stop == "target"
    assert hg.optimize.minimise(rosenbrock, [-1.2, 1.0], iterations=3).iterations == 3


def test_failures_turn_back_and_faults_come_out():
    def walled(x):
        if x[0] > 0.5:
            raise hg.UnresolvedError("a wall")
        return rosenbrock(x)

    found = hg.optimize.minimise(walled, [-1.2, 1.0], first_step=3.0)
    assert found.failures > 0 and found.x[0] <= 0.5 and found.cost < 1.0

    calls = []

    def faulty(x):
        calls.append(x)
        if len(calls) == 3:
            raise ZeroDivisionError("a fault")
        return rosenbrock(x)

    with pytest.raises(ZeroDivisionError, match="a fault"):
        hg.optimize.minimise(faulty, [-1.2, 1.0])
    assert len(calls) == 3
    with pytest.raises(hg.UnresolvedError, match="a wall"):
        hg.optimize.minimise(walled, [1.0, 1.0])
    with pytest.raises(TypeError, match="tuple"):
        hg.optimize.minimise(lambda x: float(x @ x), [1.0])
    with pytest.raises(hg.InputError, match="gradient.*shape"):
        hg.optimize.minimise(lambda x: (1.0, [1.0, 2.0]), [1.0])
    with pytest.raises(hg.InputError, match="callable"):
        hg.optimize.minimise(3, [1.0])
    with pytest.raises(hg.InputError, match="clip"):
        hg.optimize.minimise(rosenbrock, [1.0, 2.0], clip=-1.0)


def test_continuation_finds_the_deeper_well():
    def function(softness, x):
        cost, slope = 2.0, 0.0
        for depth, at, width in ((0.5, -2.0, 0.5), (1.5, 2.0, 1.0)):
            square = softness * width**2
            e = depth * np.exp(-0.5 * (x[0] - at) ** 2 / square)
            cost, slope = cost - e, slope + e * (x[0] - at) / square
        return cost, [slope]

    direct = hg.optimize.continuation(function, [1.0], [-2.2])
    softened = hg.optimize.continuation(function, [10.0, 3.0, 1.0], [-2.2])
    assert abs(direct.x[0] + 2.0) < 0.1 and abs(softened.x[0] - 2.0) < 0.01
    with pytest.raises(hg.InputError, match="at least 1 stage"):
        hg.optimize.continuation(function, [], [0.0])


def test_smoothed_sees_a_jump_and_keeps_a_slope():
    step = hg.optimize.smoothed(lambda x: (float(x[0] < 0.0), [0.0]), [0.02], spread=0.1, directions=2000)
    exact = -np.exp(-0.02) / (0.1 * np.sqrt(2.0 * np.pi))
    assert step.first[0] == 0.0
    assert abs(step.zeroth[0] - exact) < 4.0 * np.sqrt(step.zeroth_variance[0])
    assert step.gradient[0] == step.zeroth[0]
    smooth = hg.optimize.smoothed(rosenbrock, [0.3, 0.2], spread=1e-3)
    assert np.allclose(smooth.first, rosenbrock([0.3, 0.2])[1], rtol=1e-2)
    again = hg.optimize.smoothed(rosenbrock, [0.3, 0.2], spread=1e-3)
    assert np.array_equal(smooth.gradient, again.gradient) and smooth.cost == again.cost
    with pytest.raises(hg.InputError, match="spread"):
        hg.optimize.smoothed(rosenbrock, [0.3, 0.2], spread=0.0)


def test_smoothed_over_rollouts():
    """Each sample is a rollout of its own, on all cores, with the lock given back in between."""
    sim = hg.Simulator(pinch(), fidelity="isolated")
    goal = hg.objective.final_coordinate(3, 0.05)

    def function(x):
        rollout = sim.rollout(np.outer(np.ones(60), [x[0], -x[0]]))
        return rollout.value(goal), [rollout.gradient(goal).controls.sum(0) @ [1.0, -1.0]]

    found = hg.optimize.smoothed(function, [5.0], spread=0.2, directions=4)
    values = [function([5.0 + h])[0] for h in (-0.2, 0.0, 0.2)]
    assert found.failures == 0 and 0.5 * min(values) < found.cost < 2.0 * max(values)


def test_soft_contact():
    sim = hg.Simulator(pinch(), fidelity="isolated")
    soft = sim.with_soft_contact(4.0)
    push = np.outer(np.ones(60), [10.0, -10.0])
    hard_run, soft_run = sim.rollout(push), soft.rollout(push)
    assert not np.array_equal(hard_run.q, soft_run.q)
    # Nothing touches yet.
    assert np.array_equal(hard_run.q[:5], soft_run.q[:5])
    kept = pickle.loads(pickle.dumps(soft.with_soft_contact(0.5)))
    assert np.array_equal(kept.rollout(push).q, sim.with_soft_contact(2.0).rollout(push).q)
    with pytest.raises(hg.InputError, match="softening.*positive"):
        sim.with_soft_contact(0.0)
