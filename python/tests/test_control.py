"""Optimal control from Python: the numbers of the Rust side, shapes, callbacks, and errors in Python's words."""

import pickle

import numpy as np
import pytest

import hydrograd as hg
from hydrograd import cost


@pytest.fixture(scope="module")
def sim():
    """A free ellipsoid with a wrench."""
    scene = hg.Scene(fluid=hg.Fluid(density=998.0))
    scene.add(hg.Body(hg.ellipsoid(0.3, 0.2, 0.1), name="hull", density=998.0, thruster=True))
    scene.add_site("nose", "hull", position=(0.3, 0, 0))
    return hg.Simulator(scene, dt=0.02, fidelity="isolated")


TERMS = [
    cost.position("nose", (0.6, 0.1, 0.1), 1e3, last=True),
    cost.velocity(np.zeros(6), 10.0, last=True),
    cost.effort(1e-3),
    cost.control_change(1e-3),
]


def test_plan(sim):
    seen = []
    plan = hg.optimize.ilqr(sim, TERMS, knots=20, hold=3, lower=-20, upper=[20.0] * 5 + [np.inf], progress=seen.append)
    assert plan.controls.shape == plan.steps.shape == (20, 6)
    assert plan.gains.shape == (20, 6, 12)
    assert plan.rollout.steps == 60 and plan.rollout.simulator is sim
    np.testing.assert_array_equal(plan.rollout.controls, np.repeat(plan.controls, 3, axis=0))
    assert plan.controls.min() >= -20 and (np.abs(plan.controls) == 20).any()
    assert plan.stop in ("stationary", "cost") and len(plan.costs) == plan.iterations + 1 == len(seen) + 1
    assert (np.diff(plan.costs) <= 0).all() and plan.cost == plan.costs[-1]
    assert seen[0].iteration == 1 and seen[-1].cost == plan.cost and seen[0].expected > 0
    assert plan.rate > 0 and set(plan.seconds) == {"rollouts", "derivatives", "sweeps", "total"}
    assert np.linalg.norm(plan.rollout.observe("site_positions")[-1, 0] - [0.6, 0.1, 0.1]) < 0.02
    again = hg.optimize.ilqr(sim, TERMS, knots=20, hold=3, lower=-20, upper=[20.0] * 5 + [np.inf], guess=plan)
    assert again.iterations <= 2 and again.cost == pytest.approx(plan.cost, rel=1e-8)
    from_controls = hg.optimize.ilqr(sim, TERMS, knots=20, hold=3, guess=plan.controls, iterations=1)
    assert from_controls.costs[0] == pytest.approx(plan.cost, rel=1e-12)


def test_progress_ends_it(sim):
    plan = hg.optimize.ilqr(sim, TERMS, knots=20, hold=3, progress=lambda p: p.iteration == 2)
    assert plan.stop == "asked" and plan.iterations == 2
    with pytest.raises(ZeroDivisionError):
        hg.optimize.ilqr(sim, TERMS, knots=20, progress=lambda p: 1 / 0)


def test_tracking_is_a_policy(sim):
    plan = hg.optimize.ilqr(sim, TERMS, knots=20, hold=3)
    held = sim.with_policy(plan.tracking)
    assert held.policy is plan.tracking
    start = {"v": [0.1, 0.0, -0.1, 0.2, 0.0, 0.3]}
    away, tracked = sim.rollout(np.repeat(plan.controls, 3, axis=0), **start), held.rollout(steps=60, **start)
    # What the plan holds is its nose.
    nose = [run.observe("site_positions")[-1, 0] for run in (plan.rollout, away, tracked)]
    assert np.linalg.norm(nose[2] - nose[0]) < 0.2 * np.linalg.norm(nose[1] - nose[0])

    class Wrapped:
        """The same by way of Python."""

        act, act_vjp = plan.tracking.act, plan.tracking.act_vjp

    wrapped = Wrapped()
    other = sim.with_policy(wrapped).rollout(steps=60, **start)
    np.testing.assert_array_equal(other.q, tracked.q)
    seed = np.ones_like(tracked.positions)
    np.testing.assert_allclose(other.vjp(positions=seed).initial_v, tracked.vjp(positions=seed).initial_v, rtol=1e-12)


