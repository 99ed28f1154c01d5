"""A parameter study and an optimisation over many starts, spread over a Ray cluster.

A ball is pushed past a coin that floats beside its rail, and the water turns the coin. Two questions:

1. How far is the coin turned, against the gap at which the ball passes and the coin's density? One simulation for each
   pair.
2. Which push turns the coin by 0.08 rad at all of many gaps and densities as well as can be? Each step of the descent
   (Adam) takes the mean of the gradients of all starts, data-parallel: every worker has its share of the starts.

    python examples/ray_study.py [--serial] [--workers N] [--address ADDRESS] [--gaps N] [--densities N] [--descent N]
                                 [--out FILE] [--json]

Without an address Ray starts on this machine, with as many processes as there are workers, and ends with the program.
On a cluster, start Ray on every machine (`ray start --head` on the first, `ray start --address FIRST:6379` on the
others), with the same version of this package installed, and give `--address auto` on one of them, or `--address
ray://FIRST:10001` from elsewhere: `ray.init(address=...)` is all that changes. Each worker gets the simulator once,
pickled, and makes it again.

`--serial` does the same without Ray; what comes out is the same to the last bit, and the last line shows it: it ends
with a digest of all numbers.
"""

import argparse
import hashlib
import json
import os
import sys
import time

import numpy as np

import hydrograd as hg

STEPS = 60
BALL, COIN = 0.05, (0.04, 0.01, 0.04)  # radius; semi-axes, m
TARGET = 0.08  # rad
KNOTS = 6
TURN = 3  # entry of q: ball x; coin x, y, angle


def simulator():
    """The ball on a rail along x, the coin in the plane x-y beside it."""
    scene = hg.Scene(hg.Fluid(998.0), gravity=(0.0, 0.0, 0.0), time_step=0.01, steps=STEPS)
    rail = hg.prismatic((1.0, 0.0, 0.0))
    scene.add(hg.Body(hg.sphere(BALL, faces=320), name="ball", density=998.0, joint=rail, actuated=True))
    scene.add(hg.Body(hg.ellipsoid(*COIN, faces=320), name="coin", density=998.0, joint=hg.planar("xy")))
    scene.set_initial(q=(-0.15, 0.0, BALL + COIN[1] + 0.03, 0.0))
    return hg.Simulator(scene, fidelity="reduced", resolved_gap=0.02)


