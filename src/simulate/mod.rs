//! Simulations: settings, controllers, rollouts and their gradients.

mod assemble;
pub(crate) mod backend;
mod clearance;
mod contact;
mod controller;
mod controls;
mod device;
mod estimate;
mod flow;
pub mod gradcheck;
mod gradient;
pub mod growth;
mod jacobians;
mod knots;
mod limits;
pub mod objective;
mod plan;
mod policy;
mod recording;
mod rollout;
mod settings;
mod simulator;
mod submerged;
mod surface;
mod trajectory;

pub use backend::{AdapterName, Arithmetic, Backend, BackendReport, DeviceReport, GpuSettings};
pub use controls::Controls;
pub use estimate::{ErrorEstimate, Level};
pub use flow::FLOW_EDGES;
pub use gradient::{Cotangents, Gradient, Initial};
pub use jacobians::Jacobians;
pub use knots::Knots;
pub use objective::Objective;
pub use policy::{
    Action, ActionBar, Constant, Observation, OpenLoop, Pd, PdAxis, Playback, Policy, PushThenLock,
    SpeedStages, Stage,
};
pub use recording::Recording;
pub use rollout::{Rollout, Sample, Summary};
pub use settings::{Accuracy, Fidelity, Settings};
pub use simulator::{AddedMass, Simulator};
pub use submerged::Discretisation;
