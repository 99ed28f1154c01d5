"""Robots in URDF files: published ones against Pinocchio, what is said of them, and runs in water."""

import importlib.metadata
import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

import hydrograd as hg

ROOT = pathlib.Path(__file__).parents[2]
ROBOTS = {
    "so_arm_description/urdf/so101.urdf": 0.63201,
    "panda_description/urdf/panda.urdf": 17.45190,
    "ur_description/urdf/ur5_gripper.urdf": 20.99390,
    "borinot_description/urdf/borinot_flying_arm_2.urdf": 2.91054,
    "quadruped_description/urdf/quadruped.urdf": 2.77200,
}
FIXED = {"so101": 0.48501, "panda": 16.82213, "ur5_gripper": 16.99390, "borinot_flying_arm_2": 0.26354, "quadruped": 0.77200}
GRAVITY = np.array([0.3, -0.2, -9.81])
STATES = 100
# Vehicles with an arm, where a folder of recordings is given.
UVMS = pathlib.Path(os.environ.get("HYDROGRAD_RECORDINGS", "recordings")) / "uvms"


def published(name):
    """The path of one of the published robots."""
    pytest.importorskip("pinocchio")
    try:
        package = importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("the package example-robot-data isn't installed")
    path = pathlib.Path(package.locate_file(f"cmeel.prefix/share/example-robot-data/robots/{name}"))
    assert path.is_file(), path
    return path


def vehicle(name):
    """The path of a vehicle with an arm."""
    pytest.importorskip("pinocchio")
    path = UVMS / name
    if not path.is_file():
        pytest.skip(f"{path} isn't there")
    return path


def close(found, right):
    error = np.max(np.abs(found - right)) / max(np.max(np.abs(right)), 1e-3)
    assert error < 1e-10, error


def skew(w):
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def without_losses(sim):
    """Pinocchio's bias force has no damping and no friction."""
    lost = [name for name in sim.parameters if name.endswith((".joint.damping", ".joint.friction"))]
    return sim.with_parameters({name: 0.0 for name in lost})


class Pair:
    """A dry robot, here and there, and the map of its velocities; joints are found by name."""

    def __init__(self, path, base):
        import pinocchio as pin

        self.pin, self.free = pin, base == "free"
        scene = hg.Scene(hg.Fluid(0.0), gravity=GRAVITY)
        self.robot = scene.add_robot(path, base=base, shape="none", mimic="independent")
        root = [pin.JointModelFreeFlyer()] if self.free else []
        self.model = pin.buildModelFromUrdf(str(path), *root)
        self.model.gravity.linear = GRAVITY
        self.data = self.model.createData()
        self.sim = without_losses(hg.Simulator(scene))
        # Bodies in order: the coordinates of a floating base, then one for each joint.
        moving = sorted(self.robot.joints.items(), key=lambda item: item[1])
        first_q, first_v = (7, 6) if self.free else (0, 0)
        self.joints = [(self.model.getJointId(name), first_q + k, first_v + k) for k, (name, _) in enumerate(moving)]
        assert self.model.nv == self.sim.v_size == first_v + len(moving)

    def state(self, random):
        pin, nv = self.pin, self.model.nv
        q, v = np.zeros(self.sim.q_size), random.normal(size=nv)
        there, matrix, rate = pin.neutral(self.model), np.zeros((nv, nv)), np.zeros(nv)
        if self.free:
            turn = pin.exp3(random.normal(size=3))
            quaternion = pin.Quaternion(turn).coeffs()
            q[:3] = random.normal(size=3)
            q[3:7] = [quaternion[3], *quaternion[:3]]
            there[:3], there[3:7] = q[:3], quaternion
            matrix[:6, :6] = np.kron(np.eye(2), turn.T)
            rate[:6] = -np.kron(np.eye(2), skew(turn.T @ v[3:6])) @ matrix[:6, :6] @ v[:6]
        for joint, at_q, at_v in self.joints:
            q[at_q] = random.uniform(-2.0, 2.0)
            there[self.model.joints[joint].idx_q] = q[at_q]
            matrix[self.model.joints[joint].idx_v, at_v] = 1.0
        return q, there, v, matrix, rate


