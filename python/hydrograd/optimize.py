"""Descents along gradients of rollouts, and a recipe with which a gripper catches what it hasn't seen."""

from hydrograd._hydrograd import continuation, grasp, minimise, smoothed
from hydrograd._optimize import Grasp, Optimum, Smoothed

__all__ = [
    "Grasp",
    "Optimum",
    "Smoothed",
    "continuation",
    "grasp",
    "minimise",
    "smoothed",
]
