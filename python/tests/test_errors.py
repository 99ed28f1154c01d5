"""Wrong input: an exception of the tree, with a message that says what would be right."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import hydrograd as hg


def test_one_tree():
    kinds = ["Input", "Mesh", "File", "Solver", "Unresolved", "Unsupported", "Device", "Batch", "Internal"]
    for kind in kinds:
        assert issubclass(getattr(hg, kind + "Error"), hg.Error)
    assert issubclass(hg.InputError, ValueError) and issubclass(hg.FileError, OSError)
    assert not issubclass(hg.Error, ValueError)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (np.zeros((3, 5)), r"shape \(3, 5\); must have the shape \(steps, 6\)"),
        (np.zeros(6), r"shape \(6,\)"),
        (np.full((2, 6), np.nan), r"controls\[0, 0\]: got NaN; must be finite"),
        (np.full((2, 6), np.inf), "must be finite"),
        (np.zeros((2, 6), dtype=object), "dtype object"),
        (np.zeros((2, 6), dtype=complex), "dtype complex"),
        ([["a"] * 6], "dtype <U1"),
        ([[1.0, 2.0], [3.0]], "must be numbers"),
        ({"u": 1}, "dtype object"),
    ],
)
def test_controls(sim, given, says):
    with pytest.raises(hg.InputError, match=says):
        sim.rollout(given)


def test_whole_numbers_and_other_orders_are_numbers(sim):
    ones = np.ones((2, 6), dtype=np.int32)
    same = [ones.tolist(), np.asfortranarray(ones), np.ones((4, 12))[::2, ::2], ones.astype(np.float32), ones > 0]
    right = sim.rollout(ones).q
    for given in same:
        assert np.array_equal(sim.rollout(given).q, right)


def test_no_steps(sim):
    rollout = sim.rollout(np.zeros((0, 6)))
    assert rollout.q.shape == (1, 14)
    assert rollout.vjp(q=np.ones((1, 12))).controls.shape == (0, 6)


def test_cotangents(sim):
    rollout = sim.rollout(steps=2)
    with pytest.raises(hg.InputError, match=r"vjp: positions.*\(3, 2, 3\)"):
        rollout.vjp(positions=np.zeros((2, 2, 3)))
    with pytest.raises(hg.InputError, match="must be finite"):
        rollout.vjp(v=np.full((3, 12), np.nan))
    with pytest.raises(TypeError):
        rollout.vjp(np.zeros((3, 2, 3)))


def test_bodies():
    for wrong in ({"mass": -1.0}, {"density": float("nan")}, {"position": (1, 2)}, {"inertia": "x"}):
        with pytest.raises(hg.InputError):
            hg.Body(hg.sphere(1.0), **wrong)
    with pytest.raises(TypeError, match="weight"):
        hg.Body(hg.sphere(1.0), weight=1.0)
    with pytest.raises(hg.InputError, match="radius"):
        hg.sphere(-1.0)
    with pytest.raises(hg.InputError, match="faces"):
        hg.sphere(1.0, faces=0)
    with pytest.raises(hg.InputError, match="xy"):
        hg.planar("xz")
    with pytest.raises(hg.InputError, match="tangential"):
        hg.Drag(part="all")


def test_scenes():
    scene = hg.Scene()
    with pytest.raises(hg.InputError):
        hg.Simulator(scene)  # no bodies
    scene.add(hg.Body(hg.sphere(1.0)))
    with pytest.raises(hg.InputError, match="mass"):
        hg.Simulator(scene)
    with pytest.raises(hg.InputError, match="parent"):
        scene.add(hg.Body(mass=1.0, parent=7))
    with pytest.raises(hg.InputError, match='"body 0"'):
        scene.index("coin")
    with pytest.raises(hg.FileError, match="no such file"):
        hg.Scene.load("nowhere.toml")
    with pytest.raises(hg.FileError, match="line 1"):
        hg.Scene.from_toml("x = ")
    for number in (-1.0, float("nan")):
        wrong = hg.Scene(hg.Fluid(number))
        wrong.add(hg.Body(hg.sphere(1.0), density=1.0))
        with pytest.raises(hg.InputError, match="density"):
            hg.Simulator(wrong)


def test_meshes(tmp_path):
    vertices, faces = hg.sphere(1.0, faces=80).triangles()
    with pytest.raises(hg.MeshError):
        hg.mesh(vertices, faces[1:])  # a hole
    with pytest.raises(hg.MeshError):
        hg.mesh(vertices, faces[:, ::-1])  # inside out
    for wrong in (faces + 1, faces - 1, faces + 0.5):
        with pytest.raises(hg.InputError, match="numbers of vertices"):
            hg.mesh(vertices, wrong)
    with pytest.raises(hg.InputError, match=r"\(n, 3\)"):
        hg.mesh(vertices[:, :2], faces)
    with pytest.raises(hg.InputError):
        hg.mesh(vertices)
    with pytest.raises(hg.FileError):
        hg.mesh(tmp_path / "nothing.obj")


def test_settings(sim):
    scene = sim.scene
    for wrong in ({"dt": 0.0}, {"dt": float("nan")}, {"tolerance": -1.0}, {"fidelity": "most"}, {"integrator": "euler"}):
        with pytest.raises(hg.InputError, match="simulator"):
            hg.Simulator(scene, **wrong)
    with pytest.raises(hg.InputError, match="whole number"):
        hg.Simulator(scene, faces=-1)
    with pytest.raises(hg.InputError, match='must be one of "cpu", "gpu"'):
        hg.Simulator(scene, backend="tpu")
    assert sim.backend == "cpu"
    try:
        assert hg.Simulator(scene, fidelity="full", faces=80, backend="gpu").backend == "gpu"
    except hg.DeviceError as error:
        assert "adapter" in str(error)  # a machine without one
    with pytest.raises(hg.Error):
        hg.Simulator(scene, method="exact", fidelity="full").rollout(steps=1)
    with pytest.raises(hg.InputError, match="ball.mass"):
        sim.with_parameters({"weight": 1.0})
    with pytest.raises(hg.InputError):
        sim.with_parameters({"ball.mass": -1.0})


def test_what_the_water_does_not_resolve():
    scene = hg.Scene()
    rail = hg.prismatic((1, 0, 0))
    scene.add(hg.Body(hg.sphere(0.1), density=998.0, position=(-0.15, 0, 0), joint=rail))
    scene.add(hg.Body(hg.sphere(0.1), density=998.0, position=(0.15, 0, 0), locked=True, joint=rail))
    sim = hg.Simulator(scene, faces=80)
    with pytest.raises(hg.UnresolvedError, match="t = "):
        sim.rollout(steps=100, v=[1.0, 0.0])


def test_states(sim):
    with pytest.raises(hg.InputError, match=r"\(14,\)"):
        sim.state(q=np.zeros(3))
    with pytest.raises(hg.InputError, match="length 1"):
        sim.state(q=np.zeros(14))
    with pytest.raises(hg.InputError, match=r"\(6,\)"):
        sim.step(sim.state(), np.zeros(5))
    with pytest.raises(hg.InputError, match="held: got 1 numbers; must be 2, one a body"):
        sim.state(held=[True])
    state = sim.state(step=3, mode=2, held=[False, True])
    assert state.step == 3 and state.mode == 2 and state.held.tolist() == [False, True]
    assert sim.state().mode == 0 and sim.state().held.tolist() == [False, False]
    scene = hg.Scene()
    scene.add(hg.Body(hg.sphere(1.0), density=1.0))
    other = hg.Simulator(scene, fidelity="isolated")
    with pytest.raises(hg.InputError, match="state"):
        other.step(sim.state())
    with pytest.raises(hg.InputError, match="one or the other"):
        sim.rollout(state=sim.state(), q=sim.initial_q)


def test_ctrl_c_within_a_second(sim):
    """A rollout of hours ends at once, and so do making a large simulator and a comparison."""
    # Where the tests run in the background, the signal may be ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    scene = hg.Scene()
    scene.add(hg.Body(hg.sphere(1.0), density=1000.0))
    for work in (
        lambda: sim.rollout(np.zeros((1_000_000, 6))),
        lambda: hg.Simulator(scene, fidelity="full", faces=8000),
        lambda: hg.tradeoff(scene, budget=600.0),
    ):
        sent = []

        def interrupt():
            time.sleep(0.2)
            sent.append(time.monotonic())
            os.kill(os.getpid(), signal.SIGINT)

        thread = threading.Thread(target=interrupt)
        thread.start()
        with pytest.raises(KeyboardInterrupt):
            work()
        thread.join()
        assert time.monotonic() - sent[0] < 1.0
    signal.signal(signal.SIGINT, before)


def test_other_threads_run_meanwhile(sim):
    """The interpreter's lock is free during a rollout."""
    count, done = 0, threading.Event()

    def run():
        sim.rollout(np.zeros((40, 6)))
        done.set()

    thread = threading.Thread(target=run)
    thread.start()
    while not done.is_set():
        count += 1
        time.sleep(0.001)
    thread.join()
    assert count > 10


