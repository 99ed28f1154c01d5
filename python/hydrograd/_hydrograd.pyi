import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrograd._contacts import ContactForces
from hydrograd._gradient import Gradient, StepGradient, Tangents
from hydrograd._optimize import (
    Grasp,
    Identified,
    IdentifyProgress,
    IlqrProgress,
    MpcRun,
    Optimum,
    Plan,
    Point,
    Replan,
    Smoothed,
)
from hydrograd._policy import Observation, Policy
from hydrograd._tradeoff import Tradeoff

__version__: str

_Array = NDArray[np.float64]
_Path = str | os.PathLike[str]
_Body = int | str
_Progress = Callable[[int, int], object]
_Evaluated = tuple[float, ArrayLike]
_Part = Literal["tangential", "normal", "total"]
_Backend = Literal["cpu", "gpu"]
_Exchange = Literal["auto", "factor", "products"]
_Fidelity = Literal["isolated", "reduced", "auto", "full"]
_Method = Literal["auto", "exact", "panel", "mfs-vertex", "mfs-face"]
_Integrator = Literal["momentum-euler", "energy-euler", "midpoint", "rk2", "rk4", "velocity-euler"]

class _Mesh(Protocol):
    @property
    def vertices(self) -> ArrayLike: ...
    @property
    def faces(self) -> ArrayLike: ...

class Error(Exception):
    """Base of all errors of hydrograd."""
class InputError(Error, ValueError):
    """A value that can't be used: the message names the place, the value and what would be right."""
class MeshError(Error):
    """A surface mesh that doesn't bound a volume, or bounds it badly."""
class FileError(Error, OSError):
    """A file that can't be read, written or understood."""
class SolverError(Error):
    """A linear or nonlinear solve that didn't reach its tolerance."""
class UnresolvedError(Error):
    """The physics left what the discretisation or the time step resolves."""
class UnsupportedError(Error):
    """A combination of settings that has no meaning or isn't offered."""
class DeviceError(Error):
    """A GPU that isn't there, can't do what is needed, or failed."""
class BatchError(Error):
    """Members of a batch that failed. `errors` has each one's error by its number, counted from 0, with its `step` and `time` (s) where they are known; `members` has all of the batch: what ran, of a rollout that failed as far as it came, and None where there is nothing."""
    errors: dict[int, Error]
    members: list[Any]

class InternalError(Error):
    """A fault of hydrograd itself; please report it with its message."""

@final
class Fluid:
    """The fluid around the bodies: `density` in kg/m³ (default 998, fresh water at 20 °C; 0 is no fluid) and a uniform
    `current` in m/s, world axes."""
    def __new__(cls, density: float = 998.0, current: ArrayLike | None = None) -> Fluid: ...
    @property
    def density(self) -> float:
        """Density, kg/m³."""
    @property
    def current(self) -> tuple[float, float, float]:
        """Uniform steady current, m/s, world axes."""

@final
class Contact:
    """Contact between convex bodies and with walls: `stiffness` in N/m, `dissipation` in s/m, the coefficient of `friction`,
    `torsional_friction` against spinning and `rolling_friction` (torque over normal force, m), the `gap` at which surfaces touch and half the `width` over which the force sets in, in m, and the `stiction_speed`
    in m/s. What is None is chosen for the scene."""
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
    """A closed surface: made by `sphere`, `ellipsoid`, `box`, `cylinder`, `capsule`, `prism` or `mesh`."""
    @property
    def kind(self) -> str:
        """The shape's name in a scene file."""
    @property
    def volume(self) -> float:
        """Volume of the triangles, m³."""
    def triangles(self) -> tuple[_Array, NDArray[np.int64]]:
        """Its triangles: vertices (n, 3) in m and faces (m, 3), vertex numbers counted from 0."""

def sphere(radius: float, *, faces: int | None = None) -> Shape:
    """A sphere: radius in m. `faces` is the number of triangles wanted (default 1280), here and for the other shapes."""
def ellipsoid(a: float, b: float, c: float, *, faces: int | None = None) -> Shape:
    """An ellipsoid with the semi-axes a, b and c along x, y and z, in m."""
def box(x: float, y: float, z: float, *, faces: int | None = None) -> Shape:
    """A box with the edges x, y and z, in m."""
def cylinder(radius: float, length: float, *, faces: int | None = None) -> Shape:
    """A cylinder along z: radius and length in m."""
def capsule(radius: float, length: float, *, faces: int | None = None) -> Shape:
    """A capsule along z: radius, and length without its round ends, in m."""
def prism(profile: ArrayLike, length: float, *, faces: int | None = None) -> Shape:
    """A prism along x: corners (n, 2) of its convex profile in the y-z plane, and its length, in m."""
def mesh(
    vertices: ArrayLike | _Mesh | _Path, faces: ArrayLike | None = None, *, scale: float = 1.0
) -> Shape:
    """A closed triangle mesh: from arrays `vertices` (n, 3) and `faces` (m, 3) of vertex numbers counted from 0,
    counter-clockwise seen from outside; from anything that has them as attributes, such as a mesh of trimesh; or from
    the path of an OBJ, STL, PLY or DAE file, which is read where it is wanted. `scale` is the factor from its unit to m."""

@final
class Joint:
    """How a body moves against its parent: made by `free`, `fixed`, `prismatic`, `revolute`, `screw`, `planar` or `spherical`."""
    @property
    def kind(self) -> str:
        """The joint's name in a scene file."""
    @property
    def q_size(self) -> int:
        """Number of coordinates q."""
    @property
    def v_size(self) -> int:
        """Number of generalised velocities v."""

@final
class Motion:
    """A given motion of one joint coordinate, q(t): made by `Motion.linear`, `Motion.sine` or `Motion.spline`."""
    @staticmethod
    def linear(rate: float, offset: float = 0.0) -> Motion:
        """`offset + rate·t`: offset in m or rad, rate in m/s or rad/s."""
    @staticmethod
    def sine(amplitude: float, frequency: float, phase: float = 0.0, offset: float = 0.0) -> Motion:
        """`offset + amplitude·sin(frequency·t + phase)`: amplitude and offset in m or rad, frequency in rad/s, phase in rad."""
    @staticmethod
    def spline(times: ArrayLike, values: ArrayLike) -> Motion:
        """Through `values` (m or rad) at `times` (s, ascending), by the natural cubic spline: C², straight before the first and after the last. Give points as far apart as the motion is
        smooth: a recording's noise would be the joint's acceleration."""

def free() -> Joint:
    """A joint that lets a body move freely: q = position (m) and unit quaternion (w, x, y, z), v = velocity of the body's
    origin (m/s) and angular velocity (rad/s), in the parent's frame."""
def fixed() -> Joint:
    """A joint that doesn't move."""
def prismatic(axis: ArrayLike) -> Joint:
    """A joint along `axis` (three numbers, joint's frame): q in m, v in m/s."""
def revolute(axis: ArrayLike) -> Joint:
    """A joint about `axis` (three numbers, joint's frame): q in rad, v in rad/s."""
def screw(axis: ArrayLike, pitch: float) -> Joint:
    """A joint about `axis` (three numbers, joint's frame) that advances along it by `pitch` (m) in one revolution; a negative
    pitch is a left-handed thread. q in rad, v in rad/s."""
def planar(plane: Literal["xy", "yz", "zx"]) -> Joint:
    """A joint in a plane, "xy", "yz" or "zx": q = two translations in that order (m) and the angle about the normal (rad)."""
def spherical() -> Joint:
    """A joint about a point: q a unit quaternion (w, x, y, z), v the angular velocity in the parent's frame, rad/s."""

@final
class Drag:
    """Drag per area of a body's surface: `linear` in kg/(m² s), `quadratic` dimensionless (½ρc|w|w); the parts of the local
    velocity that drag are "tangential", "normal" or "total"."""
    def __new__(
        cls,
        *,
        linear: float = 0.0,
        part: _Part = "tangential",
        quadratic: float = 0.0,
        quadratic_part: _Part = "tangential",
    ) -> Drag: ...

@final
class Passive:
    """What a joint with one coordinate does by itself: a spring of `stiffness` (N/m or N m/rad) with its `rest` coordinate (m or rad), viscous `damping` (N s/m or
    N m s/rad), Coulomb `friction` (N or N m) that sets in over `friction_speed` (m/s or rad/s), and the inertia `armature` (kg or kg m²) of its drive."""
    def __new__(
        cls,
        *,
        stiffness: float = 0.0,
        rest: float = 0.0,
        damping: float = 0.0,
        friction: float = 0.0,
        friction_speed: float = 0.02,
        armature: float = 0.0,
    ) -> Passive: ...

@final
class Mimic:
    """Lets a joint with one coordinate follow that of the body named `body`: q = `ratio` · q(leader) + `offset` (m or rad)."""
    def __new__(cls, body: str, *, ratio: float = 1.0, offset: float = 0.0) -> Mimic: ...

@final
class Servo:
    """Makes the control of an actuated joint with one coordinate its target (m or rad): a drive of `stiffness` k (N/m or N m/rad) and `damping` c (N s/m or N m s/rad), implicit, and so
    stable however stiff, with the integrators "momentum-euler", "energy-euler" and "midpoint". It aims at where the joint will be a time step Δt later, τ = k (u − q − Δt q̇) − c q̇: with every
    integrator it damps by k Δt more than c."""
    def __new__(cls, stiffness: float, damping: float = 0.0) -> Servo: ...

