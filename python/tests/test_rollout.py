"""What a rollout shows: shapes, units, names."""

import pickle

import bridge_scenes
import numpy as np
import pytest

import hydrograd as hg


def test_shapes_and_types(sim, controls):
    rollout = sim.rollout(controls)
    shapes = {
        "time": (8,),
        "q": (8, 14),
        "v": (8, 12),
        "controls": (7, 6),
        "positions": (8, 2, 3),
        "rotations": (8, 2, 3, 3),
        "velocities": (8, 2, 6),
        "kinetic_energy": (8,),
        "potential_energy": (8,),
        "momentum": (8, 6),
        "min_gap": (8,),
    }
    for name, shape in shapes.items():
        array = getattr(rollout, name)
        assert array.shape == shape and array.dtype == np.float64, name
    assert (sim.control_size, sim.q_size, sim.v_size) == (6, 14, 12)
    assert sim.body_names == ["ball", "coin"] and rollout.steps == 7 and len(rollout) == 8
    assert np.array_equal(rollout.controls, controls)
    assert np.allclose(rollout.time, 0.01 * np.arange(8))


def test_arrays_mean_what_they_say(sim, controls):
    rollout = sim.rollout(controls)
    # A free body's q begins with its position, in the frame of its joint.
    assert np.allclose(rollout.q[:, 7:10], rollout.positions[:, 1] - [0.01, 0.0, 0.02], atol=1e-15)
    assert np.allclose(rollout.v[:, :6], rollout.velocities[:, 0])
    products = rollout.rotations @ rollout.rotations.swapaxes(-1, -2)
    assert np.allclose(products, np.eye(3))
    # The rate of the positions is the velocity, up to the step's length.
    rate = np.diff(rollout.positions[:, 0], axis=0) / 0.01
    mean = 0.5 * (rollout.velocities[1:, 0, :3] + rollout.velocities[:-1, 0, :3])
    assert np.abs(rate - mean).max() < 0.05 * np.abs(mean).max()


def test_a_free_ball_falls_with_half_its_displaced_mass_added():
    scene = hg.Scene(gravity=(0.0, 0.0, -9.81))
    scene.add(hg.Body(hg.sphere(0.1), density=1996.0))
    rollout = hg.Simulator(scene, 0.01, fidelity="isolated").rollout(steps=10)
    # (2 - 1) g / (2 + 1/2), in closed form.
    assert np.allclose(rollout.velocities[-1, 0, 2], -0.1 * 9.81 / 2.5, rtol=1e-12)


def test_added_mass_of_a_sphere():
    scene = hg.Scene(hg.Fluid(1000.0))
    scene.add(hg.Body(hg.sphere(0.5), density=1000.0))
    matrix = hg.added_mass(scene, fidelity="isolated")
    assert matrix.shape == (6, 6)
    assert np.allclose(matrix[:3, :3], np.eye(3) * 1000.0 * 2.0 / 3.0 * np.pi * 0.5**3)


def test_columns_by_name(sim, controls):
    columns = sim.rollout(controls).to_dict()
    assert list(columns)[:3] == ["time", "ball.x", "ball.y"]
    assert set(sim.q_names + sim.v_names) < set(columns)
    assert {array.shape for array in columns.values()} == {(8,)}
    assert np.array_equal(columns["coin.z"], sim.rollout(controls).q[:, 9])


def test_steps_and_start(sim):
    assert sim.rollout().steps == 7  # the scene's
    assert sim.rollout(steps=2).steps == 2
    q, v = sim.initial_q, sim.initial_v + 0.1
    moved = sim.rollout(steps=1, q=q, v=v)
    assert np.allclose(moved.v[0], v)
    other = sim.with_start(v=v).rollout(steps=1)
    assert np.array_equal(moved.v, other.v)
    assert np.array_equal(sim.initial_v, v - 0.1)  # the first stays as it was


def test_a_run_goes_on_to_the_bit(sim, controls):
    whole = sim.rollout(controls)
    first = sim.rollout(controls[:4])
    second = sim.rollout(controls[4:], state=first.state())
    assert np.array_equal(second.q, whole.q[4:]) and np.array_equal(second.time, whole.time[4:])
    assert first.state().step == 4 and first.state(0).step == 0
    with pytest.raises(IndexError):
        first.state(5)


