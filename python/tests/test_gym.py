"""The environments: Gymnasium's checks, the same episodes again, and what the tasks reward."""

import copy
import importlib.util
import multiprocessing
import pathlib
import pickle
import subprocess
import sys
import warnings

import numpy as np
import pytest

import hydrograd as hg

gymnasium = pytest.importorskip("gymnasium")

import hydrograd.gym as environments  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402
from hydrograd.tasks import grasp, swimmer  # noqa: E402

ROOT = pathlib.Path(__file__).parents[2]
IDS = ["hydrograd/Grasp-v0", "hydrograd/Swimmer-v0"]


def episode(env, policy, seed, steps=1000):
    """Observations, rewards and the last info."""
    observation, info = env.reset(seed=seed)
    observations, rewards = [observation], []
    for n in range(steps):
        observation, reward, terminated, truncated, info = env.step(policy(n, observation))
        observations.append(observation)
        rewards.append(reward)
        if terminated or truncated:
            break
    return np.array(observations), np.array(rewards), info


def pushes(seed, size=3):
    """Random actions, the same for a seed."""
    random = np.random.default_rng(seed)
    return lambda *_: random.uniform(-1.0, 1.0, size).astype(np.float32)


@pytest.mark.parametrize("name", IDS)
def test_gymnasiums_checks(name):
    drawn = importlib.util.find_spec("matplotlib") is not None
    env = gymnasium.make(name, render_mode="rgb_array" if drawn else None).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env, skip_render_check=not drawn)


@pytest.mark.parametrize("name", IDS)
def test_same_seed_same_episode(name):
    env = gymnasium.make(name)
    first = episode(env, pushes(0), 7, 6)
    again = episode(gymnasium.make(name), pushes(0), 7, 6)
    other = episode(env, pushes(0), 8, 6)
    for one, two in zip(first[:2], again[:2]):
        assert np.array_equal(one, two)
    assert not np.array_equal(first[0][0], other[0][0])
    assert len(np.unique(first[1])) == 6


def test_a_step_is_that_of_the_simulator():
    env = environments.GraspEnv(frame_skip=3)
    env.reset(seed=2)
    state = env.state
    action = np.array([0.5, 2.0, -0.25])
    observation = env.step(action)[0]
    for _ in range(3):
        state, _ = env.simulator.step(state, [250.0, 500.0, -125.0])  # clipped
    assert np.array_equal(env.state.q, state.q) and np.array_equal(env.state.v, state.v)
    assert np.array_equal(observation[:12], np.concatenate([state.q, state.v]))
    assert observation[12] == state.q[3] - state.q[0]
    assert np.array_equal(observation[15:], grasp.gaps(state.q))
    assert env.dt == pytest.approx(0.03)


def test_horizon():
    env = gymnasium.make(IDS[1], max_episode_steps=4)
    _, rewards, info = episode(env, lambda *_: np.zeros(3), 0)
    assert len(rewards) == 4 and info["time"] == pytest.approx(4 * env.unwrapped.dt)
    assert gymnasium.spec(IDS[0]).max_episode_steps == 50


