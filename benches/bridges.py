"""What the bridges to torch and JAX cost, against the simulator's own calls on NumPy arrays.

A ball driven along a rail beside a free coin, the fidelity `auto`: a scene whose steps are so short that what surrounds
them shows. Prints a table of medians, µs, and the fastest in brackets.

    python benches/bridges.py [--repeat N] [--steps N] [--batch N]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import jax
import numpy as np
import torch

import hydrograd as hg
import hydrograd.torch as ht

jax.config.update("jax_enable_x64", True)

import hydrograd.jax as hj  # noqa: E402  after 64 bits are on

Work = Callable[[], object]


def scene() -> hg.Scene:
    """The driven ball beside the free coin."""
    made = hg.Scene(fluid=hg.Fluid(density=998.0))
    rail = hg.prismatic((1.0, 0.0, 0.0))
    made.add(hg.Body(hg.sphere(0.05), density=998.0, position=(-0.15, 0.0, 0.0), joint=rail, actuated=True))
    made.add(hg.Body(hg.ellipsoid(0.01, 0.04, 0.04), density=998.0))
    return made


def measured(work: Work, repeat: int) -> str:
    """Median and smallest time of a call, µs."""
    work()
    times = []
    for _ in range(repeat):
        began = time.perf_counter()
        work()
        times.append(1e6 * (time.perf_counter() - began))
    return f"{np.median(times):.0f} [{min(times):.0f}]"


def steps(sim: hg.Simulator, batch: int) -> dict[str, tuple[Work, Work]]:
    """A step of each of `batch` states, and steps with their gradients, by each way."""
    u, bar = np.zeros((batch, sim.control_size)), np.ones(sim.v_size)
    q, v = sim.initial_q, sim.initial_v
    many = np.broadcast_to(q, (batch, len(q)))

    def numpy_gradient() -> object:
        return [sim.step(sim.state(q, v), row)[1].vjp(v=bar).controls for row in u]

    state, force = ht.initial_state(sim, many), torch.from_numpy(u)

    def torch_step() -> object:
        with torch.no_grad():
            return ht.step(sim, state, force)

    def torch_gradient() -> object:
        leaf = force.clone().requires_grad_()
        return torch.autograd.grad(ht.step(sim, state, leaf).v.sum(), leaf)

    began, push = hj.initial_state(sim, many), jax.numpy.asarray(u)

    def step(u: jax.Array) -> hj.State:
        return hj.step(sim, began, u)

    slope = jax.value_and_grad(lambda u: step(u).v.sum())
    fast, fast_slope = jax.jit(step), jax.jit(slope)
    return {
        "NumPy, one by one": (lambda: [sim.step(sim.state(q, v), row) for row in u], numpy_gradient),
        "torch": (torch_step, torch_gradient),
        "JAX, jit": (lambda: jax.block_until_ready(fast(push)), lambda: jax.block_until_ready(fast_slope(push))),
        "JAX, not compiled": (lambda: jax.block_until_ready(step(push)), lambda: jax.block_until_ready(slope(push))),
    }


def rollouts(sim: hg.Simulator, length: int, batch: int) -> dict[str, tuple[Work, Work]]:
    """`batch` rollouts, and rollouts with their gradients, by each way."""
    shape = (batch, length, sim.control_size)
    bar = np.ones((length + 1, sim.v_size))

    def seen() -> list[hg.Rollout]:
        made = sim.rollout_batch(np.zeros(shape))
        # What the bridges hand over, all of it.
        for rollout in made:
            _ = rollout.positions, rollout.rotations, rollout.q, rollout.v
        return made

    def numpy_gradient() -> object:
        return [rollout.vjp(v=bar).controls for rollout in seen()]

    def torch_rollout() -> object:
        with torch.no_grad():
            return ht.rollout(sim, torch.zeros(shape, dtype=torch.float64))

    def torch_gradient() -> object:
        leaf = torch.zeros(shape, dtype=torch.float64, requires_grad=True)
        return torch.autograd.grad(ht.rollout(sim, leaf).v.sum(), leaf)

    roll = jax.jit(lambda u: hj.rollout(sim, u))
    slope = jax.jit(jax.value_and_grad(lambda u: hj.rollout(sim, u).v.sum()))
    again = jax.jit(jax.grad(lambda u: hj.rollout(sim, u).v.sum()))
    push = jax.numpy.zeros(shape)
    return {
        "NumPy": (seen, numpy_gradient),
        "torch": (torch_rollout, torch_gradient),
        "JAX, jit": (lambda: jax.block_until_ready(roll(push)), lambda: jax.block_until_ready(slope(push))),
        "JAX, jit of grad alone": (lambda: None, lambda: jax.block_until_ready(again(push))),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--repeat", type=int, default=200, help="calls of a step; a tenth of that for rollouts")
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--batch", type=int, default=8)
    options = parser.parse_args()
    torch.set_num_threads(1)
    sim = hg.Simulator(scene(), 0.01, fidelity="auto")
    few = max(3, options.repeat // 10)
    tables = [
        ("a step", steps(sim, 1), options.repeat),
        (f"{options.batch} steps", steps(sim, options.batch), options.repeat),
        (f"a rollout of {options.steps} steps", rollouts(sim, options.steps, 1), few),
        (f"{options.batch} rollouts of {options.steps} steps", rollouts(sim, options.steps, options.batch), few),
    ]
    print("| what | by | forward, µs | with its gradient, µs |\n|---|---|---|---|")
    for what, ways, repeat in tables:
        for name, (forward, both) in ways.items():
            value = "" if "alone" in name else measured(forward, repeat)
            print(f"| {what} | {name} | {value} | {measured(both, repeat)} |", flush=True)


if __name__ == "__main__":
    main()