def test_tracking_travels(sim):
    """By itself, with a simulator that it controls, and with a rollout."""
    plan = hg.optimize.ilqr(sim, TERMS, knots=20, hold=3, lower=-20, upper=[20.0] * 5 + [np.inf])
    again = pickle.loads(pickle.dumps(plan.tracking))
    bar = np.linspace(-1.0, 1.0, 6)
    for time in (-0.1, 0.37, 1.19, 9.0):
        seen = hg.Observation(0, time, plan.rollout.q[7], plan.rollout.v[7] + 0.01)
        assert np.array_equal(again.act(seen), plan.tracking.act(seen))
        for found, right in zip(again.act_vjp(seen, bar), plan.tracking.act_vjp(seen, bar)):
            assert np.array_equal(found, right)
    held = sim.with_policy(plan.tracking)
    start = {"v": [0.1, 0.0, -0.1, 0.2, 0.0, 0.3]}
    rollout, other = held.rollout(steps=20, **start), pickle.loads(pickle.dumps(held)).rollout(steps=20, **start)
    assert np.array_equal(other.q, rollout.q)
    assert np.array_equal(pickle.loads(pickle.dumps(rollout)).q, rollout.q)
    for wrong in (bar[:2], np.zeros(9)):
        with pytest.raises(hg.InputError, match="control_bar.*must be 6 numbers"):
            plan.tracking.act_vjp(seen, wrong)


def test_custom_is_what_is_built_in(sim):
    """Weights on the velocity and the controls, written in Python."""

    def own(point):
        assert point.q.shape == (7,) and point.v.shape == (6,) and point.time == pytest.approx(0.02 * point.knot)
        x, xx = np.zeros(12), np.zeros((12, 12))
        x[6:], xx[6:, 6:] = 2 * point.v, 2 * np.eye(6)
        value, u, uu = point.v @ point.v, None, None
        if point.control is not None:
            value, u, uu = value + 0.01 * point.control @ point.control, 0.02 * point.control, 0.02 * np.eye(6)
        return value, x, u, xx, uu, None

    goal = cost.position("hull", (0.3, 0, 0), 100.0)
    mine = hg.optimize.ilqr(sim, [goal, cost.custom(own)], knots=15)
    theirs = hg.optimize.ilqr(sim, [goal, cost.velocity(np.zeros(6), 1.0), cost.effort(0.01)], knots=15)
    np.testing.assert_allclose(mine.controls, theirs.controls, atol=1e-9)
    assert mine.cost == pytest.approx(theirs.cost, rel=1e-12)
    without = hg.optimize.ilqr(sim, [cost.effort(0.01), cost.custom(lambda p: own(p)[:3])], knots=5, iterations=5)
    assert without.cost <= without.costs[0]


def test_what_a_cost_raises_ends_the_search(sim):
    """Where the start was fine too: it isn't taken for a trial that fails."""

    def own(point):
        if point.q[0] > 0.01:
            raise NameError("I forgot")
        return 0.0, None, None

    terms = [cost.position("hull", (0.3, 0, 0), 100.0), cost.effort(1e-6), cost.custom(own)]
    with pytest.raises(NameError, match="I forgot"):
        hg.optimize.ilqr(sim, terms, knots=15)


def test_moving_targets(sim):
    times = np.linspace(0, 1, 11)
    path = np.stack([0.2 * times, 0.1 * np.sin(times), 0 * times], axis=1)
    terms = [cost.position("hull", path, 1e4, times=times), cost.orientation("hull", np.zeros(3), 10.0), cost.effort(1e-6)]
    plan = hg.optimize.ilqr(sim, terms, knots=50)
    assert np.abs(plan.rollout.positions[10:50:5, 0] - path[2:10]).max() < 5e-3


