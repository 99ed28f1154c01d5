"""Replays of rollouts in 3-D, as pages of HTML that need nothing else."""

from hydrograd._viewer.recording import record
from hydrograd._viewer.view import View, view

__all__ = ["View", "record", "view"]
