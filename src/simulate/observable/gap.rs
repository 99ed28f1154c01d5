//! The smallest gap.

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
