"""Scalars of a rollout, added with `+`, `-` and `sum`, and weighted with `*` and `/`, for `Rollout.value` and `Rollout.gradient`."""

from hydrograd._hydrograd import (
    Objective,
    applied_effort,
    effort,
    final_coordinate,
    final_flow,
    final_observable,
    final_position,
    final_pressure,
    final_velocity,
    mean_flow,
    mean_observable,
    mean_position,
    mean_pressure,
)

__all__ = [
    "Objective",
    "applied_effort",
    "effort",
    "final_coordinate",
    "final_flow",
    "final_observable",
    "final_position",
    "final_pressure",
    "final_velocity",
    "mean_flow",
    "mean_observable",
    "mean_position",
    "mean_pressure",
]
