//! Points that were tried.

use serde::Serialize;

/// What found a grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum GraspStage {
    /// A push that was tried.
    Push,
    /// A descent along gradients.
    Descent,
    /// The evolution strategy.
    Search,
}

/// A point that was tried.
#[derive(Clone, Debug)]
pub(super) struct Tried {
    pub x: Vec<f64>,
    pub cost: f64,
    pub held_since: Option<f64>,
    pub caught: bool,
    pub stage: GraspStage,
}

impl Tried {
    /// Whether it is to be kept rather than the other: first what is caught, then what costs less.
    pub fn better(&self, other: &Self) -> bool {
        match (self.caught, other.caught) {
            (true, false) => true,
            (false, true) => false,
            _ => self.cost < other.cost,
        }
    }
}
