"""What Python costs over Rust: the same rollouts, gradients and single steps on both sides, in one run.

    python benches/overhead.py

Prints a row a scene: microseconds a step of a rollout, of a rollout with its gradient, and of a single `step` call, in Rust and
in Python, the least of some rounds each. Builds the Rust side (`cargo bench --bench overhead`).
"""

import json
import pathlib
import subprocess
import time

import hydrograd as hg

ROOT = pathlib.Path(__file__).parents[1]
# As benches/overhead.rs has it.
ROUNDS = 15
CASES = [
    ("kirchhoff_ellipsoid", "isolated", 1000),
    ("two_spheres", "isolated", 1000),
    ("two_spheres", "reduced", 300),
    ("grasp", "auto", 200),
]


def seconds(call):
    """The shortest of some calls, s."""
    least = float("inf")
    for _ in range(ROUNDS):
        start = time.perf_counter()
        call()
        least = min(least, time.perf_counter() - start)
    return least


def measure(name, fidelity, steps):
    """Seconds a step in Python, as the Rust side gives them."""
    scene = hg.Scene.load(ROOT / f"examples/scenes/{name}.toml")
    sim = hg.Simulator(scene, fidelity=fidelity)
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


def main():
    arguments = [str(part) for case in CASES for part in case]
    command = ["cargo", "bench", "--quiet", "--bench", "overhead", "--", *arguments]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    in_rust = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    print("| scene | fidelity | steps | rollout, µs/step: Rust, Python | with gradient | `step`, µs: Rust, Python | more |")
    print("|---|---|---|---|---|---|---|")
    for case, rust in zip(CASES, in_rust, strict=True):
        python = measure(*case)

        def pair(kind, rust=rust, python=python):
            a, b = rust[kind], python[kind]
            return f"{1e6 * a:.1f}, {1e6 * b:.1f} ({100 * (b / a - 1):+.1f} %)"

        more = 1e6 * (python["step"] - rust["step"])
        name, fidelity, steps = case
        step = f"{1e6 * rust['step']:.1f}, {1e6 * python['step']:.1f}"
        print(f"| {name} | {fidelity} | {steps} | {pair('rollout')} | {pair('gradient')} | {step} | {more:.1f} |")


if __name__ == "__main__":
    main()