@final
class Body:
    """A rigid body with the joint that carries it.

    `shape` is what the water sees; without one the body is dry. Give `density` (kg/m³) or `mass` (kg); `inertia` about
    the centre of mass (xx, yy, zz or also xy, xz, yz; kg m²) and `center_of_mass` (m) follow from the shape if left out.
    `position` (m) and `rotation` (axis times angle, rad) place the joint's frame in the frame of `parent`, a body's name or
    number, or the world. `actuated` makes the joint's forces controls (N, N m; a free joint has six), `thruster` a wrench on
    the body in world axes. `locked` holds the joint, `motion` (one per coordinate) drives it, `limits` (m or rad) stop it; `passive` gives it spring, damping,
    friction and armature, `mimic` lets it follow another, `servo` makes its control a target.
    `shape_position` and `shape_rotation` place the shape in the body; `refine` lists balls (center, radius, edge), m,
    where its faces are made smaller. `collision` lists the convex pieces that the body is for contact instead of its shape, each
    a shape, (shape, position) or (shape, position, rotation) in the body's frame. `start` are the joint's coordinates at the start, unless the
    scene is given all by `set_initial`. `added_mass` (6, 6; m³, m⁴, m⁵) replaces the body's own at unit density, about its origin.
    `volume` (m³) and `center_of_buoyancy` (m) are what it is buoyant by and where, instead of the shape's volume at its centroid."""
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
        passive: Passive | None = None,
        mimic: Mimic | None = None,
        servo: Servo | None = None,
        start: ArrayLike | None = None,
        volume: float | None = None,
        center_of_buoyancy: ArrayLike | None = None,
    ) -> Body: ...
    @property
    def name(self) -> str:
        """Its name; empty until it is added to a scene if it was given none."""
    @property
    def shape(self) -> Shape | None:
        """Its shape."""
    @property
    def joint(self) -> Joint:
        """Its joint."""
    @property
    def density(self) -> float | None:
        """Its density, kg/m³, if that was given."""
    @property
    def mass(self) -> float | None:
        """Its mass, kg, if that was given."""
    @property
    def position(self) -> tuple[float, float, float]:
        """Position of its joint in the parent's frame, m."""

@final
class Robot:
    """A robot that was added to a scene: its bodies and joints by name, as the numbers of their bodies, and what it came to."""
    @property
    def bodies(self) -> dict[str, int]:
        """Numbers of its bodies in the scene, by their links' names."""
    @property
    def joints(self) -> dict[str, int]:
        """Numbers of the bodies that its joints move, by the joints' names; those that follow others have no coordinate and aren't listed."""
    @property
    def thrusters(self) -> list[str]:
        """Names of its thrusters, forces of the scene: actuators of sites in MJCF files."""
    @property
    def report(self) -> dict[str, Any]:
        """What it came to, as `inspect_robot` gives it."""

def inspect_robot(
    path: _Path,
    *,
    density: float = 998.0,
    base: Literal["free", "fixed"] | None = None,
    position: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    prefix: str | None = None,
    package_path: Sequence[_Path] | None = None,
    shape: Literal["collision", "visual", "hull", "none"] | None = None,
    bad_meshes: Literal["hull", "refuse"] | None = None,
    faces: int | None = None,
    mimic: Literal["follow", "independent"] | None = None,
    actuated: bool | None = None,
    limits: bool | None = None,
    drag: Drag | None = None,
    servo: Servo | None = None,
    start: dict[str, float] | None = None,
    motions: dict[str, Motion | Sequence[Motion]] | None = None,
    zeros: dict[str, float] | None = None,
    joints: dict[str, dict[str, Any]] | None = None,
    links: dict[str, dict[str, Any]] | None = None,
) -> dict[str, Any]:
    """What a robot in a URDF file comes to in water of `density` (kg/m³): tree, masses, weight against buoyancy, meshes that were replaced, and what of the file wasn't
    used. Choices are those of `Scene.add_robot`."""

