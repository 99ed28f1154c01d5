//! Simulations: settings, controllers, rollouts and their gradients.

mod above_water;
mod allocation;
mod batch;
mod checkpoint;
mod controls;
mod deciding;
mod directions;
mod equations;
mod finite;
mod flow;
mod gains;
mod gap_check;
mod gap_flow;
mod gap_report;
mod gaps;
pub mod gradcheck;
mod gradient;
mod grown;
pub mod growth;
mod jacobians;
mod knots;
mod lines;
mod loads;
mod mesh_files;
pub mod objective;
pub mod observable;
mod part;
mod parts;
mod potential;
mod pressure;
mod record;
mod recording;
mod recording_file;
mod rollout;
mod run;
mod sample;
mod sensor;
mod settings;
mod simulator;
mod stability;
mod start;
mod step_map;
mod summary;
mod surface_flow;
mod tangents;
mod trajectory;
mod which;

pub use allocation::Allocation;
pub use batch::{BatchReport, Begin, Member, Ran};
pub use checkpoint::Checkpoint;
pub use controls::Controls;
pub use directions::{Displacement, Variables};
pub use equations::Equations;
pub use flow::{FLOW_EDGES, FLOW_POINTS};
pub use gap_check::GapCheck;
pub use gap_flow::GapFlow;
pub use gap_report::{Change, GapReport, NearGap};
pub use gradient::{Cotangents, Gradient, Initial};
pub use jacobians::Jacobians;
pub use knots::Knots;
pub use lines::{LineEnd, PathLine, Streamline, StreamlineSettings, Way};
pub use loads::{Imu, Loads};
pub use objective::Objective;
pub use part::{Part, Partwise};
pub use parts::{Checkpoints, InParts, LEAST_STATES};
pub use pressure::SurfacePressure;
pub use record::Record;
pub use recording::{Recorded, Recording};
pub use recording_file::Earlier;
#[cfg(feature = "output")]
pub(crate) use recording_file::replace;
pub use rollout::Rollout;
pub use run::Halted;
pub use sample::Sample;
pub use sensor::Sensor;
pub use settings::Settings;
pub use simulator::{AddedMass, Simulator};
pub use summary::Summary;
pub use tangents::Tangents;

#[cfg(feature = "opt")]
pub(crate) use crate::policy::steps_at;

pub use crate::assembly::Choices;
pub use crate::dynamics::State;
pub use crate::policy::{
    Action, ActionBar, Constant, Observation, OpenLoop, Pd, PdAxis, Playback, Policy, PushThenLock,
    SpeedStage, SpeedStages, Wave, WaveJoint,
};
pub use crate::water::{
    AdapterName, Arithmetic, Backend, BackendReport, Carried, DeviceReport, Discretisation,
    ErrorEstimate, Exchange, Fidelity, GapError, GpuSettings, Knob, Level, Method, Numerics,
    WaterChoices,
};
