"""What the bridge to JAX has of its own: transformations. The rest is in test_bridges.py."""

import os
import pathlib
import subprocess
import sys

import bridge_scenes
import numpy as np
import pytest

import hydrograd as hg

jax = pytest.importorskip("jax")
jax.config.update("jax_enable_x64", True)
hj = pytest.importorskip("hydrograd.jax")
jnp = jax.numpy


@pytest.fixture(scope="module")
def coupled():
    return bridge_scenes.coupled()


def pushed(case, seeds, mass):
    """A cost of controls and mass, and what the simulator itself says of its gradient."""

    def cost(controls, mass):
        made = hj.rollout(case.sim, controls, case.q, case.v, {"ball.mass": mass})
        return sum(jnp.sum(getattr(made, name) * seed) for name, seed in seeds.items())

    def right(controls):
        rollout = case.sim.with_parameters({"ball.mass": mass}).rollout(controls, q=case.q, v=case.v)
        return rollout.vjp(**seeds)

    return cost, right


@pytest.fixture(scope="module")
def seeds():
    random = np.random.default_rng(2)
    return {"positions": random.normal(size=(5, 2, 3)), "v": random.normal(size=(5, 7))}


def test_jit_grad_and_vmap_are_the_simulators_vjp(coupled, seeds):
    """To the bit, however it is composed and batched."""
    batch = np.random.default_rng(6).normal(size=(5, 4, 1))
    cost, right = pushed(coupled, seeds, 0.6)
    gradient = jax.grad(cost, argnums=(0, 1))
    shared = {"in_axes": (0, None)}
    composed = [
        jax.vmap(gradient, **shared),
        jax.jit(jax.vmap(gradient, **shared)),
        jax.vmap(jax.jit(gradient), **shared),
        jax.jit(jax.vmap(lambda *x: jax.value_and_grad(cost, argnums=(0, 1))(*x)[1], **shared)),
    ]
    wanted = [right(controls) for controls in batch]
    for function in composed:
        controls_bar, mass_bar = function(jnp.asarray(batch), 0.6)
        assert controls_bar.shape == (5, 4, 1) and mass_bar.shape == (5,)
        for b, gradient_b in enumerate(wanted):
            assert np.array_equal(controls_bar[b], gradient_b.controls)
            assert mass_bar[b] == gradient_b.parameters["ball.mass"]


def test_a_batch_goes_to_the_host_in_one_call(coupled, monkeypatch):
    calls = []
    right = hj._bridge.roll
    monkeypatch.setattr(
        hj._bridge,
        "roll",
        lambda physics, controls, *rest: (calls.append(controls.shape), right(physics, controls, *rest))[1],
    )
    inner = jax.vmap(lambda u, q: hj.rollout(coupled.sim, u, q).q, in_axes=(0, None))
    outer = jax.jit(jax.vmap(inner, in_axes=(None, 0)))
    q = jnp.stack([jnp.asarray(coupled.q)] * 2).at[1, 0].add(0.01)
    made = outer(jnp.zeros((3, 4, 1)), q)
    assert made.shape == (2, 3, 5, 8) and calls == [(6, 4, 1)]
    assert np.array_equal(made[1, 2], coupled.sim.rollout(np.zeros((4, 1)), q=q[1]).q)


def test_batches_written_out_and_vmapped_are_one_by_one(coupled):
    batch = jnp.asarray(np.random.default_rng(6).normal(size=(2, 3, 4, 1)))
    masses = jnp.linspace(0.5, 0.7, 3)

    def run(controls, mass):
        made = hj.rollout(coupled.sim, controls, parameters={"ball.mass": mass})
        state = hj.step(coupled.sim, (made.q[..., -1, :], made.v[..., -1, :]), controls[..., 0, :], {"ball.mass": mass})
        return made, state

    written = run(batch, masses)
    mapped = jax.jit(jax.vmap(jax.vmap(run), in_axes=(0, None)))(batch, masses)
    for b in np.ndindex(2, 3):
        alone = run(batch[b], masses[b[1]])
        for many in (written, mapped):
            assert all(
                np.array_equal(a[b], c) for a, c in zip(jax.tree.leaves(many), jax.tree.leaves(alone), strict=True)
            )


def test_scan_over_steps(coupled):
    """Its gradient is that of the rollout, and the backward pass finds what the forward pass left."""

    def by_steps(controls):
        def body(state, u):
            state = hj.step(coupled.sim, state, u)
            return state, state.q

        _, q = jax.lax.scan(body, hj.initial_state(coupled.sim), controls)
        return jnp.sum(q**2)

    def whole(controls):
        return jnp.sum(hj.rollout(coupled.sim, controls).q[1:] ** 2)

    controls = jnp.asarray(coupled.controls)
    value, gradient = jax.jit(jax.value_and_grad(by_steps))(controls)
    right = jax.value_and_grad(whole)(controls)
    assert np.allclose(value, right[0], rtol=1e-13) and np.allclose(gradient, right[1], rtol=1e-9)
    # What its backward pass didn't ask for isn't kept for ever.
    assert len(hj._jax.steps_kept) == 0


