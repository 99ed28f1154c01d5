//! Constants of one body.

use crate::adjoint::lie::Pose;

/// A frame fixed to a body.
#[derive(Clone, Debug)]
pub struct SiteData {
    /// Name.
    pub name: String,
    /// The body.
    pub body: usize,
    /// Its pose in the body's frame.
    pub pose: Pose,
}

/// Constants of one body.
#[derive(Clone, Debug)]
pub struct BodyData {
    /// Name, for messages.
    pub name: String,
    /// Volume within its surface, m³; what it is buoyant by is a parameter.
    pub volume: f64,
    /// Index among the bodies that the coupling knows.
    pub submerged: Option<usize>,
    /// First control of the joint's generalised forces.
    pub joint_control: Option<usize>,
    /// First control of the wrench on the body.
    pub thruster: Option<usize>,
}