def test_a_scene_is_free_while_something_is_made_of_it():
    """Other threads may change it."""
    scene, done = hg.Scene(), []
    scene.add(hg.Body(hg.sphere(1.0), name="ball", density=1000.0))

    def make():
        done.append(hg.Simulator(scene, fidelity="full", faces=2000).body_names)

    thread, count = threading.Thread(target=make), 0
    thread.start()
    while thread.is_alive():
        scene.set_initial()
        count += 1
        time.sleep(0.001)
    thread.join()
    assert done == [["ball"]] and count > 5


def test_counts_that_are_none(sim):
    for name, call in (
        ("steps", lambda: sim.rollout(steps=-1)),
        ("steps", lambda: sim.rollout(steps=2.5)),
        ("steps", lambda: sim.rollout(steps=10**30)),
        ("step", lambda: sim.state(step=-1)),
        ("faces", lambda: hg.Simulator(sim.scene, faces=-1)),
        ("rank", lambda: hg.Simulator(sim.scene, rank=-3)),
        ("steps", lambda: hg.Scene(steps=-1)),
        ("faces", lambda: hg.sphere(1.0, faces=-1)),
        ("shift", lambda: hg.optimize.ilqr(sim, [hg.cost.effort(1.0)], knots=2, shift=-1)),
        ("index", lambda: hg.objective.final_velocity(-1, 0.0)),
        (r"entries\[1\]", lambda: hg.cost.observable("positions", [0, -1], [0.0, 0.0], 1.0)),
        (r"ranks\[0\]", lambda: hg.tradeoff(sim.scene, ranks=[2.5])),
    ):
        with pytest.raises(hg.InputError, match=f"^{name}: .*whole number that isn't negative"):
            call()


