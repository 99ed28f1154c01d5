"""A gripper's fingers and how they close, designed together: the twin of finger_codesign.rs.

Two equal fingers on rails close around a free coin in water, from 0.16 m to 0.04 m beside its middle, within a second. The coin isn't in the middle of the fingers:
the water that they squeeze out takes it along before they have it. Wanted is that the fingers arrive soon and that the coin stays where it is. Found are
the forces on the fingers (eight knots, lines between them) and, in the co-design, the fingers' width and length. What is the same for all: the effort
(the root of the sum of the squared forces), the time, the volume of a finger, so its mass (thickness makes up for width and length), and the opening at the start. A finger
stays as wide as the coin, 0.06 m, which is what holds it, and is at least 0.16 m long.

The cost is the mean of the squared lateness (the opening that is left, in parts of the first one; the last tenth of the time counts ten times), and the square of
how far the coin has gone, 1 for 0.045 m. Control alone descends first; the co-design goes on from where that ended.

The water is `reduced`, without films, for shape gradients aren't there where films carry a gap: so the fingers stop 0.03 m beside the coin's faces, where the gap is resolved.
Gradients with respect to the shape pass through the compression and are right to its accuracy (`--check` tells). Both results are
run again with finer surfaces and a ten times finer compression.

    python examples/finger_codesign.py [--quick] [--check] [--out FILE] [--json]
"""

import argparse
import json
import sys
import time

import numpy as np

import hydrograd as hg

STEPS, DT = 50, 0.02
SIZE = np.array([0.10, 0.03, 0.20])  # width, thickness and length of a finger at the start, m
REACH = np.log([1 / 0.6, 1 / 0.8])  # of the logarithms of width and length
OPEN, SHUT = 0.16, 0.04  # of a finger's face from the middle, m
COIN, COIN_Z = (0.03, 0.008, 0.03), 0.06  # semi-axes; how far the coin is from the fingers' middle, m
EFFORT = 8.0  # root of the sum of one finger's squared forces, N
KNOTS = 8
COIN_WEIGHT = 0.05 / 0.01**2  # 1/m²
LATEST, LATEST_WEIGHT = STEPS // 10, 10.0
ARRIVED = 0.1  # of the opening is left
FACES, ACCURACY = 160, 1e-2
FINE_FACES, FINE_ACCURACY = 640, 1e-3

# Forces at the steps from those at the knots.
LINES = np.maximum(0.0, 1.0 - np.abs(np.linspace(0, KNOTS - 1, STEPS)[:, None] - np.arange(KNOTS)))
# Of the states' squared lateness.
WEIGHTS = np.where(np.arange(STEPS + 1) > STEPS - LATEST, LATEST_WEIGHT, 1.0) / (STEPS + 1)


def scene(size, faces):
    water = hg.Scene(time_step=DT, steps=STEPS)
    for name, side in (("left", -1), ("right", 1)):
        place = (0, side * (OPEN + size[1] / 2), 0)
        shape = hg.box(*size, faces=faces)
        water.add(hg.Body(shape, name=name, density=1200.0, position=place, joint=hg.prismatic((0, 1, 0)), actuated=True))
    coin = hg.ellipsoid(*COIN, faces=faces)
    water.add(hg.Body(coin, name="coin", density=1300.0, position=(0, 0, COIN_Z), joint=hg.planar("yz")))
    return water


def size_of(logs):
    """Width, thickness and length from the logarithms of width and length: the thickness keeps the volume."""
    return SIZE * np.exp([logs[0], -logs[0] - logs[1], logs[1]])


def forces_of(knots):
    forces = LINES @ knots
    return EFFORT * forces / np.linalg.norm(forces)


class Grip:
    """Cost and its gradient; counts rollouts, and keeps the last shape's simulator."""

    def __init__(self):
        self.rollouts, self.made = 0, None

    def simulator(self, logs, faces=FACES, accuracy=ACCURACY, shaped=True):
        key = (*logs, faces, accuracy, shaped)
        if self.made is None or self.made[0] != key:
            shapes = ["left", "right"] if shaped else []
            water = scene(size_of(logs), faces)
            self.made = key, hg.Simulator(water, fidelity="reduced", films=False, accuracy=accuracy, shape_parameters=shapes)
        return self.made[1]

    def run(self, knots, logs, **fine):
        forces = forces_of(knots)
        self.rollouts += 1
        return self.simulator(logs, **fine).rollout(np.stack([forces, -forces], axis=1))

    def gradient(self, knots, logs, shaped=True):
        """Cost, and its derivatives by the knots and the logarithms."""
        rollout, thickness = self.run(knots, logs, shaped=shaped), size_of(logs)[1]
        late, moved = seen(rollout, thickness)
        cost = cost_of(late, moved)
        by_opening = 2.0 * WEIGHTS * late / (2.0 * (OPEN - SHUT))
        seed = np.zeros_like(rollout.positions)
        seed[:, 1, 1], seed[:, 0, 1] = by_opening, -by_opening
        seed[-1, 2, 2] = 2.0 * COIN_WEIGHT * moved[-1]
        gradient = rollout.vjp(positions=seed)
        # Along the forces themselves nothing changes: they are only a direction.
        forces = LINES @ knots
        size, by_forces = np.linalg.norm(forces), np.asarray(gradient.controls) @ [1.0, -1.0]
        by_knots = LINES.T @ (EFFORT / size * (by_forces - forces * (forces @ by_forces) / size**2))
        if not shaped:
            return cost, by_knots, np.zeros(2)
        by_size = sum(np.array([gradient.parameters[f"{name}.size.{k}"] for k in "xyz"]) for name in ("left", "right"))
        # Faces are half a thickness before the middles, and the middles start half a thickness behind the faces.
        start = np.asarray(gradient.initial_q)
        by_size[1] += (start[1] - start[0]) / 2 - by_opening.sum()
        along = by_size * size_of(logs)
        return cost, by_knots, np.array([along[0] - along[1], along[2] - along[1]])


