//! Energies of all bodies and the water.

use super::entry::{Observable, Reading};
use crate::Result;
use crate::dynamics::System;
use crate::scene::Scene;

/// Of bodies and fluid.
pub(super) struct Kinetic;

/// Of the forces that have one.
pub(super) struct Potential;

/// Their sum.
pub(super) struct Total;

macro_rules! energy {
    ($type:ident, $name:literal, $of:expr) => {
        impl Observable for $type {
            fn name(&self) -> &'static str {
                $name
            }

            fn unit(&self) -> &'static str {
                "J"
            }

            fn shape(&self, _: &System) -> Vec<usize> {
                Vec::new()
            }

            fn labels(&self, _: &Scene) -> Vec<String> {
                vec![$name.into()]
            }

            fn value(&self, at: &Reading) -> Result<Vec<f64>> {
                Ok(vec![$of(at.sample)])
            }
        }
    };
}

energy!(Kinetic, "kinetic_energy", |s: &crate::simulate::Sample| s
    .kinetic_energy);
energy!(
    Potential,
    "potential_energy",
    |s: &crate::simulate::Sample| s.potential_energy
);
energy!(Total, "energy", crate::simulate::Sample::energy);
