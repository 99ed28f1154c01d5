"""Mass and drag of a coin, recovered from a noisy recording of how it sinks: the twin of system_id.rs.

A coin sinks and swings above the floor of a tank, and a camera sees where its centre is, to within 2 mm (Gaussian, the
same at every frame). From this recording alone the coin's mass and its drag coefficient are to be found; its shape and
inertia, the water, and the place and time at which it was let go are known. The recording is made by the simulator
itself with known values, so that what is found can be held against the truth.

The misfit, half the sum of squared deviations over the variance of the noise, falls by L-BFGS-B with the exact
gradient of the rollout, over the logarithms of both values: neither can become negative, and a step is a part of the
value. Where it is least its curvature is JᵀJ (Gauss and Newton), with J the positions' change with the two logarithms
over the noise's deviation; the inverse of that is their covariance, and its diagonal the squared standard errors. One
recording either is within two standard errors or isn't, so the fit is repeated for many, of other noise: some 95 % of
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
from scipy.optimize import minimize

import hydrograd as hg

MASS, DRAG = 0.030, 0.4  # the truth: kg; per area
GUESS = np.log([1.5, 0.4])  # logarithms of what is guessed at the start, in parts of the truth
STEPS = 100  # a camera of 100 frames a second for one second
DIFFERENCE = 1e-4  # of central differences in the logarithms
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


def simulate(sim, x):
    """The coin's fall with mass and drag from their logarithms over the truth's."""
    values = np.array([MASS, DRAG]) * np.exp(x)
    return sim.with_parameters(dict(zip(NAMES, values.tolist()))).rollout(steps=STEPS)


def seen(rollout):
    """What a camera sees: y and z of the coin, (STEPS, 2), m."""
    return rollout.positions[1:, 0, 1:]


def misfit(sim, recording, noise, x):
    """With its gradient over x."""
    rollout = simulate(sim, x)
    off = (seen(rollout) - recording) / noise
    seed = np.zeros_like(rollout.positions)
    seed[1:, 0, 1:] = off / noise
    gradient = rollout.vjp(positions=seed).parameters
    # Over logarithms.
    values = rollout.simulator.parameters
    return 0.5 * np.sum(off**2), np.array([gradient[name] * values[name] for name in NAMES])


def covariance(sim, noise, x):
    """Of x, where the misfit is least."""
    columns = []
    for step in DIFFERENCE * np.eye(2):
        change = seen(simulate(sim, x + step)) - seen(simulate(sim, x - step))
        columns.append(change.ravel() / (2.0 * DIFFERENCE * noise))
    jacobian = np.stack(columns, axis=1)
    return np.linalg.inv(jacobian.T @ jacobian)


def fit(sim, exact, noise, seed, say=None):
    """Mass and drag from a recording with the noise of a seed."""
    recording = exact + np.random.default_rng(seed).normal(scale=noise, size=exact.shape)

    def told(intermediate_result):
        if say:
            say(f"misfit {intermediate_result.fun:12.4f}")

    found = minimize(
        lambda x: misfit(sim, recording, noise, x),
        GUESS,
        jac=True,
        method="L-BFGS-B",
        callback=told,
        options={"gtol": 1e-3, "ftol": 1e-13},
    )
    spread = covariance(sim, noise, found.x)
    errors = np.sqrt(np.diag(spread))
    mass, drag = np.array([MASS, DRAG]) * np.exp(found.x)
    return {
        "mass": mass,  # kg
        "mass_standard_error": mass * errors[0],
        "drag": drag,
        "drag_standard_error": drag * errors[1],
        "correlation": spread[0, 1] / (errors[0] * errors[1]),
        "deviations": (found.x / errors).tolist(),  # of the logarithms from the truth, in standard errors
        "chi_squared": 2.0 * found.fun / (exact.size - 2),  # 1 for noise as large as it is said to be
        "evaluations": found.nfev,
        "stop": found.message,
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
    exact = seen(sim.rollout(steps=STEPS))

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
        f"{shown['evaluations']} rollouts with gradient, {shown['stop']}"
    )
    print(
        f"{len(fits)} recordings: {100.0 * report['part_within_two']:.0f} % of the values within two standard errors, "
        f"mean square {report['mean_square']:.2f}; {report['seconds']:.0f} s"
    )


if __name__ == "__main__":
    main()
