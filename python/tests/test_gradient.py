"""Gradients against central differences."""

import pickle

import numpy as np
import pytest

import hydrograd as hg

# Relative error of the largest entry: differences themselves are good to about this.
TOLERANCE = 2e-6


def slopes(value, x, step):
    """Central differences of a function of an array, in the array's shape."""
    out = np.zeros_like(x)
    for at in np.ndindex(x.shape):
        up, down = x.copy(), x.copy()
        up[at] += step
        down[at] -= step
        out[at] = (value(up) - value(down)) / (2 * step)
    return out


def close(found, right):
    assert np.shape(found) == np.shape(right)
    assert np.abs(found - right).max() <= TOLERANCE * np.abs(right).max()


@pytest.fixture
def seeds(sim):
    """A loss Σ weight · observation, with the weights of every kind of observation."""
    random = np.random.default_rng(5)
    return {
        "positions": random.normal(size=(8, 2, 3)),
        "v": random.normal(size=(8, 12)),
        "controls": random.normal(size=(7, 6)),
    }


def loss(rollout, seeds):
    return (
        np.sum(seeds["positions"] * rollout.positions)
        + np.sum(seeds["v"] * rollout.v)
        + np.sum(seeds["controls"] * rollout.controls)
    )


def test_vjp_of_controls(sim, controls, seeds):
    gradient = sim.rollout(controls).vjp(**seeds)
    assert gradient.controls.shape == (7, 6)
    close(gradient.controls, slopes(lambda u: loss(sim.rollout(u), seeds), controls, 1e-4))


def test_vjp_of_the_start(sim, controls, seeds):
    gradient = sim.rollout(controls).vjp(**seeds)
    found = slopes(lambda v: loss(sim.rollout(controls, v=v), seeds), sim.initial_v, 1e-4)
    close(gradient.initial_v, found)
    # Positions have plain coordinates; their tangent is themselves.
    q = sim.initial_q

    def moved(x):
        start = q.copy()
        start[7:10] = x
        return loss(sim.rollout(controls, q=start), seeds)

    close(gradient.initial_q[6:9], slopes(moved, q[7:10].copy(), 1e-4))


def test_vjp_of_rotations(sim, controls):
    # tr(Gᵀ R) changes by Σ 2 axial(…)·δθ: seed δR = δθ × R with the gradient of the trace.
    weight = np.random.default_rng(7).normal(size=(3, 3))

    def value(u):
        return np.sum(weight * sim.rollout(u).rotations[-1, 1])

    rollout = sim.rollout(controls)
    seed = np.zeros((8, 2, 3))
    seed[-1, 1] = np.cross(rollout.rotations[-1, 1], weight, axis=0).sum(axis=1)
    gradient = rollout.vjp(rotations=seed)
    close(gradient.controls, slopes(value, controls, 1e-4))


def test_parameters_by_name(sim, controls, seeds):
    gradient = sim.rollout(controls).vjp(**seeds)
    assert set(gradient.parameters) == set(sim.parameters)
    for name in ("ball.mass", "coin.inertia.xx", "coin.drag.linear", "coin.drag.quadratic", "fluid.density"):
        base = sim.parameters[name]
        step = 1e-3 * base

        def value(x):
            return loss(sim.with_parameters({name: x}).rollout(controls), seeds)

        found = (value(base + step) - value(base - step)) / (2 * step)
        assert abs(gradient.parameters[name] - found) <= 1e-4 * abs(found), name


def test_gains_of_the_scenes_controller():
    scene = hg.Scene(time_step=0.02, steps=8)
    scene.add(hg.Body(hg.sphere(0.1), name="ball", density=1100.0, joint=hg.prismatic((0, 0, 1)), actuated=True))
    pd = '[controller]\nkind = "pd"\ntarget = [0.3]\nstiffness = [4.0]\ndamping = [2.0]\n'
    sim = hg.Simulator(hg.Scene.from_toml(scene.to_toml() + "\n" + pd), fidelity="isolated")
    goal = hg.objective.final_coordinate(0, 0.2)
    found = sim.rollout().gradient(goal).gains
    assert found.shape == sim.gains.shape == (3,)
    close(found, slopes(lambda g: sim.with_gains(g).rollout().value(goal), sim.gains, 1e-3))
    # The effort of what it adds.
    effort = hg.objective.applied_effort(0.5)
    rollout = sim.rollout()
    assert np.isclose(rollout.value(effort), 0.5 * np.sum(rollout.applied_controls**2), rtol=1e-14)
    found = rollout.gradient(effort).gains
    close(found, slopes(lambda g: sim.with_gains(g).rollout().value(effort), sim.gains, 1e-3))
    by_hand = rollout.vjp(applied_controls=rollout.applied_controls)
    assert np.array_equal(by_hand.gains, found)
    tangents = rollout.jvp(gains=np.eye(3)).applied_controls
    assert tangents.shape == (3, 8, 1)
    close(np.sum(tangents * rollout.applied_controls, axis=(1, 2)), found)
    again = pickle.loads(pickle.dumps(sim.with_gains(2 * sim.gains)))
    assert np.array_equal(again.gains, 2 * sim.gains)
    with pytest.raises(hg.InputError, match="3 numbers"):
        sim.with_gains([1.0])