@final
class Scene:
    """What a simulation starts from: the fluid, walls, and bodies with their joints.

    `gravity` is in m/s², world axes; `time_step` (s) and `steps` are what a run takes unless told otherwise. Without a
    `contact`, surfaces may not touch. Bodies are numbered in the order in which they are added. `waterline` is the height (m, against gravity) above which there is no
    water to displace and to drag."""
    def __new__(
        cls,
        fluid: Fluid | None = None,
        *,
        name: str = "",
        gravity: ArrayLike | None = None,
        contact: Contact | None = None,
        time_step: float = 0.01,
        steps: int = 100,
        waterline: float | None = None,
    ) -> Scene: ...
    @staticmethod
    def load(path: _Path) -> Scene:
        """Reads a scene file (TOML); paths of meshes are relative to it, and absolute in the scene."""
    @staticmethod
    def from_toml(text: str, folder: _Path | None = None) -> Scene:
        """A scene from TOML text; paths of meshes are relative to `folder` (default: the current one), and absolute in the scene."""
    @staticmethod
    def from_urdf(
        path: _Path,
        *,
        base: Literal["free", "fixed"] | None = None,
        position: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        prefix: str | None = None,
        package_path: Sequence[_Path] | None = None,
        shape: Literal["collision", "visual", "hull", "none"] | None = None,
        bad_meshes: Literal["hull", "refuse"] | None = None,
        faces: int | None = None,
        mimic: Literal["follow", "independent"] | None = None,
        actuated: bool | None = None,
        limits: bool | None = None,
        drag: Drag | None = None,
        servo: Servo | None = None,
        start: dict[str, float] | None = None,
        motions: dict[str, Motion | Sequence[Motion]] | None = None,
        zeros: dict[str, float] | None = None,
        joints: dict[str, dict[str, Any]] | None = None,
        links: dict[str, dict[str, Any]] | None = None,
    ) -> Scene:
        """A scene of the robot in a URDF or MJCF file, in still fresh water, gravity along -z. Choices are those of `add_robot`."""
    def add_robot(
        self,
        path: _Path,
        *,
        base: Literal["free", "fixed"] | None = None,
        position: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        prefix: str | None = None,
        package_path: Sequence[_Path] | None = None,
        shape: Literal["collision", "visual", "hull", "none"] | None = None,
        bad_meshes: Literal["hull", "refuse"] | None = None,
        faces: int | None = None,
        mimic: Literal["follow", "independent"] | None = None,
        actuated: bool | None = None,
        limits: bool | None = None,
        drag: Drag | None = None,
        servo: Servo | None = None,
        start: dict[str, float] | None = None,
        motions: dict[str, Motion | Sequence[Motion]] | None = None,
        zeros: dict[str, float] | None = None,
        joints: dict[str, dict[str, Any]] | None = None,
        links: dict[str, dict[str, Any]] | None = None,
    ) -> Robot:
        """Adds the robot of a URDF or MJCF file: a body for each link that moves, a site for each that doesn't. Choices are the keys of a scene file's [[robot]]: `base` "free"
        or "fixed", `position` (m) and `rotation` (rad) of the root, `prefix` of all names, `package_path` (folders), `shape` "collision", "visual", "hull" or "none",
        `bad_meshes` "hull" or "refuse", `faces` of hulls, `mimic` "follow" or "independent", `actuated`, `limits`, `drag`, `servo` (of all joints that are controls), `start` (joint to coordinate), `motions`
        (joint to the `Motion` that drives it), `zeros` (joint whose zero isn't sure to its offset, the coordinate of a body "JOINT zero" before it), `joints` (joint to its `actuated`, `servo`, `passive`, `limits`, `limit_stiffness`), `links` (link to its `shape`, `mass`, `density`, `keep`, and what `Body` takes: `drag`, `center_of_mass`, `inertia`, `volume`, `center_of_buoyancy`,
        `added_mass`, `overlaps_parent`)."""
    def to_toml(self) -> str:
        """The scene as TOML text, from which `from_toml` makes an equal one."""
    def add(self, body: Body) -> int:
        """Adds a body and gives its number, by which `positions[step, number]` and objectives know it."""
    def add_wall(
        self, point: ArrayLike, normal: ArrayLike, surface: Literal["rigid", "free"] = "rigid"
    ) -> None:
        """Adds a plane wall through `point` (m) with `normal` into the fluid. `surface` is "rigid", or "free" for a flat free
        surface without waves (with the fidelities "reduced" and "auto", and "full" by panels)."""
    @overload
    def add_force(
        self,
        kind: Literal["spring"],
        *,
        body: str | int,
        stiffness: float,
        at: ArrayLike = (0.0, 0.0, 0.0),
        to: str | int | None = None,
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
    @overload
    def add_force(
        self,
        kind: Literal["damping"],
        *,
        body: str | int,
        at: ArrayLike = (0.0, 0.0, 0.0),
        linear: ArrayLike | None = None,
        quadratic: ArrayLike | None = None,
        name: str | None = None,
    ) -> None: ...
    @overload
    def add_force(
        self,
        kind: Literal["thruster"],
        *,
        body: str | int,
        direction: ArrayLike,
        at: ArrayLike = (0.0, 0.0, 0.0),
        polynomial: ArrayLike = (),
        table: ArrayLike = (),
        dead_band: float = 0.0,
        torque: float = 0.0,
        loss: float = 0.0,
        rotor: str | int | None = None,
        time_constant: float | None = None,
        smoothing: float = 0.01,
        name: str | None = None,
    ) -> None: ...
    @overload
    def add_force(
        self,
        kind: Literal["fin"],
        *,
        body: str | int,
        chord: ArrayLike,
        normal: ArrayLike,
        area: float,
        lift_slope: float,
        at: ArrayLike = (0.0, 0.0, 0.0),
        length: float = 0.0,
        drag: float = 0.0,
        induced_drag: float = 0.0,
        smoothing: float = 0.01,
        name: str | None = None,
    ) -> None: ...
    @overload
    def add_force(
        self,
        kind: Literal["edge"],
        *,
        body: str | int,
        span: float,
        at: ArrayLike = (0.0, 0.0, 0.0),
        forward: ArrayLike = (1.0, 0.0, 0.0),
        normal: ArrayLike = (0.0, 1.0, 0.0),
        factor: float = 1.0,
        smoothing: float = 0.01,
        name: str | None = None,
    ) -> None: ...
    @overload
    def add_force(
        self,
        kind: Literal["tendon"],
        *,
        arms: Mapping[str, float],
        stiffness: float,
        damping: float = 0.0,
        gain: float = 1.0,
        name: str | None = None,
    ) -> None: ...
    @overload
    def add_force(
        self,
        kind: Literal["current"],
        *,
        velocity: ArrayLike,
        profile: ArrayLike = (),
        over_time: Motion | None = None,
        name: str | None = None,
    ) -> None: ...
    @overload
    def add_force(
        self,
        kind: Literal["float"],
        *,
        body: str | int,
        at: ArrayLike = (0.0, 0.0, 0.0),
        volume: float = 0.0,
        mass: float = 0.0,
        name: str | None = None,
    ) -> None: ...
    def add_site(
        self, name: str, body: _Body, position: ArrayLike | None = None, rotation: ArrayLike | None = None
    ) -> int:
        """Adds a named frame on a `body` (number or name), at `position` (m) and `rotation` (rotation vector, rad) in its frame, and gives its number: rollouts tell
        "site_positions", "site_rotations", "site_attitudes" (roll, pitch, yaw), "site_velocities", "site_gyros" (rates in own axes) and "site_accelerations"."""
    @property
    def site_names(self) -> list[str]:
        """Names of the sites, in order."""
    def set_initial(
        self, q: ArrayLike | None = None, v: ArrayLike | None = None, *, momentum: ArrayLike | None = None
    ) -> None:
        """Where the scene starts: joint coordinates `q` (q_size), generalised velocity `v` (v_size) or, instead of it, generalised
        momentum M(q)v. What is None starts at the origin and at rest."""
    @property
    def shape_parameters(self) -> dict[str, float]:
        """The parameters of all bodies' shapes with their values, m (a mesh's scale: 1): "finger.size.y", "ball.radius" …"""
    def with_shape_parameters(self, values: Mapping[str, float]) -> Scene:
        """The scene with other values of some of `shape_parameters`, or of coordinates of a mesh's vertices ("hull.vertex.17.x") that is given number by number. What would turn a
        body inside out is refused."""
    def validate(self) -> None:
        """Says what is wrong with the scene, if anything is."""
    def index(self, name: str) -> int:
        """Number of the body with this name."""
    @property
    def body_names(self) -> list[str]:
        """Names of the bodies, in order."""
    @property
    def name(self) -> str:
        """Name of the scene."""
    @property
    def walls(self) -> list[tuple[list[float], list[float], Literal["rigid", "free"]]]:
        """The walls: a point (m) and the normal into the fluid, as they were given, and "rigid" or "free"."""
    @property
    def fluid(self) -> Fluid:
        """The fluid."""
    @property
    def gravity(self) -> tuple[float, float, float]:
        """Gravity, m/s², world axes."""
    @property
    def time_step(self) -> float:
        """Time step that a run takes unless told otherwise, s."""
    @property
    def steps(self) -> int:
        """Steps that a run takes unless told otherwise."""
    def __len__(self) -> int: ...

@final
class Simulator:
    """A scene made ready: shapes discretised, bodies joined, coupling prepared. It doesn't change.

    `dt` is the time step, s (default: the scene's). `fidelity` says how much of the coupling through the water is
    computed: "isolated", "reduced", "auto" (the default) or "full"; `method` how each body alone is solved: "auto", "exact", "panel",
    "mfs-vertex" or "mfs-face". `integrator`: "momentum-euler", "energy-euler", "midpoint", "rk2", "rk4" or "velocity-euler". `tolerance` is the
    relative residual at which iterative solves stop ("full"), `faces` the number of triangles of shapes by formula.
    `accuracy` (relative), `rank` (points a body) and `resolved_gap` (m) belong to "reduced" and "auto", `films` (False: the water in gaps that aren't
    resolved isn't added as films) to them and to "full" by panels. `exchange` says how compressed bodies are coupled: "factor", "products" (many bodies, about linear in their number), or "auto" (the default). `shape_parameters` are names of shape parameters ("finger.size.y"), or what these begin with ("finger"; "hull.vertex" for all
    vertices of a mesh), or "*": gradients have entries for them. `cache` is a folder that keeps compressed bodies. `backend`: "cpu" (the default), or "gpu" in a build with the feature of that name."""
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
        exchange: _Exchange | None = None,
        shape_parameters: list[str] | None = None,
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
        progress: _Progress | None = None,
    ) -> Rollout:
        """Runs the scene, with its own controller if it has one, and `controls` (steps, control_size) added to it: generalised
        forces of actuated joints and wrenches on bodies, N and N m, and commands of thrusters. Without them, `steps` (default: the scene's) without
        control. It begins where the simulator does unless given a `state`, or `q` (q_size,) and `v` (v_size,). Ctrl-C ends it.

        `progress(done, total)` is called with the steps made, at most twenty times a second and once at the end. What it raises ends the run and comes out.
        An error that ends the run has the rollout of the steps that were made as its `rollout`, whether progress raised it or a step did; the latter's has
        the `step` and the `time` (s) as well."""
    def rollout_batch(
        self,
        controls: ArrayLike,
        *,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        progress: _Progress | None = None,
    ) -> list[Rollout]:
        """Runs many controls, (batch, steps, control_size), on all cores: the same rollouts, to the bit, as one after the other. With the backend gpu and the fidelity
        reduced the couplings of all are computed together: a member is the same, to the bit, whoever runs beside it.
        `q` (batch, q_size) and `v` (batch, v_size) are where each begins, if given. Where some fail, the `BatchError` has what ran and each one's error.

        `progress(done, total)` is called with the steps made by all members together, as in `rollout`; what it raises comes out with all of the batch,
        each member as far as it came, as its `members`."""
    def gradient_batch(
        self,
        rollouts: Sequence[Rollout],
        objective: Objective,
        *,
        progress: _Progress | None = None,
    ) -> list[Gradient]:
        """Gradients of an `objective` of many rollouts of this simulator, one reverse sweep each, on all cores: those of `Rollout.gradient`, with the backend gpu
        computed together as `rollout_batch` computes the rollouts. `progress(done, total)` is called with the steps gone back by all of them together; what it raises ends the
        sweeps and comes out. Ctrl-C ends them."""
    def gradient_in_parts(
        self,
        objective: Objective,
        controls: ArrayLike | None = None,
        *,
        steps: int | None = None,
        memory: float = 1e8,
        progress: _Progress | None = None,
    ) -> tuple[float, Gradient]:
        """Value and gradient of an `objective` of a run with `controls` (steps, control_size), or of `steps` steps, from where the simulator starts, within `memory` (bytes) for what is
        kept of the run: a rollout keeps some kilobytes a step, which is too much for 10⁵ steps and more. Parts of it run again, so it takes longer; the gradient is that of the
        rollout, to rounding. Observables that are means over steps are refused. `progress(done, total)` is called with the parts done,
        as in `rollout`; what it raises ends the work and comes out. Ctrl-C ends it."""
    def state(
        self,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        *,
        step: int = 0,
        mode: int = 0,
        held: Sequence[bool] | None = None,
    ) -> State:
        """The state at coordinates `q` (q_size,) and generalised velocity `v` (v_size,) after `step` steps; what is None is
        where the simulator starts, with joints that a motion drives where that has them then. `mode` is what the scene's controller remembers, `held` (bodies,) whose joints it held in the
        step that led here, by default none."""
    def step(self, state: State, u: ArrayLike | None = None) -> tuple[State, Record]:
        """One step from a state with the controls `u` (control_size,), N and N m: the next state, and the record that has the
        step's derivatives. The steps of a rollout, to the bit."""
    def equations(self, q: ArrayLike | None = None, *, time: float = 0.0) -> Equations:
        """The equations of motion at the coordinates `q` (q_size,), or at many (N, q_size); default: where the simulator starts. Currents are as they are at `time` (s)."""
    def integrate(self, q: ArrayLike, xi: ArrayLike) -> _Array:
        """q ⊕ ξ: the configurations that `q` (…, q_size) become by the tangents `xi` (…, v_size); of rotations a rotation vector, rad, in the joint's frame."""
    def difference(self, start: ArrayLike, end: ArrayLike) -> _Array:
        """The tangents (…, v_size) by which `integrate` gets from the configurations `start` (…, q_size) to `end`; of rotations the shorter way."""
    def linearise(
        self, q: ArrayLike | None = None, v: ArrayLike | None = None, u: ArrayLike | None = None, *, step: int = 0
    ) -> tuple[_Array, _Array]:
        """The linearisation x₁ ≈ A x₀ + B u of one step in x = (q, v), coordinates in their tangent space, from the states `q` (…, q_size), `v` (…, v_size) and controls
        `u` (…, control_size): A (…, 2 v_size, 2 v_size) and B (…, 2 v_size, control_size), on all cores. What is None is where the simulator starts, with joints that a motion drives where that has them
        then, and no control. `step` is the number of the step, and so the time, of motions and currents."""
    def gradcheck(self, steps: int | None = None, *, directions: int = 4, seed: int = 0) -> dict[str, Any]:
        """Holds the gradient of a rollout of `steps` steps (the scene's number by default) against central differences, along so many random `directions` in each group (controls,
        initial state, parameters, gains), and says by how much the trajectory magnifies small changes. A dictionary: "max_rel_error", the largest over all directions of the smallest
        error over the "step_sizes"; "rel_error_controls", "rel_error_initial", "rel_error_parameters"; "directions", each with its numbers; "growth", and "advice" where that is
        large. How small an error can be seen goes with the simulator's `tolerance`: with "full" use 1e-12. Ctrl-C ends it."""
    def added_mass(self) -> _Array:
        """Added mass of the bodies in the water at the start, (6 n, 6 n), world axes: per body three rows of force per acceleration of
        its origin, then three of torque per angular acceleration; kg, kg m, kg m²."""
    def meshes(self) -> list[tuple[_Array, NDArray[np.int64]] | None]:
        """The bodies' surfaces, as gaps are measured between them, each in its body's frame: vertices (n, 3) in m and faces (m, 3)
        of vertex numbers; None for a body without a shape."""
    def with_parameters(self, changes: Mapping[str, float]) -> Simulator:
        """The same with other physical parameters, by name as in `parameters`; what isn't named stays. It shares what was
        prepared, so it costs next to nothing."""
    def with_start(self, q: ArrayLike | None = None, v: ArrayLike | None = None) -> Simulator:
        """The same with another start: coordinates `q` (q_size,) and generalised velocity `v` (v_size,). Bodies must be apart there, as at any start; of a
        joint that a motion drives both are what the motion says: 0, or that."""
    def with_gains(self, gains: ArrayLike) -> Simulator:
        """The same with other gains of its controller, (gains,)."""
    def with_policy(self, policy: Policy | Tracking) -> Simulator:
        """The same with a controller of your own in place of the scene's: an object with `act(observation)`, which gives the controls
        (control_size,), and, for gradients, `act_vjp`: see `hydrograd.Policy`. It is called once a step, and once a step of the
        reverse sweep, with the interpreter's lock."""
    def with_soft_contact(self, factor: float) -> Simulator:
        """The same with contact that sets in over `factor` times its width, with a stiffness `factor` times smaller: what a descent starts on and
        hardens (`hydrograd.optimize.continuation`). Nothing changes where nothing touches."""
    @property
    def policy(self) -> Policy | Tracking | None:
        """Its controller, if that is written in Python."""
    @property
    def gains(self) -> _Array:
        """Gains of its controller, (gains,); none without one."""
    @property
    def parameters(self) -> dict[str, float]:
        """The physical parameters by name: density, masses, inertias, drag and contact, SI units."""
    @property
    def initial_q(self) -> _Array:
        """Coordinates at the start, (q_size,)."""
    @property
    def initial_v(self) -> _Array:
        """Generalised velocity at the start, (v_size,)."""
    @property
    def scene(self) -> Scene:
        """The scene that it was made from."""
    @property
    def dt(self) -> float:
        """Time step, s."""
    @property
    def control_size(self) -> int:
        """Number of controls a step."""
    @property
    def control_names(self) -> list[str]:
        """Names of the controls, in order: "arm.force.rate" does work on the velocity "arm.rate", "arm.target.angle" is where a servo shall bring "arm.angle", "hull.wrench.fx", …
        "hull.wrench.mz" are a body's wrench, and a thruster's command has the thruster's name."""
    @property
    def control_units(self) -> list[str]:
        """Units of the controls, in order: "N", "N m", of servos' targets "m" or "rad", of a thruster's rotor "rad/s", "1" of what scales or curves make something else of."""
    def allocation(self, body: _Body) -> _Array:
        """The allocation matrix (6, n) of the thrusters on a `body` (number or name), in the order in which they were added: the wrench of a newton of thrust on the body,
        its frame, about its origin, linear part first (1, m)."""
    def thruster_controls(self, body: _Body) -> list[int]:
        """The controls (numbers) of the thrusters on a `body` (number or name), in the order of the columns of `allocation`."""
    @property
    def q_size(self) -> int:
        """Number of joint coordinates q."""
    @property
    def v_size(self) -> int:
        """Number of generalised velocities v."""
    @property
    def body_names(self) -> list[str]:
        """Names of the bodies, in order."""
    @property
    def q_names(self) -> list[str]:
        """Names of the entries of q, the joint coordinates, in order: "coin.y", "arm.angle", …"""
    @property
    def v_names(self) -> list[str]:
        """Names of the entries of v, the generalised velocities, in order: "coin.vy", "arm.rate", …"""
    @property
    def fidelity(self) -> str:
        """The fidelity in use: what was asked for, or what "auto" chose."""
    @property
    def backend(self) -> str:
        """What computes the coupling: "cpu" or "gpu"."""
    @property
    def integrator(self) -> str:
        """The integrator."""
    @property
    def contact_gaps(self) -> dict[tuple[str, str | None], float]:
        """The gaps at which surfaces are taken to touch, m, by pair of names: of two bodies, or of one and None for a wall. Empty where the scene
        has no contact."""
    @property
    def reasons(self) -> list[str]:
        """What was chosen, and why: by "auto", and of an integrator that stands in for the default, which doesn't solve contact."""
    @property
    def warnings(self) -> list[str]:
        """What should be known about the scene and its start, with names and numbers."""