def policies():
    """Those of the benchmark."""
    spec = importlib.util.spec_from_file_location("environments_bench", ROOT / "benches/environments.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_catching_is_rewarded():
    """More than doing nothing, and than the push that would do on dry land."""
    env, bench = gymnasium.make(IDS[0]), policies()
    nothing = episode(env, bench.nothing, 1)
    naive = episode(env, bench.naive_push, 1)
    caught = episode(env, bench.follow_and_close, 1)
    assert not naive[2]["is_success"] and caught[1].sum() > 2.0 * naive[1].sum()
    assert not nothing[2]["is_success"] and nothing[2]["held_for"] == 0.0
    assert caught[2]["is_success"] and caught[2]["held"]
    assert 0.5 <= caught[2]["held_for"] <= 1.0
    assert caught[1].sum() > 4.0 * nothing[1].sum()


def test_swimming_is_rewarded():
    env, bench = gymnasium.make(IDS[1], max_episode_steps=100), policies()
    still = episode(env, bench.nothing, 0)
    swam = episode(env, bench.wave, 0)
    start = swimmer.center_of_mass(env.unwrapped.simulator.initial_q)[0]
    assert swam[2]["x"] > start + 0.3
    assert swam[1].sum() > still[1].sum() + 3.0
    # The reward is distance, less effort.
    env.reset(seed=0)
    before = swimmer.center_of_mass(env.unwrapped.state.q)[0]
    _, reward, _, _, info = env.step(np.array([1.0, 0.0, -1.0]))
    assert reward == pytest.approx((info["x"] - before) / 0.05 - 0.05 * 2.0 / 3.0)


def test_out_of_reach():
    env = environments.GraspEnv(fidelity="isolated")
    env.reset(seed=0, options={"v": [0.0, 0.0, 0.0, 8.0, 0.0, 0.0]})
    ends = [env.step(np.zeros(3))[2] for _ in range(2)]
    assert ends[-1]
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        env.step(np.zeros(3))
    lane = environments.SwimmerEnv(fidelity="isolated")
    _, info = lane.reset(seed=0, options={"q": [0.0, 2.1, 0.0, 0.0, 0.0, 0.0]})
    assert info["y"] == pytest.approx(2.1)
    assert lane.step(np.zeros(3))[2]


@pytest.mark.parametrize("v", [[0, 1e5, -1e5, 0, 0, 0], [0, 0, 0, 0, 1e160, 0]])
def test_where_the_simulator_cannot_go_on_the_episode_ends(v):
    env = environments.GraspEnv()
    start, _ = env.reset(seed=0, options={"v": np.array(v, dtype=float)})
    observation, reward, terminated, truncated, info = env.step(np.ones(3))
    assert terminated and not truncated and reward == 0.0
    assert info["error"].startswith(("UnresolvedError: ", "SolverError: "))
    assert np.isfinite(observation).all() and env.observation_space.contains(observation)
    assert np.array_equal(observation, start)
    env.reset(seed=0)
    assert "error" not in env.step(np.ones(3))[4]


class Stuck:
    """A simulator that can't go on."""

    def __init__(self, simulator):
        self.simulator = simulator

    def rollout(self, *_, **__):
        raise hg.SolverError("stuck")

    def __getattr__(self, name):
        return getattr(self.simulator, name)


def test_a_step_that_fails_is_made_again_with_shorter_ones(monkeypatch):
    env, right = environments.GraspEnv(fidelity="isolated"), environments.GraspEnv(fidelity="isolated")
    for e in (env, right):
        e.reset(seed=4)
    monkeypatch.setattr(env, "_simulator", Stuck(env.simulator))
    action = np.array([0.5, 1.0, -1.0])
    found, wanted = env.step(action), right.step(action)
    assert found[4].pop("refined") and not wanted[4].pop("refined")
    assert not found[2] and found[4] == pytest.approx(wanted[4])
    assert not np.array_equal(found[0], wanted[0]) and np.allclose(found[0], wanted[0], atol=1e-3)
    assert env.state.step == 5
    monkeypatch.setattr(env, "_simulator", right.simulator)
    assert not env.step(action)[4]["refined"]
    # One that was given isn't changed.
    given = environments.GraspEnv(simulator=right.simulator)
    given.reset(seed=4)
    monkeypatch.setattr(given, "_simulator", Stuck(right.simulator))
    given.render_mode = "rgb_array"
    told = given.step(action)[4]
    # As recorders do after the last step.
    assert given.render().shape == (360, 480, 3)
    assert told["error"] == "SolverError: stuck" and not told["is_success"]


def test_wrong_input():
    env = environments.GraspEnv()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(3))
    env.reset(seed=0)
    for wrong, says in (
        (np.zeros(2), r"action: got the shape \(2,\); must have the shape \(3,\)"),
        ([0.0, np.nan, 0.0], "action: got .*nan.*finite"),
        ("left", "action: got 'left'"),
    ):
        with pytest.raises(hg.InputError, match=says):
            env.step(wrong)
    with pytest.raises(hg.InputError, match="options: got .'speed'.*'q' and 'v'"):
        env.reset(options={"speed": 1.0})
    with pytest.raises(hg.InputError, match="q"):
        env.reset(options={"q": np.zeros(4)})
    for settings, says in (
        ({"frame_skip": 0}, "frame_skip: got 0; must be a whole number"),
        ({"frame_skip": 2.5}, "frame_skip"),
        ({"render_mode": "human"}, "render_mode: got 'human'"),
        ({"fidelity": "most"}, "fidelity: got 'most'; must be one of"),
        ({"simulator": environments.SwimmerEnv().simulator}, "simulator: got one with the coordinates"),
        ({"simulator": 3}, "simulator: got 3; must be a hydrograd.Simulator"),
    ):
        with pytest.raises(hg.InputError, match=says):
            environments.GraspEnv(**settings)
    for settings in ({"num_envs": 0}, {"threads": 0}, {"max_episode_steps": -1}):
        with pytest.raises(hg.InputError, match=next(iter(settings))):
            environments.SwimmerVectorEnv(**settings)


def test_other_masses():
    own = environments.GraspEnv().simulator
    heavy = environments.GraspEnv(simulator=own.with_parameters({"coin.mass": 50.0}))
    assert heavy.simulator.parameters["coin.mass"] == 50.0
    first = episode(heavy, pushes(0), 0, 3)[0]
    assert not np.array_equal(first[-1], episode(environments.GraspEnv(), pushes(0), 0, 3)[0][-1])


def test_copies_go_on_alike():
    env = environments.SwimmerEnv(fidelity="isolated")
    episode(env, pushes(0), 0, 2)
    for other in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        assert np.array_equal(other.step(np.ones(3))[0], copy.deepcopy(env).step(np.ones(3))[0])
        assert np.array_equal(other.reset()[0], copy.deepcopy(env).reset()[0])