def test_mpc(sim):
    terms = [cost.position("hull", (0, 0, 0), 1e3), cost.velocity(np.zeros(6), 1.0), cost.effort(1e-4)]
    mpc = hg.optimize.Mpc(sim, terms, knots=10, hold=2, every=4, iterations=2, lower=-30, upper=30)
    assert mpc.model is sim
    state = sim.state(v=[0.3, 0, 0.1, 0, 0.5, 0])
    told = []
    run = mpc.run(sim, 40, state=state, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (40, 40)
    assert len(run.replans) == 10 and run.replans[0].time == 0.0 and run.replans[3].time == pytest.approx(0.24)
    assert all(r.failure is None and r.iterations <= 2 for r in run.replans[1:])
    assert run.rates.shape == (40,) and run.cost > 0
    assert np.linalg.norm(run.rollout.positions[-1, 0]) < 0.05
    mpc.reset()
    for n in range(8):
        control = mpc.control(0.02 * n, run.rollout.q[n], run.rollout.v[n])
        np.testing.assert_array_equal(control, run.rollout.controls[n])
    assert len(mpc.replans) == 2
    mpc.set_model(sim.with_parameters({"fluid.density": 1000.0}))
    assert mpc.model is not sim
    with pytest.raises(RuntimeError, match="enough"):
        mpc.run(sim, 400, progress=lambda done, total: (_ for _ in ()).throw(RuntimeError("enough")))


def test_errors(sim):
    def refused(match, *terms, error=hg.InputError, **options):
        with pytest.raises(error, match=match):
            hg.optimize.ilqr(sim, list(terms) or TERMS, **{"knots": 5, **options})

    refused("limits of control 0.*wrong way round", lower=1, upper=-1)
    refused("must be one number, or 6", lower=[1.0, 2.0])
    refused("'wide'", lower="wide")
    refused(r"guess.*shape \(4, 6\).*shape \(5, 6\)", guess=np.zeros((4, 6)))
    refused("shape", guess=np.zeros((5, 3)))
    refused('"tail".*"nose"', cost.position("tail", (0, 0, 0), 1.0))
    refused("weights.*not negative", cost.effort(-1.0))
    refused("last term", cost.position("hull", (0, 0, np.e), 1, last=True), cost.velocity([0.0], 1, last=True))
    refused("iterations", iterations=0)
    refused("previous", previous=[1.0])
    refused("shift: got 3; must be 0 unless the guess is a plan", shift=3)
    refused("shift: got 3; must be 0 unless the guess is a plan", shift=3, guess=np.zeros((5, 6)))
    refused("must be a tuple", cost.custom(lambda p: 1.0))
    refused(r"xx.*\(12, 12\)", cost.custom(lambda p: (1.0, None, None, np.eye(3), None, None)))
    refused("by zero", cost.custom(lambda p: 1 / 0), error=ZeroDivisionError)
    with pytest.raises(hg.InputError, match="callable"):
        cost.custom(3)
    with pytest.raises(hg.InputError, match=r"effort: times: got \[0, 1\]; give a `target`"):
        cost.effort(1.0, times=[0, 1])
    with pytest.raises(hg.InputError, match="every"):
        hg.optimize.Mpc(sim, TERMS, knots=5, every=9)
    with pytest.raises(hg.InputError, match="^mpc: previous: "):
        hg.optimize.Mpc(sim, TERMS, knots=5, previous="x")
    refused("^ilqr: previous: ", previous="x")
    mpc = hg.optimize.Mpc(sim, TERMS, knots=5)
    with pytest.raises(hg.InputError, match="control: q"):
        mpc.control(0.0, np.zeros(3), np.zeros(6))


def test_thrusters_without_a_slope_at_rest_are_moved():
    scene = hg.Scene(hg.Fluid(1000.0), time_step=0.05)
    scene.add(hg.Body(hg.sphere(0.1, faces=80), name="hull", density=1000.0, joint=hg.prismatic((1, 0, 0))))
    scene.add_force("thruster", body="hull", direction=(1, 0, 0), polynomial=[0, 5.0], name="jet")
    sim = hg.Simulator(scene)
    terms = [cost.position("hull", (0.2, 0, 0), 50.0), cost.effort(1e-3)]
    run = hg.optimize.Mpc(sim, terms, knots=15, hold=2, lower=-1, upper=1).run(sim, 80)
    assert abs(run.rollout.positions[-1, 0, 0] - 0.2) < 0.01
