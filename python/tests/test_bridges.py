"""The bridges to torch and JAX: gradients against differences of what they compute, numbers against the simulator's.

What only one framework has is in test_torch.py and test_jax.py.
"""

import pathlib
import subprocess
import sys

import bridge_scenes
import frameworks
import numpy as np
import pytest

import hydrograd as hg


@pytest.fixture(scope="module", params=["torch", "jax"])
def on(request):
    """A framework."""
    return frameworks.MADE[request.param]()


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


def inputs(case):
    """Controls, q, v, and by how much each parameter is multiplied."""
    return case.controls, case.q, case.v, np.ones(len(case.parameters))


def scaled(case, factors):
    return {name: value * factor for (name, value), factor in zip(case.parameters.items(), factors, strict=True)}


def rolled(on, case):
    def function(controls, q, v, factors):
        return on.bridge.rollout(case.sim, controls, q, v, scaled(case, factors))[:5]

    return function


def stepped(on, case):
    """Three steps, one after the other."""

    def function(controls, q, v, factors):
        state = (q, v)
        for u in controls[:3]:
            state = on.bridge.step(case.sim, state, u, scaled(case, factors))
        return state[:2]

    return function


def check(on, function, given, tolerance):
    """Gradients of a weighted sum against central differences of all entries, quaternions' included: relative to the
    largest of each input."""

    def weighted(*given):
        parts = [out.reshape(-1) for out in function(*given)]
        weights = [on.array(np.sin(np.linspace(-1.0, 1.3, len(part)))) for part in parts]
        return sum((weight * part).sum() for weight, part in zip(weights, parts, strict=True))

    scalar = on.compiled(weighted)
    _, found = on.differentiate(lambda *given: (weighted(*given), []), *given)
    for i, gradient in enumerate(found):
        slopes = np.zeros(gradient.shape)
        for at in np.ndindex(*gradient.shape):
            step = 1e-5 * max(1e-2, abs(given[i][at]))
            ends = []
            for sign in (1, -1):
                moved = [np.array(x) for x in given]
                moved[i][at] += sign * step
                ends.append(float(scalar(*map(on.array, moved))))
            slopes[at] = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(gradient - slopes).max() <= tolerance * np.abs(slopes).max(), (i, gradient, slopes)
        assert np.abs(slopes).max() > 0


# Contact sets in over half a millimetre: differences there are off by the square of a smaller length.
@pytest.mark.parametrize(("scene", "eps"), [("coupled", 1e-5), ("full", 1e-5), ("touching", 1e-6)])
@pytest.mark.parametrize("function", [rolled, stepped])
def test_gradcheck(on, scene, eps, function, request):
    """By the frameworks' own checks."""
    case = request.getfixturevalue(scene)
    on.gradcheck(function(on, case), *inputs(case), eps=eps)


def test_gradcheck_sees_a_wrong_gradient(on, coupled, monkeypatch):
    charts = on.bridge._bridge.Charts
    right = charts.entries
    monkeypatch.setattr(charts, "entries", lambda *given: 1.01 * right(*given))
    kind, message = on.fails
    with pytest.raises(kind, match=message):
        on.gradcheck(rolled(on, coupled), *inputs(coupled), eps=1e-5)


@pytest.mark.parametrize("scene", ["coupled", "full", "touching"])
@pytest.mark.parametrize("function", [rolled, stepped])
def test_gradients_of_every_input(on, scene, function, request):
    case = request.getfixturevalue(scene)
    check(on, function(on, case), inputs(case), 1e-5)


def test_gradients_of_gains(on):
    sim = bridge_scenes.governed()
    controls = np.zeros((6, 1))
    check(on, lambda gains: on.bridge.rollout(sim, controls, gains=gains)[:5], [np.array(sim.gains)], 1e-6)

    def steps(gains):
        state = on.bridge.initial_state(sim)
        for _ in range(3):
            state = on.bridge.step(sim, state, gains=gains)
        return state[:2]

    check(on, steps, [np.array(sim.gains)], 1e-6)