@final
class Equations:
    """The equations of motion M(q) v̇ + h(q, v, u) = τ at a configuration, or at many: made by `Simulator.equations`.

    M holds the water's part; h is what is left: Coriolis and centrifugal terms of bodies and water, gravity, buoyancy, drag and springs, less the controls u.
    Contact and the stops of joints, which a step solves, aren't in it. Where `q` was (N, q_size), all that is given may be (N, …), or one for all, and all
    that comes back has N in front; the work is spread over all cores. Each call asks the water anew."""
    @property
    def q(self) -> _Array:
        """The configurations, (…, q_size)."""
    @property
    def positions(self) -> _Array:
        """Positions of the bodies' origins, m, world axes, (…, bodies, 3)."""
    @property
    def rotations(self) -> _Array:
        """Rotation matrices of the bodies, body to world, (…, bodies, 3, 3)."""
    @property
    def center_of_mass(self) -> _Array:
        """Centre of mass of all bodies in the world, m, (…, 3); NaN where there is no mass."""
    @property
    def center_of_buoyancy(self) -> _Array:
        """Centre of the volume that all bodies displace, below a `waterline`, at which their buoyancy acts, in the world, m, (…, 3); NaN where nothing is in the water."""
    @property
    def potential_energy(self) -> _Array:
        """Potential energy, J, (…)."""
    def mass_matrix(self, part: Literal["total", "rigid", "fluid"] = "total") -> _Array:
        """M(q) (…, v_size, v_size), of `part` "total", of the bodies alone ("rigid"), or of the water alone ("fluid"); kg, kg m, kg m²."""
    def bias_force(self, v: ArrayLike | None = None, u: ArrayLike | None = None) -> _Array:
        """h(q, v, u) (…, v_size), N and N m: the generalised forces without acceleration. `v` (…, v_size) and `u` (…, control_size) are zero unless given."""
    def forward_dynamics(
        self,
        v: ArrayLike | None = None,
        u: ArrayLike | None = None,
        *,
        force: ArrayLike | None = None,
        driven: ArrayLike | None = None,
    ) -> _Array:
        """Accelerations v̇ (…, v_size) at the velocities `v`, the controls `u` and further generalised forces `force` (…, v_size), N and N m. Joints that a motion drives, or
        that are locked, have the accelerations that `driven` (…, v_size) gives them."""
    def inverse_dynamics(
        self, acceleration: ArrayLike, v: ArrayLike | None = None, u: ArrayLike | None = None
    ) -> _Array:
        """Generalised forces (…, v_size), N and N m, at which the accelerations are `acceleration` (…, v_size), beside the controls `u`; of driven joints what drives them."""
    def jacobian(self, body: _Body, point: ArrayLike | None = None) -> _Array:
        """Velocity of a `point` (m, its frame; default: its origin) of a `body` (number or name) and the body's angular velocity, world axes, per generalised velocity:
        (…, 6, v_size)."""
    def velocity(self, body: _Body, v: ArrayLike, point: ArrayLike | None = None) -> _Array:
        """Velocity of that point (m/s) and angular velocity of the body (rad/s) at `v`, world axes: (…, 6)."""
    def acceleration(
        self, body: _Body, v: ArrayLike, acceleration: ArrayLike, point: ArrayLike | None = None
    ) -> _Array:
        """Acceleration of that point (m/s²) and angular acceleration of the body (rad/s²) at `v` and the generalised `acceleration`, world axes: (…, 6)."""
    def kinetic_energy(self, v: ArrayLike) -> _Array:
        """Kinetic energy of bodies and water at `v`, J, (…); the water's in the frame that moves with the current."""
    def momentum(self, v: ArrayLike) -> _Array:
        """Momentum (kg m/s) and angular momentum about the world's origin (kg m²/s) of bodies and water at `v`, (…, 6)."""

