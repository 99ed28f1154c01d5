//! What the thrusters of a body can do to it.

use super::Simulator;
use crate::dynamics::force::Commanded;
use crate::{Error, Result};
use nalgebra::Matrix6xX;

/// The thrusters of a body. With thrusts T (N) their wrench is `matrix · T`.
#[derive(Clone, Debug, PartialEq)]
pub struct Allocation {
    /// 6 × n, a column per thruster: the wrench of a newton of thrust on the body, its frame, about its origin, linear part first (1, m).
    pub matrix: Matrix6xX<f64>,
    /// The control of each.
    pub controls: Vec<usize>,
}

impl Simulator {
    /// The allocation matrix of the thrusters ([`crate::scene::Thruster`]) on body number `body`, in the order of the scene's forces; without columns for a body that
    /// has none.
    ///
    /// # Errors
    /// A number that no body has.
    pub fn allocation(&self, body: usize) -> Result<Allocation> {
        let bodies = self.system().len();
        if body >= bodies {
            return Err(Error::input(
                "allocation: body",
                body,
                format!("must be a number under {bodies}"),
            ));
        }
        let forces = self.system().forces.iter();
        let all = forces.flat_map(|f| f.commanded(self.parameters()));
        let own: Vec<Commanded> = all.filter(|c| c.body == body).collect();
        Ok(Allocation {
            matrix: Matrix6xX::from_fn(own.len(), |i, j| own[j].wrench[i]),
            controls: own.iter().map(|c| c.control).collect(),
        })
    }

    /// Names of the controls, in order ([`crate::Scene::control_labels`]).
    pub fn control_names(&self) -> Vec<String> {
        self.scene.control_labels()
    }

    /// Units of the controls, in order ([`crate::Scene::control_units`]).
    pub fn control_units(&self) -> Vec<&'static str> {
        self.scene.control_units()
    }
}
