"""The equations of motion against Pinocchio's on random dry trees of all joints, in water against rollouts and differences; sites."""

import numpy as np
import pytest

import hydrograd as hg

pin = pytest.importorskip("pinocchio")

KINDS = ["free", "revolute", "prismatic", "spherical", "planar"]
GRAVITY = np.array([0.3, -0.2, -9.81])


def skew(w):
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def rotation(vector):
    return pin.exp3(np.asarray(vector, dtype=float))


class Tree:
    """A random dry tree, here and there, and the maps of its velocities."""

    def __init__(self, seed, bodies=7):
        random = np.random.default_rng(seed)
        self.scene, self.model = hg.Scene(hg.Fluid(0.0), gravity=GRAVITY), pin.Model()
        self.model.gravity.linear = GRAVITY
        self.kinds, path = [], [-1]
        for b in range(bodies):
            kind = KINDS[(seed + b) % len(KINDS)] if b < len(KINDS) else str(random.choice(KINDS))
            # Depth first, as Pinocchio numbers joints: on the last body, or on one that carries it.
            parent = int(random.choice(path))
            path = [*path[: path.index(parent) + 1], b]
            axis = random.normal(size=3)
            axis /= np.linalg.norm(axis)
            place, turn = random.normal(size=3), random.normal(size=3)
            mass, center, root = random.uniform(0.2, 2.0), 0.3 * random.normal(size=3), random.normal(size=(3, 3))
            moments = root @ root.T
            inertia = np.trace(moments) * np.eye(3) - moments
            joints = {
                "free": (hg.free(), pin.JointModelFreeFlyer()),
                "revolute": (hg.revolute(axis), pin.JointModelRevoluteUnaligned(axis)),
                "prismatic": (hg.prismatic(axis), pin.JointModelPrismaticUnaligned(axis)),
                "spherical": (hg.spherical(), pin.JointModelSpherical()),
                "planar": (hg.planar("xy"), pin.JointModelPlanar()),
            }
            here, there = joints[kind]
            six = [inertia[i, j] for i, j in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]]
            body = hg.Body(
                name=f"b{b}", mass=mass, inertia=six, center_of_mass=center, position=place, rotation=turn, joint=here, parent=None if parent < 0 else parent
            )
            self.scene.add(body)
            at = self.model.addJoint(parent + 1, there, pin.SE3(rotation(turn), place), f"b{b}")
            self.model.appendBodyToJoint(at, pin.Inertia(mass, center, inertia), pin.SE3.Identity())
            self.kinds.append(kind)
        self.data = self.model.createData()
        self.sim = hg.Simulator(self.scene)

    def state(self, random):
        """Coordinates of both, and the matrix of the other's velocities and its rate times the velocity."""
        ours, theirs, blocks, rates, v = [], [], [], [], []
        for kind in self.kinds:
            n = {"free": 6, "spherical": 3, "planar": 3}.get(kind, 1)
            x = random.normal(size=n)
            own = random.normal(size=n)
            block, rate = np.eye(n), np.zeros(n)
            if kind in ("free", "spherical"):
                turn = rotation(x[-3:])
                quaternion = pin.Quaternion(turn).coeffs()
                ours += [*x[:-3], quaternion[3], *quaternion[:3]]
                theirs += [*x[:-3], *quaternion]
                block = np.kron(np.eye(n // 3), turn.T)
                w = turn.T @ own[-3:]
                rate = -np.kron(np.eye(n // 3), skew(w)) @ block @ own
            elif kind == "planar":
                c, s = np.cos(x[2]), np.sin(x[2])
                ours += [*x]
                theirs += [x[0], x[1], c, s]
                block[:2, :2] = [[c, s], [-s, c]]
                rate[:2] = own[2] * np.array([[-s, c], [-c, -s]]) @ own[:2]
            else:
                ours += [*x]
                theirs += [*x]
            blocks.append(block)
            rates.append(rate)
            v.append(own)
        size = sum(len(r) for r in rates)
        matrix, at = np.zeros((size, size)), 0
        for block in blocks:
            matrix[at : at + len(block), at : at + len(block)] = block
            at += len(block)
        return np.array(ours), np.array(theirs), np.concatenate(v), matrix, np.concatenate(rates)


def close(found, right):
    error = np.max(np.abs(found - right)) / max(np.max(np.abs(right)), 1e-3)
    assert error < 1e-10, error


@pytest.mark.parametrize("seed", range(5))
def test_dry_trees_are_pinocchios(seed):
    tree, random = Tree(seed), np.random.default_rng(100 + seed)
    states = [tree.state(random) for _ in range(20)]
    n = len(states[0][2])
    a, force = random.normal(size=(20, n)), random.normal(size=(20, n))
    v = np.array([s[2] for s in states])
    equations = tree.sim.equations(np.array([s[0] for s in states]))
    mass, bias = equations.mass_matrix(), equations.bias_force(v)
    forward, inverse = equations.forward_dynamics(v, force=force), equations.inverse_dynamics(a, v)
    jacobians = [equations.jacobian(b) for b in range(len(tree.kinds))]
    moved = [equations.acceleration(b, v, a) for b in range(len(tree.kinds))]
    center, kinetic = equations.center_of_mass, equations.kinetic_energy(v)
    for k, (_, q, own, t, rate) in enumerate(states):
        theirs, accelerated = t @ own, t @ a[k] + rate
        full = pin.crba(tree.model, tree.data, q)
        full = np.triu(full) + np.triu(full, 1).T
        close(mass[k], t.T @ full @ t)
        # The rate of the other velocities at constant ones of ours belongs to the bias.
        close(bias[k], t.T @ pin.rnea(tree.model, tree.data, q, theirs, rate))
        close(inverse[k], t.T @ pin.rnea(tree.model, tree.data, q, theirs, accelerated))
        found = pin.aba(tree.model, tree.data, q, theirs, np.linalg.solve(t.T, force[k]))
        close(forward[k], np.linalg.solve(t, found - rate))
        close(center[k], pin.centerOfMass(tree.model, tree.data, q))
        close(kinetic[k], pin.computeKineticEnergy(tree.model, tree.data, q, theirs))
        pin.computeJointJacobians(tree.model, tree.data, q)
        pin.forwardKinematics(tree.model, tree.data, q, theirs, accelerated)
        for b in range(len(tree.kinds)):
            right = pin.getJointJacobian(tree.model, tree.data, b + 1, pin.LOCAL_WORLD_ALIGNED)
            close(jacobians[b][k], right @ t)
            right = pin.getClassicalAcceleration(tree.model, tree.data, b + 1, pin.LOCAL_WORLD_ALIGNED)
            close(moved[b][k], right.vector)


def arm():
    """A free body with a hinged one, in a current, under gravity, in water that couples them."""
    scene = hg.Scene(hg.Fluid(998.0, current=(0.1, -0.05, 0.02)), gravity=(0.0, 0.0, -9.81))
    base = hg.Body(hg.ellipsoid(0.1, 0.07, 0.06), name="base", density=1050.0, actuated=True, drag=hg.Drag(quadratic=2.0))
    scene.add(base)
    scene.add(hg.Body(hg.sphere(0.05), name="hand", density=1200.0, joint=hg.revolute((0, 1, 0)), parent="base", position=(0.2, 0.0, 0.0)))
    scene.add_site("tip", "hand", (0.05, 0.01, -0.02), (0.1, 0.2, 0.3))
    return scene


@pytest.fixture(scope="module")
def wet():
    return hg.Simulator(arm(), 1e-4, fidelity="reduced", integrator="rk4")


def test_accelerations_in_water_are_those_of_a_rollout(wet):
    random = np.random.default_rng(2)
    q, v = wet.integrate(wet.initial_q, 0.3 * random.normal(size=7)), random.normal(size=7)
    u = random.normal(size=wet.control_size)
    equations = wet.equations(q)
    a = equations.forward_dynamics(v, u)
    rollout = wet.rollout(np.tile(u, (4, 1)), q=q, v=v)
    seen = np.array([-25, 48, -36, 16, -3]) @ rollout.v / (12 * wet.dt)
    assert np.max(np.abs(seen - a)) < 1e-7 * np.max(np.abs(a))
    # What inverse dynamics gives is what forward dynamics takes.
    force = random.normal(size=7)
    back = equations.inverse_dynamics(equations.forward_dynamics(v, u, force=force), v, u)
    assert np.max(np.abs(back - force)) < 1e-9 * np.max(np.abs(equations.bias_force(v, u)))
    total, parts = equations.mass_matrix(), [equations.mass_matrix(part) for part in ("rigid", "fluid")]
    assert np.allclose(sum(parts), total, rtol=0, atol=1e-12)
    assert np.all(np.linalg.eigvalsh(parts[1]) > -1e-9)


def test_frames_move_as_their_jacobians_say(wet):
    random = np.random.default_rng(3)
    q, v = wet.integrate(wet.initial_q, 0.3 * random.normal(size=7)), random.normal(size=7)
    point, h = np.array([0.05, 0.01, -0.02]), 1e-6
    turned = [wet.equations(wet.integrate(q, s * h * v)) for s in (1, -1)]
    places = [e.positions[1] + e.rotations[1] @ point for e in turned]
    velocity = wet.equations(q).velocity("hand", v, point)
    assert np.max(np.abs((places[0] - places[1]) / (2 * h) - velocity[:3])) < 1e-8
    assert np.allclose(wet.equations(q).jacobian(1, point) @ v, velocity, atol=1e-14)
    rates = [e.velocity("hand", v, point) for e in turned]
    a = wet.equations(q).acceleration("hand", v, np.zeros(7), point)
    assert np.max(np.abs((rates[0] - rates[1]) / (2 * h) - a)) < 1e-7


def test_configurations_differ_by_what_joins_them(wet):
    random = np.random.default_rng(4)
    q = wet.integrate(wet.initial_q, random.normal(size=(5, 7)))
    xi = random.normal(size=(5, 7))
    assert np.max(np.abs(wet.difference(q, wet.integrate(q, xi)) - xi)) < 1e-12
    with pytest.raises(hg.InputError, match="rows"):
        wet.integrate(q, xi[:3])


def test_linearisations_of_many_states_are_those_of_each(wet):
    random = np.random.default_rng(5)
    q = wet.integrate(wet.initial_q, 0.2 * random.normal(size=(3, 7)))
    v, u = random.normal(size=(3, 7)), random.normal(size=(3, wet.control_size))
    a, b = wet.linearise(q, v, u)
    assert a.shape == (3, 14, 14) and b.shape == (3, 14, wet.control_size)
    for k in range(3):
        _, record = wet.step(wet.state(q[k], v[k]), u[k])
        right = record.jacobians()
        assert np.array_equal(a[k], right[0]) and np.array_equal(b[k], right[1])


def test_sites_are_observed_with_gradients(wet):
    random = np.random.default_rng(6)
    u = random.normal(size=(5, wet.control_size))
    rollout = wet.rollout(u)
    places = rollout.positions[:, 1] + rollout.rotations[:, 1] @ [0.05, 0.01, -0.02]
    assert np.max(np.abs(rollout.observe("site_positions")[:, 0] - places)) < 1e-15
    turned = rollout.rotations[:, 1] @ rotation([0.1, 0.2, 0.3])
    assert np.max(np.abs(rollout.observe("site_rotations")[:, 0] - turned)) < 1e-14
    velocities = np.array([wet.equations(q).velocity("hand", v, [0.05, 0.01, -0.02]) for q, v in zip(rollout.q, rollout.v)])
    assert np.max(np.abs(rollout.observe("site_velocities")[:, 0] - velocities)) < 1e-14
    bars = {name: random.normal(size=(6, 1, k)) for name, k in [("site_positions", 3), ("site_velocities", 6)]}
    gradient = rollout.vjp(observables=bars).controls
    along, h = random.normal(size=u.shape), 1e-4
    values = [sum(np.sum(bar * wet.rollout(u + s * h * along).observe(name)) for name, bar in bars.items()) for s in (1, -1)]
    slope = (values[0] - values[1]) / (2 * h)
    assert abs(np.sum(gradient * along) - slope) < 1e-6 * abs(slope)


def test_rotations_have_tangents_of_one_shape(wet):
    """Those of bodies and of sites: turns about the world's axes, as tangents and as cotangents."""
    random = np.random.default_rng(7)
    u = random.normal(size=(5, wet.control_size))
    rollout, along = wet.rollout(u), random.normal(size=u.shape)
    made = rollout.jvp(controls=along, observables=["rotations", "site_rotations"])
    assert np.array_equal(made.observables["rotations"], made.rotations)
    for name, count in (("rotations", 2), ("site_rotations", 1)):
        turned = made.observables[name]
        assert turned.shape == (6, count, 3) and np.abs(turned).max() > 0
        bar = random.normal(size=turned.shape)
        gradient = rollout.vjp(observables={name: bar}).controls
        assert np.sum(gradient * along) == pytest.approx(np.sum(bar * turned), rel=1e-9)
        with pytest.raises(hg.InputError, match=rf"{name}.*must have the shape \(6, {count}, 3\)"):
            rollout.vjp(observables={name: rollout.observe(name)})
        assert rollout.jacobian(controls=True, of=[name])[name].shape == (6, count, 3, u.size)
    bar = random.normal(size=(6, 2, 3))
    one, other = rollout.vjp(rotations=bar), rollout.vjp(observables={"rotations": bar})
    assert np.allclose(one.controls, other.controls, rtol=1e-12, atol=1e-15)


def test_what_does_not_fit_is_told(wet):
    with pytest.raises(hg.InputError, match="quaternion"):
        wet.equations(2.0 * wet.initial_q + 1.0)
    with pytest.raises(hg.InputError, match="must be a number under 2"):
        wet.equations().jacobian("foot")
    with pytest.raises(hg.InputError, match="rigid"):
        wet.equations().mass_matrix("dry")
    with pytest.raises(hg.InputError, match="one row"):
        wet.equations().bias_force(np.zeros((2, 7)))
    scene = arm()
    scene.add_site("tip", "base")
    with pytest.raises(hg.InputError, match="no other"):
        scene.validate()
    with pytest.raises(hg.InputError, match="number or name"):
        scene.add_site("toe", "foot")


def test_joints_that_follow_others_and_passive_joints():
    """F = (m₁ + armature + r² m₂) a, less what the spring pulls."""
    scene = hg.Scene(fluid=hg.Fluid(density=0.0))
    rail = hg.prismatic((1.0, 0.0, 0.0))
    spring = hg.Passive(stiffness=3.0, rest=0.1, armature=0.4)
    scene.add(hg.Body(name="left", mass=2.0, inertia=(0.1, 0.1, 0.1), joint=rail, actuated=True, passive=spring))
    scene.add(hg.Body(name="right", mass=3.0, inertia=(0.1, 0.1, 0.1), joint=rail, mimic=hg.Mimic("left", ratio=-0.5)))
    sim = hg.Simulator(scene, 0.01)
    assert (sim.q_size, sim.control_size) == (1, 1)
    equations = sim.equations([0.3])
    mass = 2.0 + 0.4 + 0.25 * 3.0
    assert equations.mass_matrix() == pytest.approx(np.array([[mass]]), rel=1e-14)
    assert equations.forward_dynamics([0.0], u=[1.0]) == pytest.approx(np.array([(1.0 - 3.0 * 0.2) / mass]), rel=1e-12)
    assert "left.joint.armature" in sim.parameters
    with pytest.raises(hg.InputError, match="product of both ratios"):
        scene.add(hg.Body(name="third", mass=3.0, inertia=(0.1, 0.1, 0.1), joint=rail, mimic=hg.Mimic("right")))
        hg.Simulator(scene, 0.01)