@final
class Loads:
    """Wrenches on all bodies at one state, kind by kind, and across their joints: made by `Rollout.loads`. Rows are force (N) and moment about the body's origin (N m), world axes. With
    the wrench across its own joint and the opposite ones of what it carries, they are the rate of a body's own momentum."""
    @property
    def kinds(self) -> list[str]:
        """What acts: the scene's forces by what they are ("gravity", "buoyancy", "linear drag", "spring", …; all springs together, whatever the scene names them), "water" (added mass; with "isolated" none on bodies that can't move), "contact"."""
    def wrenches(self, kind: str) -> _Array:
        """What one kind does to each body (bodies, 6)."""
    @property
    def joints(self) -> _Array:
        """What each body gets from what carries it, across its joint (bodies, 6); of its drive and stops as well."""
    @property
    def joint_forces(self) -> _Array:
        """Those along the axes of the joints (v_size,), N or N m: what a sensor in the drive reads."""
    @property
    def acceleration(self) -> _Array:
        """The generalised acceleration that all of it gives (v_size,)."""

@final
class SurfacePressure:
    """Pressure of the water on the faces of one body at one state, by Bernoulli's law for unsteady flow, from the accelerations there: made by `Rollout.pressure`. World frame. With
    `pressures`, −Σ p n A is what `Rollout.loads` calls "water", in a force `current` with what it calls "current", to the error of the faces."""
    @property
    def name(self) -> str:
        """The body's name."""
    @property
    def centres(self) -> _Array:
        """Centroids of the faces (n, 3), m."""
    @property
    def normals(self) -> _Array:
        """Unit normals of the faces into the water (n, 3)."""
    @property
    def areas(self) -> _Array:
        """Areas of the faces (n,), m²."""
    @property
    def velocities(self) -> _Array:
        """Velocity of the water at the centroids (n, 3), m/s; a current is in it."""
    @property
    def pressures(self) -> _Array:
        """Pressure of the flow at the centroids (n,), Pa, zero far away."""
    @property
    def hydrostatic(self) -> _Array:
        """Pressure of the water at rest (n,), Pa: zero at the world's origin, or under a `waterline` at the water's surface and all above it; of a face that reaches through it the mean over the face."""
    @property
    def at_films(self) -> _Array:
        """How much of each face lies at a gap that a film carries (n,), in parts of it."""
    @property
    def wrench(self) -> _Array:
        """Force and moment about the body's origin of `pressures` (6,), N and N m, world axes."""
    @property
    def hydrostatic_wrench(self) -> _Array:
        """The same of `hydrostatic`: buoyancy of the closed surface, of what of it is below a `waterline`."""

@final
class State:
    """A state between two steps: made by `Simulator.state`, `Simulator.step` or `Rollout.state`.

    Other simulators of the same sizes take it as well, whatever their parameters, their integrator and their time step: `q`, `v` and the number of steps are kept."""
    @property
    def step(self) -> int:
        """Number of steps made."""
    @property
    def time(self) -> float:
        """Time, s."""
    @property
    def q(self) -> _Array:
        """Joint coordinates, (q_size,)."""
    @property
    def v(self) -> _Array:
        """Generalised velocity, (v_size,)."""
    @property
    def mode(self) -> int:
        """What the scene's controller remembers; 0 without one."""
    @property
    def held(self) -> NDArray[np.bool_]:
        """Bodies whose joints the scene's controller held in the step that led here, (bodies,)."""
    @property
    def positions(self) -> _Array:
        """Positions of the bodies' origins, (bodies, 3), m, world axes."""
    @property
    def rotations(self) -> _Array:
        """Rotation matrices of the bodies, body to world, (bodies, 3, 3)."""

@final
class Record:
    """What one step leaves behind: the key to its derivatives."""
    def vjp(
        self,
        *,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        positions: ArrayLike | None = None,
        rotations: ArrayLike | None = None,
    ) -> StepGradient:
        """Transpose of the step: derivatives of `q·δq + v·δv + positions·δx + rotations·δθ` of the state after it, with `q` (v_size,) in
        the tangent space of the coordinates, `v` (v_size,), and `positions` and `rotations` (δR = δθ × R, world axes) (bodies, 3);
        what is None is zero."""
    def jacobians(self, parameters: Sequence[str] | None = None) -> tuple[_Array, ...]:
        """The linearisation x₁ ≈ A x₀ + B u of the step in x = (q, v), coordinates in their tangent space: A (2 v_size, 2 v_size)
        and B (2 v_size, control_size); with `parameters` also the derivatives with respect to those named (2 v_size, parameters)."""
    def jvp(
        self,
        *,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        u: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        gains: ArrayLike | None = None,
    ) -> tuple[_Array, _Array]:
        """Tangent of the step: the changes (δq, δv) (v_size,) each of the state after it along `q` (v_size,) in the tangent space of the
        coordinates and `v` (v_size,) of the state before it, `u` (control_size,) of its controls, `parameters` by name, and `gains`; what is None
        is zero. Each may have one more index before its own, and so has the tangent then: many directions cost little more than one."""

_Bodies = int | str | Sequence[int | str | None] | None

