"""The falling ball with coupled water and without, side by side.

A heavy sphere is driven down beside a coin that lies flat above the sea floor. With the fidelity `full` the water that
the sphere pushes away turns the coin before anything touches it; with `isolated` the coin is never moved by the sphere.

    python examples/falling_ball.py [--faces N] [--steps N] [--out FILE] [--json]

FILE is a picture of the coin's angle and of the heights against time (PNG, SVG or PDF, by its ending).
"""

import argparse
import json
import pathlib
import sys
import time

import numpy as np

import hydrograd as hg

# Height of the floor, radius of the sphere, m.
FLOOR = -0.98
RADIUS = 0.6


def simulate(scene, fidelity, options):
    """Coin and sphere against time."""
    start = time.perf_counter()
    sim = hg.Simulator(scene, fidelity=fidelity, faces=options.faces)
    # The scene's own controller pushes the sphere; no open-loop control is added to it.
    rollout = sim.rollout(steps=options.steps)
    sphere, _, height, angle = rollout.q.T  # m, m, m, rad
    return {
        "fidelity": fidelity,
        "time": rollout.time.tolist(),  # s
        "coin_angle": np.degrees(angle - angle[0]).tolist(),  # from lying flat
        "coin_height": (height - FLOOR).tolist(),  # m, its centre above the floor
        "sphere_gap": (sphere - RADIUS - FLOOR).tolist(),  # m, its lowest point above the floor
        "seconds": time.perf_counter() - start,
    }


def draw(file, curves):
    """Angle and height of the coin, and the sphere's height, against time, drawn into a file."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        print("no picture: matplotlib isn't installed (pip install matplotlib)", file=sys.stderr)
        return
    figure = Figure(figsize=(6, 8), layout="constrained")
    readings = [
        ("coin_angle", "angle of the coin from lying flat, °"),
        ("coin_height", "coin's centre above the floor, m"),
        ("sphere_gap", "sphere's lowest point above the floor, m"),
    ]
    for axes, (key, title) in zip(figure.subplots(3, 1, sharex=True), readings):
        for curve, style in zip(curves, ("-", "--")):
            axes.plot(curve["time"], curve[key], style, label=curve["fidelity"])
        axes.set_title(title)
    axes.set_xlabel("time, s")
    figure.axes[0].legend()
    figure.savefig(file)
    print(f"wrote {file}", file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--faces", type=int, default=320)
    parser.add_argument("--steps", type=int, help="default: the scene's")
    parser.add_argument("--out", default="falling_ball.png", help="picture; default: %(default)s")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    file = pathlib.Path(__file__).parent / "scenes/falling_ball.toml"
    scene = hg.Scene.load(file)
    curves = [simulate(scene, fidelity, options) for fidelity in ("full", "isolated")]
    draw(options.out, curves)
    if options.json:
        print(json.dumps(curves))
        return
    for c in curves:
        print(
            f"{c['fidelity']:8}  coin at {c['time'][-1]:.2f} s: {c['coin_angle'][-1]:+.2f}° and "
            f"{c['coin_height'][-1]:.4f} m above the floor   ({c['seconds']:.1f} s)"
        )


if __name__ == "__main__":
    main()
