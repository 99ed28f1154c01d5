import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, Protocol, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrograd._contacts import ContactForces
from hydrograd._gradient import Gradient, StepGradient, Tangents
from hydrograd._optimize import Grasp, Optimum, Smoothed
from hydrograd._policy import Policy
from hydrograd._tradeoff import Tradeoff

__version__: str

_Array = NDArray[np.float64]
_Path = str | os.PathLike[str]
_Body = int | str
_Evaluated = tuple[float, ArrayLike]
_Part = Literal["tangential", "normal", "total"]
_Backend = Literal["cpu", "gpu"]
_Fidelity = Literal["isolated", "reduced", "auto", "full"]
_Method = Literal["auto", "exact", "panel", "mfs-vertex", "mfs-face"]
_Integrator = Literal["momentum-euler", "energy-euler", "midpoint", "rk2", "rk4", "velocity-euler"]

class _Mesh(Protocol):
    @property
    def vertices(self) -> ArrayLike: ...
    @property
    def faces(self) -> ArrayLike: ...

class Error(Exception): ...
class InputError(Error, ValueError): ...
class MeshError(Error): ...
class FileError(Error, OSError): ...
class SolverError(Error): ...
class UnresolvedError(Error): ...
class UnsupportedError(Error): ...
class DeviceError(Error): ...
class BatchError(Error):
    errors: dict[int, Error]
    members: list[Any]

class InternalError(Error): ...

@final
class Fluid:
    def __new__(cls, density: float = 998.0, current: ArrayLike | None = None) -> Fluid: ...
    @property
    def density(self) -> float: ...
    @property
    def current(self) -> tuple[float, float, float]: ...

@final
class Contact:
    def __new__(
        cls,
        *,
        stiffness: float | None = None,
        dissipation: float = 0.5,
        friction: float = 0.5,
        torsional_friction: float = 0.0,
        rolling_friction: float = 0.0,
        gap: float | None = None,
        width: float | None = None,
        stiction_speed: float = 1e-3,
    ) -> Contact: ...

@final
class Shape:
    @property
    def kind(self) -> str: ...
    @property
    def volume(self) -> float: ...
    def triangles(self) -> tuple[_Array, NDArray[np.int64]]: ...

def sphere(radius: float, *, faces: int | None = None) -> Shape: ...
def ellipsoid(a: float, b: float, c: float, *, faces: int | None = None) -> Shape: ...
def box(x: float, y: float, z: float, *, faces: int | None = None) -> Shape: ...
def cylinder(radius: float, length: float, *, faces: int | None = None) -> Shape: ...
def capsule(radius: float, length: float, *, faces: int | None = None) -> Shape: ...
def prism(profile: ArrayLike, length: float, *, faces: int | None = None) -> Shape: ...
def mesh(
    vertices: ArrayLike | _Mesh | _Path, faces: ArrayLike | None = None, *, scale: float = 1.0
) -> Shape: ...

@final
class Joint:
    @property
    def kind(self) -> str: ...
    @property
    def q_size(self) -> int: ...
    @property
    def v_size(self) -> int: ...

@final
class Motion:
    @staticmethod
    def linear(rate: float, offset: float = 0.0) -> Motion: ...
    @staticmethod
    def sine(amplitude: float, frequency: float, phase: float = 0.0, offset: float = 0.0) -> Motion: ...

def free() -> Joint: ...
def fixed() -> Joint: ...
def prismatic(axis: ArrayLike) -> Joint: ...
def revolute(axis: ArrayLike) -> Joint: ...
def screw(axis: ArrayLike, pitch: float) -> Joint: ...
def planar(plane: Literal["xy", "yz", "zx"]) -> Joint: ...
def spherical() -> Joint: ...

@final
class Drag:
    def __new__(
        cls,
        *,
        linear: float = 0.0,
        part: _Part = "tangential",
        quadratic: float = 0.0,
        quadratic_part: _Part = "tangential",
    ) -> Drag: ...

