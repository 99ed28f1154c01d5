"""A fish of four links swims forward."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

import hydrograd as hg
from hydrograd.gym import drawing
from hydrograd.gym.simulation import Fidelity, SimulationEnv
from hydrograd.tasks import swimmer

_Array = NDArray[np.float64]

LARGEST = 0.1
"""Torque at an action of 1, N m."""
LANE = 2.0
"""Half the width of the lane, m."""

_EFFORT = 0.05


@functools.cache
def _simulator(fidelity: Fidelity, refinement: int) -> hg.Simulator:
    """One for all environments of a process: simulators don't change."""
    return hg.Simulator(
        swimmer.scene(), swimmer.TIME_STEP / refinement, fidelity=fidelity, resolved_gap=swimmer.RESOLVED_GAP
    )


class SwimmerEnv(SimulationEnv):
    """Swim along x, with little effort: the scene of `hydrograd.tasks.swimmer`.

    Action (3,): torques of the hinges, head to tail, over 0.1 N m, for `frame_skip` steps of 0.01 s.

    Observation (11,): cosine and sine of the heading; the hinges' angles (3, rad); the head's velocity in its own
    frame, forward and to the left (m/s), and its turning (rad/s); the hinges' rates (3, rad/s). Where the fish is in
    the world isn't told.

    Reward of a step: mean velocity of its centre of mass along x (m/s) − 0.05 · mean(action²).

    Start: heading and hinges within ±0.3 rad, the hinges' rates within ±0.05 rad/s, the head at rest. Terminates where
    the centre of mass leaves the lane, |y| > 2 m. Info: `time` (s), `x`, `y` of the centre of mass (m), `effort`,
    mean(action²).

    `simulator` takes another one with the same coordinates and controls; without it the scene's own is made with
    `fidelity`, once a process.
    """

    def __init__(
        self,
        *,
        fidelity: Fidelity = "reduced",
        frame_skip: int = 5,
        simulator: hg.Simulator | None = None,
        render_mode: str | None = None,
    ) -> None:
        joints = swimmer.LINKS - 1
        super().__init__(
            simulator,
            coordinates=swimmer.COORDINATES,
            time_step=swimmer.TIME_STEP,
            largest=np.full(joints, LARGEST),
            bounds=[1.0, 1.0, *[2.0] * joints, 5.0, 5.0, 50.0, *[50.0] * joints],
            fidelity=fidelity,
            frame_skip=frame_skip,
            render_mode=render_mode,
        )

    def _own_simulator(self, refinement: int) -> hg.Simulator:
        return _simulator(self._fidelity, refinement)

    def _start(self) -> tuple[_Array, _Array]:
        spread = np.array([0.0, 0.0] + [0.3] * swimmer.LINKS)
        rates = np.array([0.0] * 3 + [0.05] * (swimmer.LINKS - 1))
        return self.np_random.uniform(-spread, spread), self.np_random.uniform(-rates, rates)

    def _observe(self, q: _Array, v: _Array) -> _Array:
        cosine, sine = np.cos(q[2]), np.sin(q[2])
        forward, left = cosine * v[0] + sine * v[1], cosine * v[1] - sine * v[0]
        return np.concatenate([[cosine, sine], q[3:], [forward, left], v[2:]])

    def _begin(self, state: hg.State) -> dict[str, Any]:
        return self._info(state, 0.0)

    def _info(self, state: hg.State, effort: float) -> dict[str, Any]:
        x, y = swimmer.center_of_mass(state.q)
        return {"time": state.time, "x": float(x), "y": float(y), "effort": effort}

    def _judge(self, rollout: hg.Rollout, after: hg.State, action: _Array) -> tuple[float, bool, dict[str, Any]]:
        start, end = swimmer.center_of_mass(rollout.q[[0, -1]])
        effort = float(np.mean(action**2))
        reward = float((end[0] - start[0]) / self.dt) - _EFFORT * effort
        return reward, bool(abs(end[1]) > LANE), self._info(after, effort)

    def render(self) -> NDArray[np.uint8] | None:
        """The fish seen along z, (height, width, 3), or None without a render mode."""
        if self.render_mode is None:
            return None
        q = self.state.q
        x = float(swimmer.center_of_mass(q)[0])
        headings = np.cumsum(q[2:])
        links = [(c, float(h), swimmer.OUTLINE) for c, h in zip(swimmer.centers(q), headings)]
        return drawing.picture([], links, (x - 1.0, x + 1.0), (-0.75, 0.75), ("x, m", "y, m"), self.state.time)
