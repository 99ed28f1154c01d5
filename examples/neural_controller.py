"""A neural network that closes a gripper around a coin, trained by gradients through the water.

Two fingers close from 0.8 m to 0.55 m around a coin, in 1.5 s; half a second later the coin should still be where it
was along the fingers, and in the middle between them. The water that they press out carries it away, so the gripper has
to follow. It is the task of examples/controller_tuning.rs, that tunes six gains of a hand-made law; here the law is a
network of two hidden layers, whose forces (N) on column and fingers are added to those of a controller that would be
right on dry land: both motions critically damped at 3 rad/s. The untrained network's last layer is small, so that it
starts as that controller.

Every iteration simulates starts of the coin that weren't there before, all at once, differentiates their mean cost back
through every step (`hydrograd.torch.step`) to the weights, and moves these by Adam's rule. Untrained and trained are
then compared on starts that none of this has seen. Costs are squares of tolerable misses (1 cm, 5 cm/s, 1 kN): along
the fingers at all times; at the end the opening, the middle, and speeds; and the mean force. The task ends before
anything touches (`--json` has the smallest gaps; surfaces touch at 15 mm).

Measured on two cores: mean cost of 16 unseen starts 25.4 untrained and 0.18 trained, after 60 iterations of 8 starts
in 53 s; the coin leaves its place by at most 33.6 mm untrained and 2.5 mm trained.

    python examples/neural_controller.py [--iterations N] [--starts N] [--unseen N] [--out FILE.svg] [--json]
"""

from __future__ import annotations

import argparse
import json
import pathlib
import sys
import time
from typing import NamedTuple

import torch

import hydrograd as hg
import hydrograd.torch as ht
from hydrograd.tasks import grasp
from hydrograd.tasks.grasp import COIN_TURN, COIN_Y, COIN_Z, COLUMN, FINGERS

TIME_STEP = 0.04  # s
STEPS = 50
LOWER, UPPER = FINGERS
# Opening at the start and at the end, m, and how long closing takes, s.
WIDE, NARROW, CLOSING = 0.8, 0.55, 1.5
# Where the coin starts: y, m from the column; z, m; turn, rad.
LOWEST, HIGHEST = torch.tensor([[1.25, -0.02, 0.2], [1.5, 0.02, 0.6]], dtype=torch.float64)
# What would be a tolerable miss: of lengths, m, of speeds, m/s, and of forces, N.
LENGTH, SPEED, FORCE = 0.01, 0.05, 1000.0
# Force of a unit of the network's output, N.
UNIT = 1000.0
SEED = 7


def simulator() -> hg.Simulator:
    """The grasp without its own controller."""
    return hg.Simulator(grasp.scene(), TIME_STEP, fidelity="auto")


def opening(time: float) -> tuple[float, float]:
    """Wanted opening at a time, m, and its rate, m/s: smooth from start to end."""
    part = min(max(time / CLOSING, 0.0), 1.0)
    rate = (NARROW - WIDE) * 6.0 * part * (1.0 - part) / CLOSING
    return WIDE + (NARROW - WIDE) * part * part * (3.0 - 2.0 * part), rate


