"""The bridge to torch: its gradients against differences of what it computes, its numbers against the simulator's."""

import pathlib
import subprocess
import sys
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


def inputs(case):
    """Leaves: controls, q, v, and by how much each parameter is multiplied."""
    return tuple(tensor(x) for x in (case.controls, case.q, case.v, np.ones(len(case.parameters))))


def scaled(case, factors):
    return {name: value * factor for (name, value), factor in zip(case.parameters.items(), factors, strict=True)}


def check(function, leaves, tolerance=1e-6):
    """Gradients against central differences of all entries, quaternions' included: relative to the largest of each
    pair."""
    weights = [torch.linspace(-1.0, 1.3, out.numel(), dtype=torch.float64).sin() for out in function(*leaves)]

    def scalar(*given):
        return sum(weight @ out.reshape(-1) for weight, out in zip(weights, function(*given), strict=True))

    found = torch.autograd.grad(scalar(*leaves), leaves)
    for leaf, gradient in zip(leaves, found, strict=True):
        slopes = torch.zeros_like(gradient)
        for at in np.ndindex(*leaf.shape):
            step = 1e-5 * max(1e-2, abs(leaf[at].item()))
            ends = []
            for sign in (1, -1):
                moved = leaf.detach().clone()
                moved[at] += sign * step
                ends.append(scalar(*(moved if other is leaf else other.detach() for other in leaves)))
            slopes[at] = (ends[0] - ends[1]) / (2 * step)
        assert (gradient - slopes).abs().max() <= tolerance * slopes.abs().max(), (gradient, slopes)
        assert slopes.abs().max() > 0


def rolled(case):
    def function(controls, q, v, factors):
        return ht.rollout(case.sim, controls, q, v, scaled(case, factors))[:4]

    return function


def stepped(case):
    """Three steps, one after the other."""

    def function(controls, q, v, factors):
        state = (q, v)
        for u in controls[:3]:
            state = ht.step(case.sim, state, u, scaled(case, factors))
        return state[:2]

    return function


@pytest.fixture(scope="module")
def coupled():
    return bridge_scenes.coupled()


@pytest.fixture(scope="module")
def full():
    return bridge_scenes.coupled("full", steps=3)


@pytest.fixture(scope="module")
def touching():
    """Thrown on the floor: it presses in some steps and doesn't in others."""
    case = bridge_scenes.touching()
    gaps = case.sim.rollout(case.controls, q=case.q, v=case.v).min_gap
    assert gaps[0] > bridge_scenes.GAP > gaps[4]
    free = bridge_scenes.touching(contact=False).sim.rollout(case.controls, q=case.q, v=case.v)
    assert free.min_gap[-1] < gaps[-1] - 1e-4  # and that matters
    return case


@pytest.mark.parametrize("scene", ["coupled", "full", "touching"])
@pytest.mark.parametrize("function", [rolled, stepped])
def test_gradcheck(scene, function, request):
    case = request.getfixturevalue(scene)
    assert torch.autograd.gradcheck(function(case), inputs(case), eps=1e-6, atol=1e-7, rtol=1e-5)


def test_gradcheck_sees_a_wrong_gradient(coupled, monkeypatch):
    right = ht._bridge.Charts.entries
    monkeypatch.setattr(ht._bridge.Charts, "entries", lambda *given: 1.01 * right(*given))
    with pytest.raises(RuntimeError, match="Jacobian mismatch"):
        torch.autograd.gradcheck(rolled(coupled), inputs(coupled), eps=1e-6, atol=1e-7, rtol=1e-5)


@pytest.mark.parametrize("scene", ["coupled", "full", "touching"])
@pytest.mark.parametrize("function", [rolled, stepped])
def test_gradients_of_every_input(scene, function, request):
    case = request.getfixturevalue(scene)
    check(function(case), inputs(case), 1e-5)


