"""What the environments share: a simulator, actions held for some of its steps, an end where it can't go on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, get_args

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

import hydrograd as hg

_Array = NDArray[np.float64]
Fidelity = Literal["isolated", "reduced", "auto", "full"]
"""Those of `hydrograd.Simulator`."""

# By how much shorter steps are where the usual ones fail.
_REFINEMENT = 4
_FIDELITIES: tuple[Fidelity, ...] = get_args(Fidelity)


class SimulationEnv(gymnasium.Env[_Array, NDArray[np.float32]]):
    """An environment around a simulator, that never changes; the state is the environment's own.

    An action (control_size,) in [-1, 1] is the part of `largest` (N, N m) that acts during the next `frame_skip` steps
    of the simulator; what is beyond is clipped.

    Where the simulator can't go on (contact whose implicit stage isn't found, bodies driven into one another), the step
    is made again with a quarter of the time step (`info["refined"]`), unless the simulator was given. Where that can't
    either, the episode terminates with the reason in `info["error"]`, a reward of 0 and the observation before.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}

    def __init__(
        self,
        simulator: hg.Simulator | None,
        *,
        coordinates: Sequence[str],
        time_step: float,
        largest: ArrayLike,
        bounds: ArrayLike,
        fidelity: Fidelity,
        frame_skip: int,
        render_mode: str | None,
    ) -> None:
        """A simulator that was given must have the task's `coordinates` (names of q) and controls; the task's own, with
        its `time_step` (s) and a `fidelity`, is made when it is first needed. `largest` is the control at an action of
        1 (control_size,), `bounds` the largest absolute value of each observation.
        """
        if isinstance(frame_skip, bool) or not isinstance(frame_skip, (int, np.integer)) or frame_skip < 1:
            raise hg.InputError(f"frame_skip: got {frame_skip!r}; must be a whole number of at least 1")
        if fidelity not in _FIDELITIES:
            raise hg.InputError(f"fidelity: got {fidelity!r}; must be one of {_FIDELITIES}")
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise hg.InputError(
                f"render_mode: got {render_mode!r}; must be None or one of {self.metadata['render_modes']}"
            )
        self._largest = np.asarray(largest, dtype=float)
        if simulator is not None:
            if not isinstance(simulator, hg.Simulator):
                raise hg.InputError(f"simulator: got {simulator!r}; must be a hydrograd.Simulator, or None")
            size = self._largest.size
            if simulator.q_names != list(coordinates) or simulator.control_size != size:
                raise hg.InputError(
                    f"simulator: got one with the coordinates {simulator.q_names} and "
                    f"{simulator.control_size} controls; "
                    f"must have {list(coordinates)} and {size} controls"
                )
            time_step = simulator.dt
        self._simulator = simulator
        self._given = simulator is not None
        self._fidelity = fidelity
        self.frame_skip = int(frame_skip)
        """Steps of the simulator in one of the environment."""
        self.dt = time_step * self.frame_skip
        """Time of a step of the environment, s."""
        self.render_mode = render_mode
        # Frames a second of this environment, that may differ from those of its kind.
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / self.dt))}
        high = np.asarray(bounds, dtype=float)
        self.observation_space = gymnasium.spaces.Box(-high, high, dtype=np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, self._largest.shape, dtype=np.float32)
        self._bounds = high
        self._state: hg.State | None = None
        self._over = True
        self._told: dict[str, Any] = {}
        self._seen = np.zeros_like(high)

    @property
    def simulator(self) -> hg.Simulator:
        """The simulator."""
        if self._simulator is None:
            self._simulator = self._own_simulator(1)
        return self._simulator

    @property
    def state(self) -> hg.State:
        """The simulator's state now, or where the episode ended."""
        if self._state is None:
            raise ResetNeeded("no episode has begun: call reset()")
        return self._state

    @property
    def last_observation(self) -> _Array:
        """The latest observation."""
        return self._seen.copy()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[_Array, dict[str, Any]]:
        """A random start, that `seed` determines; `options` may give `q` and `v` in its place."""
        super().reset(seed=seed)
        given = dict(options or {})
        q, v = self._start()
        q, v = given.pop("q", q), given.pop("v", v)
        if given:
            raise hg.InputError(f"options: got {sorted(given)}; expected only 'q' and 'v'")
        self._state = self.simulator.state(q, v)
        self._seen = self._observation(self._state)
        self._over, self._told = False, self._begin(self._state)
        return self._seen.copy(), dict(self._told)

    def step(self, action: ArrayLike) -> tuple[_Array, float, bool, bool, dict[str, Any]]:
        """Observation, reward, whether it terminated, False (the horizon is `gymnasium.make`'s), and info."""
        state = self.state
        if self._over:
            raise ResetNeeded("the episode has ended: call reset()")
        given = self.checked(action)
        try:
            rollout, after, refined = self._advance(state, self._largest * given)
        except hg.Error as error:
            self._over = True
            said = f"{type(error).__name__}: {error}"
            return self._seen.copy(), 0.0, True, False, {**self._told, "refined": False, "error": said}
        self._state = after
        self._seen = self._observation(after)
        reward, terminated, info = self._judge(rollout, after, given)
        info["refined"] = refined
        self._over, self._told = terminated, info
        return self._seen.copy(), reward, terminated, False, dict(info)

    def _advance(self, state: hg.State, control: _Array) -> tuple[hg.Rollout, hg.State, bool]:
        """What happens in a step, the state after it, and whether it needed shorter steps."""
        try:
            rollout = self.simulator.rollout(np.tile(control, (self.frame_skip, 1)), state=state)
            return rollout, rollout.state(-1), False
        except hg.Error:
            if self._given:
                raise
        fine = self._own_simulator(_REFINEMENT)
        rollout = fine.rollout(np.tile(control, (_REFINEMENT * self.frame_skip, 1)), q=state.q, v=state.v)
        after = self.simulator.state(rollout.q[-1], rollout.v[-1], step=state.step + self.frame_skip)
        return rollout, after, True

    def checked(self, action: ArrayLike) -> _Array:
        """The action as numbers in [-1, 1]."""
        try:
            given = np.asarray(action, dtype=float)
        except (TypeError, ValueError):
            raise hg.InputError(f"action: got {action!r}; must be {self._largest.size} numbers in [-1, 1]") from None
        if given.shape != self._largest.shape:
            raise hg.InputError(f"action: got the shape {given.shape}; must have the shape {self._largest.shape}")
        if not np.isfinite(given).all():
            raise hg.InputError(f"action: got {given.tolist()}; must be finite numbers in [-1, 1]")
        return np.asarray(np.clip(given, -1.0, 1.0))

    def _observation(self, state: hg.State) -> _Array:
        return np.asarray(np.clip(self._observe(state.q, state.v), -self._bounds, self._bounds))

    # What a task says.

    def _own_simulator(self, refinement: int) -> hg.Simulator:
        """Of the task's scene, with its time step over a number; not made at once, because processes can't be forked
        once it has run.
        """
        raise NotImplementedError

    def _start(self) -> tuple[_Array, _Array]:
        """Random q and v from `self.np_random`."""
        raise NotImplementedError

    def _observe(self, q: _Array, v: _Array) -> _Array:
        """The observation, before it is clipped to its bounds."""
        raise NotImplementedError

    def _begin(self, state: hg.State) -> dict[str, Any]:
        """The info of a start."""
        raise NotImplementedError

    def _judge(self, rollout: hg.Rollout, after: hg.State, action: _Array) -> tuple[float, bool, dict[str, Any]]:
        """Reward, whether the episode terminates, and info after the steps of an action, that led to a state."""
        raise NotImplementedError
