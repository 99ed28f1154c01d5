"""Many environments stepped over threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

import hydrograd as hg
from hydrograd.gym.grasp import GraspEnv
from hydrograd.gym.simulation import SimulationEnv
from hydrograd.gym.swimmer import SwimmerEnv

_Array = NDArray[np.float64]
_Step = tuple[_Array, float, bool, bool, dict[str, Any]]


class ThreadVectorEnv(gymnasium.vector.VectorEnv[_Array, _Array, NDArray[Any]]):
    """Environments in one process that share a simulator and are stepped over a pool of threads: a rollout doesn't hold
    the interpreter's lock.

    What comes out is that of `gymnasium.vector.SyncVectorEnv` with the same seeds, to the last bit, whatever the number
    of threads. An environment whose episode has ended starts anew in its next step, whose action is left aside.
    """

    # Gymnasium closes also what was refused.
    envs: list[SimulationEnv] = []
    _pool: ThreadPoolExecutor | None = None

    def __init__(
        self,
        make: Callable[[], SimulationEnv],
        num_envs: int,
        *,
        max_episode_steps: int | None = None,
        threads: int | None = None,
    ) -> None:
        """`num_envs` environments of `make`, cut off after `max_episode_steps`; `threads` are the machine's cores if
        not given.
        """
        wanted = os.cpu_count() or 1 if threads is None else threads
        for name, value in (("num_envs", num_envs), ("threads", wanted), ("max_episode_steps", max_episode_steps)):
            if value is not None and (isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1):
                raise hg.InputError(f"{name}: got {value!r}; must be a whole number of at least 1")
        self.num_envs = int(num_envs)
        self.envs = [make() for _ in range(self.num_envs)]
        """The environments, in the order of the batch."""
        first = self.envs[0]
        self.metadata = {**first.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}
        self.render_mode = first.render_mode
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        self.observation_space = batch_space(first.observation_space, self.num_envs)
        self.action_space = batch_space(first.action_space, self.num_envs)
        self._horizon = max_episode_steps
        self._steps = np.zeros(self.num_envs, dtype=int)
        self._ended = np.zeros(self.num_envs, dtype=bool)
        self._pool = ThreadPoolExecutor(min(int(wanted), self.num_envs), thread_name_prefix="hydrograd")

    @property
    def simulator(self) -> hg.Simulator:
        """That of the first environment."""
        return self.envs[0].simulator

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Array, dict[str, Any]]:
        """All starts, or those of `options["reset_mask"]`; a number seeds the environments with it and those that
        follow.
        """
        given = dict(options or {})
        mask = np.asarray(given.pop("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise hg.InputError(f"options['reset_mask']: got {mask!r}; must be {self.num_envs} truth values")
        if seed is None:
            seeds: list[int | None] = [None] * self.num_envs
        elif isinstance(seed, (int, np.integer)):
            seeds = [int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise hg.InputError(f"seed: got {len(seeds)} numbers; must be one per environment, {self.num_envs}")
        self._steps[mask] = 0
        self._ended[mask] = False
        infos: dict[str, Any] = {}
        for i in np.flatnonzero(mask):
            info = self.envs[i].reset(seed=seeds[i], options=given or None)[1]
            infos = self._add_info(infos, info, int(i))
        return self._observations(), infos

    def step(self, actions: ArrayLike) -> tuple[_Array, _Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Observations, rewards, terminations, truncations, (num_envs, …), and infos."""
        given = np.asarray(actions)
        if given.shape != self.action_space.shape:
            raise hg.InputError(f"actions: got the shape {given.shape}; must have the shape {self.action_space.shape}")
        # Checked together, before any environment has moved.
        for env, action in zip(self.envs, given):
            env.checked(action)
        if self._pool is None:
            raise hg.InputError("step: the environments are closed; must be open")
        steps = list(self._pool.map(self._one, range(self.num_envs), given))
        infos: dict[str, Any] = {}
        for i, (_, _, terminated, truncated, info) in enumerate(steps):
            self._ended[i] = terminated or truncated
            infos = self._add_info(infos, info, i)
        rewards = np.array([s[1] for s in steps], dtype=np.float64)
        terminations, truncations = (np.array([s[k] for s in steps], dtype=np.bool_) for k in (2, 3))
        return np.stack([s[0] for s in steps]), rewards, terminations, truncations, infos

    def _one(self, i: int, action: _Array) -> _Step:
        """A step of one environment, or the start of its next episode; touches nothing of the others."""
        env = self.envs[i]
        if self._ended[i]:
            self._steps[i] = 0
            observation, info = env.reset()
            return observation, 0.0, False, False, info
        observation, reward, terminated, _, info = env.step(action)
        self._steps[i] += 1
        truncated = self._horizon is not None and bool(self._steps[i] >= self._horizon)
        return observation, reward, terminated, truncated, info

    def _observations(self) -> _Array:
        return np.stack([env.last_observation for env in self.envs])

    def render(self) -> tuple[NDArray[np.uint8] | None, ...]:  # type: ignore[override]
        """A picture of each environment."""
        return tuple(env.render() for env in self.envs)  # type: ignore[misc]

    def close_extras(self, **kwargs: Any) -> None:
        """Ends the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None
        for env in self.envs:
            env.close()


class GraspVectorEnv(ThreadVectorEnv):
    """Many `GraspEnv`s over threads; further keywords are theirs."""

    def __init__(
        self, num_envs: int = 1, *, max_episode_steps: int | None = None, threads: int | None = None, **settings: Any
    ) -> None:
        super().__init__(lambda: GraspEnv(**settings), num_envs, max_episode_steps=max_episode_steps, threads=threads)


class SwimmerVectorEnv(ThreadVectorEnv):
    """Many `SwimmerEnv`s over threads; further keywords are theirs."""

    def __init__(
        self, num_envs: int = 1, *, max_episode_steps: int | None = None, threads: int | None = None, **settings: Any
    ) -> None:
        super().__init__(lambda: SwimmerEnv(**settings), num_envs, max_episode_steps=max_episode_steps, threads=threads)
