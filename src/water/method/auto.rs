//! The most accurate method that costs nothing at run time.

use super::exact::Exact;
use super::kind::{BodyMethod, Problem, Solved};
use super::panel::Panel;
use crate::Result;
use crate::water::device::Device;
use crate::water::numerics::Numerics;
use crate::water::submerged::{Made, SubmergedBody};

/// Closed forms where there is one, else panels. Bodies solved together have a method of their own (`Method::together`).
pub(super) struct Auto;

impl Auto {
    fn of(&self, body: &SubmergedBody) -> &'static dyn BodyMethod {
        match body.ellipsoid {
            Some(_) => &Exact,
            None => &Panel,
        }
    }
}

impl BodyMethod for Auto {
    fn label(&self) -> &'static str {
        "auto"
    }

    fn leaves_to(&self, body: &SubmergedBody) -> Result<Option<&'static dyn BodyMethod>> {
        Ok(Some(self.of(body)))
    }

    fn by_formula(&self) -> bool {
        true
    }

    fn extrapolates(&self) -> bool {
        true
    }

    fn steps_together(&self) -> bool {
        true
    }

    fn made_from(&self, body: &SubmergedBody, numerics: &Numerics) -> serde_json::Value {
        self.of(body).made_from(body, numerics)
    }

    fn response(&self, body: &SubmergedBody, numerics: &Numerics, gap: f64) -> Solved {
        self.of(body).response(body, numerics, gap)
    }

    fn couple(&self, problem: &Problem, device: &mut Device) -> Result<Made> {
        Panel.couple(problem, device)
    }
}