def compare(path, base, states=STATES):
    pair, random = Pair(path, base), np.random.default_rng(7)
    pin, model, data = pair.pin, pair.model, pair.data
    drawn = [pair.state(random) for _ in range(states)]
    n = model.nv
    force = random.normal(size=(states, n))
    v = np.array([s[2] for s in drawn])
    equations = pair.sim.equations(np.array([s[0] for s in drawn]))
    mass, bias, forward = equations.mass_matrix(), equations.bias_force(v), equations.forward_dynamics(v, force=force)
    report = pair.robot.report
    frames = [(body, body, None) for body in pair.robot.bodies] + [(s["link"], s["body"], s["position"]) for s in report["sites"]]
    assert {f[0] for f in frames} == {f.name for f in model.frames if f.type == pin.FrameType.BODY}
    jacobians = {link: equations.jacobian(body, point) for link, body, point in frames}
    for k, (_, q, own, t, rate) in enumerate(drawn):
        theirs = t @ own
        full = pin.crba(model, data, q)
        full = np.triu(full) + np.triu(full, 1).T
        close(mass[k], t.T @ full @ t)
        close(bias[k], t.T @ pin.rnea(model, data, q, theirs, rate))
        found = pin.aba(model, data, q, theirs, np.linalg.solve(t.T, force[k]))
        close(forward[k], np.linalg.solve(t, found - rate))
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        for link in jacobians:
            right = pin.getFrameJacobian(model, data, model.getFrameId(link, pin.FrameType.BODY), pin.LOCAL_WORLD_ALIGNED)
            close(jacobians[link][k], right @ t)
    return report


@pytest.mark.parametrize("base", ["fixed", "free"])
@pytest.mark.parametrize("name", ROBOTS)
def test_published_robots_are_pinocchios(name, base):
    path = published(name)
    report = compare(path, base)
    assert report["mass"] == pytest.approx(ROBOTS[name], abs=1e-5)
    moving = sum(b["mass"] for b in report["bodies"] if base == "free" or b["kind"] != "fixed")
    assert moving == pytest.approx(ROBOTS[name] if base == "free" else FIXED[path.stem], abs=1e-5)


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_a_transmission_is_the_whole_under_its_constraint(base):
    """With q = E q' + o: M' = Eᵀ M E and h' = Eᵀ h, on Pinocchio's M and h of independent joints."""
    name = next(name for name in ROBOTS if "panda" in name)
    path = published(name)
    whole, random = Pair(path, base), np.random.default_rng(3)
    scene = hg.Scene(hg.Fluid(0.0), gravity=GRAVITY)
    robot = scene.add_robot(path, base=base, shape="none")
    sim = without_losses(hg.Simulator(scene))
    assert sim.v_size == whole.sim.v_size - 1
    assert any("follows" in note for note in robot.report["notes"])
    pin, first = whole.pin, 6 if whole.free else 0
    led = set(whole.robot.joints) - set(robot.joints)
    (follower,) = led
    leader = "panda_finger_joint1"
    moving = [joint for joint, _ in sorted(whole.robot.joints.items(), key=lambda item: item[1])]
    at, own = first + moving.index(follower), first + moving.index(leader)
    chosen = [k for k in range(whole.sim.v_size) if k != at]
    reduce = np.zeros((whole.sim.v_size, sim.v_size))
    reduce[chosen, range(sim.v_size)] = 1.0
    reduce[at, chosen.index(own)] = 1.0
    for _ in range(20):
        q, there, v, matrix, rate = whole.state(random)
        shift = 1 if whole.free else 0
        q[at + shift] = q[own + shift]
        there[whole.model.joints[whole.model.getJointId(follower)].idx_q] = q[own + shift]
        v[at] = v[own]
        small = np.delete(q, at + shift)
        equations = sim.equations(small)
        full = pin.crba(whole.model, whole.data, there)
        full = np.triu(full) + np.triu(full, 1).T
        close(equations.mass_matrix(), reduce.T @ matrix.T @ full @ matrix @ reduce)
        bias = matrix.T @ pin.rnea(whole.model, whole.data, there, matrix @ v, rate)
        close(equations.bias_force(v[chosen]), reduce.T @ bias)


@pytest.mark.parametrize("name", ["alpha_seabotix.urdf", "blue_rov_hardware_fixedjaw.urdf"])
def test_vehicles_with_arms_are_pinocchios(name):
    path = vehicle(name)
    for base in ["fixed", "free"]:
        compare(path, base, states=20)


def test_a_joint_without_limits_is_read_and_said():
    path = vehicle("blue_rov_hardware.urdf")
    report = hg.inspect_robot(path)
    assert any("r5m_joint_jaw" in note and "<limit>" in note for note in report["notes"]), report["notes"]


@pytest.mark.parametrize("name", ROBOTS)
def test_published_robots_run_in_water(name):
    """With default settings; fingers that start closed lie in each other's faces, and start open here."""
    path = published(name)
    start = {"panda_finger_joint1": 0.03} if "panda" in name else {}
    scene = hg.Scene.from_urdf(path, start=start)
    report = hg.inspect_robot(path)
    wet = [b for b in report["bodies"] if b["volume"] > 0]
    assert len(wet) > len(report["bodies"]) / 2, [b["shape"] for b in report["bodies"]]
    sim = hg.Simulator(scene)
    rollout = sim.rollout(np.zeros((20, sim.control_size)))
    assert np.isfinite(rollout.q).all() and np.isfinite(rollout.v).all()
    assert np.abs(rollout.q[-1] - rollout.q[0]).max() > 1e-6