class Controller(torch.nn.Module):
    """Forces (batch, 3), N, on column, lower and upper finger, from what is seen of states."""

    FREQUENCY = 3.0  # rad/s, of the controller for dry land

    def __init__(self, sim: hg.Simulator, width: int = 32) -> None:
        super().__init__()
        self.finger = sim.parameters["finger 1.mass"]  # kg
        self.gripper = sim.parameters["column.mass"] + 2 * self.finger
        layers = [torch.nn.Linear(10, width), torch.nn.Linear(width, width), torch.nn.Linear(width, 3)]
        with torch.no_grad():
            layers[-1].weight *= 0.02
            layers[-1].bias.zero_()
        network = torch.nn.Sequential(layers[0], torch.nn.Tanh(), layers[1], torch.nn.Tanh(), layers[2])
        self.network = network.to(torch.float64)

    def forward(self, time: float, q: torch.Tensor, v: torch.Tensor, along: torch.Tensor) -> torch.Tensor:
        wide, rate = opening(time)
        miss = q[:, COIN_Y] - q[:, COLUMN] - along
        # Numbers of the size of one.
        seen = torch.stack(
            [
                (q[:, COIN_Y] - q[:, COLUMN] - 1.4) / 0.1,
                miss / 0.03,
                (q[:, COIN_Z] - 0.5 * (q[:, LOWER] + q[:, UPPER])) / 0.03,
                q[:, COIN_TURN],
                (q[:, UPPER] - q[:, LOWER] - wide) / 0.03,
                (v[:, UPPER] - v[:, LOWER] - rate) / 0.1,
                (v[:, COIN_Y] - v[:, COLUMN]) / 0.1,
                v[:, COLUMN] / 0.1,
                torch.full_like(miss, rate / 0.25),
                torch.full_like(miss, 2.0 * time / (STEPS * TIME_STEP) - 1.0),
            ],
            dim=1,
        )
        stiffness, damping = self.FREQUENCY**2, 2.0 * self.FREQUENCY
        law = [self.gripper * (stiffness * miss - damping * v[:, COLUMN])]
        for finger, side in ((LOWER, -0.5), (UPPER, 0.5)):
            law.append(
                self.finger * (stiffness * (side * wide - q[:, finger]) + damping * (side * rate - v[:, finger]))
            )
        added: torch.Tensor = UNIT * self.network(seen)
        return torch.stack(law, dim=1) + added


class Run(NamedTuple):
    """Runs of a batch of starts."""

    cost: torch.Tensor
    """Of each, (batch,)."""
    miss: torch.Tensor
    """Of the coin along the fingers at all states, (batch, STEPS + 1), m."""
    q: torch.Tensor
    """Coordinates at all states, (batch, STEPS + 1, q_size)."""


def run(sim: hg.Simulator, controller: Controller, starts: torch.Tensor) -> Run:
    """Closes the gripper from starts (batch, 3) of the coin, step by step, all of them at once."""
    fingers = torch.tensor([0.0, -0.5 * WIDE, 0.5 * WIDE], dtype=torch.float64)
    along = starts[:, 0]
    state = ht.initial_state(sim, torch.cat([fingers.expand(len(starts), 3), starts], dim=1))
    q, v, forces = [state.q], [state.v], []
    for n in range(STEPS):
        forces.append(controller(n * TIME_STEP, state.q, state.v, along))
        state = ht.step(sim, state, forces[-1])
        q.append(state.q)
        v.append(state.v)
    positions, last, speed = torch.stack(q, dim=1), q[-1], v[-1]
    miss = positions[:, :, COIN_Y] - positions[:, :, COLUMN] - along[:, None]
    lengths = [
        last[:, UPPER] - last[:, LOWER] - NARROW,
        last[:, COIN_Z] - 0.5 * (last[:, LOWER] + last[:, UPPER]),
    ]
    speeds = [speed[:, COIN_Y] - speed[:, COLUMN], speed[:, LOWER], speed[:, UPPER]]
    cost = (miss / LENGTH).square().mean(dim=1)
    cost = (
        cost + (torch.stack(lengths) / LENGTH).square().sum(dim=0) + (torch.stack(speeds) / SPEED).square().sum(dim=0)
    )
    cost = cost + (torch.stack(forces, dim=1) / FORCE).square().mean(dim=(1, 2))
    return Run(cost, miss, positions)


def nearest(sim: hg.Simulator, made: Run) -> float:
    """Smallest gap between bodies in every fifth state, m."""
    states = made.q[:, ::5].reshape(-1, made.q.shape[-1])
    none = torch.zeros(len(states), 0, sim.control_size, dtype=torch.float64)
    rollouts = ht.rollout(sim, none, states).rollouts
    return min(float(rollout.min_gap[0]) for rollout in rollouts)


def draw(random: torch.Generator, count: int) -> torch.Tensor:
    """Starts of the coin, (count, 3)."""
    part = torch.rand(count, 3, generator=random, dtype=torch.float64)
    return torch.lerp(LOWEST.expand_as(part), HIGHEST.expand_as(part), part)


