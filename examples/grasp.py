"""An underwater grasp, found by gradients and SciPy: the twin of grasp.rs.

A gripper closes on a coin as it would on dry land. There it catches it; under water the fingers press out the water
between them, and the coin with it, and close behind it. Descending the gradient of the whole trajectory, contact and
water included, finds forces that catch it.

The unknowns are 33 numbers: each of the three forces at eleven knots, within ±500 N. The descent (L-BFGS-B) has two
stages, because a trajectory through a collision is a rugged thing to descend: first the approach alone, to where the
coin lies well between the fingers before they touch it; from there the whole trajectory, to a coin that is held.

    python examples/grasp.py [--out FILE] [--json] [--approach N] [--hold N]
    python examples/grasp.py --random N [--seed S] [--pushes N] [--json]

FILE is a picture of naive and found forces (PNG, SVG or PDF, by its ending). With --random N coins are caught that nobody
tuned for, by hg.optimize.grasp: their size, thickness, density, tilt and place, and the friction, are drawn by a seed.
"""

import argparse
import dataclasses
import json
import pathlib
import sys
import time

import numpy as np
from scipy.optimize import minimize

import hydrograd as hg
from hydrograd.tasks import grasp
from hydrograd.tasks.grasp import COIN_TURN, COIN_Y, COIN_Z, COLUMN, FINGERS

LIMIT = 500.0  # largest force on the column and on each finger, N
KNOTS = 11  # a quarter of a second apart
ROUNDS = 6  # of the hold, at most
APPROACH = 130  # steps: until shortly before the fingers touch the coin
SCENE = pathlib.Path(__file__).parent / "scenes/grasp.toml"


@dataclasses.dataclass(frozen=True)
class Hold:
    """Distance of coin and gripper from where they should be from a time on: squares of lengths, speeds and forces over
    those that would be a tolerable miss, meant over the states from then.
    """

    start: float  # time from which they should be there, s
    along: float  # where along the fingers the coin is wanted, m from the column
    opening: float  # between the fingers' joints, m
    grip: float  # force with which each finger should press, N
    # Misses that cost 1; infinite: it doesn't matter.
    along_miss: float  # m
    across_miss: float  # of the coin's place between the fingers, m
    opening_miss: float  # m
    drift_miss: float  # speed of the coin along the fingers, m/s
    closing_miss: float  # its speed against each finger across, and of its rim as it turns, m/s
    grip_miss: float  # N

    def of(self, rollout):
        """Cost and its gradient over the controls."""
        q, v, u = rollout.q, rollout.v, rollout.controls
        counted = rollout.time >= self.start - 1e-9
        share = 1.0 / max(counted.sum(), 1)
        lower, upper = FINGERS
        rim = max(grasp.COIN_AXES)
        # Each a sum of parts of coordinates or velocities, less what is wanted, over what is tolerable.
        places = [
            ({COIN_Y: 1.0, COLUMN: -1.0}, self.along, self.along_miss),
            ({COIN_Z: 1.0, lower: -0.5, upper: -0.5}, 0.0, self.across_miss),
            ({upper: 1.0, lower: -1.0}, self.opening, self.opening_miss),
        ]
        speeds = [
            ({COIN_Y: 1.0, COLUMN: -1.0}, 0.0, self.drift_miss),
            ({COIN_Z: 1.0, lower: -1.0}, 0.0, self.closing_miss),
            ({COIN_Z: 1.0, upper: -1.0}, 0.0, self.closing_miss),
            ({COIN_TURN: rim}, 0.0, self.closing_miss),
        ]
        presses = [({lower: 1.0}, self.grip, self.grip_miss), ({upper: -1.0}, self.grip, self.grip_miss)]
        cost, seeds = 0.0, []
        for values, terms in ((q, places), (v, speeds), (u, presses)):
            seed = np.zeros_like(values)
            on = counted[: len(values), None] * share
            for parts, wanted, tolerable in terms:
                miss = sum(part * values[:, i] for i, part in parts.items()) - wanted
                cost += float((on[:, 0] * (miss / tolerable) ** 2).sum())
                for i, part in parts.items():
                    seed[:, i] += part * on[:, 0] * 2.0 * miss / tolerable**2
            seeds.append(seed)
        gradient = rollout.vjp(q=seeds[0], v=seeds[1], controls=seeds[2])
        return cost, gradient.controls


