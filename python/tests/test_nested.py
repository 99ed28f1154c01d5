"""Python that work calls, and that asks for work of its own: nothing waits for ever, whoever waits for whom.

Programs run in processes of their own, on one thread and on two, where a deadlock runs out of time.
"""

import os
import subprocess
import sys

import pytest

START = """
import os, pickle, signal, threading, time
import numpy as np
import hydrograd as hg
from hydrograd import _bridge, cost

scene = hg.Scene(hg.Fluid(998.0), gravity=(0.0, 0.0, 0.0))
scene.add(hg.Body(hg.sphere(0.05, faces=80), name="ball", density=1100.0, position=(-0.2, 0.0, 0.0), actuated=True))
scene.add(hg.Body(hg.ellipsoid(0.02, 0.04, 0.04, faces=80), name="coin", density=1050.0))
sim = hg.Simulator(scene, 0.01, fidelity="isolated")

class Slow:
    "Takes its time."
    def act(self, seen):
        time.sleep(0.01)
        return np.zeros(6)
"""


def runs(program, folder=None):
    """Runs it to its end, in a folder."""
    code = START + program
    for count in ("1", "2"):
        environment = {**os.environ, "RAYON_NUM_THREADS": count}
        command = [sys.executable, "-c", code]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, cwd=folder)
        assert done.returncode == 0, done.stderr


def test_a_callback_may_ask_for_anything(tmp_path):
    """While every thread is in a controller, or waits for the interpreter's lock to get there."""
    runs(
        """
corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
toml = scene.to_toml()
open("scene.toml", "w").write(toml)
goal = hg.objective.final_position(1, (0.0, 0.0, 0.0))
# Each rollout is new: gaps are measured once.
asked = [
    lambda old: old.summary(),
    lambda old: old.warnings,
    lambda old: old.to_dict(),
    lambda old: old.to_dict(pressure=True),
    lambda old: old.min_gap,
    lambda old: old.velocities,
    lambda old: old.contacts(0),
    lambda old: old.observe("energy"),
    lambda old: old.value(goal),
    lambda old: old.gradient(goal),
    lambda old: old.write_gltf("run.glb"),
    lambda old: old.write_vtk("run"),
    lambda old: pickle.loads(pickle.dumps(old)),
    lambda old: hg.sphere(0.1).volume,
    lambda old: hg.sphere(0.1).triangles(),
    lambda old: hg.mesh(corners, faces),
    lambda old: hg.Scene.from_toml(toml),
    lambda old: hg.Scene.load("scene.toml"),
    lambda old: scene.validate(),
    lambda old: scene.with_shape_parameters({"ball.radius": 0.04}),
    lambda old: sim.with_parameters({"ball.mass": 1.0}),
    lambda old: sim.with_start(v=np.full(12, 0.1)),
    lambda old: sim.with_policy(Slow()),
    lambda old: sim.warnings,
    lambda old: sim.step(sim.state()),
    lambda old: sim.equations().mass_matrix(),
    lambda old: sim.meshes(),
    lambda old: sim.added_mass(),
    lambda old: hg.Simulator(scene, 0.01, fidelity="isolated"),
]
for ask in asked:
    old, during = sim.rollout(steps=3), []
    def progress(done, total):
        if not during:
            ask(old)
            during.append(done < total)
    sim.with_policy(Slow()).rollout_batch(np.zeros((2, 15, 6)), progress=progress)
    assert during == [True]
""",
        tmp_path,
    )


def test_a_controller_may_have_another_thread_simulate():
    runs(
        """
from concurrent.futures import ThreadPoolExecutor
others = ThreadPoolExecutor(4)

class Ahead:
    def __init__(self, submit):
        self.submit = submit
    def act(self, seen):
        state = sim.state(seen.q, seen.v)
        return 0.1 - self.submit(lambda: sim.step(state)[0].v[:6] + sim.rollout(steps=2, state=state).v[-1, :6])

there = sim.with_policy(Ahead(lambda work: others.submit(work).result()))
here = sim.with_policy(Ahead(lambda work: work()))
for one, other in zip(there.rollout_batch(np.zeros((4, 3, 6))), here.rollout_batch(np.zeros((4, 3, 6)))):
    assert np.array_equal(one.q, other.q) and np.abs(one.v[-1]).max() > 0
""",
    )


def test_progress_of_a_run_within_a_controller():
    runs(
        """
slow = sim.with_policy(Slow())

class Follows:
    def __init__(self, stop=False):
        self.stop, self.calls, self.times = stop, [], []
    def act(self, seen):
        here = threading.get_ident()
        def progress(done, total):
            assert threading.get_ident() == here
            self.calls.append((done, total))
            self.times.append(time.perf_counter())
            if self.stop and done:
                raise ZeroDivisionError
        if seen.step == 0:
            try:
                slow.rollout(steps=20, progress=progress)
            except ZeroDivisionError as error:
                assert 0 < error.rollout.steps < 20
                raise
            sim.rollout(steps=2, progress=progress)
        return np.zeros(6)

follows = Follows()
sim.with_policy(follows).rollout(steps=2)
first, last = follows.calls[:-1], follows.calls[-1]
assert first[-1] == (20, 20) and last == (2, 2), follows.calls
assert len(first) > 2 and min(np.diff(follows.times[:-2])) > 0.045
try:
    sim.with_policy(Follows(stop=True)).rollout(steps=2)
    raise SystemExit("it ran")
except ZeroDivisionError:
    pass
""",
    )


