"""How `Simulator.rollout_batch` scales with cores: grasps of random forces on one core and on several.

Each number of cores is measured in processes of their own (RAYON_NUM_THREADS), in turns, and the best of some rounds
counts; what comes out must be that of the rollouts one by one, to the last bit.

    python benches/batch.py [--rollouts N] [--steps N] [--cores 1,2] [--rounds N] [--fidelity NAME] [--json]

Measure on an idle machine: what else runs takes its share of the cores.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import time

import numpy as np

import hydrograd as hg
from hydrograd.tasks import grasp


def digest(rollouts):
    """Of all states, to the last bit."""
    out = hashlib.sha256()
    for rollout in rollouts:
        out.update(rollout.q.tobytes())
        out.update(rollout.v.tobytes())
    return out.hexdigest()


def measure(options):
    """In a process with so many threads: the time of a batch, and what came out."""
    sim = hg.Simulator(grasp.scene(), fidelity=options.fidelity)
    # Smooth pushes, a quarter of a second long, with which most fingers close.
    random = np.random.default_rng(0)
    pushes = random.uniform(
        [-100.0, 100.0, -200.0], [100.0, 200.0, -100.0], (options.rollouts, options.steps // 25 + 1, 3)
    )
    controls = np.repeat(pushes, 25, axis=1)[:, : options.steps]
    sim.rollout_batch(controls[:2, :10])
    start = time.perf_counter()
    batch = sim.rollout_batch(controls)
    found = {"seconds": time.perf_counter() - start, "digest": digest(batch)}
    if options.alone:
        start = time.perf_counter()
        found["digest_alone"] = digest([sim.rollout(u) for u in controls])
        found["seconds_alone"] = time.perf_counter() - start
    return found


def run(options, cores, alone):
    """The same in a child."""
    command = [sys.executable, __file__, "--measure", "--rollouts", options.rollouts, "--steps", options.steps]
    command += ["--fidelity", options.fidelity] + ["--alone"] * alone
    environment = {**os.environ, "RAYON_NUM_THREADS": str(cores)}
    done = subprocess.run(list(map(str, command)), env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


def numbers(text):
    """Whole numbers of at least 1, with commas between."""
    found = [int(part) for part in text.split(",")]
    if min(found) < 1:
        raise ValueError
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rollouts", type=int, default=64, help="%(default)s")
    parser.add_argument("--steps", type=int, default=grasp.STEPS, help="%(default)s")
    parser.add_argument("--cores", type=numbers, default=[1, 2], help="1,2")
    parser.add_argument("--rounds", type=int, default=2, help="%(default)s")
    parser.add_argument("--fidelity", default="reduced", help="%(default)s")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--measure", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--alone", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if min(options.rollouts, options.steps, options.rounds) < 1:
        parser.error("--rollouts, --steps and --rounds must be at least 1")
    if options.measure:
        print(json.dumps(measure(options)))
        return
    alone = run(options, options.cores[0], alone=True)
    runs = {cores: [] for cores in options.cores}
    runs[options.cores[0]].append(alone)
    for number in range(options.rounds):
        for k, cores in enumerate(options.cores):
            if number > 0 or k > 0:
                runs[cores].append(run(options, cores, alone=False))
    results = {cores: min(found, key=lambda r: r["seconds"]) for cores, found in runs.items()}
    first = results[options.cores[0]]
    same = {r["digest"] for found in runs.values() for r in found} == {alone["digest_alone"]}
    speedup = {cores: first["seconds"] / r["seconds"] for cores, r in results.items()}
    if options.json:
        report = {"rollouts": options.rollouts, "steps": options.steps, "same_to_the_bit": same}
        report["cores"] = {cores: {"seconds": r["seconds"], "speedup": speedup[cores]} for cores, r in results.items()}
        print(json.dumps(report))
    else:
        print(f"one by one: {alone['seconds_alone']:.2f} s")
        for cores, result in results.items():
            factor = f"{speedup[cores]:.2f} times as fast as with {options.cores[0]}"
            print(f"{cores} {'core' if cores == 1 else 'cores'}: {result['seconds']:.2f} s, {factor}")
        equal = "the same to the last bit" if same else "NOT the same"
        print(
            f"{options.rollouts} rollouts of {options.steps} steps: {equal} as one by one, with every number of cores"
        )
    if not same:
        sys.exit(1)


if __name__ == "__main__":
    main()