@final
class Rollout:
    """A trajectory of states 0 … N: the forward pass, and the only key to its gradient. Each access to an array makes a new one."""
    @property
    def simulator(self) -> Simulator:
        """The simulator that made it."""
    @property
    def steps(self) -> int:
        """Number of steps N."""
    @property
    def time(self) -> _Array:
        """Time, (N + 1,), s."""
    @property
    def q(self) -> _Array:
        """Joint coordinates, (N + 1, q_size), m, rad and unit quaternions (w, x, y, z)."""
    @property
    def v(self) -> _Array:
        """Generalised velocities, (N + 1, v_size), m/s and rad/s."""
    @property
    def controls(self) -> _Array:
        """The open-loop controls, (N, control_size), N and N m."""
    @property
    def applied_controls(self) -> _Array:
        """The controls that acted, those of the scene's or your own controller included, (N, control_size), N and N m."""
    @property
    def positions(self) -> _Array:
        """Positions of the bodies' origins, (N + 1, bodies, 3), m, world axes."""
    @property
    def rotations(self) -> _Array:
        """Rotation matrices of the bodies, body to world, (N + 1, bodies, 3, 3)."""
    @property
    def velocities(self) -> _Array:
        """Velocities of the bodies, (N + 1, bodies, 6), world axes: of the origin, m/s, and angular, rad/s."""
    @property
    def kinetic_energy(self) -> _Array:
        """Kinetic energy of bodies and fluid, (N + 1,), J."""
    @property
    def potential_energy(self) -> _Array:
        """Potential energy of weight, buoyancy, springs, joints and tendons (those at the control 0), (N + 1,), J."""
    @property
    def momentum(self) -> _Array:
        """Total momentum of bodies and fluid, (N + 1, 6): linear, kg m/s, then angular about the world's origin, kg m²/s."""
    @property
    def min_gap(self) -> _Array:
        """Smallest gap between bodies or to a wall, (N + 1,), m; NaN where there is nothing to meet."""
    @property
    def warnings(self) -> list[str]:
        """What should be known about this trajectory, with names and numbers."""
    def check_gap(self) -> dict[str, Any] | None:
        """The water across the smallest gap of the trajectory, beside that of coupled panels: a dictionary with `time` (s), `gap` (m), `bodies` (names; of
        the second None for a wall), `added_mass` (along the gap, by this rollout and by panels, kg), `slope` (the same of its slope, kg/m),
        `added_mass_error` and `force_error` (relative), `force_share` (the force by panels as a part of M u²/2h, that of an added mass M that goes as the inverse
        of the gap h, at a speed u across it) and `faces` (of the panels). None where there is no gap, no water, and where the rollout is by coupled
        panels already. It takes their setup and a solve."""
    def gap_flow(self) -> dict[str, Any] | None:
        """Which of inertia and viscosity rules the water in the smallest gap of the trajectory, whether or not viscous water acts there: a dictionary with `time`
        (s), `gap` (m), `bodies` (names; of the second None for a wall), `speed` (the fastest that it closes or opens near its smallest, m/s), `viscosity` (kinematic,
        m²/s), `film_reynolds` (h |ḣ|/ν), `viscous_over_inertial` (24 over that), `stokes` (inertia of the bodies over the viscous force, None where there is no
        film) and `lubricated`. None where there is no gap, no water, and where surfaces overlap."""
    def state(self, step: int = -1) -> State:
        """The state after `step` steps, from which a run may go on; negative numbers count from the end."""
    def contacts(self, step: int, slack: float = 0.0) -> ContactForces:
        """Contacts during the step from state `step` to the next, at the pose of that state: where surfaces are no more than `slack` (m)
        farther apart than the gap at which they touch, and what presses there. None where the scene has no contact. Negative
        numbers count from the end: -1 is the last step."""
    def pressure(self, state: int) -> list[SurfacePressure]:
        """The water's pressure on the surface of every body in it at state `state`, as the step there starts: one a body. It takes solves of its own. Negative numbers count
        states from the end. At the last state (-1) no step begins, as of `loads`: the water answers accelerations without controls and contact."""
    def loads(self, state: int) -> Loads:
        """What acts on every body and across every joint at state `state`, as the step there starts: gravity, buoyancy, drag, thrust, the inertia of the water, contact. Negative
        numbers count from the end.

        At the last state (-1) no step begins: no control acts, nothing touches and no joint's stop presses, so that what lay or was held accelerates there. What presses at the end
        of a run is that of state -2."""
    def imu(self, site: str) -> _Array:
        """What an inertial measurement unit at the site of this name reads at every state (n, 6): acceleration less gravity (m/s²) and rates (rad/s), in the site's axes. At the last state no step begins: no control acts, and nothing touches."""
    def flow(self, state: int, points: ArrayLike) -> _Array:
        """The water's velocity at `points` (n, 3), m, at state `state`: (n, 3), m/s, world axes, the current included. It takes a
        solve. Points within a body, behind a wall, or too near to an edge or to two
        surfaces at once are refused: `flow_resolved` tells them apart. Negative numbers count states from the end."""
    def flow_pressure(self, state: int, points: ArrayLike) -> _Array:
        """The pressure of the flow at `points` (n, 3), m, at state `state`: (n,), Pa, zero far away, that of the water at rest left out. Points as of `flow`."""
    def flow_resolved(self, state: int, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether `flow` knows the velocity at each of `points` (n, 3), m, at state `state`: (n,)."""
    def known_flow(self, state: int, points: ArrayLike) -> tuple[_Array, NDArray[np.bool_]]:
        """`flow` where `flow_resolved`, with the solves of one: velocities (n, 3), m/s, zero where they aren't known, and whether they are (n,)."""
    def potential(self, state: int, points: ArrayLike) -> _Array:
        """The potential φ of the flow that the bodies make at `points` (n, 3), m, at state `state`: (n,), m²/s, velocity −∇φ, zero far away, without the current. Points as of `flow`."""
    def sensor_flow(self, points: ArrayLike, bodies: _Bodies = None) -> _Array:
        """The water's velocity at sensors at the states 0 … N, (N + 1, n, 3), m/s, world axes: at `points` (n, 3), m, fixed in the world, or in the frames of `bodies`, one for all or one each, by number or
        name, None of what is fixed in the world. Sensors stand at least three quarters of an edge off all surfaces. A loss of it has gradients: `sensor_vjp`."""
    def sensor_pressure(self, points: ArrayLike, bodies: _Bodies = None) -> _Array:
        """The flow's pressure at sensors, given as of `sensor_flow`, at the states 0 … N, (N + 1, n), Pa, zero far away, that of the water at rest left out; with the mean accelerations over
        the step that starts there, as the observable "accelerations" has them."""
    def sensor_vjp(
        self, points: ArrayLike, bodies: _Bodies = None, *, flow: ArrayLike | None = None, pressure: ArrayLike | None = None
    ) -> dict[str, Any]:
        """Transpose of what sensors read: from cotangents `flow` (N + 1, n, 3) and `pressure` (N + 1, n) the keywords of `vjp` that they ask for, `positions`, `rotations`, `observables` and `density`:
        `rollout.vjp(**rollout.sensor_vjp(points, flow=bar))`. States without cotangents cost nothing."""
    def streamlines(
        self,
        state: int,
        seeds: ArrayLike,
        length: float,
        *,
        way: str = "both",
        within: tuple[ArrayLike, ArrayLike] | None = None,
        tolerance: float | None = None,
        most_steps: int = 2000,
    ) -> list[dict[str, Any]]:
        """Lines along the water's velocity at state `state` through `seeds` (n, 3), m, a dictionary each: `points` (k, 3) downstream, `velocities` (k, 3) there, which of them is the `seed`, and why it `ends`
        upstream and downstream: "length" (as long as `length`, m, each way), "box" (at the box `within`, two corners (3,)), "body …" or "wall …" (where the flow isn't known any more), "still",
        "steps" (more than `most_steps`); None where it doesn't go, with `way` "forward" or "backward". `tolerance`, m, is the error of a step."""
    def path_lines(self, seeds: ArrayLike, start: int = 0, stop: int = -1) -> list[dict[str, Any]]:
        """The ways of tracers that go with the water from `seeds` (n, 3), m, at state `start` to state `stop`, a dictionary each: `points` (k, 3) at the states from the first one on, `velocities` (k, 3)
        there, `times` (k,), s, and why it comes to its `end`: "length" (at `stop`), "body …" or "wall …". Negative numbers count states from the end."""
    def observe(self, name: str) -> _Array:
        """An observable at the states 0 … N by its name, (N + 1, …): "positions", "energy", "momentum", …; an unknown name's error has the list."""
    def value(self, objective: Objective) -> float:
        """Value of an objective."""
    def gradient(self, objective: Objective, *, progress: _Progress | None = None) -> Gradient:
        """Gradient of an objective, in one reverse sweep. `progress(done, total)` is told the steps gone back, as in `Simulator.rollout`; what it raises ends the sweep and comes out. Ctrl-C ends it."""
    def vjp(
        self,
        *,
        positions: ArrayLike | None = None,
        rotations: ArrayLike | None = None,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        controls: ArrayLike | None = None,
        applied_controls: ArrayLike | None = None,
        observables: Mapping[str, ArrayLike] | None = None,
        density: float = 0.0,
        progress: _Progress | None = None,
    ) -> Gradient:
        """Transpose of the rollout: the gradient of Σ cotangent · δ(observation), for any loss of your own. `q` in the tangent
        space of the coordinates and `v` are (N + 1, v_size), `positions` and `rotations` (δR = δθ × R, world axes)
        (N + 1, bodies, 3), `controls`, what the loss has of the open-loop ones directly, and `applied_controls`, those with what the controller added, (N, control_size); `observables` has
        cotangents of others by name, each in the shape that `observe` gives, but of "q", "rotations" and "site_rotations" in the tangent space, as `q` and `rotations`; `density` what the loss has of the water's density directly. What is None is zero. `progress` is that of `gradient`. Ctrl-C ends it."""
    def jvp(
        self,
        *,
        controls: ArrayLike | None = None,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        gains: ArrayLike | None = None,
        observables: Sequence[str] | None = None,
    ) -> Tangents:
        """Tangents of the trajectory, the counterpart of `vjp`: how the states change along `controls` (N, control_size), `q` (v_size,) in the tangent space of the
        initial coordinates, the initial `v` (v_size,), `parameters` by name, and `gains`; what is None stays. Each may have one more index before its own, for many
        directions at once, which cost little more than one. `observables` names others whose tangents are wanted. A `Tangents`. Ctrl-C ends it."""
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
    ) -> dict[str, _Array]:
        """Jacobians of the observables `of` ("q" in the tangent space of the coordinates, "rotations" and "site_rotations" as δθ) at `states` (all where None; negative numbers count from the end)
        with respect to the `parameters` named, and where True the initial `q` (in its tangent space) and `v`, the `gains`, and the `controls` of all steps: by name an array
        (states, …, columns) whose columns come in that order. It costs a few runs, whatever the number of columns. Ctrl-C ends it."""
    def step_jacobians(self, parameters: Sequence[str] | None = None) -> tuple[_Array, ...]:
        """Linearisations x_{n+1} ≈ A_n x_n + B_n u_n of all steps in x = (q, v), coordinates in their tangent space, the scene's controller included: A (N, 2 v_size, 2 v_size)
        and B (N, 2 v_size, control_size); with `parameters` also the derivatives with respect to those named (N, 2 v_size, parameters). Steps are taken on all cores."""
    def to_dict(self, *, pressure: bool = False) -> dict[str, _Array]:
        """Columns by name, one row a state: time, each coordinate and velocity, energy, momentum of all together, smallest gap, and the controls that acted from there on (NaN at the last state), SI units, with `pressure` also that of the flow on every face
        ("ball.pressure_0", …, Pa), at the price of solves of its own a state; `pandas.DataFrame(rollout.to_dict())` is a table."""
    def write_vtk(
        self,
        folder: _Path,
        *,
        frames_per_second: float | None = None,
        every: int | None = None,
        loads: bool = False,
        pressure: bool = False,
        flow: tuple[ArrayLike, ArrayLike, float] | None = None,
        streamlines: tuple[ArrayLike, float] | None = None,
    ) -> list[Path]:
        """Writes files of VTK, which ParaView opens, into a folder, which is made where there is none; the files to open are given. `bodies.pvd`: all bodies' triangles frame by frame, in the
        world, with the `body` (number) and the `velocity` (m/s) of every face, and with `pressure`, at the price of solves of its own a frame, the `pressure` of the flow and the `hydrostatic`
        one (Pa) and the `water_velocity` (m/s) there, as `pressure` tells them, zero where a face isn't `wetted` (1 or 0); `walls.vtp`: walls as squares; with `loads`, `loads.pvd`: at each body's origin what acts on it,
        `gravity_force` (N), `gravity_moment` (N m), `water_force`, …, of every kind that `loads` tells; with `flow`, two corners (3,) of a box and the spacing of a grid in it, m, `flow.pvd`: the
        water's `velocity` there, zero where it isn't `resolved`; with `streamlines`, seeds (n, 3) and a length, m, `streamlines.pvd`: the lines of `streamlines`, of seeds where the flow is known. Frames are up to `frames_per_second` of simulated time (30 unless told otherwise), or every `every`-th
        state, with the first and the last. Files of the same names are replaced. Ctrl-C ends it."""
    def write_gltf(
        self,
        path: _Path,
        *,
        frames_per_second: float | None = None,
        every: int | None = None,
        colors: Mapping[str, str] | None = None,
    ) -> Path:
        """Writes an animated scene in glTF 2.0, to a name that ends in `.glb`, which Blender and browsers open, and gives its path: a node each body, moved between frames, and walls. Lengths are m and times s, counted from
        the first state; the node `hydrograd` above all turns z up. `colors` are "#rrggbb" by the names of bodies; frames are those of `write_vtk`. A file that stands there is replaced."""
    def summary(self) -> dict[str, Any]:
        """Figures of the whole trajectory: energies (J), drift of momentum (relative), iterations, smallest gap (m), by what the water
        across gaps is carried and how far off it is estimated to be (`gaps`), the largest gap
        at which surfaces are taken to touch (m), steps that were cut into pieces, and the most pieces of one."""
    def __len__(self) -> int: ...