def test_objectives(sim, controls):
    goal = hg.objective.final_position(1, (0.1, 0.0, 0.0)) + 1e-3 * hg.objective.effort(1.0)
    rollout = sim.rollout(controls)
    miss = rollout.positions[-1, 1] - [0.1, 0.0, 0.0]
    assert np.isclose(rollout.value(goal), miss @ miss + 1e-3 * np.sum(controls**2), rtol=1e-13)
    close(rollout.gradient(goal).controls, slopes(lambda u: sim.rollout(u).value(goal), controls, 1e-4))
    with pytest.raises(hg.InputError, match="under 2"):
        rollout.value(hg.objective.mean_position(2, (0, 0, 0)))


def test_one_step(sim, controls):
    rollout = sim.rollout(controls)
    state = sim.state()
    for n in range(3):
        assert state.step == n
        assert np.array_equal(state.q, rollout.q[n]) and np.array_equal(state.positions, rollout.positions[n])
        state, record = sim.step(state, controls[n])
    q_bar, v_bar = np.arange(12.0), np.linspace(-1, 1, 12)
    bar = record.vjp(q=q_bar, v=v_bar)
    a, b = record.jacobians()
    assert a.shape == (24, 24) and b.shape == (24, 6)
    both = np.concatenate([q_bar, v_bar])
    assert np.allclose(np.concatenate([bar.q, bar.v]), both @ a) and np.allclose(bar.controls, both @ b)
    q_dot, v_dot = record.jvp(q=v_bar, v=q_bar, u=np.ones(6))
    assert np.allclose(np.concatenate([q_dot, v_dot]), a @ np.concatenate([v_bar, q_bar]) + b @ np.ones(6))
    with pytest.raises(hg.InputError, match="jvp: u"):
        record.jvp(u=np.ones(5))


def test_one_step_is_a_rollout_of_one(sim, controls):
    random = np.random.default_rng(9)
    seeds = {"positions": random.normal(size=(2, 3)), "rotations": random.normal(size=(2, 3)), "v": random.normal(size=12)}
    _, record = sim.step(sim.state(), controls[0])
    found = record.vjp(**seeds)
    right = sim.rollout(controls[:1]).vjp(**{name: np.stack([0 * x, x]) for name, x in seeds.items()})
    assert np.array_equal(found.controls, right.controls[0])
    assert np.array_equal(found.q, right.initial_q) and np.array_equal(found.v, right.initial_v)
    assert np.abs(found.controls).max() > 0


def test_jacobians_of_a_step(sim, controls):
    """A and B against differences, where coordinates are plain: positions and velocities."""
    state = sim.state(v=np.linspace(-0.1, 0.1, 12))
    _, record = sim.step(state, controls[0])
    a, b = record.jacobians()
    plain = np.r_[0:3, 6:9, 12:24]  # rows of x = (δq, v) that aren't rotations
    at = np.r_[0:3, 7:10]

    def after(q, v, u):
        state, _ = sim.step(sim.state(q, v), u)
        return np.concatenate([state.q[at], state.v])

    def columns(of, x):
        found = []
        for i in range(len(x)):
            step = np.zeros(len(x))
            step[i] = 1e-4
            found.append((of(x + step) - of(x - step)) / 2e-4)
        return np.array(found).T

    q, v, u = state.q, state.v, controls[0]
    close(b[plain], columns(lambda x: after(q, v, x), u))
    close(a[plain][:, 12:], columns(lambda x: after(q, x, u), v))

    def placed(x):
        start = q.copy()
        start[at] = x
        return after(start, v, u)

    close(a[plain][:, np.r_[0:3, 6:9]], columns(placed, q[at]))


