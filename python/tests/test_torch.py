"""What the bridge to torch has of its own; the rest is in test_bridges.py."""

import threading
import time

import bridge_scenes
import numpy as np
import pytest

import hydrograd as hg

torch = pytest.importorskip("torch")
ht = pytest.importorskip("hydrograd.torch")


def tensor(values):
    return torch.tensor(values, dtype=torch.float64, requires_grad=True)


@pytest.fixture(scope="module")
def coupled():
    return bridge_scenes.coupled()


def test_trajectories_show_their_rollouts(coupled):
    right = coupled.sim.rollout(coupled.controls, q=coupled.q, v=coupled.v)
    made = ht.rollout(coupled.sim, *(tensor(x) for x in (coupled.controls, coupled.q, coupled.v)))
    assert np.array_equal(made.rollouts[0].min_gap, right.min_gap)
    assert len(ht.rollout(coupled.sim, torch.zeros(2, 3, 4, 1, dtype=torch.float64)).rollouts) == 6


def test_shared_parameters_run_as_one_batch(coupled):
    controls = torch.zeros(5, 4, 1, dtype=torch.float64)
    mass = tensor(0.6)
    made = ht.rollout(coupled.sim, controls, parameters={"ball.mass": mass})
    made.positions.sum().backward()
    assert len({id(rollout.simulator) for rollout in made.rollouts}) == 1
    alone = tensor(0.6)
    ht.rollout(coupled.sim, controls[0], parameters={"ball.mass": alone}).positions.sum().backward()
    assert torch.allclose(mass.grad, 5 * alone.grad, rtol=1e-12)


def test_nothing_is_kept_where_nothing_is_differentiated(coupled):
    made = ht.rollout(coupled.sim, torch.zeros(2, 1, dtype=torch.float64))
    assert not made.q.requires_grad and made.q.grad_fn is None
    with torch.no_grad():
        assert not ht.step(coupled.sim, ht.initial_state(coupled.sim), tensor([1.0])).v.requires_grad


def test_backward_passes_leave_the_interpreters_lock(coupled):
    rollout = ht.rollout(coupled.sim, tensor(np.zeros((4, 300, 1))))
    count, done = 0, threading.Event()

    def work():
        rollout.positions.sum().backward()
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        count += 1
        time.sleep(0.001)
    thread.join()
    assert count > 10


def test_second_derivatives_are_refused(coupled):
    """Whichever way they are asked for: a gradient that were a constant would have a Hessian of zero."""
    start = ht.initial_state(coupled.sim)
    # Costs whose own slope doesn't depend on the run are linear in what it gives, and their Hessians the run's alone.
    costs = [
        lambda u: ht.rollout(coupled.sim, u).q.square().sum(),
        lambda u: ht.rollout(coupled.sim, u).q.sum(),
        lambda u: ht.step(coupled.sim, start, u[0]).v.sum(),
    ]
    controls, ones = tensor(coupled.controls), torch.ones_like(tensor(coupled.controls))
    autograd, func = torch.autograd.functional, torch.func
    for cost in costs:
        (slope,) = torch.autograd.grad(cost(controls), controls, create_graph=True)
        ways = [
            lambda slope=slope: slope.sum().backward(),
            lambda cost=cost: autograd.hessian(cost, controls),
            lambda cost=cost: autograd.hvp(cost, controls, ones),
            lambda cost=cost: autograd.vhp(cost, controls, ones),
            lambda cost=cost: func.hessian(cost)(controls.detach()),
            lambda cost=cost: func.jacrev(func.jacrev(cost))(controls.detach()),
            lambda cost=cost: func.jacrev(func.jacfwd(cost))(controls.detach()),
        ]
        for way in ways:
            with pytest.raises(hg.UnsupportedError, match="derivatives of derivatives"):
                way()


def test_what_is_changed_afterwards_does_not_matter(coupled):
    controls = tensor(coupled.controls)
    cost = ht.rollout(coupled.sim, controls).positions.square().sum()
    cost.backward(retain_graph=True)
    first = controls.grad.clone()
    with torch.no_grad():
        controls += 1.0
    controls.grad = None
    cost.backward()
    assert torch.equal(controls.grad, first)


def test_tensors_elsewhere_are_refused(coupled):
    with pytest.raises(hg.InputError, match=r"on meta; .*\.cpu\(\)"):
        ht.rollout(coupled.sim, torch.zeros(4, 1, dtype=torch.float64, device="meta"))
