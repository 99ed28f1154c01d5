"""The environments of `hydrograd.gym`: what simple policies get, and how many steps a second.

    python benches/environments.py [--seeds N] [--envs N] [--steps N] [--json]

Returns are means over the seeds 0 … N − 1, whole episodes. The speed is that of random actions, in steps of an
environment (5 steps of the simulator) per second, all environments together. Only those of one run can be compared:
measure on an idle machine.
"""

import argparse
import json
import time

import gymnasium
import numpy as np

import hydrograd.gym  # noqa: F401

GRASP, SWIMMER = "hydrograd/Grasp-v0", "hydrograd/Swimmer-v0"


def nothing(step, observation):
    """No force."""
    return np.zeros(3)


def at_random(step, observation):
    """Any force."""
    return np.random.default_rng([step, *np.abs(observation * 1e6).astype(int) % 1000]).uniform(-1.0, 1.0, 3)


def naive_push(step, observation):
    """400 N on each finger until one is faster than 0.2 m/s: it catches the coin on dry land."""
    push = 0.8 if np.abs(observation[7:9]).max() < 0.2 else 0.0
    return np.array([0.0, push, -push])


def follow_and_close(step, observation):
    """Closes the fingers at 0.3 m/s while the column follows the coin, then presses with 100 N."""
    along, opening = observation[12], observation[14]
    closing = 0.5 * (observation[7] - observation[8])
    column = 5.0 * (along - 1.2) + 5.0 * (observation[9] - observation[6])
    finger = 8.0 * (0.3 - closing) if opening > 0.5 else 0.2
    return np.clip([column, finger, -finger], -1.0, 1.0)


def wave(step, observation):
    """A wave from head to tail, 6 rad/s and 0.8 rad high, a radian apart from hinge to hinge."""
    wanted = 0.8 * np.sin(6.0 * 0.05 * step - np.arange(3))
    return np.clip(10.0 * (wanted - observation[2:5]) - 0.5 * observation[8:], -1.0, 1.0)


POLICIES = {GRASP: (nothing, at_random, naive_push, follow_and_close), SWIMMER: (nothing, at_random, wave)}


def episode(env, policy, seed):
    """Return, steps made again with shorter ones, and the last info."""
    observation, info = env.reset(seed=seed)
    total, refined, step = 0.0, 0, 0
    while True:
        observation, reward, terminated, truncated, info = env.step(policy(step, observation))
        total, step, refined = total + reward, step + 1, refined + info.get("refined", False)
        if terminated or truncated:
            return total, refined, info


def returns(name, seeds):
    """For each policy."""
    env, rows = gymnasium.make(name), []
    for policy in POLICIES[name]:
        episodes = [episode(env, policy, seed) for seed in range(seeds)]
        totals = [total for total, _, _ in episodes]
        rows.append(
            {
                "policy": policy.__name__,
                "mean": float(np.mean(totals)),
                "least": min(totals),
                "most": max(totals),
                "successes": sum(bool(info.get("is_success")) for _, _, info in episodes),
                "refined": sum(refined for _, refined, _ in episodes),
                "errors": sum("error" in info for _, _, info in episodes),
            }
        )
    return rows


def speeds(name, count, steps):
    """Steps a second, by the way in which many are stepped."""
    rows = {}
    # Processes can't be forked from one that has run simulations.
    for label, mode, settings in (
        ("async", "async", {"vector_kwargs": {"context": "spawn"}}),
        ("sync", "sync", {}),
        ("threads", "vector_entry_point", {}),
    ):
        envs = gymnasium.make_vec(name, count, vectorization_mode=mode, **settings)
        envs.reset(seed=0)
        envs.action_space.seed(0)
        actions = [envs.action_space.sample() for _ in range(steps)]
        start = time.perf_counter()
        for action in actions:
            envs.step(action)
        rows[label] = count * steps / (time.perf_counter() - start)
        envs.close()
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=20, help="%(default)s")
    parser.add_argument("--envs", type=int, default=8, help="%(default)s")
    parser.add_argument("--steps", type=int, default=45, help="of all together, below an episode's (%(default)s)")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    report = {
        name: {"returns": returns(name, options.seeds), "speeds": speeds(name, options.envs, options.steps)}
        for name in POLICIES
    }
    if options.json:
        print(json.dumps(report))
        return
    for name, found in report.items():
        print(name)
        for row in found["returns"]:
            print(
                f"  {row['policy']:17} {row['mean']:7.2f} ({row['least']:.2f} to {row['most']:.2f})"
                + (f", {row['successes']} of {options.seeds} succeed" if name == GRASP else "")
                + f"; {row['refined']} steps refined, {row['errors']} errors"
            )
        print("  steps a second: " + ", ".join(f"{label} {speed:.0f}" for label, speed in found["speeds"].items()))


if __name__ == "__main__":
    main()