def test_gradients_of_gains():
    sim = bridge_scenes.governed()
    controls = torch.zeros(6, 1, dtype=torch.float64)
    check(lambda gains: ht.rollout(sim, controls, gains=gains)[:4], (tensor(sim.gains),))

    def steps(gains):
        state = ht.initial_state(sim)
        for _ in range(3):
            state = ht.step(sim, state, gains=gains)
        return state[:2]

    check(steps, (tensor(sim.gains),))


def test_quaternions_of_other_lengths(coupled):
    """The map is that of the quaternion over its length, so its gradient is orthogonal to it."""
    controls, q, v, *_ = inputs(coupled)
    with torch.no_grad():
        q[4:] *= 1.004
    check(lambda q: ht.rollout(coupled.sim, controls.detach(), q, v.detach())[:4], (q,))
    check(lambda q: ht.step(coupled.sim, (q, v.detach()))[:2], (q,))
    ht.rollout(coupled.sim, controls, q, v).positions.square().sum().backward()
    assert q.grad[4:].abs().max() > 0
    assert abs(q.grad[4:] @ q[4:]) <= 1e-14 * q.grad[4:].norm()


def test_the_numbers_are_the_simulators(coupled):
    leaves = inputs(coupled)
    made = ht.rollout(coupled.sim, *leaves[:3])
    right = coupled.sim.rollout(coupled.controls, q=coupled.q, v=coupled.v)
    for name in ("positions", "rotations", "q", "v"):
        assert np.array_equal(getattr(made, name).detach(), getattr(right, name))
    assert np.array_equal(made.rollouts[0].min_gap, right.min_gap)
    seeds = {name: np.random.default_rng(2).normal(size=getattr(right, name).shape) for name in ("positions", "v")}
    sum((getattr(made, name) * torch.from_numpy(seed)).sum() for name, seed in seeds.items()).backward()
    gradient = right.vjp(**seeds)
    assert np.array_equal(leaves[0].grad, gradient.controls) and np.array_equal(leaves[2].grad, gradient.initial_v)
    assert np.array_equal(leaves[1].grad[:4], gradient.initial_q[:4])  # plain coordinates


def test_a_batch_is_what_its_members_are(coupled):
    random = torch.Generator().manual_seed(4)
    push = torch.randn(2, 3, 4, 1, generator=random, dtype=torch.float64)
    masses = torch.linspace(0.5, 0.7, 3, dtype=torch.float64)  # kg, along the second dimension

    def run(controls, mass):
        given = [x.clone().requires_grad_() for x in (controls, torch.tensor(coupled.q), mass)]
        made = ht.rollout(coupled.sim, given[0], given[1], parameters={"ball.mass": given[2]})
        state = ht.step(coupled.sim, (given[1], made.v[..., 0, :]), given[0][..., 0, :], {"ball.mass": given[2]})
        (made.positions.square().sum() + made.v.sum() + state.q.sum() + state.v.sum()).backward()
        return [*made[:4], *state], [x.grad for x in given], made.rollouts

    whole, bars, rollouts = run(push, masses)
    assert whole[0].shape == (2, 3, 5, 2, 3) and whole[4].shape == (2, 3, 8) and len(rollouts) == 6
    sum_q = torch.zeros(8, dtype=torch.float64)
    for b in np.ndindex(2, 3):
        one, (controls, q, _), _ = run(push[b], masses[b[1]])
        assert all(torch.equal(all_[b], alone) for all_, alone in zip(whole, one, strict=True))
        assert torch.equal(bars[0][b], controls)
        sum_q += q
    # What is shared gathers all members' gradients.
    assert torch.allclose(bars[1], sum_q, rtol=1e-12) and bars[2].shape == (3,)


def test_shared_parameters_run_as_one_batch(coupled):
    controls = torch.zeros(5, 4, 1, dtype=torch.float64)
    mass = tensor(0.6)
    made = ht.rollout(coupled.sim, controls, parameters={"ball.mass": mass})
    made.positions.sum().backward()
    assert len({id(rollout.simulator) for rollout in made.rollouts}) == 1
    alone = tensor(0.6)
    ht.rollout(coupled.sim, controls[0], parameters={"ball.mass": alone}).positions.sum().backward()
    assert torch.allclose(mass.grad, 5 * alone.grad, rtol=1e-12)


