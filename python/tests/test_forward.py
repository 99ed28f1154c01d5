"""Forward mode: tangents, Jacobians and linearisations, alone and through torch and JAX."""

import bridge_scenes
import numpy as np
import pytest

import hydrograd as hg

NAMES = ["fluid.density", "ball.mass", "coin.mass", "coin.inertia.xx"]


@pytest.fixture(scope="module")
def coupled():
    return bridge_scenes.coupled()


@pytest.fixture(scope="module")
def rollout(coupled):
    return coupled.sim.rollout(coupled.controls, q=coupled.q, v=coupled.v)


@pytest.fixture(scope="module")
def along(rollout):
    """Three directions of everything."""
    random, sim = np.random.default_rng(4), rollout.simulator
    return {
        "controls": random.normal(size=(3, *rollout.controls.shape)),
        "q": 0.1 * random.normal(size=(3, sim.v_size)),
        "v": random.normal(size=(3, sim.v_size)),
        "parameters": {name: sim.parameters[name] * random.normal(size=3) for name in NAMES},
    }


def one(along, k):
    parameters = {name: x[k] for name, x in along["parameters"].items()}
    return {**{name: x[k] for name, x in along.items() if name != "parameters"}, "parameters": parameters}


def test_tangents_are_what_the_gradient_is_the_transpose_of(rollout, along):
    random = np.random.default_rng(5)
    made = rollout.jvp(**along, observables=["velocities", "angular_momentum"])
    bars = {name: random.normal(size=getattr(made, name).shape[1:]) for name in ("q", "v", "positions", "rotations")}
    others = {name: random.normal(size=x.shape[1:]) for name, x in made.observables.items()}
    gradient = rollout.vjp(**bars, observables=others)
    for k in range(3):
        forth = sum(np.sum(bar * getattr(made, name)[k]) for name, bar in bars.items())
        forth += sum(np.sum(bar * made.observables[name][k]) for name, bar in others.items())
        d = one(along, k)
        back = np.sum(gradient.controls * d["controls"]) + gradient.initial_q @ d["q"] + gradient.initial_v @ d["v"]
        back += sum(gradient.parameters[name] * x for name, x in d["parameters"].items())
        assert abs(forth - back) < 1e-10 * abs(forth)


def test_many_directions_are_one_by_one(rollout, along):
    many = rollout.jvp(**along)
    for k in range(3):
        alone = rollout.jvp(**one(along, k))
        for name in ("q", "v", "positions", "rotations"):
            found, right = getattr(many, name)[k], getattr(alone, name)
            assert found.shape == right.shape
            assert np.allclose(found, right, rtol=1e-11, atol=1e-13 * np.abs(right).max())
    shared = rollout.jvp(q=along["q"][0], v=along["v"])
    assert np.allclose(shared.v[1], rollout.jvp(q=along["q"][0], v=along["v"][1]).v, rtol=1e-11)


def test_jacobians_by_differences(coupled, rollout):
    found = rollout.jacobian(NAMES, of=["positions", "v"], states=[2, -1])
    assert found["positions"].shape == (2, 2, 3, 4) and found["v"].shape == (2, 7, 4)
    for i, name in enumerate(NAMES):
        value = coupled.sim.parameters[name]
        h = 1e-4 * value

        def run(x, name=name):
            return coupled.sim.with_parameters({name: x}).rollout(coupled.controls, q=coupled.q, v=coupled.v)

        ahead, behind = run(value + h), run(value - h)
        for part in ("positions", "v"):
            slope = (getattr(ahead, part) - getattr(behind, part))[[2, -1]] / (2 * h)
            assert np.allclose(found[part][..., i], slope, rtol=1e-5, atol=1e-6 * np.abs(slope).max())