NEVER = float("inf")
REACHING = Hold(1.2, 1.25, 0.44, 0.0, 0.05, 0.05, 0.05, 0.05, NEVER, NEVER)
HOLDING = Hold(1.9, 1.2, 0.1 + 2.0 * grasp.GAP, 100.0, 0.2, 0.1, 0.1, 0.1, 0.1, 100.0)


class Knots:
    """Controls that run straight from knot to knot, evenly spaced from the first step to the last: LIMIT · tanh x at a
    knot.
    """

    def __init__(self, steps):
        at = np.arange(steps) * (KNOTS - 1) / (steps - 1)
        # (steps, KNOTS): the share of each knot in each step.
        self.shares = np.clip(1.0 - np.abs(at[:, None] - np.arange(KNOTS)), 0.0, None)

    def controls(self, x):
        """Forces (steps, 3), N, of x (33,)."""
        return self.shares @ (LIMIT * np.tanh(x.reshape(KNOTS, 3)))

    def controls_vjp(self, x, controls_bar):
        """Cotangent of x from that of the forces."""
        return (self.shares.T @ controls_bar * LIMIT * (1.0 - np.tanh(x.reshape(KNOTS, 3)) ** 2)).ravel()

    def through(self, controls):
        """The x whose forces are those of `controls` at the knots."""
        at = np.rint(np.linspace(0, len(controls) - 1, KNOTS)).astype(int)
        return np.arctanh(np.clip(controls[at] / LIMIT, -0.99, 0.99)).ravel()


class Enough(Exception):
    """Ends a descent from inside."""


class Descent:
    """L-BFGS-B to a target cost, within a number of evaluations, that takes failed rollouts and jumps of the
    gradient.
    """

    def __init__(self, function, target, evaluations, clip=None, first_step=0.3):
        self.function, self.target, self.most, self.clip, self.first_step = (
            function,
            target,
            evaluations,
            clip,
            first_step,
        )
        self.evaluations, self.failures, self.iterations = 0, 0, 0
        self.best, self.cost = None, np.inf

    def evaluate(self, x):
        if self.evaluations >= self.most:
            raise Enough
        self.evaluations += 1
        try:
            cost, gradient = self.function(x)
        except hg.Error:
            # A bowl around the best point, above its cost, turns the search back.
            if self.best is None:
                raise
            self.failures += 1
            away = x - self.best
            return 10.0 * self.cost * (1.0 + away @ away), 20.0 * self.cost * away
        if self.evaluations == 1:
            self.first = np.linalg.norm(gradient)
        # Gradients through a collision that is about to happen otherwise are hundreds of times the first, and say
        # little.
        if self.clip is not None:
            gradient = gradient * min(1.0, self.clip * self.first / max(np.linalg.norm(gradient), 1e-300))
        if cost < self.cost:
            self.best, self.cost, self.slope = x.copy(), cost, np.linalg.norm(gradient)
        if cost <= self.target:
            raise Enough
        return cost, gradient

    def run(self, x, iterations, say):
        """The best point and its cost."""

        def told(_):
            self.iterations += 1
            say(f"iteration {self.iterations:2}: cost {self.cost:.4f}, {self.evaluations} rollouts with gradient")
            if self.iterations >= iterations:
                raise Enough

        try:
            self.evaluate(x)
            while iterations > 0:
                # In units in which the first step has the length that is wanted.
                center, before = self.best, self.cost
                scale = self.first_step * max(self.slope, 1e-300)

                def scaled(y, center=center, scale=scale):
                    cost, gradient = self.evaluate(center + self.first_step * y)
                    return cost / scale, self.first_step * gradient / scale

                minimize(scaled, np.zeros_like(x), jac=True, method="L-BFGS-B", callback=told)
                # The line search lost its way: again from the best point, along its gradient, while that helps.
                if self.cost >= before:
                    break
        except Enough:
            pass
        return self.best, self.cost


