"""What a comparison of a scene's configurations gives."""

from __future__ import annotations

import json
from dataclasses import dataclass


@dataclass(frozen=True)
class TradeoffQuantity:
    """One part of the reference."""

    what: str
    """What it is."""
    error_estimate: float | None
    """Estimate of its own relative error; None where nothing tells."""


@dataclass(frozen=True)
class TradeoffReference:
    """What errors are measured against."""

    added_mass: TradeoffQuantity
    """Of the water's part of the mass matrix at the start."""
    moving_differs_by: float | None
    """How far the added mass of the reference for accelerations and end states is from that above."""
    acceleration: TradeoffQuantity | None
    """Of the acceleration at the start; None where there is none."""
    end_state: TradeoffQuantity | None
    """Of coordinates and velocities at the end; None where there is none."""
    horizon_seconds: float
    """Time at which the end states are compared, s."""
    seconds: float
    """Wall time, s."""
    notes: list[str]
    """What limits it."""


@dataclass(frozen=True)
class TradeoffRow:
    """One configuration with its time and its errors.

    Errors are relative to the reference. None where there is no number, and where a choice makes no difference.
    """

    family: str
    """What was varied to come here: "base", "method", "faces", "rank", "accuracy", "tolerance", "integrator", "time-step" or
    "product"."""
    fidelity: str
    """As the keyword of `Simulator`."""
    method: str
    """As the keyword of `Simulator`."""
    faces_per_body: int | None
    """The keyword `faces` of `Simulator`; None: the scene's own."""
    rank: int | None
    """As the keyword of `Simulator`."""
    accuracy: float | None
    """As the keyword of `Simulator`."""
    tolerance: float | None
    """As the keyword of `Simulator`."""
    integrator: str
    """As the keyword of `Simulator`."""
    time_step: float
    """The keyword `dt` of `Simulator`, s."""
    fidelity_used: str
    """What "auto" chose; the fidelity itself otherwise."""
    faces: int | None
    """Faces of all bodies."""
    unknowns: int | None
    """Unknowns of the coupled system."""
    points: int | None
    """Points of all compressed bodies."""
    ms_per_step: float | None
    """Wall time of a step."""
    ms_per_gradient_step: float | None
    """Wall time of a step and its part of the gradient."""
    ms_per_simulated_second: float | None
    """Wall time of a simulated second."""
    added_mass_rel_error: float | None
    """Largest |ΔM_ij| / √(M_ii M_jj) at the start."""
    acceleration_rel_error: float | None
    """Of the acceleration at the start, in the metric of the mass matrix."""
    end_state_rel_error: float | None
    """Of coordinates or velocities at the end, the larger, relative to how far they go."""
    setup_seconds: float | None
    """Wall time of what is made once per scene, s."""
    timed_steps: int | None
    """Steps of the timed rollouts."""
    timed_repetitions: int | None
    """Their repetitions."""
    below_reference: bool
    """Whether the error of the added mass is below the reference's own: the true one is anywhere up to that."""
    acceleration_below_reference: bool
    """The same of the acceleration."""
    end_state_below_reference: bool
    """The same of the end state."""
    pareto: bool
    """Whether no other row that steps as the first one does (integrator, time step) is at most as slow a step and at most as
    wrong in the added mass, and better in one; errors below the reference's own count as that."""
    pareto_end_state: bool
    """The same of all rows with the time of a simulated second and the error of the end state."""
    note: str | None
    """What is missing though nothing failed, and why."""
    error: str | None
    """What failed."""


@dataclass(frozen=True)
class Tradeoff:
    """Times and errors of a scene's configurations."""

    scene: str
    """Name of the scene."""
    reference: TradeoffReference
    """What errors are measured against."""
    rows: list[TradeoffRow]
    """The configurations that were measured, fidelity by fidelity."""
    left_out: list[str]
    """Configurations that the budget had no time for."""
    budget: float
    """The time that was given, s."""
    seconds: float
    """Wall time of everything, s."""
    threads: int
    """Threads that a step may use."""
    warnings: list[str]
    """What to know about the scene."""

    @classmethod
    def _from_json(cls, text: str) -> Tradeoff:
        data = json.loads(text)
        reference = data["reference"]
        for part in ("added_mass", "acceleration", "end_state"):
            if reference[part] is not None:
                reference[part] = TradeoffQuantity(**reference[part])
        data["reference"] = TradeoffReference(**reference)
        data["rows"] = [TradeoffRow(**row) for row in data["rows"]]
        return cls(**data)
