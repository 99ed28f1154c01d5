//! Equal scenes whose couplings are computed together.

use super::Coupling;
use crate::Result;
use serde::Serialize;
use std::sync::Arc;

/// Seats for equal scenes that are simulated side by side, each on a stack of its own: what all of them ask for at one time is computed at once.
///
/// A question waits until every seat that is taken has asked one. What is answered doesn't depend on who sits beside, to the last bit.
pub trait Together: Send + Sync {
    /// How many seats there are.
    fn seats(&self) -> usize;

    /// The coupling of all of them: it asks from the seat of the member that runs on its thread, and answers by itself where none does.
    fn coupling(&self) -> Arc<dyn Coupling>;

    /// Calls `member` for each seat, all side by side, and returns when all are done; once. Seats for which there is no thread or memory are left out. A member
    /// may be halted wherever it asks, so that it must hold no lock there that another needs, nor ask from a parallel iterator, nor wait for another member.
    ///
    /// # Errors
    /// Threads or memory that can't be had.
    fn side_by_side(&self, member: &(dyn Fn(usize) + Sync)) -> Result<()>;

    /// What was done so far.
    fn report(&self) -> TogetherReport;
}

/// A scene's numbers, by which what it asks of the device can be counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SceneSize {
    /// Bodies in the water.
    pub bodies: usize,
    /// Images, the bodies themselves among them.
    pub images: usize,
    /// Points of all bodies.
    pub points: usize,
    /// Unknowns.
    pub modes: usize,
    /// Columns of the basis.
    pub columns: usize,
    /// Ordered pairs of points of which one sees the other or its image.
    pub pairs: usize,
    /// Numbers in the maps of all bodies, from unknowns and twists to points.
    pub entries: usize,
}

/// What was computed together, and the time that it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TogetherReport {
    /// Of each scene.
    pub size: SceneSize,
    /// Times that all seats had asked.
    pub meetings: u64,
    /// Questions answered.
    pub questions: u64,
    /// Evaluations that were computed alone on the CPU instead, for films or for a system that the device doesn't solve.
    pub alone: u64,
    /// Seconds in which questions were put together for the device and handed over, summed over groups of seats that meet apart.
    pub packing: f64,
    /// Seconds of waiting for the device: its work and what it sends back.
    pub waiting: f64,
    /// Seconds of these in which the device computed, where it has a clock.
    pub computing: Option<f64>,
    /// Iterations of all evaluations of a basis.
    pub iterations: u64,
    /// Evaluations of a basis.
    pub evaluations: u64,
}
