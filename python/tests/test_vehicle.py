"""Forces that vehicles need, as scenes in Python give them."""

import numpy as np
import pytest

import hydrograd as hg


def vehicle():
    scene = hg.Scene(gravity=(0, 0, -9.81), time_step=0.01)
    scene.add(hg.Body(hg.ellipsoid(0.2, 0.1, 0.08, faces=80), name="rov", density=998.0, volume=0.0068, center_of_buoyancy=(0, 0, 0.02)))
    scene.add(
        hg.Body(name="rotor", mass=0.1, inertia=(1e-3, 1e-3, 1e-3), joint=hg.revolute((1, 0, 0)), parent="rov", position=(-0.2, 0, 0))
    )
    scene.add_force("damping", body="rov", name="hull", linear=np.diag([2.0, 3, 3, 0.1, 0.1, 0.1]), quadratic=[9, 12, 14, 0.1, 0.1, 0.2])
    for name, side in (("port", 1), ("starboard", -1)):
        scene.add_force("thruster", body="rov", name=name, at=(-0.1, 0.1 * side, 0), direction=(1, 0, 0), polynomial=(0, 20), torque=0.02 * side)
    table = [(-1, -20), (-0.1, 0), (0.1, 0), (1, 30)]
    scene.add_force("thruster", body="rov", name="lift", direction=(0, 0, 1), table=table, loss=2.0, dead_band=0.01)
    scene.add_force("thruster", body="rov", name="screw", at=(-0.2, 0, 0), direction=(1, 0, 0), polynomial=(0, 1e-3), rotor="rotor", time_constant=0.1)
    scene.add_force("fin", body="rov", name="tail", at=(-0.2, 0, 0), chord=(1, 0, 0), normal=(0, 1, 0), length=0.1, area=0.01, lift_slope=4, drag=0.02)
    scene.add_force("float", body="rov", name="foam", at=(0, 0, 0.05), volume=1e-4, mass=0.01)
    return scene


def test_controls_have_names_and_an_allocation():
    sim = hg.Simulator(vehicle(), fidelity="isolated")
    assert sim.control_names == ["port", "starboard", "lift", "screw"]
    matrix = sim.allocation("rov")
    assert matrix.shape == (6, 4) and sim.thruster_controls(0) == [0, 1, 2, 3]
    assert np.allclose(matrix[:, 0], [1, 0, 0, 0.02, 0, -0.1])
    assert np.allclose(matrix[:, 1], [1, 0, 0, -0.02, 0, 0.1])
    assert sim.allocation(1).shape == (6, 0)
    with pytest.raises(hg.InputError, match="allocation: body: got hull"):
        sim.allocation("hull")


def test_parameters_of_vehicles_have_gradients():
    sim = hg.Simulator(vehicle(), fidelity="isolated")
    u = np.tile([0.6, 0.4, 0.5, 40.0], (30, 1))
    weights = np.random.default_rng(1).normal(size=(31, 2, 3))

    def loss(changes):
        changed = sim.with_parameters({**sim.parameters, **changes}) if changes else sim
        return float((weights * changed.rollout(u).positions).sum())

    gradient = sim.rollout(u).vjp(positions=weights).parameters
    for name in (
        "hull.linear.x.x", "hull.quadratic.x", "port.coefficient.2", "starboard.torque", "lift.thrust.3", "lift.loss", "lift.dead_band",
        "screw.time_constant", "tail.area", "tail.lift_slope", "tail.drag", "foam.volume", "rov.volume", "rov.center_of_buoyancy.z",
        "rov.center_of_mass.x", "fluid.density",
    ):
        value = sim.parameters[name]
        step = 1e-4 * max(abs(value), 0.01)
        difference = (loss({name: value + step}) - loss({name: value - step})) / (2 * step)
        assert np.isclose(gradient[name], difference, rtol=2e-5, atol=1e-9), (name, gradient[name], difference)


def test_wrong_keys_are_told():
    scene = vehicle()
    with pytest.raises(hg.InputError, match="polynom"):
        scene.add_force("thruster", body="rov", direction=(1, 0, 0), polynom=(1,))
    scene.add_force("damping", body="rov", linear=(1, 1, 1, 1, 1, -1))
    with pytest.raises(hg.InputError, match=r"linear\[5\]"):
        scene.validate()
    assert hg.Scene.from_toml(vehicle().to_toml()) == vehicle()


