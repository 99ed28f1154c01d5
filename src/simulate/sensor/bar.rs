//! Cotangents of one body.

use crate::adjoint::lie::{Vec3, Vec6};

/// Cotangents of what is observed of one body, world axes.
#[derive(Clone, Copy)]
pub(super) struct BodyBar {
    /// Of its origin.
    pub position: Vec3,
    /// Of its rotation, δR = δθ × R.
    pub rotation: Vec3,
    /// Of the velocity of its origin and its angular velocity.
    pub velocity: Vec6,
    /// Of the rates of these.
    pub gain: Vec6,
}

impl BodyBar {
    /// All zero.
    pub fn zero() -> Self {
        Self {
            position: Vec3::zeros(),
            rotation: Vec3::zeros(),
            velocity: Vec6::zeros(),
            gain: Vec6::zeros(),
        }
    }
}
