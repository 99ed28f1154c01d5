//! The system at one configuration with the derivatives of the water's energy there: what forces and transposes need.

use super::evaluation::combined;
use super::{Evaluation, Parameters, System};
use crate::adjoint::lie::Vec6;
use crate::coupling::{Linearise, Linearised};
use crate::multibody::Kinematics;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::ops::Deref;
use std::sync::OnceLock;

/// An [`Evaluation`] with the forces that the water makes, and with all derivatives.
pub struct Linearisation<'a> {
    evaluation: Evaluation<'a>,
    /// At zero density nothing of it acts, and it is made when a derivative with respect to the density first asks for it.
    water: OnceLock<Water<'a>>,
}

/// The water at unit density.
pub(super) struct Water<'a> {
    pub linearised: Box<dyn Linearised + 'a>,
    /// Spatial momentum of each body per basis column (6 × k each).
    columns: Vec<DMatrix<f64>>,
}

impl Water<'_> {
    /// Spatial momenta of the bodies for coefficients on the basis.
    pub fn momenta(&self, direction: &DVector<f64>) -> Vec<Vec6> {
        combined(&self.columns, direction)
    }

    /// Those of column `k` of the basis.
    pub fn column(&self, k: usize) -> Vec<Vec6> {
        let of = |m: &DMatrix<f64>| m.fixed_view::<6, 1>(0, k).into_owned();
        self.columns.iter().map(of).collect()
    }
}

impl<'a> Deref for Linearisation<'a> {
    type Target = Evaluation<'a>;

    fn deref(&self) -> &Evaluation<'a> {
        &self.evaluation
    }
}

impl System {
    /// Evaluates the system at `q` with its derivatives.
    ///
    /// # Errors
    /// As [`System::evaluate`], and a coupling that has values only.
    pub fn linearise<'a>(
        &'a self,
        parameters: &'a Parameters,
        q: &DVector<f64>,
    ) -> Result<Linearisation<'a>> {
        let mut out = self.linearise_apart(parameters, q)?;
        let poses = &out.evaluation.kinematics.poses;
        out.evaluation.contact_points = self.contact_points(parameters, poses)?;
        Ok(out)
    }

    /// The same without looking for places where surfaces are near, for configurations where contact isn't asked for.
    pub(super) fn linearise_apart<'a>(
        &'a self,
        parameters: &'a Parameters,
        q: &DVector<f64>,
    ) -> Result<Linearisation<'a>> {
        let kinematics = self.kinematics(q)?;
        self.differentiable()?;
        let water = match self.in_water(parameters) {
            true => Some(self.water(&kinematics)?),
            false => None,
        };
        let momenta = match &water {
            Some(water) => water.columns.clone(),
            None => self.spatial_momenta(&kinematics, None),
        };
        let report =
            (water.as_ref()).map_or_else(Default::default, |w| w.linearised.report().clone());
        Ok(Linearisation {
            evaluation: Evaluation::new(self, parameters, q, kinematics, momenta, report),
            water: water.map_or_else(OnceLock::new, OnceLock::from),
        })
    }

    fn water(&self, kinematics: &Kinematics) -> Result<Water<'_>> {
        let basis = self.basis(kinematics);
        let linearised = (self.differentiable()?).linearise(&basis.poses, &basis.twists)?;
        Ok(Water {
            columns: self.spatial_momenta(kinematics, Some(linearised.momenta())),
            linearised,
        })
    }

    /// The coupling with its derivatives.
    pub(crate) fn differentiable(&self) -> Result<&dyn Linearise> {
        self.coupling
            .differentiable()
            .ok_or_else(|| Error::Unsupported {
                what: format!("a step with {}", self.coupling.name()),
                why: "forces need derivatives of the water's energy, and it has values only, as a reference"
                    .into(),
                instead: "use the fidelity full, reduced or isolated, which have all derivatives".into(),
            })
    }
}

impl<'a> Linearisation<'a> {
    /// The water at unit density, where any acts.
    pub fn fluid(&self) -> Option<&dyn Linearised> {
        self.acting().map(|water| water.linearised.as_ref())
    }

    /// The water that acts; none at zero density, and where no body is in it.
    pub(super) fn acting(&self) -> Option<&Water<'a>> {
        self.water
            .get()
            .filter(|_| self.system.in_water(self.parameters))
    }

    /// The water whose density is a parameter, whether it acts or not; none where no body is in it.
    pub(super) fn water(&self) -> Result<Option<&Water<'a>>> {
        let system = self.system;
        if self.water.get().is_none() && system.coupling.bodies() > 0 {
            // Another thread's is the same.
            let _ = self.water.set(system.water(&self.kinematics)?);
        }
        Ok(self.water.get())
    }
}
