//! Equations of motion: forces, the coupled mass matrix, integrators, and their adjoints.

mod acceleration;
mod answers;
mod armature;
mod balance;
mod balance_recoil;
mod balance_water;
mod body;
mod body_loads;
mod body_parameters;
mod contact;
mod contact_curvature;
mod contact_force;
mod contact_law;
mod contact_shape;
mod cotangents;
mod damping;
mod declared;
mod drift;
mod evaluation;
mod fluid;
pub mod force;
mod inertia;
mod integrator;
mod island_matrix;
mod islands;
mod late;
mod limit;
mod linearisation;
mod momentum;
mod motion_force;
mod motions;
mod parameters;
mod recoil;
mod resistance;
mod shape;
mod shapes;
mod slopes;
mod stiffness;
mod symmetry;
mod system;
mod tied;
mod ties;
mod tree_motions;

pub use armature::Armature;
pub use body::{BodyData, SiteData};
pub(crate) use body_parameters::body_places;
pub use contact::{ChangedShape, ContactForce, ContactGap, ContactModel, Dual, PairContact};
pub use contact_law::ContactLaws;
pub use cotangents::ForceCotangents;
pub use drift::Drift;
pub use evaluation::Evaluation;
pub(crate) use evaluation::WITHIN;
pub use inertia::Inertia;
pub use integrator::{
    ContactVelocities, Input, Integrator, LinearisedStep, Solved, State, StateBar, StateTangents,
    StepBar, StepRecord, Stepper, Stops,
};
pub use limit::JointLimit;
pub use linearisation::Linearisation;
pub use motions::Motions;
pub use parameters::{
    BodyValues, Declarations, Declared, Entry, Owner, Parameter, Parameters, Range, Typical,
};
pub use shapes::{Follows, Shapes};
pub use slopes::{InputTangents, Slopes};
pub use stiffness::Fastest;
pub use symmetry::FreeMotions;
pub(crate) use symmetry::{Group, free_motions, refuse, refuse_tilt};
pub use system::{Drive, System};