def test_observables_by_name(sim, controls, seeds):
    rollout = sim.rollout(controls)
    assert np.array_equal(rollout.observe("positions"), rollout.positions)
    assert np.array_equal(rollout.observe("rotations"), rollout.rotations)
    assert np.array_equal(rollout.observe("velocities"), rollout.velocities)
    assert np.array_equal(rollout.observe("energy"), rollout.kinetic_energy + rollout.potential_energy)
    seed = np.random.default_rng(3).normal(size=rollout.positions.shape)
    one, other = rollout.vjp(positions=seed), rollout.vjp(observables={"positions": seed})
    assert np.array_equal(one.controls, other.controls)

    spin = rollout.observe("angular_momentum")
    assert spin.shape == rollout.positions.shape
    goal = hg.objective.final_observable("angular_momentum", 4, 0.0)
    assert rollout.value(goal) == spin[-1, 1, 1] ** 2
    seed = np.zeros(spin.shape)
    seed[-1, 1, 1] = 2 * spin[-1, 1, 1]
    found = rollout.vjp(observables={"angular_momentum": seed}).controls
    close(found, slopes(lambda u: sim.rollout(u).observe("angular_momentum")[-1, 1, 1] ** 2, controls, 1e-4))

    with pytest.raises(hg.InputError, match="angular_momentum"):
        rollout.observe("spin")
    with pytest.raises(hg.UnsupportedError, match="derivative of the observable"):
        rollout.vjp(observables={"energy": np.zeros(len(rollout))})
    with pytest.raises(hg.InputError, match="angular_momentum"):
        rollout.vjp(observables={"angular_momentum": np.zeros(3)})


def test_springs_and_screws():
    scene = hg.Scene(fluid=hg.Fluid(density=0.0), gravity=(0, 0, -9.81), time_step=0.01, steps=20)
    nut = hg.Body(mass=2.0, inertia=(0.2, 0.2, 0.3), name="nut", joint=hg.screw((0, 0, 1), 0.5))
    assert repr(hg.screw((0, 0, 1), 0.5)) == "screw((0.0, 0.0, 1.0), 0.5)"
    scene.add(nut)
    scene.add_force("spring", body="nut", at=np.array([0.1, 0, 0]), to_at=(0, 0, 1), stiffness=5, damping=0.1)
    sim = hg.Simulator(scene, fidelity="isolated")
    assert sim.q_names == ["nut.angle"]
    seed = np.ones((21, 1))
    found = sim.rollout().vjp(v=seed).parameters
    for name, step in (("spring 1.stiffness", 1e-3), ("spring 1.damping", 1e-4)):

        def value(x):
            return sim.with_parameters({name: x}).rollout().v.sum()

        base = sim.parameters[name]
        slope = (value(base + step) - value(base - step)) / (2 * step)
        assert found[name] == pytest.approx(slope, rel=1e-6), name
    assert hg.Scene.from_toml(scene.to_toml()) == scene
    for keys, says in (
        ({"stiffness": 1.0, "lenght": 2.0}, "has no key `lenght`; remove it or use one of the keys: name, body"),
        ({"stiffness": "firm"}, 'stiffness: invalid type: string "firm", expected a number'),
        ({}, "lacks the key `stiffness`"),
        ({"stiffness": 1.0, "at": [0.0, 1.0]}, "at: invalid length 2, expected a list of length 3"),
    ):
        with pytest.raises(hg.InputError, match=says):
            scene.add_force("spring", body="nut", **keys)
    with pytest.raises(hg.InputError, match="`sprng` is not known; did you mean `spring`"):
        scene.add_force("sprng", body="nut")
    with pytest.raises(hg.InputError, match="screw: axis"):
        hg.screw((0, 0), 0.1)


def test_lubrication():
    scene = hg.Scene(fluid=hg.Fluid(density=998.0), gravity=(0, 0, -9.81), time_step=0.01, steps=20)
    scene.add_wall((0, 0, 0), (0, 0, 1))
    scene.add(hg.Body(hg.sphere(0.05, faces=320), density=2000.0, name="ball", position=(0, 0, 0.052)))
    dry = hg.Simulator(scene, fidelity="isolated", integrator="momentum-euler").rollout()
    assert dry.gap_flow() is None or not dry.gap_flow()["lubricated"]
    scene.add_force("lubrication", roughness=1e-4, viscosity=50.0, bodies=["ball"])
    sim = hg.Simulator(scene, fidelity="isolated")
    rollout = sim.rollout()
    heights = rollout.positions[:, 0, 2] - 0.05
    assert (heights > 0.0005).all() and (np.diff(heights) < 0.0).all()
    flow = rollout.gap_flow()
    assert flow["lubricated"] and flow["bodies"] == ("ball", None)
    assert flow["film_reynolds"] == pytest.approx(flow["gap"] * flow["speed"] * 998.0 / 50.0)
    assert flow["viscous_over_inertial"] == pytest.approx(24 / flow["film_reynolds"])
    assert flow["stokes"] < 1.0
    seed = np.zeros_like(rollout.positions)
    seed[-1, 0, 2] = 1.0
    found = rollout.vjp(positions=seed).parameters
    for name in ("lubrication 1.viscosity", "lubrication 1.roughness"):
        base = sim.parameters[name]
        # Small enough for the film's faces to be cut alike.
        step = 1e-4 * base

        def value(x, name=name):
            return sim.with_parameters({name: x}).rollout().positions[-1, 0, 2]

        slope = (value(base + step) - value(base - step)) / (2 * step)
        assert found[name] == pytest.approx(slope, rel=1e-6), name
    assert hg.Scene.from_toml(scene.to_toml()) == scene
    with pytest.raises(hg.InputError, match="rougness"):
        scene.add_force("lubrication", rougness=1e-4)


