"""Mass and drag of a coin, recovered from a noisy recording of how it sinks: the twin of system_id.rs.

A coin sinks and swings above the floor of a tank, and a camera sees where its centre is, to within 2 mm (Gaussian, the
same at every frame). From this recording alone the coin's mass and its drag coefficient are to be found; its shape and
inertia, the water, and the place and time at which it was let go are known. The recording is made by the simulator
itself with known values, so that what is found can be held against the truth.

`hg.optimize.identify` finds both, over their logarithms (neither can become negative, and a step is a part of the value), by Levenberg and Marquardt on exact Jacobians of the rollout,
and gives standard errors. One recording either is within two standard errors or isn't, so the fit is repeated for many, of other noise: some 95 % of
the values should be within two, and the square of their deviations over the standard errors should be 1 on the mean.

    python examples/system_id.py [--noise METRES] [--seed N] [--recordings N] [--out FILE] [--json]
"""

import argparse
import concurrent.futures
import json
import math
import sys
import time

import numpy as np

import hydrograd as hg

MASS, DRAG = 0.030, 0.4  # the truth: kg; per area
GUESS = (1.5, 0.4)  # what is guessed at the start, in parts of the truth
STEPS = 100  # a camera of 100 frames a second for one second
NAMES = ("coin.mass", "coin.drag.quadratic")


def simulator():
    """A coin of 60 mm, let go aslant 0.6 m above the floor."""
    scene = hg.Scene(gravity=(0.0, 0.0, -9.81), time_step=0.01, steps=STEPS)
    scene.add_wall((0.0, 0.0, -0.6), (0.0, 0.0, 1.0))
    drag = hg.Drag(quadratic=DRAG, quadratic_part="total")
    shape = hg.ellipsoid(0.03, 0.005, 0.03, faces=320)
    scene.add(hg.Body(shape, name="coin", mass=MASS, drag=drag, joint=hg.planar("yz")))
    # Nearly flat: the thin axis is the body's y.
    scene.set_initial(q=(0.0, 0.0, math.pi / 2 - 0.3))
    return hg.Simulator(scene, fidelity="reduced")


def fit(sim, exact, noise, seed, say=None):
    """Mass and drag from a recording with the noise of a seed."""
    recording = exact + np.random.default_rng(seed).normal(scale=noise, size=exact.shape)
    run = hg.optimize.Experiment("fall", sim, steps=STEPS)
    for k, axis in enumerate("yz"):
        run.saw("positions", f"coin.position_{axis}", recording[:, k], deviation=noise, states=list(range(1, STEPS + 1)))
    unknowns = [
        hg.optimize.Unknown(name, positive=True, start=part * truth)
        for name, part, truth in zip(NAMES, GUESS, (MASS, DRAG))
    ]

    def told(p):
        if say:
            say(f"misfit {p.cost:12.4f}")

    found = hg.optimize.identify([run], unknowns, progress=told, profiles=0)
    mass, drag = found.unknowns
    return {
        "mass": mass.value,  # kg
        "mass_standard_error": mass.standard_error,
        "drag": drag.value,
        "drag_standard_error": drag.standard_error,
        "correlation": float(found.correlations[0, 1]),
        # Of the logarithms from the truth, in standard errors.
        "deviations": [
            math.log(u.value / truth) * u.value / u.standard_error for u, truth in ((mass, MASS), (drag, DRAG))
        ],
        "chi_squared": found.chi_squared,  # 1 for noise as large as it is said to be
        "simulations": found.simulations,
        "jacobians": found.jacobians,
        "stop": found.stop,
    }


def draw(file, fits):
    """Mass and drag of all recordings with their standard errors, and the truth."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        print("no picture: matplotlib isn't installed (pip install matplotlib)", file=sys.stderr)
        return
    figure = Figure(figsize=(5, 4.4), layout="constrained")
    axes = figure.add_subplot(
        title="fits with standard errors; the truth in red", xlabel="mass, g", ylabel="drag coefficient"
    )
    for f in fits:
        axes.errorbar(
            1e3 * f["mass"],
            f["drag"],
            xerr=1e3 * f["mass_standard_error"],
            yerr=f["drag_standard_error"],
            color="tab:blue",
            alpha=0.5,
        )
    axes.plot(1e3 * MASS, DRAG, "o", color="tab:red", zorder=3)
    figure.savefig(file)
    print(f"wrote {file}", file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--noise", type=float, default=2e-3, help="standard deviation, m (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the noise (%(default)s)")
    parser.add_argument("--recordings", type=int, default=20, help="%(default)s")
    parser.add_argument("--out", default="system_id.png", help="picture; default: %(default)s")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    options = parser.parse_args()
    if not (0.0 < options.noise < math.inf and options.recordings >= 1 and options.seed >= 0):
        parser.error("--noise must be positive, --recordings at least 1, --seed not negative")
    begun = time.perf_counter()
    sim = simulator()
    exact = sim.rollout(steps=STEPS).positions[1:, 0, 1:]

    def say(line):
        print(line, file=sys.stderr)

    # Over threads: a rollout doesn't hold the interpreter's lock.
    with concurrent.futures.ThreadPoolExecutor() as pool:
        work = [
            pool.submit(fit, sim, exact, options.noise, options.seed + k, None if k else say)
            for k in range(options.recordings)
        ]
        fits = [w.result() for w in work]
    draw(options.out, fits)
    shown = fits[0]
    deviations = np.array([f["deviations"] for f in fits])
    report = {
        "true_mass": MASS,
        "true_drag": DRAG,
        "noise": options.noise,  # m
        "seed": options.seed,
        "fit": shown,
        "within_two": bool((np.abs(shown["deviations"]) <= 2.0).all()),
        "recordings": len(fits),
        "part_within_two": float((np.abs(deviations) <= 2.0).mean()),
        "mean_square": float((deviations**2).mean()),
        "seconds": time.perf_counter() - begun,
    }
    if options.json:
        print(json.dumps(report))
        return
    off = shown["deviations"]
    print(
        f"positions seen to {1e3 * options.noise:.1f} mm, {STEPS} frames; "
        f"correlation of the two {shown['correlation']:+.2f}"
    )
    print(
        f"mass {1e3 * shown['mass']:.3f} ± {1e3 * shown['mass_standard_error']:.3f} g, true {1e3 * MASS:.3f} g: "
        f"{off[0]:+.2f} standard errors"
    )
    print(
        f"drag {shown['drag']:.4f} ± {shown['drag_standard_error']:.4f}, true {DRAG:.4f}: {off[1]:+.2f} standard errors"
    )
    print(
        f"misfit per degree of freedom {shown['chi_squared']:.2f}; "
        f"{shown['simulations']} rollouts, {shown['jacobians']} Jacobians, ended by {shown['stop']}"
    )
    print(
        f"{len(fits)} recordings: {100.0 * report['part_within_two']:.0f} % of the values within two standard errors, "
        f"mean square {report['mean_square']:.2f}; {report['seconds']:.0f} s"
    )


if __name__ == "__main__":
    main()