def test_the_smallest_gap_is_compared_with_panels():
    scene = hg.Scene(gravity=(0.0, 0.0, 0.0), time_step=0.01)
    scene.add_wall((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    scene.add(hg.Body(hg.cylinder(1.0, 0.25), density=1000.0, position=(0.0, 0.0, 0.225)))
    check = hg.Simulator(scene, fidelity="reduced", faces=320, films=False).rollout(steps=1).check_gap()
    assert check["bodies"][1] is None and np.isclose(check["gap"], 0.1) and check["time"] == 0.0
    run, panels = check["added_mass"]
    assert np.isclose(check["added_mass_error"], run / panels - 1.0) and 0.01 < check["added_mass_error"] < 0.1
    run, panels = check["slope"]
    assert np.isclose(check["force_error"], run / panels - 1.0) and 0.1 < check["force_error"] < 0.6
    assert np.isclose(check["force_share"], abs(panels) * check["gap"] / check["added_mass"][1])
    assert hg.Simulator(scene, fidelity="full", faces=320).rollout(steps=1).check_gap() is None
    # The film in the gap is most of what was missing.
    film = hg.Simulator(scene, fidelity="reduced", faces=320).rollout(steps=1).check_gap()
    assert abs(film["force_error"]) < abs(check["force_error"])


def test_scenes_in_files(tmp_path, sim):
    path = tmp_path / "two.toml"
    path.write_text(sim.scene.to_toml())
    scene = hg.Scene.load(path)
    assert scene == sim.scene and scene.index("coin") == 1 and len(scene) == 2
    assert np.array_equal(hg.Simulator(scene, faces=80).rollout().q.shape, (8, 14))


def test_chain_walls_contact_and_motion():
    scene = hg.Scene(gravity=(0.0, 0.0, -9.81), contact=hg.Contact(friction=0.3), time_step=0.002)
    scene.add_wall((0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
    base = scene.add(hg.Body(hg.box(0.2, 0.2, 0.2), density=2000.0, joint=hg.prismatic((0, 0, 1)), limits=(-0.5, 0.5)))
    crank = hg.Body(hg.capsule(0.03, 0.2), name="crank", density=1500.0, parent=base, position=(0.3, 0.0, 0.0))
    scene.add(crank)
    turned = hg.Body(mass=1.0, inertia=(0.1, 0.1, 0.1), parent="crank", joint=hg.revolute((1, 0, 0)))
    scene.add(turned)
    scene.add(hg.Body(mass=1.0, inertia=(1, 1, 1), joint=hg.planar("xy"), motion=[hg.Motion.linear(0.1)] * 3))
    sim = hg.Simulator(scene, fidelity="isolated")
    assert sim.integrator == "momentum-euler"  # contact
    rollout = sim.rollout(steps=3)
    assert rollout.q.shape == (4, 1 + 7 + 1 + 3)
    assert np.allclose(rollout.q[:, -1], 0.1 * rollout.time)
    gaps = sim.contact_gaps
    assert all(0.0 < gap < 2e-3 for gap in gaps.values())
    assert ("crank", None) in gaps  # the wall
    assert rollout.summary()["contact_gap"] == max(gaps.values())


def test_meshes_from_arrays_objects_and_files(tmp_path):
    vertices, faces = hg.box(0.1, 0.2, 0.3, faces=200).triangles()
    shape = hg.mesh(vertices, faces)
    assert np.isclose(shape.volume, 0.006)

    class Mesh:
        pass

    other = Mesh()
    other.vertices, other.faces = vertices.tolist(), faces.astype(np.uint32)
    assert hg.mesh(other) == shape
    path = tmp_path / "box.obj"
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += ["f " + " ".join(str(i + 1) for i in face) for face in faces]
    path.write_text("\n".join(lines))
    assert np.isclose(hg.mesh(path, scale=10.0).volume, 6.0)
    assert np.isclose(hg.mesh(vertices, faces, scale=10.0).volume, 6.0)
    matrices = []
    for made in (shape, hg.mesh(str(path))):
        scene = hg.Scene()
        scene.add(hg.Body(made, density=1000.0))
        assert hg.Scene.from_toml(scene.to_toml()) == scene
        matrices.append(hg.added_mass(scene))
    # A file's vertices may be numbered in another order.
    assert np.allclose(*matrices, rtol=1e-9, atol=1e-12)


def test_files_of_meshes_are_found_from_anywhere(tmp_path, monkeypatch):
    vertices, faces = hg.box(0.1, 0.2, 0.3, faces=80).triangles()
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += ["f " + " ".join(str(i + 1) for i in face) for face in faces]
    for folder in ("scenes", "elsewhere"):
        (tmp_path / folder).mkdir()
    file = tmp_path / "scenes/box.obj"
    file.write_text("\n".join(lines))
    body = '[[bodies]]\nname = "box"\ndensity = 1000.0\nshape = { kind = "mesh", path = "box.obj" }\n'
    (tmp_path / "scenes/a.toml").write_text(f"time_step = 0.01\nsteps = 2\n[fluid]\ndensity = 0.0\n{body}")
    monkeypatch.chdir(tmp_path)
    scene, shape = hg.Scene.load("scenes/a.toml"), hg.mesh("scenes/box.obj")
    sim = hg.Simulator(scene)
    monkeypatch.chdir("elsewhere")
    text = scene.to_toml()
    for again in (pickle.loads(pickle.dumps(scene)), hg.Scene.from_toml(text), hg.Scene.from_toml(text, "nowhere")):
        assert again == scene
    assert pickle.loads(pickle.dumps(sim)).rollout().steps == 2
    assert np.isclose(shape.volume, 0.006)
    # What a simulator was made of it knows, whatever became of the file.
    file.unlink()
    assert len(sim.rollout().to_dict()["time"]) == 3


def test_a_state_of_another_simulator_keeps_its_velocity(sim, controls):
    """Whatever integrators step in: most of them in momentum, which is another where the masses are."""

    def made(dt=0.01, **settings):
        return hg.Simulator(sim.scene, dt, fidelity="isolated", **settings)

    momentum, velocity = made(integrator="momentum-euler"), made(integrator="velocity-euler")
    heavier = momentum.with_parameters({"ball.mass": 3 * momentum.parameters["ball.mass"]})
    simulators = [momentum, velocity, heavier, made(dt=0.005), made(integrator="midpoint")]
    goal = [hg.cost.effort(1.0)]
    for first in simulators:
        state = first.rollout(controls[:3]).state()
        assert np.abs(state.v).max() > 1e-3
        for second in simulators:
            right = second.state(state.q, state.v, step=3)
            run = second.rollout(controls[3:5], state=state)
            assert np.allclose(run.v[0], state.v, rtol=1e-9, atol=1e-12) and np.array_equal(run.q[0], state.q)
            assert np.isclose(run.time[0], 3 * second.dt)
            assert np.allclose(run.q[-1], second.rollout(controls[3:5], state=right).q[-1], rtol=1e-9, atol=1e-12)
            after, right_after = second.step(state, controls[3])[0], second.step(right, controls[3])[0]
            assert np.allclose(after.v, right_after.v, rtol=1e-9, atol=1e-12) and after.step == 4
            plan = hg.optimize.ilqr(second, goal, knots=2, state=state, iterations=1)
            assert np.allclose(plan.rollout.v[0], state.v, rtol=1e-9, atol=1e-12)
            followed = hg.optimize.Mpc(second, goal, knots=2).run(second, 2, state=state)
            assert np.allclose(followed.rollout.v[0], state.v, rtol=1e-9, atol=1e-12)


def test_a_state_of_the_same_simulator_made_again_goes_on_to_the_bit(sim, controls):
    state = sim.rollout(controls[:4]).state()
    right = sim.rollout(controls[4:], state=state).q
    others = [pickle.loads(pickle.dumps(sim)), sim.with_start(v=sim.initial_v + 0.1), sim.with_policy(Nothing())]
    for other in others:
        assert np.array_equal(other.rollout(controls[4:], state=state).q, right)
    assert np.array_equal(sim.rollout(controls[4:], state=pickle.loads(pickle.dumps(state))).q, right)


class Nothing:
    """A controller that does nothing."""

    def act(self, seen):
        return np.zeros(6)


def test_a_state_of_other_sizes_is_refused(sim):
    scene = hg.Scene()
    scene.add(hg.Body(hg.sphere(0.05), density=1000.0, actuated=True))
    other = hg.Simulator(scene, 0.01, fidelity="isolated")
    for use in (other.rollout, other.step):
        with pytest.raises(hg.InputError, match="as the scene's"):
            use(state=sim.state())


def test_no_configurations_have_no_tangents(sim):
    none, some = np.zeros((0, sim.q_size)), np.zeros((0, sim.v_size))
    for q, xi in ((none, some), (none, np.zeros(sim.v_size)), (sim.initial_q, some)):
        assert sim.integrate(q, xi).shape == (0, sim.q_size)
    for start, end in ((none, none), (none, sim.initial_q), (sim.initial_q, none)):
        assert sim.difference(start, end).shape == (0, sim.v_size)
    with pytest.raises(hg.InputError, match="0 and 2 rows"):
        sim.integrate(none, np.zeros((2, sim.v_size)))
    equations = sim.equations(none)
    assert equations.q.shape == none.shape and equations.mass_matrix().shape == (0, sim.v_size, sim.v_size)
    assert sim.linearise(none)[0].shape == (0, 2 * sim.v_size, 2 * sim.v_size)


def test_states_have_driven_joints_where_their_motion_has_them():
    sim = bridge_scenes.locking()
    rollout = sim.rollout(steps=3)
    state = sim.state(step=3)
    assert state.q[1] == pytest.approx(rollout.q[3, 1], rel=1e-12)
    assert state.v[1] == pytest.approx(0.05 * np.cos(0.06), rel=1e-12)
    given = sim.state(q=rollout.q[3], v=[rollout.v[3, 0], 0.0], step=3)
    np.testing.assert_allclose(given.v, rollout.v[3], rtol=1e-12)
    for one in (state, given):
        np.testing.assert_allclose(one.v, sim.rollout(steps=0, state=one).v[0], rtol=1e-9)
    for found, right in zip(sim.linearise(step=3), sim.linearise(state.q, state.v, step=3)):
        assert np.array_equal(found, right)
    with pytest.raises(hg.InputError, match="other.*driven"):
        sim.state(q=sim.initial_q + [0.0, 0.01], step=3)
