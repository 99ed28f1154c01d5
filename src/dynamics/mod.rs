//! Equations of motion: forces, the coupled mass matrix, integrators, and their adjoints.

mod acceleration;
mod evaluation;
mod external;
mod force;
mod integrator;
mod momentum;
mod parameters;
mod system;

pub use evaluation::Evaluation;
pub use force::ForceCotangents;
pub use integrator::{Input, Integrator, Memo, State, StateBar, StepBar, Stepped, Stepper};
pub use parameters::Parameters;
pub use system::{BodyData, Drive, System};
