"""What Python costs over Rust: the same rollouts, gradients and single steps, both sides in turns.

    python benches/overhead.py [--rounds N]

Prints a row a scene: microseconds a step of a rollout, of a rollout with its gradient, and of a single `step` call, in Rust and
in Python, the least of all rounds. Builds the Rust side (`cargo bench --bench overhead`).
"""

import argparse
import json
import pathlib
import subprocess
import time

import hydrograd as hg

ROOT = pathlib.Path(__file__).parents[1]
CASES = [
    ("kirchhoff_ellipsoid", "isolated", 1000),
    ("two_spheres", "isolated", 1000),
    ("two_spheres", "reduced", 300),
    ("grasp", "auto", 200),
]


def seconds(call):
    """Seconds of a call."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def python_side(sim, steps):
    """Seconds a step, as the Rust side gives them."""
    goal = hg.objective.final_velocity(0, 0.0)

    def one_by_one():
        state = sim.state()
        for _ in range(steps):
            state, _ = sim.step(state)

    calls = {
        "rollout": lambda: sim.rollout(steps=steps),
        "gradient": lambda: sim.rollout(steps=steps).gradient(goal),
        "step": one_by_one,
    }
    return {kind: seconds(call) / steps for kind, call in calls.items()}


def rust_side(process):
    """What the Rust side measures next."""
    process.stdin.write("\n")
    process.stdin.flush()
    return json.loads(process.stdout.readline())


def measure(name, fidelity, steps, rounds):
    """The least of all rounds, in Rust and in Python."""
    scene = hg.Scene.load(ROOT / f"examples/scenes/{name}.toml")
    sim = hg.Simulator(scene, fidelity=fidelity)
    command = ["cargo", "bench", "--quiet", "--bench", "overhead", "--", name, fidelity, str(steps)]
    least = [{}, {}]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        for _ in range(rounds):
            for best, found in zip(least, (rust_side(process), python_side(sim, steps)), strict=True):
                for kind, value in found.items():
                    best[kind] = min(value, best.get(kind, value))
        process.stdin.close()
    return least


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=40)
    rounds = parser.parse_args().rounds
    print("| scene | fidelity | steps | rollout, µs/step: Rust, Python | with gradient | `step`, µs: Rust, Python | more |")
    print("|---|---|---|---|---|---|---|")
    for name, fidelity, steps in CASES:
        rust, python = measure(name, fidelity, steps, rounds)

        def pair(kind, rust=rust, python=python):
            a, b = rust[kind], python[kind]
            return f"{1e6 * a:.1f}, {1e6 * b:.1f} ({100 * (b / a - 1):+.1f} %)"

        step = f"{1e6 * rust['step']:.1f}, {1e6 * python['step']:.1f}"
        more = 1e6 * (python["step"] - rust["step"])
        print(f"| {name} | {fidelity} | {steps} | {pair('rollout')} | {pair('gradient')} | {step} | {more:.1f} |")


if __name__ == "__main__":
    main()