def naive_push(rollout):
    """What the scene's own controller did: 400 N on each finger until one is faster than 0.2 m/s."""
    speed = np.abs(rollout.v[:-1, list(FINGERS)]).max(1)
    pushing = np.logical_and.accumulate(speed < 0.2)
    return pushing[:, None] * np.array([0.0, 400.0, -400.0])


def draw(file, curves):
    """Column, opening, and coin of rollouts against time, drawn into a file."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        print("no picture: matplotlib isn't installed (pip install matplotlib)", file=sys.stderr)
        return
    figure = Figure(figsize=(9, 6), layout="constrained")
    readings = [
        ("column, m", lambda q: q[:, COLUMN]),
        ("opening of the fingers, m", lambda q: q[:, FINGERS[1]] - q[:, FINGERS[0]]),
        ("coin along the fingers, m (tips at 1.6)", lambda q: q[:, COIN_Y] - q[:, COLUMN]),
        ("turn of the coin, rad (flat at 1.57)", lambda q: q[:, COIN_TURN]),
    ]
    for axes, (title, reading) in zip(figure.subplots(2, 2).flat, readings):
        for (name, rollout), color in zip(curves, ("tab:red", "tab:blue")):
            axes.plot(rollout.time, reading(rollout.q), color=color, label=name)
        axes.set(title=title, xlabel="time, s")
    figure.axes[1].legend()
    figure.savefig(file)
    print(f"wrote {file}", file=sys.stderr)


def draw_scene(random):
    """The scene with another coin in it, in another place, and another friction."""
    radius = random.uniform(0.14, 0.26)
    half = radius * random.uniform(0.2, 0.4)
    mass = random.uniform(1000.0, 2500.0) * 4.0 / 3.0 * np.pi * radius**2 * half
    across, along = mass / 5.0 * (radius**2 + half**2), mass / 5.0 * 2.0 * radius**2
    place = grasp.REACH - random.uniform(0.1, 0.3), random.uniform(-0.05, 0.05), random.uniform(-0.6, 0.6)
    changes = {
        "friction = 0.65": f"friction = {random.uniform(0.4, 0.9)}",
        "semi_axes = [0.2, 0.05, 0.2]": f"semi_axes = [{radius}, {half}, {radius}]",
        "mass = 10.776": f"mass = {mass}",
        "inertia = [0.130, 0.236, 0.130]": f"inertia = [{across}, {along}, {across}]",
        "q = [0.0, -0.4, 0.4, 1.4, 0.0, 0.4]": f"q = [0.0, -0.4, 0.4, {place[0]}, {place[1]}, {place[2]}]",
    }
    text = SCENE.read_text()
    for old, new in changes.items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return hg.Scene.from_toml(text)


def catch_random(options):
    """Grasps that are drawn by a seed, with one set of settings for all."""
    random = np.random.default_rng(options.seed)
    pad = (0.0, grasp.REACH - 0.3, 0.0)
    reports = []
    for k in range(options.random):
        begun = time.perf_counter()
        # Searched in cheap water: compressed sources alone.
        sim = hg.Simulator(draw_scene(random), fidelity="reduced", films=False)
        found = hg.optimize.grasp(
            sim,
            object="coin",
            fingers=[("finger 1", pad), ("finger 2", pad)],
            closing=(0.0, 1.0, -1.0),
            limits=LIMIT,
            pushes=options.pushes,
        )
        report = {
            "caught": found.caught,
            "held_since": found.held_since,  # s
            "stage": found.stage,
            "cost": found.cost,
            "simulations": found.simulations,
            "gradients": found.gradients,
            "seconds": time.perf_counter() - begun,
        }
        reports.append(report)
        if not options.json:
            since = "" if found.held_since is None else f", held since {found.held_since:.2f} s"
            word = "caught" if found.caught else "lost"
            print(f"grasp {k + 1}: {word} by {found.stage}{since}, cost {found.cost:.3f}, {found.simulations} simulations")
    if options.json:
        print(json.dumps(reports))
    else:
        print(f"{sum(r['caught'] for r in reports)} of {options.random} caught")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", default="grasp.png", help="picture; default: %(default)s")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    parser.add_argument("--approach", type=int, default=10, help="most iterations of the approach (%(default)s)")
    parser.add_argument("--hold", type=int, default=60, help="most iterations of the hold (%(default)s)")
    parser.add_argument("--random", type=int, metavar="N", help="catch so many random coins instead")
    parser.add_argument("--seed", type=int, default=1, help="of the random coins (%(default)s)")
    parser.add_argument("--pushes", type=int, help="pushes tried for each of them (the recipe's own number)")
    options = parser.parse_args()
    if options.random is not None:
        catch_random(options)
        return
    begun = time.perf_counter()

    text = SCENE.read_text()
    dry = hg.Scene.from_toml(text.replace("density = 998.0", "density = 0.0"))
    naive_dry = hg.Simulator(dry, fidelity="isolated").rollout(steps=grasp.STEPS)
    naive = hg.Simulator(hg.Scene.from_toml(text), fidelity="reduced", films=False).rollout(steps=grasp.STEPS)

    # The same scene without the controller: from here on the forces are open-loop. The water is the cheap one, of compressed sources alone, that the
    # forces of grasp.rs are searched in.
    sim = hg.Simulator(grasp.scene(), fidelity="reduced", films=False)
    knots = Knots(grasp.STEPS)
    rollouts = 0.0

    def cost(goal, steps):
        def evaluate(x):
            nonlocal rollouts
            rollouts += steps / grasp.STEPS
            value, controls_bar = goal.of(sim.rollout(knots.controls(x)[:steps]))
            whole = np.zeros((grasp.STEPS, 3))
            whole[:steps] = controls_bar
            return value, knots.controls_vjp(x, whole)

        return evaluate

    def say(stage):
        return lambda line: print(f"{stage}, {line}", file=sys.stderr)

    x = knots.through(naive_push(naive))
    cost_naive = cost(HOLDING, grasp.STEPS)(x)[0]
    reaching = Descent(cost(REACHING, APPROACH), target=0.3, evaluations=20)
    x, _ = reaching.run(x, options.approach, say("approach"))
    rounds, goal, left = [reaching], HOLDING, options.hold
    while True:
        holding = Descent(cost(goal, grasp.STEPS), target=0.1, evaluations=40, clip=0.1)
        x, _ = holding.run(x, left, say("hold"))
        found = sim.rollout(knots.controls(x))
        rounds.append(holding)
        left -= holding.iterations
        # A cost tells how well the coin is held on the whole and not since when: as long as it isn't caught, half the speeds are tolerable.
        if grasp.caught(found) or left <= 0 or len(rounds) > ROUNDS:
            break
        goal = dataclasses.replace(goal, drift_miss=goal.drift_miss / 2.0, closing_miss=goal.closing_miss / 2.0)
    cost_found = HOLDING.of(found)[0]
    seconds = time.perf_counter() - begun
    draw(options.out, [("naive", naive), ("found", found)])

    report = {
        "naive_dry_caught": grasp.caught(naive_dry),
        "naive_caught": grasp.caught(naive),
        "found_caught": grasp.caught(found),
        "found_held_since": grasp.held_since(found),  # s
        "cost_naive": cost_naive,
        "cost_found": cost_found,
        "iterations": sum(descent.iterations for descent in rounds),
        "rollouts": rollouts,  # with gradients, shorter ones by their share
        "failures": sum(descent.failures for descent in rounds),
        "forces": knots.controls(x)[:: (grasp.STEPS - 1) // (KNOTS - 1)].tolist(),  # N
        "seconds": seconds,
        "warnings": found.warnings,
    }
    if options.json:
        print(json.dumps(report))
        return
    word = {True: "caught", False: "lost"}
    print(f"naive push without water: {word[report['naive_dry_caught']]}")
    print(f"naive push in water: {word[report['naive_caught']]}")
    print(f"{report['iterations']} iterations, {rollouts:.1f} rollouts with gradients, {seconds:.1f} s")
    for warning in report["warnings"]:
        print(f"warning: {warning}")
    since = report["found_held_since"]
    held = "not held at the end" if since is None else f"held since {since:.2f} s of {found.time[-1]:.2f} s"
    print(f"found by descent: {word[report['found_caught']]} ({held}), cost {cost_naive:.1f} -> {cost_found:.3f}")


if __name__ == "__main__":
    main()
