"""Rollouts as tables, labelled arrays and pictures."""

import pathlib
import sys

import numpy as np
import pytest

import hydrograd as hg

SCENES = pathlib.Path(__file__).parents[2] / "examples/scenes"


@pytest.fixture(scope="module")
def rollout():
    sim = hg.Simulator(hg.Scene.load(SCENES / "gripper.toml"), fidelity="isolated")
    return sim.rollout(np.full((60, sim.control_size), 1.0))


def test_pandas(rollout):
    pytest.importorskip("pandas")
    table = hg.to_pandas(rollout)
    assert list(table.index) == list(rollout.time) and table.index.name == "time"
    assert np.array_equal(table["palm.position"], rollout.q[:, 0])
    assert np.array_equal(table["pebble.rate"], rollout.v[:, -1])
    acted = table[rollout.simulator.control_names].to_numpy()
    assert np.array_equal(acted[:-1], rollout.applied_controls) and np.isnan(acted[-1]).all()


def test_xarray(rollout):
    pytest.importorskip("xarray")
    data = hg.to_xarray(rollout)
    assert np.array_equal(data.q.sel(coordinate="pebble.z"), rollout.q[:, 4])
    assert np.array_equal(data.positions.sel(body="pebble"), rollout.positions[:, 3])
    assert np.array_equal(data.velocities.sel(body="palm", component="vz"), rollout.velocities[:, 0, 2])
    assert np.array_equal(data.momentum.sel(direction="lz"), rollout.momentum[:, 5])
    forces = rollout.observe("contact_forces")
    assert np.nanmax(np.abs(forces)) > 0.0  # the pebble lies on the floor
    assert np.array_equal(data.contact_forces, forces, equal_nan=True)
    assert list(data.control.values) == rollout.simulator.control_names
    assert list(data.control_unit.values) == rollout.simulator.control_units == ["N", "N m", "N m"]
    assert data.controls.attrs["units"] == "N, N m"
    assert data.controls.shape == (60, 3) and data.positions.attrs["units"] == "m"
    assert data.rotations.shape == (61, 4, 3, 3) and data.attrs["fidelity"] == "isolated"


def test_plot(rollout, tmp_path):
    pytest.importorskip("matplotlib")
    figure = hg.plot(rollout, ["q", "v", "controls", "energy", "contact_forces", "min_gap"])
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "coordinates, m, rad",
        "velocities, m/s, rad/s",
        "controls, N, N m",
        "energy, J",
        "contact forces, N",
        "smallest gap, m",
    ]
    assert np.array_equal(figure.axes[0].lines[3].get_ydata(), rollout.q[:, 3])
    figure.savefig(tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 20_000
    with pytest.raises(hg.InputError, match="speed"):
        hg.plot(rollout, ["speed"])
    # A scene without contact or control has neither panel.
    scene = hg.Scene()
    scene.add(hg.Body(hg.sphere(0.1), density=1000.0))
    alone = hg.Simulator(scene, fidelity="isolated").rollout(steps=2)
    assert len(hg.plot(alone, ["controls", "energy", "contact_forces", "min_gap"]).axes) == 1


def test_what_is_missing_is_said(rollout, monkeypatch):
    for module in ("pandas", "xarray", "matplotlib", "matplotlib.figure"):
        monkeypatch.setitem(sys.modules, module, None)
    for call, package in ((hg.to_pandas, "pandas"), (hg.to_xarray, "xarray"), (hg.plot, "matplotlib")):
        with pytest.raises(ImportError, match=f"pip install {package}"):
            call(rollout)
