"""Small scenes through which the bridges are differentiated, with numbers to begin at."""

import dataclasses

import numpy as np

import hydrograd as hg


@dataclasses.dataclass(frozen=True)
class Case:
    """A simulator and where a rollout of it begins; the quaternions aren't those of no turn."""

    sim: hg.Simulator
    controls: np.ndarray
    q: np.ndarray
    v: np.ndarray
    parameters: dict[str, float]


def _case(sim, steps, names, force):
    random = np.random.default_rng(11)
    q = sim.initial_q
    for i, name in enumerate(sim.q_names):
        if name.endswith(".qw"):
            q[i : i + 4] = np.array([0.9, 0.2, -0.3, 0.25]) / np.linalg.norm([0.9, 0.2, -0.3, 0.25])
    v = sim.initial_v + random.normal(scale=0.05, size=sim.v_size)
    controls = random.normal(scale=force, size=(steps, sim.control_size))
    return Case(sim, controls, q, v, {name: sim.parameters[name] for name in names})


def _ball_and_coin():
    scene = hg.Scene(hg.Fluid(998.0, current=(0.02, 0.0, 0.0)))
    rail = hg.prismatic((1.0, 0.0, 0.0))
    ball = hg.Body(hg.sphere(0.05), name="ball", density=1100.0, position=(-0.12, 0.0, 0.0), joint=rail, actuated=True)
    drag = hg.Drag(linear=20.0, part="total", quadratic=0.5, quadratic_part="total")
    scene.add(ball)
    scene.add(hg.Body(hg.ellipsoid(0.02, 0.04, 0.03), name="coin", density=1050.0, drag=drag))
    return scene


def coupled(fidelity="reduced", steps=4):
    """A ball driven along a rail beside a free coin."""
    sim = hg.Simulator(_ball_and_coin(), 0.01, fidelity=fidelity, faces=40, tolerance=1e-13)
    return _case(sim, steps, ["ball.mass", "coin.drag.linear", "fluid.density"], 0.3)


# Where surfaces touch, m.
GAP = 0.004


def touching(contact=True):
    """A free ball that is thrown on a floor, spinning, and pushed on the way."""
    law = hg.Contact(stiffness=2e4, dissipation=0.2, friction=0.4, gap=GAP, width=5e-4) if contact else None
    scene = hg.Scene(hg.Fluid(998.0), gravity=(0.0, 0.0, -9.81), contact=law)
    scene.add_wall((0.0, 0.0, -0.1), (0.0, 0.0, 1.0))
    scene.add(hg.Body(hg.sphere(0.1, faces=80), name="ball", density=2000.0, position=(0.0, 0.0, GAP), actuated=True))
    sim = hg.Simulator(scene, 0.002, fidelity="isolated")
    names = ["ball.mass", "contact.stiffness", "contact.friction"] if contact else []
    case = _case(sim, 8, names, [2.0, 2.0, 2.0, 0.1, 0.1, 0.1])
    return dataclasses.replace(case, v=np.array([0.3, -0.1, -0.5, 0.5, 1.0, 0.2]))


def governed():
    """A ball under the scene's own PD controller, with its gains."""
    scene = hg.Scene(time_step=0.02)
    scene.add(hg.Body(hg.sphere(0.1), name="ball", density=1100.0, joint=hg.prismatic((0, 0, 1)), actuated=True))
    pd = '[controller]\nkind = "pd"\ntarget = [0.3]\nstiffness = [4.0]\ndamping = [2.0]\n'
    return hg.Simulator(hg.Scene.from_toml(scene.to_toml() + "\n" + pd), fidelity="isolated")


def locking():
    """A ball that the scene's controller pushes until it passes 2 cm, and then holds, beside one that swings by a
    motion of time."""
    scene = hg.Scene(time_step=0.02)
    rail = hg.prismatic((1, 0, 0))
    scene.add(hg.Body(hg.sphere(0.1), name="ball", density=1000.0, joint=rail, actuated=True))
    scene.add(
        hg.Body(
            hg.sphere(0.1),
            name="other",
            density=1000.0,
            position=(0.0, 0.5, 0.0),
            joint=rail,
            motion=[hg.Motion.sine(0.05, 1.0)],
        )
    )
    push = '[controller]\nkind = "push-then-lock"\nbody = "ball"\nforce = 8.0\nstop_at = 0.02\n'
    return hg.Simulator(hg.Scene.from_toml(scene.to_toml() + "\n" + push), fidelity="reduced")


def passive():
    """A coin that sinks: nothing drives it."""
    scene = hg.Scene(gravity=(0.0, 0.0, -9.81))
    scene.add(hg.Body(hg.ellipsoid(0.01, 0.04, 0.04), name="coin", density=2000.0))
    return hg.Simulator(scene, 0.01, fidelity="isolated")
