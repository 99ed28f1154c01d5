"""Runs a scene and writes its replay: a page that any browser with WebGL shows.

With --flow, arrows show the water's velocity in a plane through the middle of where the bodies go, across the axis named.

    python examples/replay.py examples/scenes/grasp.toml grasp.html
    python examples/replay.py examples/scenes/falling_ball.toml ball.html --fidelity full --flow x --frames 126
"""

import argparse

import numpy as np

import hydrograd as hg


def plane(rollout, axis, count):
    """A grid of points across `axis` (0, 1, 2), about `count` along its longer side, half as large again as where the bodies go."""
    meshes = rollout.simulator.meshes()
    places = [
        rollout.positions[:, b, None] + mesh[0] @ rollout.rotations[:, b].swapaxes(-1, -2)
        for b, mesh in enumerate(meshes)
        if mesh is not None
    ]
    low = np.min([p.min(axis=(0, 1)) for p in places], axis=0)
    high = np.max([p.max(axis=(0, 1)) for p in places], axis=0)
    middle, half = (low + high) / 2, 0.75 * (high - low)
    half[axis] = 0.0
    step = 2 * half.max() / count
    sides = [np.arange(-h, h + step / 2, step) for h in half]
    return middle + np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 3)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scene")
    parser.add_argument("page")
    parser.add_argument("--fidelity", default="auto")
    parser.add_argument("--faces", type=int)
    parser.add_argument("--steps", type=int, help="default: the scene's")
    parser.add_argument("--frames", type=int, default=1000, help="most states that are drawn")
    parser.add_argument("--flow", choices="xyz", help="the plane through the origin in which the flow is drawn")
    parser.add_argument("--view-from", type=float, nargs=3, metavar=("X", "Y", "Z"))
    parser.add_argument("--open", action="store_true", help="show it in a browser")
    options = parser.parse_args()
    sim = hg.Simulator(hg.Scene.load(options.scene), fidelity=options.fidelity, faces=options.faces)
    rollout = sim.rollout(steps=options.steps)
    flow = None if options.flow is None else plane(rollout, "xyz".index(options.flow), 28)
    view = hg.view(
        rollout,
        options.page,
        open=options.open,
        max_frames=options.frames,
        flow=flow,
        view_from=options.view_from,
    )
    print(f"{view.file}: {len(rollout)} states, {len(view.html) / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
