"""A rollout as what other programs work with: a table, labelled arrays, a picture."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hydrograd._hydrograd import InputError, Rollout, Simulator

if TYPE_CHECKING:
    import matplotlib.figure
    import pandas
    import xarray

# Observables of each body: name, what its last index counts, unit.
OF_BODIES = {
    "positions": (("x", "y", "z"), "m"),
    "velocities": (("vx", "vy", "vz", "wx", "wy", "wz"), "m/s, rad/s"),
    "angular_momentum": (("x", "y", "z"), "kg m²/s"),
    "contact_forces": (("x", "y", "z"), "N"),
}
PANELS = ("q", "v", "controls", "energy", "contact_forces", "min_gap")


def _needs(module: str, what: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        name = module.split(".")[0]
        raise ImportError(f"hydrograd.{what} needs {name}: pip install {name}") from error


def to_pandas(rollout: Rollout) -> pandas.DataFrame:
    """The states 0 … N as a table with the time (s) as its index: coordinates and velocities by name, energy, momenta of all together, smallest gap, and the controls that acted from
    there on by name (NaN at the last state); SI units.

    It has the columns of `Rollout.to_dict` and needs pandas.
    """
    pandas = _needs("pandas", "to_pandas")
    columns = rollout.to_dict()
    return pandas.DataFrame(columns, index=pandas.Index(columns.pop("time"), name="time"))


def _units(sim: Simulator) -> str:
    """Those of the controls, each once."""
    return ", ".join(dict.fromkeys(sim.control_units))


def to_xarray(rollout: Rollout) -> xarray.Dataset:
    """All of a rollout as labelled arrays with units in their attributes; needs xarray.

    `q` (time, coordinate) and `v` (time, velocity) by their names; of each body `positions`, `velocities` (of its origin, then angular; world axes),
    `angular_momentum` and `contact_forces` (time, body, axis), and `rotations` (time, body, row, column); of all of it `momentum` (time, direction: linear, then angular about
    the world's origin), `kinetic_energy`, `potential_energy`, `min_gap` (time);
    `controls` (step, control) by their names, each with its `control_unit`, and `applied_controls`, which hold the controller's as well.
    """
    xarray = _needs("xarray", "to_xarray")
    sim = rollout.simulator
    data: dict[str, Any] = {
        "q": (("time", "coordinate"), rollout.q, {"units": "m, rad, unit quaternions"}),
        "v": (("time", "velocity"), rollout.v, {"units": "m/s, rad/s"}),
        "rotations": (("time", "body", "row", "column"), rollout.rotations, {"units": "1"}),
        "momentum": (("time", "direction"), rollout.momentum, {"units": "kg m/s, kg m²/s"}),
        "kinetic_energy": (("time",), rollout.kinetic_energy, {"units": "J"}),
        "potential_energy": (("time",), rollout.potential_energy, {"units": "J"}),
        "min_gap": (("time",), rollout.min_gap, {"units": "m"}),
        "controls": (("step", "control"), rollout.controls, {"units": _units(sim)}),
        "applied_controls": (("step", "control"), rollout.applied_controls, {"units": _units(sim)}),
    }
    coordinates: dict[str, Any] = {
        "time": ("time", rollout.time, {"units": "s"}),
        "coordinate": sim.q_names,
        "velocity": sim.v_names,
        "direction": ["px", "py", "pz", "lx", "ly", "lz"],
        "body": sim.body_names,
        "control": sim.control_names,
        "control_unit": ("control", sim.control_units),
    }
    for name, (labels, unit) in OF_BODIES.items():
        axis = "axis" if len(labels) == 3 else "component"
        values = rollout.observe(name).reshape(len(rollout), len(sim.body_names), len(labels))
        data[name] = (("time", "body", axis), values, {"units": unit})
        coordinates[axis] = list(labels)
    return xarray.Dataset(data, coordinates, {"time_step": sim.dt, "fidelity": sim.fidelity, "integrator": sim.integrator})


def plot(rollout: Rollout, what: Sequence[str] = ("q", "v", "energy", "contact_forces")) -> matplotlib.figure.Figure:
    """A picture of a rollout against time, a panel for each of `what`: "q", "v", "controls", "energy", "contact_forces", "min_gap".

    What doesn't exist in the scene (controls, contact) is left out. Needs Matplotlib; the figure is returned, `.savefig("run.png")` keeps it.
    """
    for name in what:
        if name not in PANELS:
            raise InputError(f'plot: what: got "{name}"; must be some of {", ".join(PANELS)}')
    figure_type = _needs("matplotlib.figure", "plot").Figure
    sim, time = rollout.simulator, rollout.time
    forces = np.linalg.norm(rollout.observe("contact_forces").reshape(len(rollout), -1, 3), axis=-1)
    lines: dict[str, tuple[str, list[tuple[str, Any, Any]]]] = {
        "q": ("coordinates, m, rad", [(name, time, x) for name, x in zip(sim.q_names, rollout.q.T)]),
        "v": ("velocities, m/s, rad/s", [(name, time, x) for name, x in zip(sim.v_names, rollout.v.T)]),
        "controls": (f"controls, {_units(sim)}", [(name, time[:-1], u) for name, u in zip(sim.control_names, rollout.applied_controls.T)]),
        "energy": (
            "energy, J",
            [
                ("kinetic", time, rollout.kinetic_energy),
                ("potential", time, rollout.potential_energy),
                ("both", time, rollout.kinetic_energy + rollout.potential_energy),
            ],
        ),
        "contact_forces": (
            "contact forces, N",
            [(name, time, f) for name, f in zip(sim.body_names, forces.T) if np.nanmax(f, initial=0.0) > 0.0],
        ),
        "min_gap": ("smallest gap, m", [("", time, rollout.min_gap)] if np.isfinite(rollout.min_gap).any() else []),
    }
    shown = [lines[name] for name in what if lines[name][1]]
    figure = figure_type(figsize=(8, 2.2 * max(len(shown), 1)), layout="constrained")
    axes = np.atleast_1d(figure.subplots(max(len(shown), 1), 1, sharex=True))
    for panel, (label, curves) in zip(axes, shown):
        for name, x, y in curves:
            panel.plot(x, y, label=name)
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
        if 1 < len(curves) <= 12:
            panel.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes[-1].set_xlabel("time, s")
    return figure