def test_quaternions_of_other_lengths(on, coupled):
    """The map is that of the quaternion over its length, so its gradient is orthogonal to it."""
    controls, q, v, *_ = inputs(coupled)
    q = q.copy()
    q[4:] *= 1.004
    check(on, lambda q: on.bridge.rollout(coupled.sim, controls, q, v)[:4], [q], 2e-6)
    check(on, lambda q: on.bridge.step(coupled.sim, (q, on.array(v)))[:2], [q], 2e-6)
    _, (gradient,) = on.differentiate(
        lambda q: ((on.bridge.rollout(coupled.sim, controls, q, v).positions ** 2).sum(), []), q
    )
    assert np.abs(gradient[4:]).max() > 0
    assert abs(gradient[4:] @ q[4:]) <= 1e-14 * np.linalg.norm(gradient[4:])


def test_the_numbers_are_the_simulators(on, coupled):
    right = coupled.sim.rollout(coupled.controls, q=coupled.q, v=coupled.v)
    random = np.random.default_rng(2)
    seeds = {name: random.normal(size=getattr(right, name).shape) for name in ("positions", "v")}

    def run(controls, q, v):
        made = on.bridge.rollout(coupled.sim, controls, q, v)
        cost = sum((getattr(made, name) * on.array(seed)).sum() for name, seed in seeds.items())
        return cost, made[:5]

    made, bars = on.differentiate(run, coupled.controls, coupled.q, coupled.v)
    for name, array in zip(("positions", "rotations", "q", "v", "applied_controls"), made, strict=True):
        assert np.array_equal(array, getattr(right, name))
    gradient = right.vjp(**seeds)
    assert np.array_equal(bars[0], gradient.controls) and np.array_equal(bars[2], gradient.initial_v)
    assert np.array_equal(bars[1][:4], gradient.initial_q[:4])  # plain coordinates


def test_a_batch_is_what_its_members_are(on, coupled):
    push = np.random.default_rng(4).normal(size=(2, 3, 4, 1))
    masses = np.linspace(0.5, 0.7, 3)  # kg, along the second dimension

    def run(controls, q, mass):
        made = on.bridge.rollout(coupled.sim, controls, q, parameters={"ball.mass": mass})
        state = on.bridge.step(coupled.sim, (q, made.v[..., 0, :]), controls[..., 0, :], {"ball.mass": mass})
        cost = (made.positions**2).sum() + made.v.sum() + state.q.sum() + state.v.sum()
        return cost, [*made[:5], *state]

    whole, bars = on.differentiate(run, push, coupled.q, masses)
    assert whole[0].shape == (2, 3, 5, 2, 3) and whole[4].shape == (2, 3, 4, 1) and whole[5].shape == (2, 3, 8)
    sum_q = np.zeros(8)
    for b in np.ndindex(2, 3):
        one, (controls, q, _) = on.differentiate(run, push[b], coupled.q, masses[b[1]])
        assert all(np.array_equal(all_[b], alone) for all_, alone in zip(whole, one, strict=True))
        assert np.array_equal(bars[0][b], controls)
        sum_q += q
    # What is shared gathers all members' gradients.
    assert np.allclose(bars[1], sum_q, rtol=1e-12) and bars[2].shape == (3,)


def test_steps_make_a_rollout_with_a_controller_that_remembers(on):
    """Driven joints, time, and a joint that the controller holds: nothing of a state is lost between steps."""
    sim = bridge_scenes.locking()
    controls = 0.5 * np.random.default_rng(1).normal(size=(16, 1))
    right = on.bridge.rollout(sim, controls)
    state, held = on.bridge.initial_state(sim), []
    for n, u in enumerate(controls):
        state = on.bridge.step(sim, state, u)
        held.append(state.held.tolist())
        assert np.allclose(on.numbers(state.q), on.numbers(right.q)[n + 1], rtol=1e-12, atol=1e-15)
        assert np.allclose(on.numbers(state.v), on.numbers(right.v)[n + 1], rtol=1e-12, atol=1e-15)
    assert state.step == 16 and held[0] == [False, False] and held[-1] == [True, False]
    # Released from another step, the motion of time is another: where it has its joint is left to it.
    later = state._replace(step=state.step + 20)
    with pytest.raises(hg.InputError, match="other.position: got .* its motion has"):
        on.bridge.step(sim, later, controls[0])
    q, v = (on.numbers(x) * [1.0, 0.0] for x in (state.q, state.v))
    late = on.bridge.step(sim, later._replace(q=q, v=v), controls[0])
    assert np.abs(on.numbers(late.q) - on.numbers(on.bridge.step(sim, state, controls[0]).q)).max() > 1e-3


