//! Robots in URDF and MJCF files as bodies: links at fixed joints fold into what carries them, geometry becomes closed surfaces, and what was chosen, replaced or not used is
//! reported.
//!
//! What a scene makes of it is in `scene::robot`.

mod bodies;
mod chosen;
mod even;
mod file;
mod followers;
mod hull;
mod inertia;
mod joints;
mod kept;
mod known;
mod massless;
mod mjcf;
mod options;
mod overlap;
mod paths;
mod pieces;
mod points;
mod read;
mod report;
mod surface;
mod tree;

pub(crate) use bodies::{Imported, RobotBody, import};
pub(crate) use joints::{Dynamics, Led};
pub use options::{BadMeshes, Base, Followers, Wet};
pub(crate) use options::{JointChoice, LinkChoice, Options};
pub use report::{BodyReport, FoldedReport, MeshUse, Report, Unused};
