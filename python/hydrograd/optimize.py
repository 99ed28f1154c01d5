"""Descents along gradients of rollouts, optimal control, and a recipe with which a gripper catches what it hasn't seen."""

from hydrograd._hydrograd import Mpc, Tracking, continuation, grasp, ilqr, minimise, smoothed
from hydrograd._optimize import Grasp, IlqrProgress, MpcRun, Optimum, Plan, Replan, Smoothed

__all__ = [
    "Grasp",
    "IlqrProgress",
    "Mpc",
    "MpcRun",
    "Optimum",
    "Plan",
    "Replan",
    "Smoothed",
    "Tracking",
    "continuation",
    "grasp",
    "ilqr",
    "minimise",
    "smoothed",
]