def test_lists_of_a_body():
    shape = hg.box(0.1, 0.1, 0.1)
    for given, says in (
        ({"parent": -1}, "parent: got -1; must be the name of a body, or its number"),
        ({"collision": [shape, 3]}, r"collision\[1\]: got 3; must be a shape"),
        ({"collision": [(shape,)]}, r"collision\[0\]: .*must be a shape"),
        ({"collision": shape}, "collision: .*must be a list"),
        ({"collision": []}, "collision: got no pieces; give some, or leave it out"),
        ({"refine": [(1, 2)]}, r"refine\[0\]: got \(1, 2\); must be \(center, radius, edge\)"),
    ):
        with pytest.raises(hg.InputError, match='body "crate": ' + says):
            hg.Body(shape, name="crate", density=1.0, **given)
    pieces = [shape, (shape, (0, 0, 0.1)), (shape, (0, 0, 0.1), (0, 0, 1))]
    assert hg.Body(shape, density=1.0, collision=pieces, refine=((np.zeros(3), 0.1, 0.01),)).name == ""


def test_a_failing_step_keeps_what_ran():
    """Two balls that fall through one another, dry of contact: overlap ends the run."""
    scene = hg.Scene(gravity=(0.0, 0.0, -9.81))
    scene.add(hg.Body(hg.sphere(0.05, faces=80), joint=hg.fixed(), density=1000.0))
    scene.add(hg.Body(hg.sphere(0.05, faces=80), density=8000.0, position=(0.0, 0.0, 0.15)))
    sim = hg.Simulator(scene, 0.01, fidelity="reduced")
    with pytest.raises(hg.Error) as caught:
        sim.rollout(steps=100)
    partial = caught.value.rollout
    assert 0 < partial.steps == caught.value.step < 100 and caught.value.time == pytest.approx(0.01 * partial.steps)
    assert np.array_equal(partial.q, sim.rollout(steps=partial.steps).q)


def test_a_cost_without_terms(sim):
    with pytest.raises(hg.InputError, match="problem: cost: got no terms"):
        hg.optimize.ilqr(sim, [], knots=2)


def test_more_steps_than_there_can_be():
    """In a process of its own, which ends where they aren't refused before memory is taken for them."""
    program = """
import hydrograd as hg
from hydrograd import cost

scene = hg.Scene()
scene.add(hg.Body(hg.sphere(0.1), name="ball", density=1000.0, actuated=True))
driven = hg.Simulator(scene, 0.01, fidelity="isolated")
still = hg.Scene()
still.add(hg.Body(hg.sphere(0.1), density=1000.0))
still = hg.Simulator(still, 0.01, fidelity="isolated")
goal = hg.objective.final_velocity(0, 0.0)
terms = [cost.effort(1.0)]
for sim in (driven, still):
    for steps in (10**12, 2**61):
        for call in (
            lambda: sim.rollout(steps=steps),
            lambda: sim.gradient_in_parts(goal, steps=steps),
            lambda: hg.optimize.ilqr(sim, terms, knots=steps),
            lambda: hg.optimize.ilqr(sim, terms, knots=steps, hold=steps),
            lambda: hg.optimize.Mpc(sim, terms, knots=steps),
        ):
            try:
                call()
                raise SystemExit("it ran")
            except hg.Error as error:
                assert "steps" in str(error) and "must be at most" in str(error), error
try:
    still.gradient_in_parts(goal, [[]], steps=3)
    raise SystemExit("it ran")
except hg.InputError as error:
    assert str(error).startswith("gradient_in_parts: steps: got 3; must be 1"), error
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