class Worker:
    """Has a simulator, and does one start at a time."""

    def __init__(self, sim):
        self.sim = sim
        self.mass = sim.parameters["coin.mass"]
        self.inertia = {name: sim.parameters[name] for name in sim.parameters if name.startswith("coin.inertia")}

    def run(self, push, gap, density):
        """A push (KNOTS,), N, past a coin at a gap (m) of a density (over the water's)."""
        changes = {"coin.mass": density * self.mass} | {name: density * i for name, i in self.inertia.items()}
        controls = np.repeat(push, STEPS // KNOTS)[:, None]
        start = (-0.15, 0.0, BALL + COIN[1] + gap, 0.0)
        return self.sim.with_parameters(changes).rollout(controls, q=start)

    def turn(self, push, gap, density):
        """How far the coin is turned at the end, rad."""
        return self.run(push, gap, density).q[-1, TURN]

    def gradient(self, push, gap, density):
        """Squared miss of the turn (rad²) and its gradient over the push."""
        rollout = self.run(push, gap, density)
        miss = rollout.q[-1, TURN] - TARGET
        seed = np.zeros_like(rollout.v)
        seed[-1, TURN] = 2.0 * miss
        return miss**2, rollout.vjp(q=seed).controls.reshape(KNOTS, -1).sum(1)


class Serial:
    """All starts one after the other, here."""

    def __init__(self, sim):
        self.worker = Worker(sim)

    def map(self, task, push, starts):
        return [getattr(self.worker, task)(push, *start) for start in starts]

    def close(self):
        pass


class Cluster:
    """The starts dealt out to Ray's workers; results come back in the order of the starts."""

    def __init__(self, sim, workers, address):
        # Nothing is reported to anyone unless it's asked for.
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            import ray
        except ImportError:
            sys.exit("this example needs Ray (pip install ray), or --serial")
        self.ray = ray
        here = {} if address else {"num_cpus": workers, "object_store_memory": 80 * 2**20, "include_dashboard": False}
        try:
            # "local": a new one, even where another runs.
            ray.init(address=address or "local", log_to_driver=False, logging_level="error", **here)
        except ConnectionError as error:
            sys.exit(f"--address {address}: no Ray cluster answers there: {error}")
        shared = ray.put(sim)
        self.workers = [ray.remote(Worker).remote(shared) for _ in range(workers)]

    def map(self, task, push, starts):
        turns = zip(starts, self.workers * len(starts))
        return self.ray.get([getattr(worker, task).remote(push, *start) for start, worker in turns])

    def close(self):
        self.ray.shutdown()


def descend(team, push, starts, steps, say):
    """Adam from a push, on the mean over the starts: the push, and the cost before each step and at the end."""
    first, second, costs = np.zeros(KNOTS), np.zeros(KNOTS), []
    for k in range(1, steps + 2):
        found = team.map("gradient", push, starts)
        # Summed in the order of the starts, whoever computed them.
        costs.append(sum(cost for cost, _ in found) / len(found))
        say(f"step {k - 1}: mean squared miss {costs[-1]:.3e} rad²")
        if k > steps:
            return push, costs
        slope = sum(gradient for _, gradient in found) / len(found)
        first, second = 0.8 * first + 0.2 * slope, 0.99 * second + 0.01 * slope**2
        push = push - 0.1 * (first / (1.0 - 0.8**k)) / (np.sqrt(second / (1.0 - 0.99**k)) + 1e-12)
    raise AssertionError


def draw(file, gaps, densities, turns):
    """The turn against the gap, a curve per density, into a file."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        print("no picture: matplotlib isn't installed (pip install matplotlib)", file=sys.stderr)
        return
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.add_subplot(xlabel="gap, mm", ylabel="turn of the coin, °")
    for density, row in zip(densities, np.degrees(turns).T):
        axes.plot(1e3 * gaps, row, "o-", label=f"{density:.2f} times the water's density")
    axes.legend()
    figure.savefig(file)
    print(f"wrote {file}", file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--serial", action="store_true", help="without Ray")
    parser.add_argument("--workers", type=int, default=2, help="%(default)s")
    parser.add_argument("--address", help="of a running cluster; default: one on this machine for as long as this runs")
    parser.add_argument("--gaps", type=int, default=8, help="%(default)s")
    parser.add_argument("--densities", type=int, default=4, help="%(default)s")
    parser.add_argument("--descent", type=int, default=5, help="steps (%(default)s)")
    parser.add_argument("--out", default="ray_study.png", help="picture; default: %(default)s")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    options = parser.parse_args()
    if min(options.workers, options.gaps, options.densities, options.descent + 1) < 1:
        parser.error("--workers, --gaps and --densities must be at least 1, --descent not negative")
    sim = simulator()
    gaps = np.linspace(0.02, 0.06, options.gaps)
    densities = np.linspace(0.5, 2.0, options.densities)
    starts = [(float(gap), float(density)) for gap in gaps for density in densities]
    push = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0])  # N

    team = Serial(sim) if options.serial else Cluster(sim, options.workers, options.address)
    try:
        begun = time.perf_counter()
        turns = np.array(team.map("turn", push, starts)).reshape(len(gaps), len(densities))
        studied = time.perf_counter()
        found, costs = descend(team, push, starts, options.descent, lambda line: print(line, file=sys.stderr))
        descended = time.perf_counter()
    finally:
        team.close()
    draw(options.out, gaps, densities, turns)
    digest = hashlib.sha256(turns.tobytes() + found.tobytes() + np.array(costs).tobytes()).hexdigest()[:16]
    report = {
        "workers": 0 if options.serial else options.workers,
        "gaps": gaps.tolist(),  # m
        "densities": densities.tolist(),  # over the water's
        "turns": turns.tolist(),  # rad, (gaps, densities)
        "push": found.tolist(),  # N
        "costs": costs,  # rad²
        "digest": digest,
        "seconds": {"study": studied - begun, "descent": descended - studied},
    }
    if options.json:
        print(json.dumps(report))
        return
    print(
        f"{len(starts)} simulations in {studied - begun:.2f} s; "
        f"{len(costs) * len(starts)} gradients in {descended - studied:.2f} s"
    )
    print(f"turned by {np.degrees(turns.min()):.2f}° to {np.degrees(turns.max()):.2f}°")
    print(f"mean squared miss {costs[0]:.3e} -> {costs[-1]:.3e} rad² in {options.descent} steps; digest {digest}")


if __name__ == "__main__":
    main()
