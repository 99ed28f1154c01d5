//! Plain scene data: what a user writes, in Rust or in a TOML file. No numerics.
//!
//! SI units throughout. Frames: a body's pose in the world is
//! `parent pose ∘ placement ∘ joint motion`; the body's origin is where its joint acts.

#[macro_use]
mod build;
mod carriers;
mod contact;
mod file;
mod force;
#[cfg(feature = "urdf")]
mod imports;
mod joint;
mod mimic;
mod motion;
mod origin;
mod passive;
mod problem;
#[cfg(feature = "urdf")]
mod robot;
mod servo;
mod shape;
mod site;
mod spline;
mod validate;

pub(crate) use crate::geometry::impossible_inertia;
pub use crate::geometry::{Refinement, Wall, WallSurface};
pub use crate::multibody::{Joint, Plane};
pub use crate::shape::Shape;
pub use build::BodyId;
pub(crate) use carriers::Carriers;
pub use contact::{CollisionPiece, Contact};
pub(crate) use force::{AXES, BUOYANT_ANYWHERE, least_damping};
pub use force::{
    Coefficients, Current, Damping, Edge, Fin, Float, Force, Lubrication, Spring, Tendon, Thruster,
    WATER_VISCOSITY,
};
#[cfg(feature = "urdf")]
pub use imports::Imports;
pub use mimic::Mimic;
pub use origin::Origin;
pub use passive::Passive;
#[cfg(feature = "urdf")]
pub use robot::{
    Added, BadMeshes, Base, BodyReport, FoldedReport, Followers, MeshUse, Robot, RobotJoint,
    RobotLink, RobotReport, Unused, Wet,
};
pub use servo::Servo;
pub use site::Site;
pub use spline::Spline;

use serde::{Deserialize, Serialize};

/// Everything that a simulation starts from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Name, for reports.
    #[serde(default, skip_serializing_if = "is_default")]
    pub name: String,
    /// The water.
    pub fluid: Fluid,
    /// Gravity, m/s², world frame.
    #[serde(default, skip_serializing_if = "is_default")]
    pub gravity: [f64; 3],
    /// Height of the surface of still water, m: how far from the world's origin it is against gravity. Above there is no water: what is there of a body has no buoyancy and no
    /// drag. None: the water has no end. Its inertia isn't told of it (`docs/water.md`).
    pub waterline: Option<f64>,
    /// Time step, s.
    pub time_step: f64,
    /// Number of steps of a run.
    pub steps: usize,
    /// Settings that a run of this scene starts from, e.g. `preset = "paper"`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub preset: Preset,
    /// Plane rigid walls: one, or mutually perpendicular ones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub walls: Vec<Wall>,
    /// How surfaces touch; without it bodies may not.
    pub contact: Option<Contact>,
    /// The bodies, parents before children.
    #[serde(default)]
    pub bodies: Vec<Body>,
    /// Robots that a scene file asks for; reading it turns them into bodies, and leaves none here.
    #[cfg(feature = "urdf")]
    #[serde(default, rename = "robot", skip_serializing_if = "Vec::is_empty")]
    pub robots: Vec<Robot>,
    /// What came of the robots that it has.
    #[cfg(feature = "urdf")]
    #[serde(skip)]
    pub imports: Imports,
    /// Forces between bodies, beside those that bodies have of their own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub forces: Vec<Force>,
    /// Named frames on bodies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sites: Vec<Site>,
    /// Where the scene starts.
    #[serde(default, skip_serializing_if = "is_default")]
    pub initial: Initial,
    /// What drives the actuated joints.
    pub controller: Option<Controller>,
}

choices! {
    /// A family of choices.
    pub enum Preset {
        /// hydrograd's own.
        #[default]
        Default,
        /// The paper's: face sources, rows not scaled, potential read at face centres, semi-implicit Euler in velocity.
        Paper,
    }
}

/// The fluid around the bodies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fluid {
    /// Density, kg/m³; zero is "no water".
    pub density: f64,
    /// Uniform steady current, m/s, world frame; must be parallel to the walls.
    #[serde(default, skip_serializing_if = "is_default")]
    pub current: [f64; 3],
}

/// A rigid placement: rotation first, then translation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Placement {
    /// Translation, m.
    #[serde(skip_serializing_if = "is_default")]
    pub position: [f64; 3],
    /// Rotation vector (axis times angle), rad.
    #[serde(skip_serializing_if = "is_default")]
    pub rotation: [f64; 3],
}