def test_steps_make_a_rollout_with_a_controller_that_remembers():
    """Driven joints, time, and a joint that the controller holds: nothing of a state is lost between steps."""
    sim = bridge_scenes.locking()
    controls = 0.5 * torch.randn(16, 1, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    right = ht.rollout(sim, controls)
    state, held = ht.initial_state(sim), []
    for n, u in enumerate(controls):
        state = ht.step(sim, state, u)
        held.append(state.held.tolist())
        assert torch.allclose(state.q, right.q[n + 1], rtol=1e-12, atol=1e-15)
        assert torch.allclose(state.v, right.v[n + 1], rtol=1e-12, atol=1e-15)
    assert state.step == 16 and held[0] == [False, False] and held[-1] == [True, False]
    # Released from another step, the motion of time is another.
    late = ht.step(sim, state._replace(step=state.step + 20), controls[0])
    assert (late.q - ht.step(sim, state, controls[0]).q).abs().max() > 1e-3


def test_steps_and_rollouts_have_one_gradient(coupled):
    one, other = tensor(coupled.controls), tensor(coupled.controls)
    ht.rollout(coupled.sim, one).q[-1].square().sum().backward()
    state = ht.initial_state(coupled.sim)
    for u in other:
        state = ht.step(coupled.sim, state, u)
    state.q.square().sum().backward()
    assert torch.allclose(one.grad, other.grad, rtol=1e-9)


def test_nothing_is_kept_where_nothing_is_differentiated(coupled):
    made = ht.rollout(coupled.sim, torch.zeros(2, 1, dtype=torch.float64))
    assert not made.q.requires_grad and made.q.grad_fn is None
    with torch.no_grad():
        assert not ht.step(coupled.sim, ht.initial_state(coupled.sim), tensor([1.0])).v.requires_grad


def test_without_steps_and_without_controls(coupled):
    """Nothing to do is nothing special, alone and in a batch."""
    v = tensor(coupled.v)
    made = ht.rollout(coupled.sim, torch.zeros(2, 0, 1, dtype=torch.float64), v=v)
    made.v.sum().backward()
    assert made.q.shape == (2, 1, 8) and torch.allclose(v.grad, torch.full_like(v, 2.0))
    sim = bridge_scenes.passive()
    mass = tensor(sim.parameters["coin.mass"])
    made = ht.rollout(sim, torch.zeros(3, 5, 0, dtype=torch.float64), parameters={"coin.mass": mass})
    made.positions.sum().backward()
    assert np.array_equal(made.q[1].detach(), sim.rollout(steps=5).q) and mass.grad < 0  # heavier, lower
    state = ht.step(sim, ht.initial_state(sim))
    assert torch.allclose(state.q, made.q[0, 1], rtol=1e-13)


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
    controls = tensor(coupled.controls)
    (slope,) = torch.autograd.grad(ht.rollout(coupled.sim, controls).q.square().sum(), controls, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        slope.sum().backward()


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


F64 = {"dtype": torch.float64}


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"controls": torch.zeros(4, 1)}, r"rollout: controls: got dtype torch.float32; .*\.double\(\)"),
        ({"controls": torch.zeros(4, 1, dtype=torch.complex128)}, "complex"),
        ({"controls": torch.zeros(4, 1, **F64, device="meta")}, r"on meta; .*\.cpu\(\)"),
        ({"controls": torch.zeros(4, 2, **F64)}, r"\(4, 2\); must have the shape \(\.\.\., steps, 1\)"),
        ({"controls": torch.zeros(1, **F64)}, r"must have the shape \(\.\.\., steps, 1\)"),
        ({"controls": torch.full((4, 1), float("nan"), **F64)}, r"controls\[0, 0\]: got NaN; must be finite"),
        ({"controls": "push"}, "must be a tensor or numbers"),
        ({"controls": torch.zeros(3, 4, 1, **F64), "q": torch.zeros(2, 8, **F64)}, r"must go with \(3,\)"),
        ({"controls": torch.zeros(0, 4, 1, **F64)}, "must hold at least one"),
        ({"q": torch.zeros(7, **F64)}, r"rollout: q: .*\(\.\.\., 8\)"),
        ({"q": torch.zeros(8, **F64)}, r"quaternion .* length 0"),
        ({"q": torch.full((8,), float("nan"), **F64)}, "finite"),
        ({"v": np.zeros(7, dtype=np.float32)}, "rollout: v: got dtype torch.float32"),
        ({"parameters": {"ball.weight": 1.0}}, r"parameters: got 'ball.weight'; must be one of .*ball\.mass"),
        ({"parameters": {"ball.mass": float("nan")}}, r"parameters\['ball.mass'\].*must be finite"),
        ({"parameters": {"ball.mass": -1.0}}, "mass"),
        ({"parameters": {"ball.mass": torch.ones(2)}}, "float32"),
        ({"gains": torch.zeros(2, **F64)}, r"gains: .*\(\.\.\., 0\)"),
    ],
)
def test_wrong_input(coupled, given, says):
    with pytest.raises(hg.InputError, match=says):
        ht.rollout(coupled.sim, **{"controls": torch.zeros(4, 1, **F64), **given})