def test_columns_of_jacobians_come_in_order(rollout):
    steps, nu, nv = rollout.steps, rollout.simulator.control_size, rollout.simulator.v_size
    found = rollout.jacobian(["ball.mass"], q=True, v=True, controls=True)
    assert found["q"].shape == (steps + 1, nv, 1 + 2 * nv + steps * nu)
    controls = np.zeros(rollout.controls.shape)
    controls[2, 0] = 1.0
    cases = {0: {"parameters": {"ball.mass": 1.0}}, 1 + 3: {"q": np.eye(nv)[3]}, 1 + nv + 2: {"v": np.eye(nv)[2]}}
    cases[1 + 2 * nv + 2 * nu] = {"controls": controls}
    for column, direction in cases.items():
        right = rollout.jvp(**direction)
        for name in ("q", "v"):
            exact = getattr(right, name)
            assert np.allclose(found[name][..., column], exact, rtol=1e-10, atol=1e-11 * np.abs(exact).max())
    assert rollout.jacobian(["ball.mass"])["v"].shape == (steps + 1, nv, 1)


def test_linearisations_of_all_steps(rollout):
    a, b, p = rollout.step_jacobians(NAMES)
    n, nv = rollout.steps, rollout.simulator.v_size
    assert a.shape == (n, 2 * nv, 2 * nv) and b.shape == (n, 2 * nv, 1) and p.shape == (n, 2 * nv, 4)
    assert all(np.array_equal(x, y) for x, y in zip(rollout.step_jacobians(), (a, b), strict=True))
    whole = rollout.jacobian(NAMES, q=True, v=True, states=[-1])
    by_x = np.concatenate([whole["q"][0], whole["v"][0]])
    product, by_parameters = np.eye(2 * nv), np.zeros((2 * nv, 4))
    for a_n, p_n in zip(a, p, strict=True):
        product, by_parameters = a_n @ product, a_n @ by_parameters + p_n
    assert np.allclose(product, by_x[:, 4:], rtol=1e-9, atol=1e-10)
    assert np.allclose(by_parameters, by_x[:, :4], rtol=1e-9, atol=1e-12)


def test_one_step(coupled):
    sim = coupled.sim
    _, record = sim.step(sim.state(coupled.q, coupled.v), coupled.controls[0])
    a, b, p = record.jacobians(NAMES)
    dq, dv = record.jvp(parameters={"ball.mass": [1.0, 2.0]}, u=[0.5])
    right = p[:, 1] + 0.5 * b[:, 0], 2 * p[:, 1] + 0.5 * b[:, 0]
    assert dq.shape == dv.shape == (2, sim.v_size) and a.shape == (14, 14)
    assert np.allclose(np.concatenate([dq, dv], axis=1), right, rtol=1e-11)


def test_wrong_directions_are_named(rollout):
    with pytest.raises(hg.InputError, match=r"jvp: v: got an array of shape \(2, 3\)"):
        rollout.jvp(v=np.zeros((2, 3)))
    with pytest.raises(hg.InputError, match="2 directions; must be 3"):
        rollout.jvp(v=np.zeros((2, 7)), q=np.zeros((3, 7)))
    with pytest.raises(hg.InputError, match="ball.weight"):
        rollout.jvp(parameters={"ball.weight": 1.0})
    with pytest.raises(hg.InputError, match="ball.weight"):
        rollout.jacobian(["ball.weight"])
    with pytest.raises(hg.UnsupportedError, match="derivative of the observable \"energy\""):
        rollout.jvp(v=np.zeros(7), observables=["energy"])
    with pytest.raises(IndexError, match="state 9"):
        rollout.jacobian(NAMES, states=[9])


def framework(name):
    pytest.importorskip(name)
    if name == "jax":
        import jax

        jax.config.update("jax_enable_x64", True)
        import hydrograd.jax as bridge

        return bridge, jax.numpy.asarray, jax.jvp, jax.jacfwd, jax.jacrev
    import torch

    import hydrograd.torch as bridge

    def tensor(x):
        return torch.tensor(np.asarray(x), dtype=torch.float64)

    return bridge, tensor, torch.func.jvp, torch.func.jacfwd, torch.func.jacrev


