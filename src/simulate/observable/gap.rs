//! The smallest gap, and the estimated error of the water across it.

use super::entry::{Observable, Reading};
use crate::Result;
use crate::dynamics::System;
use crate::scene::Scene;

/// Between bodies or to a wall; NaN where there is nothing to meet.
pub(super) struct SmallestGap;

impl Observable for SmallestGap {
    fn name(&self) -> &'static str {
        "min_gap"
    }

    fn unit(&self) -> &'static str {
        "m"
    }

    fn shape(&self, _: &System) -> Vec<usize> {
        Vec::new()
    }

    fn labels(&self, _: &Scene) -> Vec<String> {
        vec!["min_gap".into()]
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        Ok(vec![(at.gap)().map_or(f64::NAN, |g| g.distance)])
    }
}

/// Of the added mass along the smallest gap and of its slope, and so of the force, relative; NaN where none is known.
pub(super) struct Error;

impl Observable for Error {
    fn name(&self) -> &'static str {
        "gap_error"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn shape(&self, _: &System) -> Vec<usize> {
        vec![2]
    }

    fn labels(&self, _: &Scene) -> Vec<String> {
        ["added_mass", "force"]
            .map(|of| format!("gap_error.{of}"))
            .into()
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        let error = (at.gap_error)();
        Ok(error.map_or(vec![f64::NAN; 2], |e| vec![e.added_mass, e.force]))
    }
}