def test_what_is_run_again_is_the_same_to_the_bit(coupled, monkeypatch):
    controls = jnp.asarray(coupled.controls)

    def function(u):
        return jnp.sum(hj.rollout(coupled.sim, u).positions ** 2) + jnp.sum(
            hj.step(coupled.sim, hj.initial_state(coupled.sim), u[0]).v ** 2
        )

    calls = []
    right = hj._bridge.roll
    monkeypatch.setattr(hj._bridge, "roll", lambda *given: (calls.append(1), right(*given))[1])
    kept = jax.value_and_grad(function)(controls)
    assert len(calls) == 1
    monkeypatch.setattr(hj._jax.Memo, "take", lambda *_: None)
    again = jax.value_and_grad(function)(controls)
    assert len(calls) == 3
    assert kept[0] == again[0] and np.array_equal(kept[1], again[1])


def test_steps_remember_what_the_controller_does():
    sim = bridge_scenes.locking()
    right = hj.rollout(sim, jnp.zeros((16, 1)))
    last, states = jax.jit(
        lambda: jax.lax.scan(lambda s, _: (hj.step(sim, s),) * 2, hj.initial_state(sim), length=16)
    )()
    assert np.allclose(states.q, right.q[1:], rtol=1e-12, atol=1e-15)
    assert np.allclose(states.v, right.v[1:], rtol=1e-12, atol=1e-15)
    assert last.step == 16 and last.held.tolist() == [True, False] and not states.held[0].any()


def test_jit_without_controls():
    sim = bridge_scenes.passive()
    made = jax.jit(lambda: hj.rollout(sim, jnp.zeros((3, 5, 0))))()
    assert np.array_equal(made.q[1], sim.rollout(steps=5).q)


def test_runs_of_nothing_differ_by_their_lengths():
    """Without controls all that they are given is the same: each backward pass finds its own forward pass."""
    sim = bridge_scenes.passive()

    def run(steps):
        return lambda v: jnp.sum(hj.rollout(sim, jnp.zeros((steps, 0)), v=v).positions ** 2)

    v = jnp.asarray(sim.initial_v + 0.1)
    (_, back5), (_, back8) = jax.vjp(run(5), v), jax.vjp(run(8), v)
    found = back5(jnp.ones(()))[0], back8(jnp.ones(()))[0]
    for steps, bar in zip((5, 8), found):
        assert np.array_equal(bar, jax.grad(run(steps))(v))


def test_jit_is_compiled_once(coupled):
    traced = []

    @jax.jit
    def function(u):
        traced.append(1)
        return hj.rollout(coupled.sim, u).q

    for scale in (0.0, 1.0, 2.0):
        function(scale * jnp.ones((4, 1)))
    assert len(traced) == 1


def test_wrong_values_under_jit_keep_their_message(coupled):
    run = jax.jit(lambda u: hj.rollout(coupled.sim, u).q)
    with pytest.raises(
        jax.errors.JaxRuntimeError, match=r"InputError: rollout: controls\[2, 0\]: got NaN; must be finite"
    ):
        jax.block_until_ready(run(jnp.zeros((4, 1)).at[2, 0].set(jnp.nan)))
    assert np.isfinite(run(jnp.zeros((4, 1)))).all()  # and it goes on


def test_32_bits_are_refused(coupled):
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(hg.InputError, match='jax_enable_x64", True'):
            hj.rollout(coupled.sim, np.zeros((4, 1)))
    finally:
        jax.config.update("jax_enable_x64", True)


LARGE = """
import os
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
import faulthandler; faulthandler.dump_traceback_later(60, exit=True)
import jax; jax.config.update("jax_enable_x64", True)
import hydrograd as hg, hydrograd.jax as hj
scene = hg.Scene(); scene.add(hg.Body(hg.sphere(0.05), density=998.0, actuated=True))
sim = hg.Simulator(scene, 0.01, fidelity="isolated")
function = jax.jit(jax.vmap(jax.value_and_grad(lambda u: jax.numpy.sum(hj.rollout(sim, 2 * u).positions ** 2))))
controls = jax.numpy.full((40, 60, 6), 0.01)  # 115 kB
for _ in range(8):
    # More is asked for before the host has done what was.
    value, gradient = function(controls)
    controls = controls - gradient @ jax.numpy.eye(6)
print(float(controls.sum()) > 0)
"""


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="needs a way to take cores away")
def test_large_arrays_on_one_core():
    """One thread must do both JAX's work and the host's: with `jax.pure_callback` this stands still."""
    folder = pathlib.Path(hg.__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", LARGE], capture_output=True, text=True, cwd=folder, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "True\n"