@final
class Objective:
    """A scalar of a rollout: made by the functions of `hydrograd.objective`, added with `+`, `-` and `sum`, and weighted with `*` and `/`."""
    def __add__(self, other: Objective) -> Objective: ...
    def __radd__(self, other: Literal[0]) -> Objective: ...
    def __sub__(self, other: Objective) -> Objective: ...
    def __neg__(self) -> Objective: ...
    def __truediv__(self, divisor: float) -> Objective: ...
    def __mul__(self, factor: float) -> Objective: ...
    def __rmul__(self, factor: float) -> Objective: ...

def final_position(body: int | str, target: ArrayLike) -> Objective:
    """Squared distance (m²) of the origin of `body`, its number or its name, from `target` (m, world axes) at the end."""
def mean_position(body: int | str, target: ArrayLike) -> Objective:
    """Mean squared distance (m²) of the origin of `body`, its number or its name, from `target` (m, world axes) over all states."""
def final_coordinate(index: int, target: float, weight: float = 1.0) -> Objective:
    """`weight · (q[index] − target)²` at the end, for a coordinate of a prismatic, revolute or planar joint (m or rad)."""
def final_velocity(index: int, target: float, weight: float = 1.0) -> Objective:
    """`weight · (v[index] − target)²` at the end (m/s or rad/s)."""
def final_observable(name: str, entry: int, target: float, weight: float = 1.0) -> Objective:
    """`weight · (x − target)²` at the end, x entry number `entry` (last index fastest) of the observable `name` as `Rollout.observe` gives
    it; the observable must have a transpose."""
def mean_observable(name: str, entry: int, target: float, weight: float = 1.0) -> Objective:
    """The mean of `weight · (x − target)²` over all states, x as in `final_observable`."""
def final_flow(point: ArrayLike, target: ArrayLike, weight: float = 1.0, *, body: int | str | None = None) -> Objective:
    """`weight` times the squared distance of the water's velocity from `target` (m/s, world axes) at the end, at a sensor at `point` (m), fixed in the world, or in the frame of `body`
    (its number or its name): as `Rollout.sensor_flow` reads it."""
def mean_flow(point: ArrayLike, target: ArrayLike, weight: float = 1.0, *, body: int | str | None = None) -> Objective:
    """The mean of `final_flow` over all states."""
def final_pressure(point: ArrayLike, target: float, weight: float = 1.0, *, body: int | str | None = None) -> Objective:
    """`weight · (p − target)²` at the end, p the flow's pressure (Pa) at a sensor as of `final_flow`: as `Rollout.sensor_pressure` reads it."""
def mean_pressure(point: ArrayLike, target: float, weight: float = 1.0, *, body: int | str | None = None) -> Objective:
    """The mean of `final_pressure` over all states."""
def effort(weight: float) -> Objective:
    """`weight` times the sum of the squared open-loop controls (N², N² m²)."""

def applied_effort(weight: float) -> Objective:
    """`weight` times the sum of the squares of the controls that acted, the open-loop ones and what the controller added (N², N² m²): its gains have a share in it."""

_Derivative = ArrayLike | None

@final
class CostTerm:
    """A term of the cost that `hydrograd.optimize.ilqr` lowers: made by its static methods, which are the functions of `hydrograd.cost`.

    It is the sum of `weights` times squared entries: one weight for all, or one each. A running term is integrated over time: at every knot but the last it counts its value times
    the knot's duration. With `last=True` it counts once, at the end. Targets stand, or move: with `times` (n,), s, of the simulation's clock, `target` has a row for each, and goes straight from row to row."""
    @staticmethod
    def configuration(target: ArrayLike, weights: ArrayLike, *, times: ArrayLike | None = None, last: bool = False) -> CostTerm:
        """Distance of all coordinates from `target` (q_size,), in their tangent space: `weights` one or (v_size,)."""
    @staticmethod
    def velocity(target: ArrayLike, weights: ArrayLike, *, times: ArrayLike | None = None, last: bool = False) -> CostTerm:
        """Distance of the generalised velocity from `target` (v_size,), m/s, rad/s."""
    @staticmethod
    def effort(weights: ArrayLike, *, target: ArrayLike | None = None, times: ArrayLike | None = None) -> CostTerm:
        """The open-loop controls, N and N m; or their distance from `target` (control_size,), where one is given."""
    @staticmethod
    def control_change(weights: ArrayLike) -> CostTerm:
        """Changes of the open-loop controls from one knot to the next."""
    @staticmethod
    def position(
        frame: str,
        target: ArrayLike,
        weights: ArrayLike,
        *,
        point: ArrayLike | None = None,
        times: ArrayLike | None = None,
        last: bool = False,
    ) -> CostTerm:
        """Distance of a point of the body or site named `frame` from `target` (3,), m, world axes: that of its origin, or of `point` (3,), m, its frame."""
    @staticmethod
    def orientation(frame: str, target: ArrayLike, weights: ArrayLike, *, times: ArrayLike | None = None, last: bool = False) -> CostTerm:
        """Rotation vector, rad, world axes, that takes the axes of the body or site named `frame` from `target`, a rotation vector (3,) from the world's axes, to where they are."""
    @staticmethod
    def observable(
        name: str,
        entries: Sequence[int],
        target: ArrayLike,
        weights: ArrayLike,
        *,
        times: ArrayLike | None = None,
        last: bool = False,
    ) -> CostTerm:
        """Distance of some `entries` (n,) (last index fastest) of the observable `name` from `target` (n,); the observable must have a transpose."""
    @staticmethod
    def custom(
        function: Callable[
            [Point],
            tuple[float, _Derivative, _Derivative] | tuple[float, _Derivative, _Derivative, _Derivative, _Derivative, _Derivative],
        ],
        *,
        last: bool = False,
    ) -> CostTerm:
        """A cost of your own. `function(point)` is given a `hydrograd.cost.Point` and gives a tuple (cost, x, u) or (cost, x, u, xx, uu, ux): the cost (a running one per second), its gradient by the state,
        (2 v_size,) (coordinates in their tangent space, then velocity), by the controls, (control_size,), and their second derivatives, ux (control_size, 2 v_size). None is zero. It is
        called from several threads."""

@final
class Tracking:
    """The feedback that holds a robot to a plan, `u = ū + K (x ⊖ x̄)` within the plan's limits: a policy, for `Simulator.with_policy`. Before the plan starts and after it has ended
    the nearest controls are held, without feedback."""
    def act(self, observation: Observation, /) -> _Array:
        """The controls, (control_size,), at an observation: its `time`, `q` and `v`."""
    def act_vjp(self, observation: Observation, control_bar: ArrayLike, /) -> tuple[_Array, _Array]:
        """Transpose of `act`: cotangents (q_bar, v_bar) from that of the controls."""

@final
class Mpc:
    """Model-predictive control: a plan over `knots` of `hold` time steps of the simulator `model`, made again by `iterations` of iLQR every `every` of its time steps from where the plant is, from the plan
    before, moved on; the first one by `first_iterations`. Between plans the plan's `feedback` acts, or its controls alone. Other keywords are those of `ilqr`.

    The plant may be a robot, which asks for controls step by step (`control`), or a simulator (`run`): the model itself, or one of another fidelity, current, parameters or time step."""
    def __new__(
        cls,
        model: Simulator,
        cost: Sequence[CostTerm],
        *,
        knots: int,
        hold: int = 1,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        previous: ArrayLike | None = None,
        every: int = 1,
        iterations: int = 3,
        first_iterations: int = 50,
        feedback: bool = True,
        tolerance: float = 1e-6,
        trials: int = 10,
    ) -> Mpc: ...
    @property
    def model(self) -> Simulator:
        """The simulator that plans."""
    @property
    def replans(self) -> list[Replan]:
        """All plans so far, those of a run under way among them: a list of `Replan`."""
    def set_model(self, model: Simulator) -> None:
        """Plans with another simulator from now on: one that has learnt the current, say. It must have the sizes and the time step of the one before. Not during `run` or `control`."""
    def reset(self) -> None:
        """Forgets plans, so that the next call starts anew. Not during `run` or `control`."""
    def control(self, time: float, q: ArrayLike, v: ArrayLike) -> _Array:
        """The controls, (control_size,), at a time, s, from where the plant is: `q` (q_size,), `v` (v_size,). Plans again when that is due. Times must not go back; the first one starts the clock."""
    def run(
        self,
        plant: Simulator,
        steps: int,
        *,
        state: State | None = None,
        cost: Sequence[CostTerm] | None = None,
        progress: _Progress | None = None,
    ) -> MpcRun:
        """Runs a simulated plant for `steps` of its time steps from `state`, or from where it starts: an `MpcRun`; on from the plans so far if all of them are of times before, or it starts where the last run ended. Its cost is that of `cost`, or of the terms that are planned with.
        `progress(done, total)` is called every so often with the steps of the plant; what it raises ends the run, and so does Ctrl-C."""

