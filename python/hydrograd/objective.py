"""Scalars of a rollout, added with `+`, `-` and `sum`, and weighted with `*` and `/`, for `Rollout.value` and `Rollout.gradient`."""

from hydrograd._hydrograd import (
    Objective,
    effort,
    final_coordinate,
    final_observable,
    final_position,
    final_velocity,
    mean_position,
)

__all__ = [
    "Objective",
    "effort",
    "final_coordinate",
    "final_observable",
    "final_position",
    "final_velocity",
    "mean_position",
]
