"""Descents along gradients of rollouts, optimal control, and a recipe with which a gripper catches what it hasn't seen."""

from hydrograd._hydrograd import Experiment, Mpc, Tracking, Unknown, continuation, grasp, identify, ilqr, minimise, smoothed
from hydrograd._optimize import (
    Fitted,
    Grasp,
    Identified,
    IdentifyProgress,
    IlqrProgress,
    MpcRun,
    Optimum,
    Plan,
    Profile,
    Replan,
    SeriesFit,
    Smoothed,
    WeakDirection,
)

__all__ = [
    "Experiment",
    "Fitted",
    "Grasp",
    "Identified",
    "IdentifyProgress",
    "IlqrProgress",
    "Mpc",
    "MpcRun",
    "Optimum",
    "Plan",
    "Profile",
    "Replan",
    "SeriesFit",
    "Smoothed",
    "Tracking",
    "Unknown",
    "WeakDirection",
    "continuation",
    "grasp",
    "identify",
    "ilqr",
    "minimise",
    "smoothed",
]