def test_wrong_states(coupled):
    q, v, *_ = ht.initial_state(coupled.sim)
    for state, says in [
        ((q, v[:3]), r"step: state.v: .*\(\.\.\., 7\)"),
        ((q, v, -1), "step: state.step: got -1"),
        ((q, v, 0.5), "state.step: got dtype torch.float32"),
        ((q, v, torch.zeros(2, dtype=torch.int64)), r"state.step: got shape \(2,\)"),
        ((q.float(), v), "state.q: got dtype torch.float32"),
    ]:
        with pytest.raises(hg.InputError, match=says):
            ht.step(coupled.sim, state)
    with pytest.raises(hg.InputError, match="sim: got a value of type Scene"):
        ht.step(coupled.sim.scene, (q, v))


def test_a_wrong_cotangent_is_an_input_error(coupled):
    controls = tensor(coupled.controls)
    with pytest.raises(hg.InputError, match="must be finite"):
        (ht.rollout(coupled.sim, controls).positions * float("nan")).sum().backward()


def test_whole_numbers_and_arrays_are_numbers(coupled):
    right = ht.rollout(coupled.sim, torch.ones(4, 1, **F64)).q
    for given in (np.ones((4, 1)), [[1]] * 4, torch.ones(4, 1, dtype=torch.int32)):
        assert torch.equal(ht.rollout(coupled.sim, given).q, right)


@pytest.mark.parametrize("name", ["torch", "jax"])
def test_without_the_framework(name):
    """The package alone doesn't need it, and its bridge says what is missing."""
    program = f"import sys; sys.modules['{name}'] = None; import hydrograd; import hydrograd.{name}"
    folder = pathlib.Path(hg.__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=folder)
    assert done.returncode == 1
    assert f"ImportError: hydrograd.{name} needs" in done.stderr and f"pip install {name}" in done.stderr


def test_what_the_page_shows(coupled):
    """The program of docs/autodiff.md."""
    page = pathlib.Path(__file__).parents[2] / "docs/autodiff.md"
    program = page.read_text().split("```python\n")[1].split("```")[0]
    assert "import hydrograd.torch as ht" in program
    names = {"sim": coupled.sim, "policy": lambda q, v: -0.1 * v[..., :1]}
    exec(program, names)
    assert names["controls"].grad.abs().max() > 0 and names["mass"].grad is not None
    assert names["state"].step == 100