def cost_of(late, moved):
    return (WEIGHTS * late**2).sum() + COIN_WEIGHT * moved[-1] ** 2


def seen(rollout, thickness):
    """The part of the opening that is left, and how far the coin has gone along the fingers, m: at every state."""
    y, z = rollout.positions[..., 1], rollout.positions[:, 2, 2]
    late = ((y[:, 1] - y[:, 0] - thickness) / 2 - SHUT) / (OPEN - SHUT)
    return late, z - z[0]


def descend(grip, knots, shaped, iterations, tolerance=1e-4):
    """Knots and logarithms of the lowest cost."""
    from scipy.optimize import minimize

    best = None

    def cost(x):
        nonlocal best
        try:
            value, by_knots, by_logs = grip.gradient(x[:KNOTS], x[KNOTS:] if shaped else np.zeros(2), shaped)
        except hg.Error:
            # Driven into the coin: a bowl around the best point, above its cost, turns the search back.
            away = x - best[1]
            height, far = max(best[0], np.linalg.norm(best[2]) * np.linalg.norm(away)), away @ away
            return best[0] + height, 2.0 * height * away / far
        slope = np.concatenate([by_knots, by_logs]) if shaped else by_knots
        if best is None or value < best[0]:
            best = value, x.copy(), slope
        return value, slope

    # Of length 1 like the logarithms.
    x = np.concatenate([knots / np.linalg.norm(knots), np.zeros(2 if shaped else 0)])
    bounds = [(None, None)] * KNOTS + [(-r, r) for r in REACH[: len(x) - KNOTS]]
    options = {"maxiter": iterations, "maxfun": 2 * iterations, "ftol": tolerance, "gtol": 1e-6}
    minimize(cost, x, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    x = best[1]
    return x[:KNOTS], x[KNOTS:] if shaped else np.zeros(2)


def first_knots():
    """Closes for three quarters of the time: pushed, then held back."""
    t = np.arange(KNOTS) / (KNOTS - 1)
    return np.where(t < 0.75, np.cos(np.pi * t / 0.75), 0.0)


def check(grip):
    """By how much derivatives are off from central differences, in parts of the largest: of a knot, and of the logarithms, where each end is compressed anew."""
    knots, logs = first_knots(), np.array([-0.1, 0.05])
    cost, by_knots, by_logs = grip.gradient(knots, logs)

    def cost_at(knots, logs, shaped):
        return cost_of(*seen(grip.run(knots, logs, shaped=shaped), size_of(logs)[1]))

    def slope(knot, log, h):
        if log is None:
            # The simulator that is there, with the shapes' derivatives.
            ends = [cost_at(knots + s * h * np.eye(KNOTS)[knot], logs, True) for s in (1, -1)]
        else:
            ends = [cost_at(knots, logs + s * h * np.eye(2)[log], False) for s in (1, -1)]
        return (ends[0] - ends[1]) / (2 * h)

    forces = abs(slope(2, None, 1e-4) - by_knots[2]) / abs(by_knots).max()
    shape = max(abs(slope(0, k, 2e-2) - by_logs[k]) for k in range(2)) / abs(by_logs).max()
    return float(forces), float(shape)


def numbers(rollout, logs):
    late, moved = seen(rollout, size_of(logs)[1])
    outside = np.nonzero(np.abs(late) > ARRIVED)[0]
    return {
        "lateness": float((late**2).mean()),
        "arrived": float(DT * (outside[-1] + 1)) if outside[-1] < STEPS else None,  # s
        "coin_moved": float(moved[-1]),  # m
        "coin_moved_most": float(np.abs(moved).max()),
    }


def result(grip, knots, logs, finer):
    rollout = grip.run(knots, logs)
    late, moved = seen(rollout, size_of(logs)[1])
    out = numbers(rollout, logs)
    out |= {"effort": EFFORT, "size": size_of(logs).tolist()}  # N; width, thickness, length, m
    out |= {"left": late.tolist(), "coin": moved.tolist(), "forces": forces_of(knots).tolist()}
    if finer:
        out["finer"] = numbers(grip.run(knots, logs, faces=FINE_FACES, accuracy=FINE_ACCURACY, shaped=False), logs)
    return out


def draw(file, before, after):
    """Fingers and coin from the side and from the front, and what happens."""
    try:
        import matplotlib

        matplotlib.use("agg")
        from matplotlib import pyplot
        from matplotlib.patches import Ellipse, Rectangle
    except ImportError:
        print("matplotlib isn't installed: no picture", file=sys.stderr)
        return
    matplotlib.rcParams["svg.fonttype"] = "none"
    figure, axes = pyplot.subplots(2, 3, figsize=(9.2, 6.4), layout="constrained")
    both = ((before, "tab:gray", "control alone"), (after, "tab:blue", "fingers and control"))
    for row, (own, colour, name) in enumerate(both):
        x, y, z = own["size"]
        side, front = axes[row, 0], axes[row, 1]
        for sign in (-1, 1):
            for face, alpha in ((OPEN, 0.25), (SHUT, 0.8)):
                corner = (face if sign > 0 else -face - y, -z / 2)
                side.add_patch(Rectangle(corner, y, z, color=colour, alpha=alpha))
        front.add_patch(Rectangle((-x / 2, -z / 2), x, z, color=colour, alpha=0.8))
        for ax, wide in ((side, COIN[1]), (front, COIN[0])):
            for up, style in ((0.0, {"fill": False, "ls": ":"}), (own["coin"][-1], {"color": "tab:orange"})):
                ax.add_patch(Ellipse((0, COIN_Z + up), 2 * wide, 2 * COIN[2], **style))
            ax.set(aspect="equal", xlim=(-0.23, 0.23) if ax is side else (-0.13, 0.13), ylim=(-0.13, 0.13))
        side.set(title=name, xlabel="y, m", ylabel="z, m")
        front.set(xlabel="x, m")
        t = DT * np.arange(STEPS + 1)
        axes[0, 2].plot(t, 100 * np.array(own["left"]), color=colour, label=name)
        axes[1, 2].plot(t, 1e3 * np.array(own["coin"]), color=colour, label=name)
    axes[0, 2].set(ylabel="opening left, %")
    axes[0, 2].axhline(0, color="black", lw=0.5)
    axes[0, 2].legend(fontsize=8)
    axes[1, 2].set(xlabel="t, s", ylabel="coin moved, mm")
    figure.savefig(file)
    print(f"wrote {file}", file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="few iterations, not run again with finer surfaces")
    parser.add_argument("--check", action="store_true", help="hold derivatives against differences, and end")
    parser.add_argument("--out", default="finger_codesign.png", help="picture; default: %(default)s")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    options = parser.parse_args()
    if options.check:
        forces, shape = check(Grip())
        print(json.dumps({"forces": forces, "shape": shape}) if options.json else f"off by {forces:.1e} (forces) and {shape:.1e} (shape, compressed anew) of the largest")
        sys.exit(0 if forces < 1e-5 and shape < 0.1 else 1)
    begun = time.perf_counter()
    alone, together = Grip(), Grip()
    knots, _ = descend(alone, first_knots(), False, 6 if options.quick else 40)
    print(f"control alone took {alone.rollouts} rollouts, {time.perf_counter() - begun:.0f} s", file=sys.stderr)
    shaped = descend(together, knots, True, 3 if options.quick else 25)
    # What the co-design went on for, the rival goes on for as well.
    more = descend(alone, knots, False, 3 if options.quick else 40)
    before = result(alone, *more, not options.quick)
    after = result(together, *shaped, not options.quick)
    before["rollouts"], after["rollouts"] = alone.rollouts, together.rollouts
    draw(options.out, before, after)
    gains = {k: 1.0 - abs(after[k]) / abs(before[k]) for k in ("lateness", "coin_moved")}
    report = {"alone": before, "together": after, "gains": gains, "seconds": time.perf_counter() - begun}
    if options.json:
        print(json.dumps(report))
        return
    for name, own in (("control alone", before), ("fingers and control", after)):
        for how, n in (("", own), (", finer", own.get("finer"))):
            if n:
                arrived = "never" if n["arrived"] is None else f"after {n['arrived']:.2f} s"
                print(f"{name}{how}: nine tenths closed {arrived}, squared lateness {n['lateness']:.3f}, coin moved {1e3 * n['coin_moved']:.1f} mm")
    print(f"less: lateness by {100 * gains['lateness']:.0f} %, motion of the coin by {100 * gains['coin_moved']:.0f} %, at the same effort; {report['seconds']:.0f} s")
    print("finger: " + " × ".join(f"{1e3 * s:.0f}" for s in after["size"]) + " mm (was " + " × ".join(f"{1e3 * s:.0f}" for s in SIZE) + "; width, thickness, length)")


if __name__ == "__main__":
    main()