def test_steps_and_rollouts_have_one_gradient(on, coupled):
    def whole(controls):
        return (on.bridge.rollout(coupled.sim, controls).q[-1] ** 2).sum(), []

    def by_steps(controls):
        state = on.bridge.initial_state(coupled.sim)
        for u in controls:
            state = on.bridge.step(coupled.sim, state, u)
        return (state.q**2).sum(), []

    (_, (one,)), (_, (other,)) = (on.differentiate(f, coupled.controls) for f in (whole, by_steps))
    assert np.allclose(one, other, rtol=1e-9)


def test_without_steps_and_without_controls(on, coupled):
    """Nothing to do is nothing special, alone and in a batch."""
    none = np.zeros((2, 0, 1))

    def at_once(v):
        made = on.bridge.rollout(coupled.sim, none, v=v)
        return made.v.sum(), [made.q]

    (q,), (v_bar,) = on.differentiate(at_once, coupled.v)
    assert q.shape == (2, 1, 8) and np.allclose(v_bar, 2.0)
    sim = bridge_scenes.passive()

    def sinking(mass):
        made = on.bridge.rollout(sim, np.zeros((3, 5, 0)), parameters={"coin.mass": mass})
        return made.positions.sum(), [made.q]

    (q,), (mass_bar,) = on.differentiate(sinking, sim.parameters["coin.mass"])
    assert np.array_equal(q[1], sim.rollout(steps=5).q) and mass_bar < 0  # heavier, lower
    state = on.bridge.step(sim, on.bridge.initial_state(sim))
    assert np.allclose(on.numbers(state.q), q[0, 1], rtol=1e-13)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"controls": np.zeros((4, 1), dtype=np.float32)}, "rollout: controls: got dtype {precision}"),
        ({"controls": np.zeros((4, 1), dtype=complex)}, "complex"),
        ({"controls": np.zeros((4, 2))}, r"\(4, 2\); must have the shape \(\.\.\., steps, 1\)"),
        ({"controls": np.zeros(1)}, r"must have the shape \(\.\.\., steps, 1\)"),
        ({"controls": np.full((4, 1), np.nan)}, r"controls\[0, 0\]: got (NaN|nan); must be finite"),
        ({"controls": "push"}, "must be (a tensor|an array) or numbers"),
        ({"controls": np.zeros((3, 4, 1)), "q": np.zeros((2, 8))}, r"must go with \(3,\)"),
        ({"controls": np.zeros((0, 4, 1))}, "must hold at least one"),
        ({"q": np.zeros(7)}, r"rollout: q: .*\(\.\.\., 8\)"),
        ({"q": np.zeros(8)}, r"quaternion .* length 0"),
        ({"q": np.full(8, np.nan)}, "finite"),
        ({"v": np.zeros(6)}, r"rollout: v: .*\(\.\.\., 7\)"),
        ({"v": np.zeros(7, dtype=np.float32)}, r"rollout: v: got dtype (torch\.)?float32"),
        ({"parameters": {"ball.weight": 1.0}}, r"parameters: got 'ball.weight'; must be one of .*ball\.mass"),
        ({"parameters": {"ball.mass": float("nan")}}, r"parameters\['ball.mass'\].*must be finite"),
        ({"parameters": {"ball.mass": -1.0}}, "mass"),
        ({"parameters": {"ball.mass": np.ones(2, dtype=np.float32)}}, "float32"),
        ({"gains": np.zeros(2)}, r"gains: .*\(\.\.\., 0\)"),
    ],
)
def test_wrong_input(on, coupled, given, says):
    with pytest.raises(hg.InputError, match=says.replace("{precision}", on.precision)):
        on.bridge.rollout(coupled.sim, **{"controls": np.zeros((4, 1)), **given})