def test_batches_within_batches():
    """What the bridges do for torch and JAX, where a controller of a batch calls them."""
    runs(
        """
# As on a machine of two cores, with more members than those.
_bridge.os.cpu_count = lambda: 2
inner = _bridge.physics_of("inner", sim, {"ball.mass": None})
masses = np.array([[0.5], [0.6], [0.7]])

def refuse(b):
    if b == 1:
        raise hg.InputError("not this one")
    return b

class Ahead:
    def act(self, seen):
        try:
            _bridge.each(refuse, range(3))
        except hg.BatchError as error:
            assert error.members == [0, None, 2] and list(error.errors) == [1]
        else:
            raise SystemExit("nothing was refused")
        none = np.zeros(3, dtype=np.int64)
        memory = _bridge.Memory(none, none, np.zeros((3, 2), dtype=bool))
        q, v = np.tile(seen.q, (3, 1)), np.tile(seen.v, (3, 1))
        after = _bridge.advance(inner, q, v, np.full((3, 6), 0.1), masses, np.zeros((3, 0)), memory)
        rolled = _bridge.roll(inner, np.full((3, 2, 6), 0.1), q, v, masses, np.zeros((3, 0)))
        return after.v[:, :6].sum(axis=0) + sum(one.v[-1, :6] for one in rolled)

thinks = sim.with_policy(Ahead())
q, v = np.tile(sim.initial_q, (5, 1)), np.tile(sim.initial_v, (5, 1))
controls, none = np.zeros((5, 3, 6)), np.zeros((5, 0))
values = np.linspace(0.5, 0.9, 5)[:, None]
# Members by the threads of the bridge, and by those of rollout_batch.
outer = _bridge.physics_of("outer", thinks, {"ball.mass": None})
apart = _bridge.roll(outer, controls, q, v, values, none)
together = _bridge.roll(_bridge.physics_of("outer", thinks, None), controls, q, v, none, none)
for one, mass in zip(apart, values[:, 0]):
    assert np.array_equal(one.q, thinks.with_parameters({"ball.mass": mass}).rollout(controls[0]).q)
for one in together:
    assert np.array_equal(one.q, thinks.rollout(controls[0]).q) and np.abs(one.v[-1]).max() > 0
""",
    )


@pytest.mark.parametrize("own", ["progress", "cost"])
def test_a_planner_and_its_callbacks(own):
    runs(
        f"""
own = {own!r}
"""
        + """
q, v = sim.initial_q, sim.initial_v
refused, seen, once = [], [], threading.Lock()

def ask(mpc):
    calls = (mpc.reset, lambda: mpc.set_model(sim), lambda: mpc.control(0.0, q, v), lambda: mpc.run(sim, 2))
    for call in calls:
        try:
            call()
            raise SystemExit("it wasn't refused")
        except hg.UnsupportedError as error:
            refused.append(str(error))

def costs(point):
    time.sleep(0.002)
    seen.append((len(mpc.replans), mpc.model is sim))
    # It is asked by several threads.
    if own == "cost" and once.acquire(blocking=False):
        ask(mpc)
    return 0.0, None, None

def progress(done, total):
    seen.append((len(mpc.replans), mpc.model is sim))
    if own == "progress" and done < total and once.acquire(blocking=False):
        ask(mpc)

terms = [cost.position("ball", (0, 0, 0), 10.0), cost.effort(1e-3), cost.custom(costs)]
mpc = hg.optimize.Mpc(sim, terms, knots=4, hold=2, every=4, iterations=1, first_iterations=2)
run = mpc.run(sim, 40, progress=progress)
assert len(refused) == 4 and all("Mpc." in said for said in refused), refused
counts = [count for count, _ in seen]
assert len(set(counts)) > 2 and counts[-1] == len(mpc.replans) == len(run.replans) == 10
assert all(same for _, same in seen)

# What Ctrl-C leaves to itself is waited for. Shells start programs in the background deaf to it.
signal.signal(signal.SIGINT, signal.default_int_handler)
threading.Timer(0.1, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    mpc.run(sim, 10**5)
    raise SystemExit("it ran")
except KeyboardInterrupt:
    mpc.reset()
assert mpc.replans == []
mpc.set_model(sim.with_parameters({"ball.mass": 0.7}))
assert mpc.model is not sim and mpc.control(0.0, q, v).shape == (6,) and len(mpc.replans) == 1
""",
    )


def test_what_ends_a_batch_ends_its_members():
    """By Ctrl-C, with members that run and members that wait, and by an exception of one: nothing goes on, and the process ends."""
    runs(
        """
signal.signal(signal.SIGINT, signal.default_int_handler)
physics = _bridge.physics_of("slow", sim.with_policy(Slow()), {"ball.mass": None})
masses, none = np.linspace(0.5, 0.9, 8)[:, None], np.zeros((8, 0))
q, v = np.tile(sim.initial_q, (8, 1)), np.tile(sim.initial_v, (8, 1))
started = time.perf_counter()
threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    _bridge.roll(physics, np.zeros((8, 2000, 6)), q, v, masses, none)
    raise SystemExit("it ran")
except KeyboardInterrupt:
    assert time.perf_counter() - started < 5.0

ended = []

def work(b, progress):
    if b == 0:
        raise ZeroDivisionError
    try:
        while True:
            progress(0, 1)
            time.sleep(0.01)
    finally:
        ended.append(b)

try:
    _bridge.each(work, range(50), stops=True)
    raise SystemExit("it ran")
except ZeroDivisionError:
    pass
_bridge._pool(os.getpid()).shutdown()
assert len(ended) < 49 and time.perf_counter() - started < 15.0
""",
    )