def test_a_gradient_of_the_example():
    """From a file to a gradient, held against a difference."""
    scene = hg.Scene.from_urdf(ROOT / "examples" / "rov.urdf", drag=hg.Drag(quadratic=1.0, quadratic_part="normal"), limits=False, faces=80)
    sim = hg.Simulator(scene, 0.02, fidelity="isolated", tolerance=1e-12)
    assert sim.control_size == 4
    hand = scene.index("hand")
    random = np.random.default_rng(1)
    u, along = random.normal(scale=0.05, size=(2, 20, 4))

    def value(u):
        return sim.rollout(u).positions[-1, hand, 2]

    rollout = sim.rollout(u)
    seed = np.zeros_like(rollout.positions)
    seed[-1, hand, 2] = 1.0
    slope = np.sum(rollout.vjp(positions=seed).controls * along)
    step = 1e-4
    difference = (value(u + step * along) - value(u - step * along)) / (2 * step)
    assert slope == pytest.approx(difference, rel=1e-6)


def command(*arguments):
    return subprocess.run([sys.executable, "-m", "hydrograd", *map(str, arguments)], capture_output=True, text=True, check=False)


def test_the_command_line_takes_robots():
    path = ROOT / "examples" / "rov.urdf"
    shown = command("inspect", path)
    assert shown.returncode == 0, shown.stderr
    for words in ["vehicle (free)", "weight", "buoyancy", "centre of mass", "effort of <limit>"]:
        assert words in shown.stdout, words
    report = json.loads(command("inspect", path, "--json").stdout)
    assert report == hg.inspect_robot(path)
    ran = command("run", path, "--steps", "20", "--fidelity", "isolated", "--json")
    assert json.loads(ran.stdout)["steps"] == 20, ran.stderr
    wrong = command("inspect", ROOT / "examples" / "none.urdf", "--json")
    assert wrong.returncode == 1 and "none.urdf" in json.loads(wrong.stdout)["error"]


def test_packages_are_found_by_path(tmp_path):
    package = tmp_path / "packages" / "pack"
    package.mkdir(parents=True)
    (package / "cube.obj").write_text((ROOT / "tests/fuzz/corpus/mesh/cube.obj").read_text())
    path = tmp_path / "elsewhere" / "robot.urdf"
    path.parent.mkdir()
    inertial = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    mesh = '<collision><geometry><mesh filename="package://pack/cube.obj"/></geometry></collision>'
    path.write_text(f'<robot name="r"><link name="a">{inertial}{mesh}</link></robot>')
    with pytest.raises(hg.InputError, match="package_path"):
        hg.Scene.from_urdf(path)
    assert hg.Scene.from_urdf(path, package_path=[tmp_path / "packages"]).body_names == ["a"]
    found = subprocess.run(
        [sys.executable, "-m", "hydrograd", "inspect", str(path)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "ROS_PACKAGE_PATH": str(tmp_path / "packages")},
    )
    assert found.returncode == 0, found.stderr
    assert command("inspect", path, "--package-path", tmp_path / "packages").returncode == 0


def test_choices_that_can_not_be_are_refused():
    path = ROOT / "examples" / "rov.urdf"
    for choices, words in [
        ({"base": "tied"}, "tied"),
        ({"bases": "free"}, "bases"),
        ({"links": {"hand": {"shape": "round"}}}, "round"),
        ({"links": {"foot": {"mass": 1.0}}}, "foot"),
        ({"start": {"arm_elbow": 9.0}}, "arm_elbow"),
        ({"start": hg.Drag(quadratic=1.0)}, "quadratic.*no such name"),
        ({"drga": hg.Drag(quadratic=1.0)}, "drga"),
        ({"start": {"arm_elbow": float("nan")}}, "robot: start.*nan.*finite"),
        ({"urdf": "other.urdf"}, "urdf.*other.urdf.*first argument"),
    ]:
        with pytest.raises(hg.InputError, match=words):
            hg.Scene.from_urdf(path, **choices)
    scene = hg.Scene()
    first = scene.add_robot(path, prefix="a/", position=np.array([0.0, 0.0, 1.0]), links={"hand": {"density": 1200.0}})
    assert first.joints["arm_elbow"] == scene.index("a/forearm") == first.bodies["a/forearm"]
    assert "a/fingertip" in scene.site_names
    assert "rov" in str(first) and "rov" in repr(first)
    scene.add_robot(path, prefix="b/", base="fixed")
    scene.validate()