def test_pieces_and_torsional_friction():
    radius, torsional = 0.1, 0.002
    contact = hg.Contact(torsional_friction=torsional, rolling_friction=1e-3)
    scene = hg.Scene(fluid=hg.Fluid(density=0.0), gravity=(0, 0, -9.81), contact=contact, time_step=0.01, steps=40)
    scene.add_wall((0, 0, 0), (0, 0, 1))
    # Of two balls one lies within the other: what touches is the outer.
    pieces = [hg.sphere(radius), (hg.sphere(0.05), (0, 0, 0.02)), (hg.sphere(0.05), (0, 0, 0.02), (0.1, 0, 0))]
    ball = hg.Body(hg.sphere(radius), name="ball", density=1000.0, position=(0, 0, 1.01 * radius), collision=pieces)
    scene.add(ball)
    assert hg.Scene.from_toml(scene.to_toml()) == scene
    sim = hg.Simulator(scene, fidelity="isolated").with_start(v=np.array([0, 0, 0, 0, 0, 5.0]))
    spin = sim.rollout().v[:, 5]
    slows = (spin[10] - spin[40]) / 0.3
    assert slows == pytest.approx(torsional * 9.81 / (0.4 * radius**2), rel=1e-3)
    seed = np.zeros((41, 6))
    seed[-1, 5] = 1.0
    name = "contact.torsional_friction"
    found = sim.rollout().vjp(v=seed).parameters[name]

    def value(x):
        return sim.with_parameters({name: x}).rollout().v[-1, 5]

    slope = (value(torsional + 1e-6) - value(torsional - 1e-6)) / 2e-6
    assert found == pytest.approx(slope, rel=1e-6)
    with pytest.raises(hg.InputError, match=r"ball.*collision\[0\].*position"):
        hg.Body(hg.sphere(radius), name="ball", collision=[(hg.sphere(0.05), (0, 0))])


def test_objectives_are_added_subtracted_and_named(sim, controls):
    rollout = sim.rollout(controls)
    name = sim.body_names[1]
    by_number = hg.objective.final_position(1, (0.1, 0.0, 0.0))
    by_name = hg.objective.final_position(name, (0.1, 0.0, 0.0))
    value = rollout.value(by_number)
    assert rollout.value(by_name) == value
    assert rollout.value(sum([by_number, by_name])) == pytest.approx(2 * value, rel=1e-14)
    assert rollout.value(3 * by_name - by_number) == pytest.approx(2 * value, rel=1e-14)
    assert rollout.value(-by_name / 2) == pytest.approx(-value / 2, rel=1e-14)
    with pytest.raises(hg.InputError, match="must be one of"):
        rollout.value(hg.objective.final_position("nobody", (0, 0, 0)))
    with pytest.raises(hg.InputError, match="must not be zero"):
        by_name / 0
    with pytest.raises(hg.InputError, match="constant"):
        1 + by_name


def test_gradcheck():
    scene = hg.Scene()
    scene.add(hg.Body(hg.sphere(0.05), name="ball", density=1100.0, actuated=True))
    scene.add(hg.Body(hg.ellipsoid(0.01, 0.04, 0.04), density=998.0, position=(0.1, 0.01, 0)))
    found = hg.Simulator(scene, fidelity="reduced").gradcheck(10, directions=2, seed=3)
    assert found["max_rel_error"] < 1e-7 and len(found["directions"]) == 6
    assert found["growth"]["total"] > 1.0 and found["advice"] is None
    with pytest.raises(hg.InputError, match="at least 1"):
        hg.Simulator(scene, fidelity="isolated").gradcheck(0)
    with pytest.raises(hg.InputError, match="steps"):
        hg.Simulator(scene, fidelity="isolated").gradcheck(-1)


def test_contact_says_how_it_is_made():
    given = hg.Contact(gap=1e-3, friction=0.3)
    assert eval(repr(given), {"Contact": hg.Contact}) == given