/// One rigid body with the joint that carries it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Name, unique in the scene.
    pub name: String,
    /// Surface that the water sees. A body without one is dry unless `added_mass` is given.
    pub shape: Option<Shape>,
    /// Pose of the shape in the body's frame.
    #[serde(default, skip_serializing_if = "is_default")]
    pub shape_at: Placement,
    /// Convex pieces that the body is for contact, instead of its shape: a concave body is a union of such. The water sees
    /// `shape` all the same.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub collision: Vec<CollisionPiece>,
    /// Regions where the faces of the shape are made smaller: where the body comes near others. Elsewhere the
    /// mesh stays as its number of faces makes it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub refine: Vec<Refinement>,
    /// Mass, kg. Give this or `density`; a body fixed to the world needs neither.
    pub mass: Option<f64>,
    /// Density, kg/m³, from which mass and inertia follow with the shape's volume.
    pub density: Option<f64>,
    /// Centre of mass in the body's frame, m; default: the shape's centroid.
    pub center_of_mass: Option<[f64; 3]>,
    /// Volume by which the body is buoyant, m³; default: its shape's. It changes nothing else of what the water does.
    pub volume: Option<f64>,
    /// Where buoyancy acts in the body's frame, m; default: the shape's centroid, or the centre of mass.
    pub center_of_buoyancy: Option<[f64; 3]>,
    /// Inertia about the centre of mass, body axes, kg m²: xx, yy, zz or xx, yy, zz, xy, xz, yz.
    /// Default: that of the shape filled evenly with `mass`.
    pub inertia: Option<Vec<f64>>,
    /// The body's own added mass at unit density of the fluid, about its origin, body axes, 6 × 6
    /// rows (linear, then angular; m³, m⁴, m⁵): instead of the computed one. With the coupled fidelities, which need a shape all the same, what
    /// other bodies and walls change of it is as computed.
    pub added_mass: Option<Vec<Vec<f64>>>,
    /// Name of the parent body; default: the world.
    pub parent: Option<String>,
    /// Whether the body's surface touches or overlaps that of the nearest body with a shape that
    /// carries it. The two then don't feel each other through the water, and may share up to half of
    /// the smaller one's volume.
    #[serde(default, skip_serializing_if = "is_default")]
    pub overlaps_parent: bool,
    /// Pose of the joint's frame in the parent's frame.
    #[serde(default, skip_serializing_if = "is_default")]
    pub placement: Placement,
    /// How the body moves against its parent.
    #[serde(default)]
    pub joint: Joint,
    /// Another joint that moves this one, by a transmission.
    pub mimic: Option<Mimic>,
    /// Coordinates of the joint where the scene starts, unless [`Initial::q`] is given; empty: its origin.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub start: Vec<f64>,
    /// A given motion of the joint's coordinates, one per coordinate; the joint is then driven.
    pub motion: Option<Vec<Motion>>,
    /// Holds the joint where it starts.
    #[serde(default, skip_serializing_if = "is_default")]
    pub locked: bool,
    /// Range of a prismatic or revolute joint's coordinate, lower and upper end, m or rad: at either a stop pushes back, by
    /// the law of contact, without friction. It may start anywhere from one to the other. While a controller holds the joint its
    /// stops have nothing to do.
    pub limits: Option<[f64; 2]>,
    /// Stiffness of the stops at `limits`, N/m or N m/rad. Default: ten times the inertia that the joint's coordinate has at the
    /// start, the water's and that of all bodies it carries included, over the square of the time step, which is near rigid at that
    /// step. The force sets in over ± a thousandth of the range around a limit.
    pub limit_stiffness: Option<f64>,
    /// Spring, damping, friction and rotor of a joint with one coordinate.
    pub passive: Option<Passive>,
    /// Whether the joint's generalised forces are controls.
    #[serde(default, skip_serializing_if = "is_default")]
    pub actuated: bool,
    /// A drive whose target is the joint's control, in place of its force.
    pub servo: Option<Servo>,
    /// Whether a wrench on the body (world axes, about its origin) is a control.
    #[serde(default, skip_serializing_if = "is_default")]
    pub thruster: bool,
    /// Drag on the body's surface.
    pub drag: Option<Drag>,
    /// Where a scene file gives it.
    #[serde(skip)]
    pub origin: Origin,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// A given motion of one joint coordinate, q(t).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Motion {
    /// `offset + rate·t`.
    Linear {
        /// Value at t = 0, m or rad.
        offset: f64,
        /// Rate, m/s or rad/s.
        rate: f64,
    },
    /// `offset + amplitude·sin(frequency·t + phase)`.
    Sine {
        /// Mean value, m or rad.
        #[serde(default)]
        offset: f64,
        /// Amplitude, m or rad.
        amplitude: f64,
        /// Angular frequency, rad/s.
        frequency: f64,
        /// Phase at t = 0, rad.
        #[serde(default)]
        phase: f64,
    },
    /// Through given points, twice continuously differentiable: see [`Spline`].
    Spline(Spline),
}

