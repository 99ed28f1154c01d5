"""A swimmer's body and gait, designed together: the twin of swimmer_codesign.rs.

A fish of three ellipsoids, as heavy as the water it displaces, hangs together by two elastic joints with a motor each. In four seconds from rest it shall get
as far as it can. Found are the torques of both motors at each of 200 steps and, in the co-design, how high and how thick each link is. What is the same for all:
the effort (the root of the sum of all squared torques), the time, the length of the links, the joints' springs and dampers, and the volume of the fish, so its mass too.

Control alone has a hard-working rival here: it descends from four gaits (three frequencies, two phases between the joints), with more rollouts in
total than the co-design has, which starts from one. Torques live on a sphere (only their direction counts), heights and thicknesses on
a surface of equal volume, so that L-BFGS has nothing to obey but bounds: no link gets more than half as high or thick again (a factor of exp(0.4)), before all are thinned to the same volume.

The water is `isolated`: each link has its own added mass, and they don't feel each other's flow. It is a potential flow: no wake, no stall. The drag of a real fish would cost both.

    python examples/swimmer_codesign.py [--quick] [--check] [--out FILE] [--json]
"""

import argparse
import json
import sys
import time

import numpy as np

import hydrograd as hg

STEPS, DT = 200, 0.02
LINKS = ("tail", "middle", "head")
LENGTH, HEIGHT, WIDTH = 1 / 6, 1 / 6, 1 / 30  # semi-axes of every link at the start: along x, z and y, m
JOINT = 0.02  # from a link's tip to the joint, m
STIFFNESS, DAMPING = 5.0, 0.3  # of the joints: N·m/rad, N·m·s/rad
EFFORT = 20.0  # root of the sum of all squared torques, N·m
REACH = 0.4  # of the logarithms of heights and widths
GAITS = ((4.0, 1.5), (4.0, -1.5), (5.5, 1.5), (2.8, 1.5))  # rad/s, and how far the tail's torque is ahead, rad


def scene(sizes):
    """A fish whose links have these widths and heights (semi-axes along y and z, m), rows by link."""
    water = hg.Scene(fluid=hg.Fluid(density=998.0), time_step=DT, steps=STEPS)
    for name, side in (("middle", 0), ("head", 1), ("tail", -1)):
        shape = hg.ellipsoid(LENGTH, *sizes[LINKS.index(name)])
        more = {"joint": hg.planar("xy")}
        if side:
            more = {
                "parent": "middle",
                "position": (side * LENGTH, 0, 0),
                "shape_position": (side * (LENGTH + JOINT), 0, 0),
                "joint": hg.revolute((0, 0, 1)),
                "passive": hg.Passive(stiffness=STIFFNESS, damping=DAMPING),
                "actuated": True,
            }
        water.add(hg.Body(shape, name=name, density=998.0, **more))
    return water


def gait(frequency, ahead):
    """Torques that start a descent, head and tail: their size doesn't count."""
    t = frequency * DT * np.arange(STEPS)
    return np.stack([np.sin(t), np.sin(t + ahead)], axis=1)


def sizes_of(logs):
    """Widths and heights from their logarithms in parts of the start's. The volume of all is kept by the widths."""
    factors = np.exp(np.reshape(logs, (3, 2)))
    volumes = factors.prod(axis=1)
    return np.array([WIDTH, HEIGHT]) * factors * np.array([3.0 / volumes.sum(), 1.0]), volumes / volumes.sum()


class Swim:
    """Distance and its gradient; counts rollouts."""

    def __init__(self):
        self.rollouts = 0

    def run(self, pattern, logs):
        sizes, _ = sizes_of(logs)
        names = [f"{link}.semi_axes" for link in LINKS]
        sim = hg.Simulator(scene(sizes), dt=DT, fidelity="isolated", shape_parameters=names)
        self.rollouts += 1
        return sim.rollout(EFFORT * pattern / np.linalg.norm(pattern))

    def gradient(self, pattern, logs):
        """Distance, m, and its derivatives by the pattern and the logarithms."""
        rollout = self.run(pattern, logs)
        seed = np.zeros_like(rollout.positions)
        seed[-1, 0, 0] = 1.0
        gradient = rollout.vjp(positions=seed)
        # Along the pattern itself nothing changes: it is only a direction.
        size = np.linalg.norm(pattern)
        along = np.asarray(gradient.controls)
        by_pattern = EFFORT / size * (along - pattern * (pattern * along).sum() / size**2)
        sizes, shares = sizes_of(logs)
        by_size = [[gradient.parameters[f"{link}.semi_axes.{k}"] for k in "yz"] for link in LINKS]
        by_logs = sizes * by_size
        # A link that grows makes all links thinner.
        by_logs = by_logs - shares[:, None] * by_logs[:, 0].sum()
        return distance(rollout), by_pattern, by_logs.ravel()