@final
class Unknown:
    """A number to be found by `identify`: the parameter `name`, or several, `sets` = {parameter: factor}; `sets_start` = {coordinate: factor} sets coordinates of
    the initial state by their labels ("arm.angle"), in every experiment. The search begins at `start` (default: the prior's mean, or the first experiment's
    value) and stays `within` (least, largest); `prior` = (mean, deviation) is what was known beforehand. `positive` searches over the logarithm: the prior's deviation is then that of the logarithm."""
    def __new__(
        cls,
        name: str,
        *,
        sets: Mapping[str, float] | None = None,
        sets_start: Mapping[str, float] | None = None,
        start: float | None = None,
        prior: tuple[float, float] | None = None,
        within: tuple[float, float] | None = None,
        positive: bool = False,
    ) -> Unknown: ...
    @staticmethod
    def inertia(body: str) -> list[Unknown]:
        """The inertia of a body about its centre of mass, as six unknowns that make a physical one whatever they are: entries xx, yy, zz (by their logarithms), xy, xz, yz of the upper
        triangular root L (√kg m) of its second moments of mass, I = tr(L Lᵀ) 1 - L Lᵀ, by the names "BODY.inertia.root.xx" and so on."""
    @property
    def name(self) -> str:
        """Its name."""

@final
class Experiment:
    """A recording for `identify`: a `simulator` that starts as it did, and what was done, `controls` (steps, control_size) or none for so many `steps`. With `start_within` = (q, v) the initial
    state is unknown, and known beforehand to these deviations (m or rad, m/s or rad/s; 0: exactly). `saw` adds what was seen."""
    def __new__(
        cls,
        name: str,
        simulator: Simulator,
        *,
        steps: int | None = None,
        controls: ArrayLike | None = None,
        start_within: tuple[float, float] | None = None,
    ) -> Experiment: ...
    def saw(
        self,
        observable: str,
        entry: int | str,
        values: ArrayLike,
        *,
        deviation: float,
        states: Sequence[int] | None = None,
    ) -> None:
        """Adds what was seen of one `entry` of an `observable`, by its number or its label ("hull.pitch"): `values` at `states` (default: at all, the start among them), and the standard
        `deviation` of the noise. NaN says that nothing was seen."""
    def saw_function(
        self,
        observables: Sequence[str],
        function: Callable[[dict[str, _Array]], ArrayLike],
        *,
        states: Sequence[int] | None = None,
    ) -> None:
        """Adds residuals that are a function of whole `observables` at `states` (default: all), such as amplitudes, phases and mean speeds: `function` gets them as arrays
        (states, …) by name in a dict, and gives differences from what was measured over their deviations, (n,). It must be differentiable, and is differentiated by differences of its own
        along exact tangents of the observables, without a simulation."""
    def scaled(self, parameter: str, factor: float) -> None:
        """Makes a parameter `factor` times what an unknown sets it to, in this experiment: where a law says how it depends on what was done."""
    @property
    def name(self) -> str:
        """Its name."""

def identify(
    experiments: Sequence[Experiment],
    unknowns: Sequence[Unknown],
    *,
    loss: tuple[Literal["huber", "cauchy"], float] | None = None,
    iterations: int = 50,
    damping: float = 1e-6,
    cost_tolerance: float = 1e-8,
    step_tolerance: float = 1e-3,
    profiles: int = 1,
    progress: Callable[[IdentifyProgress], object] | None = None,
) -> Identified:
    """The unknowns that fit the recordings best, by Levenberg and Marquardt on exact Jacobians of rollouts, and how well they are known: an `Identified`.

    `loss`: ("huber", k) or ("cauchy", k) forgives what lies more than k deviations off. It makes `iterations` at most, and ends once one lowers the misfit by less than
    `cost_tolerance` of itself, or moves no unknown by more than `step_tolerance` standard errors; `damping` is that of the first. Of the `profiles` directions that are known least the
    misfit is simulated. `progress(p)` is called after every iteration with an `IdentifyProgress`; where it gives True the best so far is what is found. Ctrl-C ends it."""
def ilqr(
    simulator: Simulator,
    cost: Sequence[CostTerm],
    *,
    knots: int,
    hold: int = 1,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    previous: ArrayLike | None = None,
    state: State | None = None,
    guess: ArrayLike | Plan | Tracking | None = None,
    shift: int = 0,
    iterations: int = 100,
    tolerance: float = 1e-9,
    target: float | None = None,
    regularisation: float = 0.0,
    trials: int = 10,
    progress: Callable[[IlqrProgress], object] | None = None,
) -> Plan:
    """Controls over a horizon that lower a cost from a state on, within limits, by iterated linear–quadratic regulation on the simulator's own Jacobians: a `Plan`, with the feedback about
    it. `cost` is a list of terms (`hydrograd.cost`).

    There are `knots` of controls, each held over `hold` time steps; `lower` and `upper` are the least and largest open-loop controls (N, N m), one for all or (control_size,); None: none. `previous`
    (control_size,): the controls before the first knot, from which `cost.control_change` counts. It starts at the `state`, or where the simulator does, from `guess`: controls (knots, control_size), or
    a `Plan` that was made before, of which `shift` time steps have passed, with its feedback; None: no control.

    It makes `iterations` at most, and ends once one lowers the cost, or expects to, by less than `tolerance` of it, or the cost is at most `target`. `regularisation` is the part by which each control's
    curvature is made larger at first, `trials` the most lengths of a step that are tried. `progress(p)` is called after every iteration with an `IlqrProgress`; where it gives True the plan so far is
    what is found. What it raises ends it and comes out, and so does what a cost or a controller of your own raises. Ctrl-C ends it."""
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
) -> Optimum:
    """Lowers a function from `start` (n,), by L-BFGS that takes failures and jumps: an `Optimum`. `function(x)` gives the cost and its gradient (n,). Where it
    raises an `hg.Error` (a rollout that fails) the search is turned back; any other exception ends it, and so does Ctrl-C.

    `iterations` and `evaluations` are the most that are made, `memory` the pairs that are remembered, `first_step` the length of the first trial
    step in units of x (None: from the cost and its gradient). It ends once the gradient is shorter than `gradient_tolerance` of the first one, the cost falls
    by less than `cost_tolerance` of itself, or the cost is at most `target`. With `clip` gradients longer than that many times the first are shortened to it: where a
    trajectory is about to jump they are huge and say little."""
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
) -> Optimum:
    """Descends `function(stage, x)`, as `minimise` does, for each of `stages` in turn, each from where the one before ended: softnesses of contact
    (`Simulator.with_soft_contact`), say, that end in 1. The `Optimum` is that of the last stage, with the iterations, evaluations and failures of all; a stage
    whose start fails is passed over, unless it is the last. Keywords are those of `minimise`, for each stage."""
def smoothed(
    function: Callable[[_Array], _Evaluated],
    x: ArrayLike,
    *,
    spread: float = 0.05,
    directions: int = 16,
    seed: int = 1,
) -> Smoothed:
    """A function's cost and gradient averaged over a neighbourhood of `x` (n,): a `Smoothed`. `function(x)` gives the cost and its gradient (n,), at
    `directions` normal displacements of standard deviation `spread` and their opposites, the same ones (`seed`) at every x, so that
    what is averaged can be descended. Where it raises an `hg.Error` the direction is left out; any other exception ends it, and so does Ctrl-C. It is called from
    several threads: rollouts in it run side by side."""
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
) -> Grasp:
    """Finds controls with which a gripper catches an object and holds it to the end of the run: a `Grasp`. One recipe with one set of settings: evenly
    spread pushes, descents from the best of them, CMA-ES where nothing is caught.

    `simulator` may be a scene, which is then simulated as its defaults say; it needs contact, and runs open-loop, whatever its own controller. `object` is the body
    that is to be held and `fingers` those that hold it, each with the point (3,) of it that should press, m, body frame; bodies are given by name or number.
    `closing` (controls,) has the sign that closes the gripper, and what part of the limit does; 0: it doesn't. `limits` are the largest absolute
    values of the controls, N or N m, one or (controls,). `hold`: for how long it must be held at the end, s.

    `knots` of each control, `pushes` that are tried, `starts`: the best of them from which is descended, `evaluations` with gradients of each part of a descent,
    `softness` of contact over which is descended, in turn, `target`: a cost that is good enough, `search`: simulations of CMA-ES, `seed` of it.
    Ctrl-C ends it."""

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
) -> Tradeoff:
    """Measures a scene's time per step against its error, over everything that can be chosen: a `Tradeoff`.

    Each fidelity, method for a body alone, number of faces, of points (`ranks`) and accuracy of compressed bodies, tolerance,
    integrator and time step (s) is varied around the scene's own choice, or around the first value of a list that is given;
    with `full_product` every combination is measured. Errors are against coupled panels on finer and finer meshes (added
    mass) and against compressed bodies of high accuracy with a quarter of the time step (accelerations, and end states
    after `steps` steps). Configurations are timed one after another on this machine, so leave it alone meanwhile. `budget` is
    the time for all this, s; what it has no time for is in `left_out`. With `reference_faces` faces a body the reference
    takes the time it needs. Ctrl-C ends it."""