/// Drag on a body's surface, summed over its faces (Eq. 22 and its companions). The coefficients
/// are per area of the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Drag {
    /// Which part of the local velocity drags in the linear law.
    #[serde(skip_serializing_if = "is_default")]
    pub part: DragPart,
    /// Linear coefficient, kg/(m² s): νρ of Eq. 22.
    #[serde(skip_serializing_if = "is_default")]
    pub linear: f64,
    /// Which part of the local velocity drags in the quadratic law.
    #[serde(skip_serializing_if = "is_default")]
    pub quadratic_part: DragPart,
    /// Quadratic coefficient c of `½ ρ c |w| w` per face area, with w the dragging part of the
    /// velocity; dimensionless.
    #[serde(skip_serializing_if = "is_default")]
    pub quadratic: f64,
}

/// Part of the surface velocity that drags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DragPart {
    /// Along the surface, Eq. 22.
    #[default]
    Tangential,
    /// Across the surface.
    Normal,
    /// Both.
    Total,
}

/// Where a scene starts; lengths must match the joints in the order of the bodies.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Initial {
    /// Joint coordinates; empty: all at their origin.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub q: Vec<f64>,
    /// Generalised velocity; empty: at rest.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub v: Vec<f64>,
    /// Generalised momentum M(q)v, the water's part included, instead of `v`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub momentum: Vec<f64>,
}

/// What drives the actuated joints of a scene file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Controller {
    /// The same generalised forces at every step.
    Constant {
        /// One per control, N or N m.
        control: Vec<f64>,
    },
    /// Proportional–derivative control of each actuated joint coordinate; thrusters among the forces get nothing from it.
    Pd {
        /// Target coordinates, one per actuated one, m or rad.
        target: Vec<f64>,
        /// Stiffness of each, N/m or N m/rad.
        stiffness: Vec<f64>,
        /// Damping of each, N s/m or N m s/rad.
        damping: Vec<f64>,
    },
    /// Pushes one joint with a constant force until its coordinate passes a value, then stops it
    /// within one step and holds it (the paper's falling ball).
    PushThenLock {
        /// The body whose (one-coordinate) joint is pushed.
        body: String,
        /// Generalised force, N or N m.
        force: f64,
        /// The coordinate at which it is stopped, m or rad; approached from above if `force` is
        /// negative, from below otherwise.
        stop_at: f64,
    },
    /// Given controls, each for as long as a step of the scene, and nothing after the last: an optimised trajectory to be run again, with steps of another length as well: one that goes over several has their mean.
    Playback {
        /// One row per step, in it one per control, N or N m.
        control: Vec<Vec<f64>>,
    },
    /// Constant controls, stage by stage: a stage ends for good once the joint of one of `bodies` is faster than its
    /// `until`, and after the last one nothing acts (the paper's grasps).
    SpeedStages {
        /// Bodies whose one-coordinate joints are watched.
        bodies: Vec<String>,
        /// In their order.
        stages: Vec<SpeedStage>,
    },
    /// A wave of joint angles that travels from head to tail, held by torques ([`Wave`](crate::simulate::Wave)): a swimming fish. Gains: all numbers but `places` and `rise`.
    Wave {
        /// Bodies whose actuated revolute joints bend, from head to tail.
        bodies: Vec<String>,
        /// Where each is along the body, 0 at the head, 1 at the tail; default: evenly, the last at 1.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        places: Vec<f64>,
        /// Amplitude's coefficients of 1, s and s², s the place, rad.
        amplitude: [f64; 3],
        /// Angular frequency, rad/s.
        frequency: f64,
        /// Length of the wave by that of the body; it travels to the tail where it is positive.
        length: f64,
        /// Added to all angles, rad: a turn.
        #[serde(default, skip_serializing_if = "is_default")]
        bias: f64,
        /// N m/rad.
        stiffness: f64,
        /// N m s/rad.
        damping: f64,
        /// Time in which the wave rises from nothing, s.
        #[serde(default, skip_serializing_if = "is_default")]
        rise: f64,
    },
}

/// Controls until a speed is reached.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpeedStage {
    /// Speed of a joint that ends the stage, m/s or rad/s.
    pub until: f64,
    /// One per control, N or N m.
    pub control: Vec<f64>,
}