@pytest.fixture(scope="module", params=["torch", "jax"])
def bridge(request):
    return framework(request.param)


def functions(case, bridge):
    """A rollout and some steps of everything, with quaternions of other lengths than one."""

    def whole(controls, q, v, mass):
        made = bridge.rollout(case.sim, controls, q, v, {"ball.mass": mass})
        return made.positions, made.rotations, made.q, made.v

    def by_steps(controls, q, v, mass):
        state = bridge.State(q, v)
        for n in range(2):
            state = bridge.step(case.sim, state, controls[n], {"ball.mass": mass})
        return state.q, state.v

    return whole, by_steps


def test_both_modes_of_frameworks_agree(coupled, bridge):
    module, array, jvp, jacfwd, jacrev = bridge
    given = [array(x) for x in (coupled.controls, coupled.q * 1.001, coupled.v, 0.6)]
    random = np.random.default_rng(6)
    for function in functions(coupled, module):
        places = (0, 1, 2, 3)
        forward, reverse = jacfwd(function, argnums=places)(*given), jacrev(function, argnums=places)(*given)
        along = [array(random.normal(size=np.shape(x))) for x in given]
        _, tangents = jvp(function, tuple(given), tuple(along))
        for f, r, t in zip(forward, reverse, tangents, strict=True):
            product = 0.0
            for part, other, d in zip(f, r, along, strict=True):
                part, other, d = np.asarray(part), np.asarray(other), np.asarray(d)
                assert np.allclose(part, other, rtol=1e-8, atol=1e-9 * max(1.0, np.abs(other).max()))
                product = product + np.tensordot(part, d, axes=d.ndim)
            assert np.allclose(np.asarray(t), product, rtol=1e-9, atol=1e-10)


def test_a_jacobian_of_jax_takes_one_run(coupled, monkeypatch):
    hj, array, _, jacfwd, _ = framework("jax")
    calls = []
    right = hj._bridge.roll
    monkeypatch.setattr(hj._bridge, "roll", lambda *given: (calls.append(1), right(*given))[1])
    import jax

    jacobian = jax.jit(jacfwd(lambda u: hj.rollout(coupled.sim, u).q))(array(coupled.controls))
    assert jacobian.shape == (5, 8, 4, 1) and 1 <= len(calls) <= 2
    batched = jax.vmap(jacfwd(lambda u: hj.rollout(coupled.sim, u).q))(array(np.stack([coupled.controls] * 2)))
    assert np.allclose(batched[1], jacobian, rtol=1e-12, atol=1e-15)


def test_jax_checks_forward_mode(coupled):
    hj, array, *_ = framework("jax")
    from jax.test_util import check_grads

    def function(controls, mass):
        return hj.rollout(coupled.sim, controls, parameters={"ball.mass": mass}).positions

    check_grads(function, (array(coupled.controls), array(0.6)), order=1, modes=["fwd", "rev"], eps=1e-4, rtol=1e-5)


def test_torch_checks_forward_mode(coupled):
    ht, array, *_ = framework("torch")
    import torch

    def function(controls, v):
        return ht.rollout(coupled.sim, controls, v=v).positions

    given = tuple(x.requires_grad_() for x in (array(coupled.controls), array(coupled.v)))
    assert torch.autograd.gradcheck(function, given, eps=1e-6, atol=1e-7, rtol=1e-5, check_forward_ad=True)
    batch = torch.func.vmap(lambda u: ht.rollout(coupled.sim, u).q)(array(np.stack([coupled.controls] * 3)))
    assert np.array_equal(batch[2], ht.rollout(coupled.sim, array(coupled.controls)).q)


def test_second_derivatives_are_refused(coupled):
    hj, array, _, jacfwd, jacrev = framework("jax")
    for outer in (jacfwd, jacrev):
        for inner in (jacfwd, jacrev):
            with pytest.raises(hg.UnsupportedError, match="derivatives of derivatives"):
                outer(inner(lambda u: hj.rollout(coupled.sim, u).q[-1].sum()))(array(coupled.controls))