def test_wrong_states(on, coupled):
    q, v, *_ = on.bridge.initial_state(coupled.sim)
    for state, says in [
        ((q, v[:3]), r"step: state.v: .*\(\.\.\., 7\)"),
        ((q, v, -1), "step: state.step: got -1"),
        ((q, v, 0.5), r"state.step: got dtype (torch\.)?float"),
        ((q, v, on.whole([0, 0])), r"state.step: got shape \(2,\)"),
        ((on.single(on.numbers(q)), v), r"state.q: got dtype (torch\.)?float32"),
    ]:
        with pytest.raises(hg.InputError, match=says):
            on.bridge.step(coupled.sim, state)
    with pytest.raises(hg.InputError, match="sim: got a value of type Scene"):
        on.bridge.step(coupled.sim.scene, (q, v))


def test_a_wrong_cotangent_is_an_input_error(on, coupled):
    with pytest.raises(hg.InputError, match="must be finite"):
        on.differentiate(
            lambda controls: ((on.bridge.rollout(coupled.sim, controls).positions * float("nan")).sum(), []),
            coupled.controls,
        )


def test_a_batch_of_one_fails_as_batches_do(on, coupled):
    sim = bridge_scenes.locking()
    # The motion of time has its joint elsewhere then.
    late = on.bridge.initial_state(sim)._replace(step=20)
    for run, given in (
        (lambda u: on.bridge.rollout(coupled.sim, u), np.full((4, 1), 1e300)),
        (lambda u: on.bridge.step(sim, late, u), np.zeros(1)),
    ):
        with pytest.raises(hg.Error) as alone:
            run(on.array(given))
        assert not isinstance(alone.value, hg.BatchError)
        for lead in ((1,), (1, 1), (2,)):
            with pytest.raises(hg.BatchError, match="member 0") as batch:
                run(on.array(np.tile(given, (*lead, *(1,) * given.ndim))))
            assert str(batch.value.errors[0]) == str(alone.value)


def test_whole_numbers_and_arrays_are_numbers(on, coupled):
    right = on.numbers(on.bridge.rollout(coupled.sim, on.array(np.ones((4, 1)))).q)
    for given in (np.ones((4, 1)), [[1]] * 4, on.whole([[1]] * 4)):
        assert np.array_equal(on.numbers(on.bridge.rollout(coupled.sim, given).q), right)


@pytest.mark.parametrize("name", ["torch", "jax"])
def test_without_the_framework(name):
    """The package alone doesn't need it, and its bridge says what is missing."""
    program = f"import sys; sys.modules['{name}'] = None; import hydrograd; import hydrograd.{name}"
    folder = pathlib.Path(hg.__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=folder)
    assert done.returncode == 1
    assert f"ImportError: hydrograd.{name} needs" in done.stderr and f"pip install {name}" in done.stderr


def program_of_the_page(n):
    """The n-th program of docs/autodiff.md."""
    page = pathlib.Path(__file__).parents[2] / "docs/autodiff.md"
    return page.read_text().split("```python\n")[n].split("```")[0]


def test_what_the_page_shows_of_torch(coupled):
    frameworks.Torch()
    program = program_of_the_page(1)
    assert "import hydrograd.torch as ht" in program
    names = {"sim": coupled.sim, "policy": lambda q, v: -0.1 * v[..., :1]}
    exec(program, names)
    assert names["controls"].grad.abs().max() > 0 and names["mass"].grad is not None
    assert names["state"].step == 100


def test_what_the_page_shows_of_jax(coupled):
    on = frameworks.Jax()
    program = program_of_the_page(2)
    assert "import hydrograd.jax as hj" in program
    batch = on.array(np.random.default_rng(1).normal(size=(2, 100, 1)))
    names = {"sim": coupled.sim, "batch": batch, "controls": batch[0]}
    exec(program, names)
    controls_bar, mass_bar = names["gradients"]
    assert controls_bar.shape == (2, 100, 1) and mass_bar.shape == (2,) and np.abs(mass_bar).min() > 0
    assert names["states"].q.shape == (100, 8)