def test_pictures():
    pytest.importorskip("matplotlib")
    for name in IDS:
        env = gymnasium.make(name, render_mode="rgb_array")
        env.reset(seed=0)
        first = env.render()
        assert first.shape == (360, 480, 3) and first.dtype == np.uint8 and len(np.unique(first)) > 10
        for _ in range(3):
            env.step(np.array([1.0, 0.5, -0.5]))
        assert not np.array_equal(env.render(), first)
        assert gymnasium.make(name).unwrapped.render() is None


def test_pictures_without_matplotlib(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    env = environments.SwimmerEnv(fidelity="isolated", render_mode="rgb_array")
    env.reset(seed=0)
    with pytest.raises(hg.UnsupportedError, match="pip install matplotlib"):
        env.render()


def several(env, steps):
    """What comes of random actions, and the ends."""
    observation, _ = env.reset(seed=3)
    random, out = np.random.default_rng(1), [observation]
    for _ in range(steps):
        actions = random.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        observation, reward, terminated, truncated, info = env.step(actions)
        out += [observation, reward, terminated, truncated, info["time"]]
    env.close()
    return out


def test_many_over_threads_are_those_one_after_the_other():
    def make(mode, **settings):
        return gymnasium.make_vec(
            IDS[1], 3, vectorization_mode=mode, max_episode_steps=4, fidelity="isolated", **settings
        )

    # Ten steps: two episodes cut off, and their new starts.
    right = several(make("sync"), 10)
    for threads in (1, 3):
        env = make(None, threads=threads)
        assert isinstance(env, environments.SwimmerVectorEnv)
        found = several(env, 10)
        assert len(found) == len(right)
        assert all(np.array_equal(one, other) for one, other in zip(found, right))
    assert right[4 + 5 * 3].all() and not right[4].any()  # truncated at the fourth step


def test_some_of_many_can_be_reset():
    env = environments.SwimmerVectorEnv(3, fidelity="isolated")
    env.reset(seed=[1, 2, 3])
    moved = env.step(np.ones((3, 3)))[0]
    observation, info = env.reset(seed=9, options={"reset_mask": np.array([False, True, False])})
    assert np.array_equal(observation[[0, 2]], moved[[0, 2]]) and not np.array_equal(observation[1], moved[1])
    assert info["_time"].tolist() == [False, True, False]
    for wrong, says in (({"seed": [1]}, "seed"), ({"options": {"reset_mask": [True]}}, "reset_mask")):
        with pytest.raises(hg.InputError, match=says):
            env.reset(**wrong)
    with pytest.raises(hg.InputError, match=r"actions: got the shape \(3,\)"):
        env.step(np.zeros(3))
    actions = np.zeros((3, 3))
    actions[2, 0] = np.nan
    before = [e.state.step for e in env.envs]
    with pytest.raises(hg.InputError, match="finite"):
        env.step(actions)
    assert [e.state.step for e in env.envs] == before
    env.close()
    with pytest.raises(hg.InputError, match="closed"):
        env.step(np.zeros((3, 3)))


def test_many_in_other_processes():
    settings = {"fidelity": "isolated", "max_episode_steps": 4}
    env = gymnasium.make_vec(IDS[1], 2, vectorization_mode="async", vector_kwargs={"context": "spawn"}, **settings)
    right = gymnasium.make_vec(IDS[1], 2, vectorization_mode="sync", **settings)
    assert all(np.array_equal(one, other) for one, other in zip(several(env, 5), several(right, 5)))


def told(queue):
    """In a forked process: what a reset says."""
    try:
        environments.SwimmerEnv(fidelity="isolated").reset(seed=0)
        queue.put("nothing")
    except hg.UnsupportedError as error:
        queue.put(str(error))


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no forks here")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_fork_after_simulations_is_told_to_spawn():
    environments.SwimmerEnv(fidelity="isolated").reset(seed=0)
    episode(environments.SwimmerEnv(fidelity="isolated"), pushes(0), 0, 1)
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=told, args=(queue,))
    child.start()
    said = queue.get(timeout=30)
    child.join(timeout=30)
    assert child.exitcode == 0
    assert "spawn" in said


def test_a_fork_before_simulations_runs():
    code = """
import multiprocessing, hydrograd.gym as environments
def run(queue):
    env = environments.SwimmerEnv(fidelity="isolated")
    env.reset(seed=0)
    queue.put(env.step([0.0] * 3)[1])
context = multiprocessing.get_context("fork")
queue = context.Queue()
environments.SwimmerEnv(fidelity="isolated")  # made, but nothing has run
child = context.Process(target=run, args=(queue,))
child.start()
print(queue.get(timeout=60))
child.join()
"""
    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("no forks here")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=90)
    assert done.returncode == 0, done.stderr
    assert np.isfinite(float(done.stdout))


def test_without_gymnasium():
    code = "import sys; sys.modules['gymnasium'] = None; import hydrograd.gym"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.strip().endswith("hydrograd.gym needs Gymnasium 1.1 or later: pip install gymnasium")