@final
class Body:
    def __new__(
        cls,
        shape: Shape | None = None,
        *,
        name: str = "",
        density: float | None = None,
        mass: float | None = None,
        inertia: ArrayLike | None = None,
        center_of_mass: ArrayLike | None = None,
        position: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        joint: Joint | None = None,
        parent: int | str | None = None,
        actuated: bool = False,
        thruster: bool = False,
        locked: bool = False,
        motion: Sequence[Motion] | None = None,
        limits: ArrayLike | None = None,
        limit_stiffness: float | None = None,
        drag: Drag | None = None,
        shape_position: ArrayLike | None = None,
        shape_rotation: ArrayLike | None = None,
        refine: Sequence[tuple[ArrayLike, float, float]] | None = None,
        added_mass: ArrayLike | None = None,
        overlaps_parent: bool = False,
        collision: Sequence[
            Shape | tuple[Shape, ArrayLike] | tuple[Shape, ArrayLike, ArrayLike]
        ] | None = None,
    ) -> Body: ...
    @property
    def name(self) -> str: ...
    @property
    def shape(self) -> Shape | None: ...
    @property
    def joint(self) -> Joint: ...
    @property
    def density(self) -> float | None: ...
    @property
    def mass(self) -> float | None: ...
    @property
    def position(self) -> tuple[float, float, float]: ...

@final
class Scene:
    def __new__(
        cls,
        fluid: Fluid | None = None,
        *,
        name: str = "",
        gravity: ArrayLike | None = None,
        contact: Contact | None = None,
        time_step: float = 0.01,
        steps: int = 100,
    ) -> Scene: ...
    @staticmethod
    def load(path: _Path) -> Scene: ...
    @staticmethod
    def from_toml(text: str, folder: _Path | None = None) -> Scene: ...
    def to_toml(self) -> str: ...
    def add(self, body: Body) -> int: ...
    def add_wall(
        self, point: ArrayLike, normal: ArrayLike, surface: Literal["rigid", "free"] = "rigid"
    ) -> None: ...
    @overload
    def add_force(
        self,
        kind: Literal["spring"],
        *,
        body: str,
        stiffness: float,
        at: ArrayLike = (0.0, 0.0, 0.0),
        to: str | None = None,
        to_at: ArrayLike = (0.0, 0.0, 0.0),
        rest_length: float = 0.0,
        damping: float = 0.0,
        name: str | None = None,
    ) -> None: ...
    @overload
    def add_force(
        self,
        kind: Literal["lubrication"],
        *,
        roughness: float,
        viscosity: float = 1.0016e-3,
        bodies: Sequence[str] = (),
        reach: float | None = None,
        name: str | None = None,
    ) -> None: ...
    def set_initial(
        self, q: ArrayLike | None = None, v: ArrayLike | None = None, *, momentum: ArrayLike | None = None
    ) -> None: ...
    def validate(self) -> None: ...
    def index(self, name: str) -> int: ...
    @property
    def body_names(self) -> list[str]: ...
    @property
    def name(self) -> str: ...
    @property
    def walls(self) -> list[tuple[list[float], list[float], Literal["rigid", "free"]]]: ...
    @property
    def fluid(self) -> Fluid: ...
    @property
    def gravity(self) -> tuple[float, float, float]: ...
    @property
    def time_step(self) -> float: ...
    @property
    def steps(self) -> int: ...
    def __len__(self) -> int: ...

