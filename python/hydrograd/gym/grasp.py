"""A gripper under water catches a coin and holds it."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

import hydrograd as hg
from hydrograd.gym import drawing
from hydrograd.gym.simulation import Fidelity, SimulationEnv
from hydrograd.tasks import grasp
from hydrograd.tasks.grasp import COIN_TURN, COIN_Y, COIN_Z, COLUMN, FINGERS

_Array = NDArray[np.float64]

LARGEST = 500.0
"""Force at an action of 1, N."""

# Where the coin is wanted along the fingers and how far apart these then are, m.
_ALONG, _OPENING = 1.2, 0.1 + 2.0 * grasp.GAP
# How long it must be held, s.
_SUCCESS = 0.5


@functools.cache
def _simulator(fidelity: Fidelity, refinement: int) -> hg.Simulator:
    """One for all environments of a process: simulators don't change."""
    return hg.Simulator(grasp.scene(), grasp.TIME_STEP / refinement, fidelity=fidelity)


class GraspEnv(SimulationEnv):
    """Catch the coin and hold it: the scene of `hydrograd.tasks.grasp`.

    Action (3,): forces on the column and both fingers over 500 N, for `frame_skip` steps of 0.01 s.

    Observation (17,): q (6), v (6), the coin's place along the fingers and from the middle between them, their opening,
    and the gaps between the coin and each finger (m); the coin's angle within ±π. World frame, SI units.

    Reward of a step: 1/(1 + miss) + 2 · held − 0.01 · mean(action²), with miss = ((along − 1.2)/0.2)² + (across/0.1)² +
    ((opening − 0.13)/0.4)², m, and held 1 while the coin is between the fingers, touched by both (to 3 mm) and no point
    of it faster than 5 mm/s against a finger.

    Start: at rest; each of the column, the fingers and the coin's place within ±0.03 m of the scene's, its angle within
    ±0.2 rad of 0.4. Terminates where the coin is out of reach (0.4 m beyond the tips, 0.3 m behind the column, 1 m
    aside) or the column 1.5 m away. Info: `time` (s), `held`, `held_for` (s), `is_success` (held for half a second).

    `simulator` takes another one with the same coordinates and controls, e.g. other masses by `with_parameters`;
    without it the scene's own is made with `fidelity`, once a process.
    """

    def __init__(
        self,
        *,
        fidelity: Fidelity = "reduced",
        frame_skip: int = 5,
        simulator: hg.Simulator | None = None,
        render_mode: str | None = None,
    ) -> None:
        places = [2.0, 1.0, 1.0, 4.0, 2.0, np.pi]
        rates = [5.0, 5.0, 5.0, 10.0, 10.0, 50.0]
        super().__init__(
            simulator,
            coordinates=grasp.COORDINATES,
            time_step=grasp.TIME_STEP,
            largest=np.full(3, LARGEST),
            bounds=[*places, *rates, 4.0, 2.0, 2.0, 4.0, 4.0],
            fidelity=fidelity,
            frame_skip=frame_skip,
            render_mode=render_mode,
        )
        self._held_for = 0.0

    def _own_simulator(self, refinement: int) -> hg.Simulator:
        return _simulator(self._fidelity, refinement)

    def _start(self) -> tuple[_Array, _Array]:
        spread = np.array([0.03, 0.03, 0.03, 0.03, 0.03, 0.2])
        q = np.array(grasp.START) + self.np_random.uniform(-spread, spread)
        return q, np.zeros(6)

    def _observe(self, q: _Array, v: _Array) -> _Array:
        turn = q[COIN_TURN] - 2.0 * np.pi * np.rint(q[COIN_TURN] / (2.0 * np.pi))
        return np.concatenate([q[:COIN_TURN], [turn], v, _places(q), grasp.gaps(q)])

    def _begin(self, state: hg.State) -> dict[str, Any]:
        self._held_for = 0.0
        return self._info(state, bool(grasp.held(state.q, state.v)))

    def _info(self, state: hg.State, held: bool) -> dict[str, Any]:
        success = self._held_for >= _SUCCESS - 1e-9
        return {"time": state.time, "held": held, "held_for": self._held_for, "is_success": success}

    def _judge(self, rollout: hg.Rollout, after: hg.State, action: _Array) -> tuple[float, bool, dict[str, Any]]:
        for held in grasp.held(rollout.q[1:], rollout.v[1:]):
            self._held_for = self._held_for + rollout.simulator.dt if held else 0.0
        q = rollout.q[-1]
        along, across, opening = _places(q)
        miss = ((along - _ALONG) / 0.2) ** 2 + (across / 0.1) ** 2 + ((opening - _OPENING) / 0.4) ** 2
        reward = 1.0 / (1.0 + miss) + 2.0 * bool(held) - 0.01 * float(np.mean(action**2))
        lost = not -0.3 <= along <= grasp.REACH + 0.4 or abs(q[COIN_Z]) > 1.0 or abs(q[COLUMN]) > 1.5
        return float(reward), bool(lost), self._info(after, bool(held))

    def render(self) -> NDArray[np.uint8] | None:
        """The gripper and the coin seen along x, (height, width, 3), or None without a render mode."""
        if self.render_mode is None:
            return None
        q = self.state.q
        polygons = [grasp.finger_outline(q, k) for k in (0, 1)]
        polygons.append(np.array([q[COLUMN], 0.0]) + np.array([[-0.12, -0.9], [0.0, -0.9], [0.0, 0.9], [-0.12, 0.9]]))
        coin = (q[[COIN_Y, COIN_Z]], float(q[COIN_TURN]), grasp.COIN_AXES)
        return drawing.picture(polygons, [coin], (-0.6, 2.4), (-1.1, 1.1), ("y, m", "z, m"), self.state.time)


def _places(q: _Array) -> tuple[float, float, float]:
    """Of the coin along the fingers and from the middle between them; the fingers' opening, m."""
    lower, upper = q[FINGERS[0]], q[FINGERS[1]]
    return q[COIN_Y] - q[COLUMN], q[COIN_Z] - 0.5 * (lower + upper), upper - lower