def test_currents():
    """By depth and time: a ball that is as heavy as the water goes with it, and its way is differentiated by what the current is."""
    scene = hg.Scene(time_step=0.02)
    for name, z in (("high", -1.0), ("deep", -6.0)):
        scene.add(hg.Body(hg.sphere(0.1, faces=80), name=name, density=998.0, position=(0, 0, z)))
    tide = hg.Motion.sine(amplitude=1.0, frequency=2.0)
    profile = np.array([[2.0, 1.0], [4.0, 0.5], [5.0, 0.25]])
    scene.add_force("current", name="tide", velocity=(0.5, 0.1, 0), profile=profile, over_time=tide)
    assert hg.Scene.from_toml(scene.to_toml()) == scene
    sim = hg.Simulator(scene, fidelity="isolated", integrator="rk4")
    rollout = sim.rollout(np.zeros((50, 0)))
    share = np.array([1.0, 0.25])
    along = np.array([0.5, 0.1, 0.0])
    flow = np.sin(2.0 * 0.02 * np.arange(51))[:, None, None] * share[:, None] * along
    assert np.allclose(rollout.v.reshape(51, 2, 6)[:, :, :3], flow, atol=1e-7)

    weights = np.zeros((51, 2, 3))
    weights[-1, 1, 0] = 1.0
    gradient = rollout.vjp(positions=weights).parameters
    # ∫ sin 2t dt over a second, by the current's velocity and by its share there.
    way = 0.5 * (1 - np.cos(2.0))
    assert np.isclose(gradient["tide.velocity.x"], 0.25 * way, rtol=1e-6)
    assert np.isclose(gradient["tide.share.2"], 0.5 * way, rtol=1e-6)
    assert gradient["tide.share.0"] == 0.0

    accelerations = [sim.equations(time=t).forward_dynamics(np.zeros(12))[:3] for t in (0.0, 0.3)]
    assert np.allclose(accelerations, np.outer(2.0 * np.cos([0.0, 0.6]), along), rtol=1e-9)
    scene.add_force("current", velocity=(0.1, 0, 0), profile=[[1.0, 1.0], [1.0, 0.5]])
    with pytest.raises(hg.InputError, match=r"forces\[1\]\.profile"):
        scene.validate()


def test_loads_and_sensors():
    """An arm that is held level in the air weighs on its joint, and its sensor reads gravity; in water the free hull carries nothing across its joint."""
    scene = hg.Scene(hg.Fluid(0.0), gravity=(0, 0, -9.81))
    arm = {"mass": 2.0, "inertia": (0.1, 0.1, 0.1), "center_of_mass": (0.4, 0, 0), "joint": hg.revolute((0, 1, 0))}
    scene.add(hg.Body(name="arm", locked=True, **arm))
    scene.add_site("tip", "arm", position=(0.8, 0, 0))
    rollout = hg.Simulator(scene).rollout(np.zeros((3, 0)))
    loads = rollout.loads(-1)
    assert np.allclose(loads.joints, [[0, 0, 2 * 9.81, 0, -0.4 * 2 * 9.81, 0]], atol=1e-12)
    assert np.allclose(loads.joint_forces, [-0.4 * 2 * 9.81]) and np.array_equal(loads.acceleration, [0.0])
    assert np.allclose(rollout.imu("tip"), np.tile([0, 0, 9.81, 0, 0, 0], (4, 1)), atol=1e-12)

    rollout = hg.Simulator(vehicle(), fidelity="isolated").rollout(np.tile([0.6, 0.4, 0.5, 40.0], (10, 1)))
    loads = rollout.loads(5)
    assert {"gravity", "buoyancy", "damping", "thrust", "fin", "water"} <= set(loads.kinds)
    assert loads.wrenches("thrust").shape == (2, 6) and abs(loads.wrenches("thrust")[0, 0]) > 1
    assert np.abs(loads.joints[0]).max() < 1e-9 * np.abs(loads.wrenches("gravity")[0]).max()
    with pytest.raises(hg.InputError, match="loads: kind"):
        loads.wrenches("magic")
    with pytest.raises(hg.InputError, match="imu: site"):
        rollout.imu("nose")


def test_forces_name_bodies_by_number_too():
    scene = hg.Scene(hg.Fluid(1000.0))
    scene.add(hg.Body(hg.sphere(0.1, faces=80), name="hull", mass=4.0))
    scene.add(hg.Body(name="rotor", mass=1.0, inertia=(1e-3,) * 3, joint=hg.revolute((1, 0, 0))))
    scene.add_force("thruster", body=0, direction=(1, 0, 0), rotor=1, time_constant=0.2, name="jet")
    scene.add_force("spring", body="hull", to=1, stiffness=2.0)
    text = scene.to_toml()
    assert 'rotor = "rotor"' in text and 'to = "rotor"' in text and text.count('body = "hull"') == 2
    scene.add_force("damping", body=np.int64(0), linear=(1.0,) * 6)
    assert scene.to_toml().count('body = "hull"') == 3
    for wrong in (False, -1, 0.5, np.zeros(2)):
        with pytest.raises(hg.InputError, match=r"damping: body: got .*; must be the number or name of a body"):
            scene.add_force("damping", body=wrong, linear=(1.0,) * 6)
    with pytest.raises(hg.InputError, match=r"thruster: body.*got 2.*\[\"hull\", \"rotor\"\]"):
        scene.add_force("thruster", body=2, direction=(1, 0, 0))
    with pytest.raises(hg.InputError, match="pd.*none of the scene's is actuated"):
        pd = '\n[controller]\nkind = "pd"\ntarget = []\nstiffness = []\ndamping = []\n'
        hg.Simulator(hg.Scene.from_toml(text + pd))