@final
class Simulator:
    def __new__(
        cls,
        scene: Scene,
        dt: float | None = None,
        *,
        fidelity: _Fidelity | None = None,
        method: _Method | None = None,
        tolerance: float | None = None,
        integrator: _Integrator | None = None,
        faces: int | None = None,
        accuracy: float | None = None,
        rank: int | None = None,
        resolved_gap: float | None = None,
        films: bool | None = None,
        cache: _Path | None = None,
        backend: _Backend | None = None,
    ) -> Simulator: ...
    def rollout(
        self,
        controls: ArrayLike | None = None,
        *,
        steps: int | None = None,
        state: State | None = None,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
    ) -> Rollout: ...
    def rollout_batch(
        self, controls: ArrayLike, *, q: ArrayLike | None = None, v: ArrayLike | None = None
    ) -> list[Rollout]: ...
    def state(
        self,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        *,
        step: int = 0,
        mode: int = 0,
        held: Sequence[bool] | None = None,
    ) -> State: ...
    def step(self, state: State, u: ArrayLike | None = None) -> tuple[State, Record]: ...
    def added_mass(self) -> _Array: ...
    def meshes(self) -> list[tuple[_Array, NDArray[np.int64]] | None]: ...
    def with_parameters(self, changes: Mapping[str, float]) -> Simulator: ...
    def with_start(self, q: ArrayLike | None = None, v: ArrayLike | None = None) -> Simulator: ...
    def with_gains(self, gains: ArrayLike) -> Simulator: ...
    def with_policy(self, policy: Policy) -> Simulator: ...
    def with_soft_contact(self, factor: float) -> Simulator: ...
    @property
    def policy(self) -> Policy | None: ...
    @property
    def gains(self) -> _Array: ...
    @property
    def parameters(self) -> dict[str, float]: ...
    @property
    def initial_q(self) -> _Array: ...
    @property
    def initial_v(self) -> _Array: ...
    @property
    def scene(self) -> Scene: ...
    @property
    def dt(self) -> float: ...
    @property
    def control_size(self) -> int: ...
    @property
    def q_size(self) -> int: ...
    @property
    def v_size(self) -> int: ...
    @property
    def body_names(self) -> list[str]: ...
    @property
    def q_names(self) -> list[str]: ...
    @property
    def v_names(self) -> list[str]: ...
    @property
    def fidelity(self) -> str: ...
    @property
    def backend(self) -> str: ...
    @property
    def integrator(self) -> str: ...
    @property
    def contact_gaps(self) -> dict[tuple[str, str | None], float]: ...
    @property
    def reasons(self) -> list[str]: ...
    @property
    def warnings(self) -> list[str]: ...