MJCF = """<mujoco model="sampler">
  <compiler angle="degree" eulerseq="xyz"/>
  <default>
    <joint damping="0" armature="0.02"/>
    <geom density="900"/>
    <default class="thin"><geom type="capsule" size="0.03"/><joint range="-100 100"/></default>
  </default>
  <worldbody>
    <light pos="0 0 3"/>
    <body name="base">
      <geom type="box" size="0.2 0.1 0.05"/>
      <body name="shoulder" pos="0 0 0.1" quat="0.8 0.2 -0.4 0.4">
        <joint name="yaw" type="hinge" axis="0 0 1" range="-170 170"/>
        <joint name="pitch" type="hinge" axis="0.2 1 0" pos="0.01 0.02 0.03" armature="0"/>
        <geom class="thin" fromto="0 0 0 0.3 0.1 0.05"/>
        <geom type="ellipsoid" size="0.05 0.04 0.03" pos="0.3 0 0" mass="0.4"/>
        <site name="elbow mark" pos="0.3 0 0"/>
        <body name="slider" pos="0.3 0.1 0.05" axisangle="0.6 0.8 0 35">
          <inertial pos="0.02 0.01 0" mass="1.3" fullinertia="0.02 0.03 0.025 0.001 -0.002 0.0015"/>
          <joint name="out" type="slide" axis="1 0 0.5" range="-0.2 0.3"/>
          <geom type="cylinder" size="0.02 0.1" contype="0" conaffinity="0"/>
          <body name="hand" pos="0.2 0 0" xyaxes="0 1 0 -1 0 0">
            <joint name="wrist" axis="0 1 0" pos="-0.05 0 0.02" class="thin"/>
            <geom type="sphere" size="0.06"/>
            <body name="palm" pos="0.05 0 0"><geom type="box" size="0.02 0.04 0.01" euler="10 20 30"/></body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="yaw"/></actuator>
</mujoco>
"""


def test_an_mjcf_file_is_pinocchios(tmp_path):
    """M and h of a file with degrees, defaults, several joints of a body, joints away from origins, and inertia from geometry."""
    pin = pytest.importorskip("pinocchio")

    path = tmp_path / "sampler.xml"
    path.write_text(MJCF)
    scene = hg.Scene(hg.Fluid(0.0), gravity=GRAVITY)
    robot = scene.add_robot(path)
    sim = hg.Simulator(scene)
    assert any("have no actuator" in note for note in robot.report["notes"])
    model = pin.buildModelFromMJCF(str(path))
    model.gravity.linear = GRAVITY
    data = model.createData()
    # It makes one joint of several of a body, in their order.
    moving = sorted(robot.joints.items(), key=lambda item: item[1])
    assert model.nv == sim.v_size == 4 and [name for name, _ in moving] == ["yaw", "pitch", "out", "wrist"]
    at = range(4)
    random = np.random.default_rng(2)
    for _ in range(100):
        q, v = random.uniform(-0.2, 0.2, 4), random.normal(size=4)
        there, rate = np.zeros(4), np.zeros(4)
        there[at], rate[at] = q, v
        equations = sim.equations(q)
        full = pin.crba(model, data, there)
        full = np.triu(full) + np.triu(full, 1).T
        close(equations.mass_matrix(), full[np.ix_(at, at)])
        close(equations.bias_force(v), pin.rnea(model, data, there, rate, np.zeros(4))[at])


def test_joints_and_links_are_as_chosen():
    """Drives, losses and drag of single joints and links: as objects, as mappings, for all and for one."""
    path = ROOT / "examples" / "rov.urdf"
    chosen = dict(
        servo=hg.Servo(5.0, 0.5),
        joints={
            "arm_elbow": {"servo": {"stiffness": 8.0}, "passive": hg.Passive(damping=0.2)},
            "arm_shoulder": {"actuated": False, "limits": np.array([-0.5, 0.5])},
        },
        links={"hand": {"drag": hg.Drag(quadratic=0.5)}},
    )
    scene = hg.Scene.from_urdf(path, **chosen)
    text = scene.to_toml()
    joints = hg.Scene.from_urdf(path).add_robot(path, prefix="again/", position=(5, 0, 0)).joints
    assert {"arm_elbow", "arm_shoulder"} <= set(joints)
    assert text.count("stiffness = 8.0") == 1 and text.count("stiffness = 5.0") == len(joints) - 2
    assert text.count("damping = 0.2") == 1 and text.count("quadratic = 0.5") == 1
    assert "limits = [-0.5, 0.5]" in text
    sim = hg.Simulator(scene, fidelity="isolated")
    assert sim.control_size == len(joints) - 1
    with pytest.raises(hg.InputError, match="no such name"):
        hg.Scene.from_urdf(path, joints={"elbow": {"servo": hg.Servo(1.0)}})
    with pytest.raises(hg.InputError, match="strength"):
        hg.Scene.from_urdf(path, joints={"arm_elbow": {"strength": 1.0}})
