"""Parameters from recordings."""

import gc
import math
import weakref

import numpy as np
import pytest

import hydrograd as hg

MASS, DRAG, STEPS = 0.03, 0.4, 60


@pytest.fixture(scope="module")
def coin():
    scene = hg.Scene(gravity=(0.0, 0.0, -9.81), time_step=0.01, steps=STEPS)
    drag = hg.Drag(quadratic=DRAG, quadratic_part="total")
    scene.add(hg.Body(hg.ellipsoid(0.03, 0.005, 0.03, faces=80), name="coin", mass=MASS, drag=drag))
    return hg.Simulator(scene, fidelity="isolated")


def unknowns():
    return [
        hg.optimize.Unknown("coin.mass", positive=True, start=0.05),
        hg.optimize.Unknown("coin.drag.quadratic", positive=True, start=0.2, prior=(0.4, 1.0)),
    ]


def experiment(sim, noise=0.0, outliers=False):
    depth = sim.rollout(steps=STEPS).positions[:, 0, 2]
    seen = depth + np.random.default_rng(1).normal(scale=noise, size=depth.shape)
    seen[7] = math.nan
    if outliers:
        seen[10::10] += 0.3
    run = hg.optimize.Experiment("fall", sim, steps=STEPS)
    run.saw("positions", "coin.position_z", seen, deviation=max(noise, 1e-4))
    return run


def test_a_coin_is_recovered(coin):
    """Without noise to 1e-5, with it within four standard errors."""
    told = []
    found = hg.optimize.identify([experiment(coin)], unknowns(), progress=told.append)
    assert found.values["coin.mass"] == pytest.approx(MASS, rel=1e-5)
    assert found.values["coin.drag.quadratic"] == pytest.approx(DRAG, rel=1e-5)
    assert [p.iteration for p in told] == list(range(1, len(told) + 1))
    better = coin.with_parameters(found.parameters)
    assert better.parameters["coin.mass"] == found.values["coin.mass"]
    noisy = hg.optimize.identify([experiment(coin, noise=1e-3)], unknowns(), profiles=2)
    for u, truth in zip(noisy.unknowns, (MASS, DRAG)):
        assert abs(u.value - truth) < 4.0 * u.standard_error and not u.at_bound
    assert noisy.unknowns[0].of_prior is None and 0.0 < noisy.unknowns[1].of_prior < 1.0
    assert 0.6 < noisy.chi_squared < 1.5 and len(noisy.weak) == 2
    assert noisy.correlations.shape == (2, 2) and noisy.series[0].label == "coin.position_z"


def test_what_lies_far_off_is_forgiven(coin):
    plain, robust = (
        hg.optimize.identify([experiment(coin, 1e-3, outliers=True)], unknowns(), loss=loss, profiles=0)
        for loss in (None, ("cauchy", 2.0))
    )
    off = [abs(f.values["coin.mass"] / MASS - 1.0) for f in (plain, robust)]
    assert off[1] < 0.02 and off[1] < 0.2 * off[0]


def test_an_experiment_holds_its_controller():
    """Also where nobody else does; and what holds its experiment is collected with it."""

    class Push:
        def act(self, seen):
            return np.full(1, 0.2)

        def act_vjp(self, seen, control_bar):
            return None, None

    scene = hg.Scene(time_step=0.01)
    rail = hg.prismatic((1, 0, 0))
    scene.add(hg.Body(hg.sphere(0.05, faces=80), name="ball", mass=0.6, joint=rail, actuated=True))
    bare = hg.Simulator(scene, fidelity="isolated")
    seen = bare.rollout(np.full((STEPS, 1), 0.2)).positions[:, 0, 0]
    run = hg.optimize.Experiment("push", bare.with_policy(Push()), steps=STEPS)
    gc.collect()
    run.saw("positions", "ball.position_x", seen, deviation=1e-4)
    found = hg.optimize.identify([run], [hg.optimize.Unknown("ball.mass", positive=True, start=0.5)])
    assert found.values["ball.mass"] == pytest.approx(0.6, rel=1e-5)

    def cycle():
        push = Push()
        push.run = hg.optimize.Experiment("push", bare.with_policy(push), steps=STEPS)
        return weakref.ref(push)

    gone = [cycle() for _ in range(3)]
    gc.collect()
    assert [at() for at in gone] == [None] * 3


def test_functions_of_observables(coin):
    depth = coin.rollout(steps=STEPS).positions[:, 0, 2]
    run = hg.optimize.Experiment("fall", coin, steps=STEPS)
    last = list(range(40, STEPS + 1))
    slope = np.polyfit(last, depth[last], 1)[0]

    def residual(seen):
        assert seen["positions"].shape == (len(last), 1, 3)
        return [(np.polyfit(last, seen["positions"][:, 0, 2], 1)[0] - slope) / 1e-5]

    run.saw_function(["positions"], residual, states=last)
    found = hg.optimize.identify([run], unknowns()[1:])
    assert found.values["coin.drag.quadratic"] == pytest.approx(DRAG, rel=1e-3)

    def broken(seen):
        raise ZeroDivisionError("of my own")

    wrong = hg.optimize.Experiment("fall", coin, steps=STEPS)
    wrong.saw_function(["positions"], broken)
    with pytest.raises(ZeroDivisionError, match="of my own"):
        hg.optimize.identify([wrong], unknowns())


def test_it_can_be_ended_and_says_what_is_wrong(coin):
    ended = hg.optimize.identify([experiment(coin)], unknowns(), progress=lambda p: p.iteration == 2)
    assert (ended.stop, ended.iterations) == ("asked", 2)

    def stop(p):
        raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        hg.optimize.identify([experiment(coin)], unknowns(), progress=stop)
    run = hg.optimize.Experiment("fall", coin, steps=STEPS)
    with pytest.raises(hg.Error, match="coin.position_w"):
        run.saw("positions", "coin.position_w", np.zeros(STEPS + 1), deviation=1.0)
    with pytest.raises(hg.Error, match="as many as states"):
        run.saw("positions", 2, np.zeros(5), deviation=1.0)
    with pytest.raises(hg.Error, match="fall.*saw"):
        hg.optimize.identify([run], unknowns())
    with pytest.raises(hg.Error, match="coin.colour"):
        hg.optimize.identify([experiment(coin)], [hg.optimize.Unknown("coin.colour")])
    with pytest.raises(hg.Error, match="loss"):
        hg.optimize.identify([experiment(coin)], unknowns(), loss=("best", 1.0))
    with pytest.raises(hg.Error, match="steps"):
        hg.optimize.Experiment("fall", coin, steps=3, controls=np.zeros((3, 0)))


def test_splines():
    times, values = [0.0, 0.5, 1.2, 2.0], [0.1, 0.4, -0.2, 0.3]
    scene = hg.Scene(time_step=0.1, steps=20)
    motion = hg.Motion.spline(times, values)
    joint = hg.revolute((0.0, 0.0, 1.0))
    scene.add(hg.Body(hg.sphere(0.1), name="arm", density=1000.0, joint=joint, motion=[motion]))
    q = hg.Simulator(scene, fidelity="isolated").rollout(steps=20).q[:, 0]
    assert q[[0, 5, 12, 20]] == pytest.approx(values, abs=1e-12)
    assert "4 points" in repr(motion) and motion == hg.Motion.spline(np.array(times), values)
    with pytest.raises(hg.Error, match=r"times\[1\].*ascend"):
        hg.Motion.spline([0.0, 0.0], [1.0, 2.0])