@final
class State:
    @property
    def step(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def q(self) -> _Array: ...
    @property
    def v(self) -> _Array: ...
    @property
    def mode(self) -> int: ...
    @property
    def held(self) -> NDArray[np.bool_]: ...
    @property
    def positions(self) -> _Array: ...
    @property
    def rotations(self) -> _Array: ...

@final
class Record:
    def vjp(
        self,
        *,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        positions: ArrayLike | None = None,
        rotations: ArrayLike | None = None,
    ) -> StepGradient: ...
    def jacobians(self, parameters: Sequence[str] | None = None) -> tuple[_Array, ...]: ...
    def jvp(
        self,
        *,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        u: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        gains: ArrayLike | None = None,
    ) -> tuple[_Array, _Array]: ...

@final
class Rollout:
    @property
    def simulator(self) -> Simulator: ...
    @property
    def steps(self) -> int: ...
    @property
    def time(self) -> _Array: ...
    @property
    def q(self) -> _Array: ...
    @property
    def v(self) -> _Array: ...
    @property
    def controls(self) -> _Array: ...
    @property
    def positions(self) -> _Array: ...
    @property
    def rotations(self) -> _Array: ...
    @property
    def velocities(self) -> _Array: ...
    @property
    def kinetic_energy(self) -> _Array: ...
    @property
    def potential_energy(self) -> _Array: ...
    @property
    def momentum(self) -> _Array: ...
    @property
    def min_gap(self) -> _Array: ...
    @property
    def warnings(self) -> list[str]: ...
    def check_gap(self) -> dict[str, Any] | None: ...
    def gap_flow(self) -> dict[str, Any] | None: ...
    def state(self, step: int = -1) -> State: ...
    def contacts(self, step: int, slack: float = 0.0) -> ContactForces: ...
    def flow(self, state: int, points: ArrayLike) -> _Array: ...
    def flow_resolved(self, state: int, points: ArrayLike) -> NDArray[np.bool_]: ...
    def observe(self, name: str) -> _Array: ...
    def value(self, objective: Objective) -> float: ...
    def gradient(self, objective: Objective) -> Gradient: ...
    def vjp(
        self,
        *,
        positions: ArrayLike | None = None,
        rotations: ArrayLike | None = None,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        controls: ArrayLike | None = None,
        observables: Mapping[str, ArrayLike] | None = None,
    ) -> Gradient: ...
    def jvp(
        self,
        *,
        controls: ArrayLike | None = None,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        gains: ArrayLike | None = None,
        observables: Sequence[str] | None = None,
    ) -> Tangents: ...
    def jacobian(
        self,
        parameters: Sequence[str] | None = None,
        *,
        q: bool = False,
        v: bool = False,
        gains: bool = False,
        controls: bool = False,
        of: Sequence[str] | None = None,
        states: Sequence[int] | None = None,
    ) -> dict[str, _Array]: ...
    def step_jacobians(self, parameters: Sequence[str] | None = None) -> tuple[_Array, ...]: ...
    def to_dict(self) -> dict[str, _Array]: ...
    def summary(self) -> dict[str, Any]: ...
    def __len__(self) -> int: ...

@final
class Objective:
    def __add__(self, other: Objective) -> Objective: ...
    def __radd__(self, other: Literal[0]) -> Objective: ...
    def __sub__(self, other: Objective) -> Objective: ...
    def __neg__(self) -> Objective: ...
    def __truediv__(self, divisor: float) -> Objective: ...
    def __mul__(self, factor: float) -> Objective: ...
    def __rmul__(self, factor: float) -> Objective: ...

def final_position(body: int | str, target: ArrayLike) -> Objective: ...
def mean_position(body: int | str, target: ArrayLike) -> Objective: ...
def final_coordinate(index: int, target: float, weight: float = 1.0) -> Objective: ...
def final_velocity(index: int, target: float, weight: float = 1.0) -> Objective: ...
def final_observable(name: str, entry: int, target: float, weight: float = 1.0) -> Objective: ...
def effort(weight: float) -> Objective: ...

def minimise(
    function: Callable[[_Array], _Evaluated],
    start: ArrayLike,
    *,
    iterations: int = 100,
    evaluations: int = 1000,
    memory: int = 10,
    first_step: float | None = 0.1,
    gradient_tolerance: float = 1e-6,
    cost_tolerance: float = 1e-9,
    target: float | None = None,
    clip: float | None = None,
) -> Optimum: ...
def continuation(
    function: Callable[[float, _Array], _Evaluated],
    stages: ArrayLike,
    start: ArrayLike,
    *,
    iterations: int = 100,
    evaluations: int = 1000,
    memory: int = 10,
    first_step: float | None = 0.1,
    gradient_tolerance: float = 1e-6,
    cost_tolerance: float = 1e-9,
    target: float | None = None,
    clip: float | None = None,
) -> Optimum: ...
def smoothed(
    function: Callable[[_Array], _Evaluated],
    x: ArrayLike,
    *,
    spread: float = 0.05,
    directions: int = 16,
    seed: int = 1,
) -> Smoothed: ...
def grasp(
    simulator: Simulator | Scene,
    *,
    object: _Body,
    fingers: Sequence[tuple[_Body, ArrayLike]],
    closing: ArrayLike,
    limits: ArrayLike,
    hold: float = 0.5,
    knots: int | None = None,
    pushes: int | None = None,
    starts: int | None = None,
    evaluations: int | None = None,
    softness: Sequence[float] | None = None,
    target: float | None = None,
    search: int | None = None,
    seed: int = 1,
) -> Grasp: ...

def tradeoff(
    scene: Scene,
    *,
    fidelities: Sequence[_Fidelity] | None = None,
    methods: Sequence[_Method] | None = None,
    faces: Sequence[int] | None = None,
    ranks: Sequence[int] | None = None,
    accuracies: Sequence[float] | None = None,
    tolerances: Sequence[float] | None = None,
    integrators: Sequence[_Integrator] | None = None,
    time_steps: Sequence[float] | None = None,
    full_product: bool = False,
    steps: int | None = None,
    reference_faces: int | None = None,
    budget: float = 120.0,
) -> Tradeoff: ...
