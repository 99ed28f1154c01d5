//! Momentum of all bodies and the water.

use super::entry::{Observable, Reading};
use crate::Result;
use crate::dynamics::System;
use crate::scene::Scene;

/// Linear, then angular about the world's origin.
pub(super) struct Momentum;

impl Observable for Momentum {
    fn name(&self) -> &'static str {
        "momentum"
    }

    fn unit(&self) -> &'static str {
        "kg m/s, and kg m²/s about the world's origin"
    }

    fn shape(&self, _: &System) -> Vec<usize> {
        vec![6]
    }

    fn labels(&self, _: &Scene) -> Vec<String> {
        let of = |kind: &str| ["x", "y", "z"].map(|axis| format!("{kind}_{axis}"));
        [of("momentum"), of("angular_momentum")].concat()
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        Ok(at.sample.momentum.as_slice().to_vec())
    }
}
