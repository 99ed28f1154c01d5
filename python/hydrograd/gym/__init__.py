"""Environments for reinforcement learning, in the interface of Gymnasium.

Importing this registers

- `hydrograd/Grasp-v0`: a gripper under water catches a coin and holds it (`GraspEnv`),
- `hydrograd/Swimmer-v0`: a fish of four links swims forward (`SwimmerEnv`),

for `gymnasium.make` and `gymnasium.make_vec`. The latter steps many environments over threads unless it is told
otherwise (`vectorization_mode="sync"` or `"async"`).
"""

try:
    import gymnasium as _gymnasium
    from gymnasium.vector import AutoresetMode as _since_1_1  # noqa: F401
except ImportError as missing:
    raise ImportError("hydrograd.gym needs Gymnasium 1.1 or later: pip install gymnasium") from missing

from hydrograd.gym.grasp import GraspEnv
from hydrograd.gym.simulation import SimulationEnv
from hydrograd.gym.swimmer import SwimmerEnv
from hydrograd.gym.vector import GraspVectorEnv, SwimmerVectorEnv, ThreadVectorEnv

__all__ = [
    "GraspEnv",
    "GraspVectorEnv",
    "SimulationEnv",
    "SwimmerEnv",
    "SwimmerVectorEnv",
    "ThreadVectorEnv",
]

for _name, _steps in (("Grasp", 50), ("Swimmer", 200)):
    if f"hydrograd/{_name}-v0" not in _gymnasium.registry:
        _gymnasium.register(
            id=f"hydrograd/{_name}-v0",
            entry_point=f"hydrograd.gym:{_name}Env",
            vector_entry_point=f"hydrograd.gym:{_name}VectorEnv",
            max_episode_steps=_steps,
        )