def distance(rollout):
    """Of the middle along x, m."""
    return float(rollout.positions[-1, 0, 0] - rollout.positions[0, 0, 0])


def work(rollout, pattern):
    """What the motors put in, J: the sum of their positive powers. The joints' coordinates are the last two."""
    turned = np.diff(rollout.q[:, 3:], axis=0)
    return float(np.maximum(EFFORT * pattern / np.linalg.norm(pattern) * turned, 0.0).sum())


def descend(swim, start, shaped, iterations):
    """The farthest swim from a gait: pattern and logarithms."""
    from scipy.optimize import minimize

    size = start.size

    def cost(x):
        try:
            far, by_pattern, by_logs = swim.gradient(x[:size].reshape(start.shape), x[size:] if shaped else np.zeros(6))
        except hg.Error:
            # A step too long: the line search turns back.
            return 1.0, np.zeros_like(x)
        return -far, -np.concatenate([by_pattern.ravel(), by_logs if shaped else []])

    # Of length 1, so that the pattern turns about as fast as the logarithms grow.
    x = np.concatenate([start.ravel() / np.linalg.norm(start), np.zeros(6 if shaped else 0)])
    bounds = [(None, None)] * size + [(-REACH, REACH)] * (len(x) - size)
    options = {"maxiter": iterations, "maxcor": 20, "maxls": 40, "gtol": 1e-7, "ftol": 1e-6, "maxfun": 2 * iterations}
    found = minimize(cost, x, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    return found.x[:size].reshape(start.shape), found.x[size:] if shaped else np.zeros(6)


def check(swim):
    """The largest part by which a derivative is off from a central difference: one of a torque, and those of all logarithms."""
    pattern, logs = gait(*GAITS[0]), np.array([0.1, -0.05, 0.02, 0.1, -0.1, 0.2])
    _, by_pattern, by_logs = swim.gradient(pattern, logs)
    off = []
    for k in range(-1, 6):
        by = by_pattern[60, 1] if k < 0 else by_logs[k]
        ends = []
        for h in (1e-4, -1e-4):
            moved, other = pattern.copy(), logs.copy()
            if k < 0:
                moved[60, 1] += 10 * h
            else:
                other[k] += h
            ends.append(distance(swim.run(moved, other)))
        off.append(abs((ends[0] - ends[1]) / (2e-4 * (10 if k < 0 else 1)) - by) / (abs(by_pattern).max() if k < 0 else abs(by_logs).max()))
    return max(off)


def result(swim, pattern, logs):
    rollout = swim.run(pattern, logs)
    return {
        "distance": distance(rollout),  # m
        "effort": EFFORT,  # N·m
        "seconds": STEPS * DT,
        "work": work(rollout, pattern),  # J
        "widths": sizes_of(logs)[0][:, 0].tolist(),  # semi-axes of tail, middle and head, m
        "heights": sizes_of(logs)[0][:, 1].tolist(),
        "course": (rollout.positions[:, 0, 0] - rollout.positions[0, 0, 0]).tolist(),
        "joints": rollout.q[:, 3:].tolist(),  # head and tail, rad
        "torques": (EFFORT * pattern / np.linalg.norm(pattern)).tolist(),  # N·m
    }


def draw(file, before, after):
    """Both fish from the side and from above, and how they get on."""
    try:
        import matplotlib

        matplotlib.use("agg")
        from matplotlib import pyplot
        from matplotlib.patches import Ellipse
    except ImportError:
        print("matplotlib isn't installed: no picture", file=sys.stderr)
        return
    matplotlib.rcParams["svg.fonttype"] = "none"
    figure, axes = pyplot.subplots(3, 2, figsize=(8.4, 6.4), height_ratios=(2, 1.1, 2.4), layout="constrained")
    for column, (own, colour, name) in enumerate(((before, "tab:gray", "control alone"), (after, "tab:blue", "body and gait"))):
        for row, (key, seen) in enumerate((("heights", "from the side"), ("widths", "from above"))):
            ax = axes[row, column]
            for k, size in enumerate(own[key]):
                place = (k - 1) * (2 * LENGTH + JOINT)
                ax.add_patch(Ellipse((place, 0), 2 * LENGTH, 2 * size, color=colour, alpha=0.7))
            ax.set(aspect="equal", xlim=(-0.55, 0.55), ylim=(-0.28, 0.28) if row == 0 else (-0.08, 0.08), ylabel="z, m" if row == 0 else "y, m")
            ax.set_title(f"{name}, {seen}", fontsize=9)
        t = DT * np.arange(STEPS + 1)
        axes[2, 0].plot(t, own["course"], color=colour, label=f"{name}: {own['distance']:.3f} m")
        for k, style in enumerate(("-", "--")):
            axes[2, 1].plot(t, np.degrees(np.array(own["joints"])[:, k]), style, color=colour, lw=1, label=f"{name}, {('head', 'tail')[k]}")
    axes[2, 0].set(xlabel="t, s", ylabel="way, m")
    axes[2, 1].set(xlabel="t, s", ylabel="joints, °")
    axes[2, 0].legend(fontsize=8)
    axes[2, 1].legend(fontsize=7)
    figure.savefig(file)
    print(f"wrote {file}", file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="few iterations, one gait for the rival")
    parser.add_argument("--check", action="store_true", help="hold derivatives against differences, and end")
    parser.add_argument("--out", default="swimmer_codesign.png", help="picture; default: %(default)s")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    options = parser.parse_args()
    if options.check:
        off = check(Swim())
        print(json.dumps({"off": off}) if options.json else f"derivatives and differences: apart by {off:.1e} of the largest")
        sys.exit(0 if off < 1e-5 else 1)
    begun = time.perf_counter()
    iterations, gaits = (8, GAITS[:1]) if options.quick else (100, GAITS)
    alone, best = Swim(), None
    for start in gaits:
        pattern, logs = descend(alone, gait(*start), False, iterations)
        far = distance(alone.run(pattern, logs))
        print(f"control alone from {start[0]} rad/s, {start[1]:+} rad: {far:.4f} m, {alone.rollouts} rollouts so far", file=sys.stderr)
        if best is None or far > best[0]:
            best = far, pattern, logs
    together = Swim()
    shaped = descend(together, gait(*GAITS[0]), True, iterations)
    before, after = result(alone, *best[1:]), result(together, *shaped)
    before["rollouts"], after["rollouts"] = alone.rollouts, together.rollouts
    draw(options.out, before, after)
    gain = after["distance"] / before["distance"] - 1.0
    report = {"start": distance(Swim().run(gait(*GAITS[0]), np.zeros(6))), "alone": before, "together": after, "gain": gain}
    report["seconds"] = time.perf_counter() - begun
    if options.json:
        print(json.dumps(report))
        return
    print(f"the gait at the start: {report['start']:.3f} m in {STEPS * DT:.0f} s")
    for name, own in (("control alone", before), ("body and gait", after)):
        print(f"{name}: {own['distance']:.3f} m, {own['work']:.2f} J of work, {own['rollouts']} rollouts")
    print(f"farther by {100 * gain:.0f} % at the same effort, {100 * (after['distance'] / after['work'] * before['work'] / before['distance'] - 1):+.0f} % per work; {report['seconds']:.0f} s")
    for k, link in enumerate(LINKS):
        print(f"{link}: {2e3 * after['widths'][k]:.0f} mm thick, {2e3 * after['heights'][k]:.0f} mm high (was {2e3 * WIDTH:.0f}, {2e3 * HEIGHT:.0f})")


if __name__ == "__main__":
    main()
