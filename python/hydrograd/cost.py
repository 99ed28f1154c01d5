"""Terms of the cost that `hydrograd.optimize.ilqr` and `hydrograd.optimize.Mpc` lower."""

from hydrograd._hydrograd import CostTerm
from hydrograd._optimize import Point

configuration = CostTerm.configuration
control_change = CostTerm.control_change
custom = CostTerm.custom
effort = CostTerm.effort
observable = CostTerm.observable
orientation = CostTerm.orientation
position = CostTerm.position
velocity = CostTerm.velocity

__all__ = [
    "CostTerm",
    "Point",
    "configuration",
    "control_change",
    "custom",
    "effort",
    "observable",
    "orientation",
    "position",
    "velocity",
]
