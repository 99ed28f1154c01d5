"""Sensors in the water, their gradients, the potential, streamlines and tracers."""

import numpy as np
import pytest

import hydrograd as hg

POINT = [0.0, 0.35, 0.05]


@pytest.fixture(scope="module")
def sim() -> hg.Simulator:
    scene = hg.Scene(gravity=(0, 0, 0))
    scene.add(hg.Body(hg.ellipsoid(0.2, 0.1, 0.15), density=998.0, name="fish", actuated=True))
    return hg.Simulator(scene, dt=0.02, fidelity="isolated", faces=80)


def rollout(sim: hg.Simulator, scale: float = 1.0) -> hg.Rollout:
    push = np.outer(np.linspace(1.0, 0.5, 5), [2.0, 1.0, -1.0, 0.1, 0.0, 0.2])
    return sim.rollout(scale * push)


@pytest.mark.parametrize("body", [None, "fish", 0])
def test_losses_of_readings_have_gradients(sim: hg.Simulator, body: str | int | None) -> None:
    def read(scale: float) -> tuple[np.ndarray, np.ndarray]:
        run = rollout(sim, scale)
        return run.sensor_flow([POINT], body), run.sensor_pressure([POINT], body)

    run = rollout(sim)
    flow, pressure = read(1.0)
    assert flow.shape == (6, 1, 3)
    assert pressure.shape == (6, 1)
    seed = run.sensor_vjp([POINT], body, flow=2 * flow, pressure=1e-4 * np.ones_like(pressure))
    gradient = run.vjp(**seed)
    slope = (gradient.controls * run.controls).sum()

    def loss(scale: float) -> float:
        flow, pressure = read(scale)
        return float((flow**2).sum() + 1e-4 * pressure.sum())

    h = 1e-4
    difference = (loss(1 + h) - loss(1 - h)) / (2 * h)
    assert slope == pytest.approx(difference, rel=1e-6)
    assert gradient.parameters["fluid.density"] != 0.0


def test_objectives_of_readings(sim: hg.Simulator) -> None:
    goal = hg.objective.mean_flow(POINT, [0.1, 0, 0], body="fish") + 1e-4 * hg.objective.final_pressure(POINT, 3.0)
    goal = goal + hg.objective.final_flow(POINT, [0, 0, 0]) + 1e-5 * hg.objective.mean_pressure(POINT, 1.0, body=0)
    run = rollout(sim)
    slope = (run.gradient(goal).controls * run.controls).sum()
    h = 1e-4
    difference = (rollout(sim, 1 + h).value(goal) - rollout(sim, 1 - h).value(goal)) / (2 * h)
    assert slope == pytest.approx(difference, rel=1e-6)


def test_readings_are_the_flow(sim: hg.Simulator) -> None:
    run = rollout(sim)
    flow = run.sensor_flow([POINT, POINT], [None, "fish"])
    np.testing.assert_allclose(flow[0, 0], run.flow(0, [POINT])[0], rtol=1e-10)
    carried = run.positions[-1, 0] + run.rotations[-1, 0] @ POINT
    np.testing.assert_allclose(flow[-1, 1], run.flow(-1, [carried])[0], rtol=1e-10)


def test_the_potential_is_that_of_the_flow(sim: hg.Simulator) -> None:
    run = rollout(sim)
    h = 1e-4
    sides = [np.add(POINT, s * h * axis) for axis in np.eye(3) for s in (1, -1)]
    phi = run.potential(-1, sides)
    assert phi.shape == (6,)
    slope = (phi[::2] - phi[1::2]) / (2 * h)
    flow = run.flow(-1, [POINT])[0]
    assert np.linalg.norm(slope + flow) < 0.1 * np.linalg.norm(flow)


def test_lines(sim: hg.Simulator) -> None:
    run = rollout(sim)
    [line] = run.streamlines(-1, [POINT], 0.5, within=([-1, -1, -1], [1, 1, 1]))
    assert line["points"].shape == line["velocities"].shape
    np.testing.assert_array_equal(line["points"][line["seed"]], POINT)
    assert all(e in ("length", "box", 'body "fish"') for e in line["ends"])
    [line] = run.streamlines(-1, [POINT], 0.1, way="forward")
    assert line["seed"] == 0
    assert line["ends"] == [None, "length"]
    [path] = run.path_lines([POINT])
    assert path["points"].shape == (6, 3)
    assert path["end"] == "length"
    np.testing.assert_allclose(path["times"], run.time)


def test_what_is_refused_has_a_name(sim: hg.Simulator) -> None:
    run = rollout(sim)
    many = np.broadcast_to(np.array(POINT), (1_000_000_000, 3))
    for call in (
        lambda: run.flow(0, many),
        lambda: run.flow_pressure(0, many),
        lambda: run.flow_resolved(0, many),
        lambda: run.potential(0, many),
        lambda: run.sensor_flow(many),
        lambda: run.streamlines(0, many, 1.0),
    ):
        with pytest.raises(hg.Error, match="their number.*1000000000.*20000000"):
            call()
    with pytest.raises(hg.Error, match="way"):
        run.streamlines(0, [POINT], 1.0, way="up")
    with pytest.raises(hg.Error, match=r"seeds.*finite"):
        run.streamlines(0, [[np.nan, 0, 0]], 1.0)
    with pytest.raises(hg.Error, match="shark"):
        run.sensor_flow([POINT], "shark")
    with pytest.raises(hg.Error, match="bodies"):
        run.sensor_flow([POINT], ["fish", None])
    with pytest.raises(hg.Error, match="fish"):
        run.sensor_flow([[0.0, 0.0, 0.0]])
    with pytest.raises(hg.Error, match="shape"):
        run.sensor_vjp([POINT], flow=np.zeros((6, 3)))


def test_streamlines_in_files(sim: hg.Simulator, tmp_path) -> None:
    files = rollout(sim).write_vtk(tmp_path, every=5, streamlines=([POINT], 0.3))
    assert [f.name for f in files] == ["bodies.pvd", "streamlines.pvd"]