def train(
    sim: hg.Simulator, controller: Controller, random: torch.Generator, options: argparse.Namespace
) -> list[float]:
    """Mean cost of the starts of each iteration, before its step; a line for each on standard error."""
    optimiser = torch.optim.Adam(controller.parameters(), lr=options.rate)
    # Large steps first, ever smaller ones then.
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(
        optimiser, max(1, options.iterations), eta_min=0.05 * options.rate
    )
    history = []
    for n in range(options.iterations):
        cost = run(sim, controller, draw(random, options.starts)).cost.mean()
        optimiser.zero_grad()
        torch.autograd.backward(cost)
        size = torch.nn.utils.clip_grad_norm_(controller.parameters(), 10.0)
        optimiser.step()
        schedule.step()
        history.append(cost.item())
        print(f"iteration {n + 1:3}: mean cost {history[-1]:9.4f}, |gradient| {size.item():9.3e}", file=sys.stderr)
    return history


def plot(file: pathlib.Path, history: list[float], before: Run, after: Run) -> None:
    """Costs against iterations, and misses of unseen starts against time."""
    import matplotlib

    matplotlib.use("Agg")
    # The same numbers give the same file.
    matplotlib.rcParams.update({"svg.hashsalt": "neural_controller", "svg.fonttype": "none"})
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    left.semilogy(range(len(history)), history)
    left.set(xlabel="iteration", ylabel="mean cost of its starts", title="training")
    times = [n * TIME_STEP for n in range(STEPS + 1)]
    for made, colour, name in ((before, "tab:red", "untrained"), (after, "tab:blue", "trained")):
        lines = right.plot(times, 1e3 * made.miss.T, color=colour, linewidth=0.8)
        lines[0].set_label(name)
    right.set(xlabel="time, s", ylabel="coin off its place along the fingers, mm", title="unseen starts")
    right.legend()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, metadata={"Date": None} if file.suffix == ".svg" else None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--iterations", type=int, default=60)
    parser.add_argument("--starts", type=int, default=8, help="in each iteration")
    parser.add_argument("--unseen", type=int, default=16, help="starts that are compared")
    parser.add_argument("--rate", type=float, default=1e-2, help="first step size")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("neural_controller.svg"))
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    for name, least in (("iterations", 0), ("starts", 1), ("unseen", 1)):
        if getattr(options, name) < least:
            parser.error(f"--{name}: got {getattr(options, name)}; must be at least {least}")
    began = time.perf_counter()
    # The tensors are small: what takes time runs on the simulator's threads.
    torch.set_num_threads(1)
    torch.manual_seed(SEED)
    sim = simulator()
    controller = Controller(sim)
    unseen = draw(torch.Generator().manual_seed(SEED + 1), options.unseen)
    with torch.no_grad():
        before = run(sim, controller, unseen)
    prepared = time.perf_counter()
    history = train(sim, controller, torch.Generator().manual_seed(SEED + 2), options)
    trained = time.perf_counter()
    with torch.no_grad():
        after = run(sim, controller, unseen)
        gaps = [1e3 * nearest(sim, made) for made in (before, after)]
    plot(options.out, history, before, after)
    costs = before.cost.mean().item(), after.cost.mean().item()
    misses = [1e3 * made.miss.abs().max().item() for made in (before, after)]
    report = {
        "untrained_cost": costs[0],
        "trained_cost": costs[1],
        "untrained_costs": before.cost.tolist(),
        "trained_costs": after.cost.tolist(),
        "untrained_miss_mm": misses[0],
        "trained_miss_mm": misses[1],
        "untrained_nearest_mm": gaps[0],
        "trained_nearest_mm": gaps[1],
        "history": history,
        "training_seconds": trained - prepared,
        "seconds": time.perf_counter() - began,
    }
    if options.json:
        print(json.dumps(report))
        return
    print(
        f"{options.unseen} unseen starts: mean cost {costs[0]:.2f} untrained, {costs[1]:.2f} trained, "
        f"{costs[0] / costs[1]:.1f} times less; coin off its place by at most {misses[0]:.1f} mm, {misses[1]:.1f} mm; "
        f"{options.iterations} iterations of {options.starts} starts in {report['training_seconds']:.0f} s; "
        f"wrote {options.out}"
    )


if __name__ == "__main__":
    main()
