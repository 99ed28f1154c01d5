//! What a trajectory's gaps are carried by, and how far off the water across them is estimated to be.

use crate::water::Carried;
use serde::Serialize;

/// Estimates over a trajectory ([`Rollout::gap_report`](crate::simulate::Rollout::gap_report)).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct GapReport {
    /// The smallest gap.
    pub nearest: Option<NearGap>,
    /// Of the smallest gaps of all states, the one with the largest estimated error of the force.
    pub worst: Option<NearGap>,
    /// Number of times that a pair's water was taken over by a film or given back to the sources or panels; films at the start count.
    pub changes: usize,
    /// The first 20 of them.
    pub first_changes: Vec<Change>,
}

/// A gap, and the water across it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NearGap {
    /// When, s.
    pub time: f64,
    /// m.
    pub gap: f64,
    /// Names of the bodies; of the second none for a wall.
    pub bodies: (String, Option<String>),
    /// By what the water is carried.
    pub carried: Carried,
    /// Estimated error of the added mass along the gap, relative.
    pub added_mass_error: f64,
    /// Estimated error of its slope, and so of the force across the gap, relative.
    pub force_error: f64,
}

/// A pair whose water is carried by something else from then on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Of the first state at which it is, s.
    pub time: f64,
    /// Names of the bodies; of the second none for a wall.
    pub bodies: (String, Option<String>),
    /// By what.
    pub carried: Carried,
}
