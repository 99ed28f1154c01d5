//! The system at one configuration with the derivatives of the water's energy there: what forces and transposes need.

use super::fluid::FluidMomenta;
use super::{Evaluation, Parameters, System};
use crate::adjoint::lie::{Mat6, Pose, Vec6};
use crate::coupling::scattering::ScatteredLinearised;
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
    /// The bodies' momenta.
    pub fluid: FluidMomenta<'a>,
}

impl<'a> Deref for Linearisation<'a> {
    type Target = Evaluation<'a>;

    fn deref(&self) -> &Evaluation<'a> {
        &self.evaluation
    }
}

impl System {
    /// Evaluates the system at `q` and the time `time` (s) with its derivatives.
    ///
    /// # Errors
    /// As [`System::evaluate`], and a coupling that has values only.
    pub fn linearise<'a>(
        &'a self,
        parameters: &'a Parameters,
        q: &DVector<f64>,
        time: f64,
    ) -> Result<Linearisation<'a>> {
        let mut out = self.linearise_apart(parameters, q, time)?;
        let poses = &out.evaluation.kinematics.poses;
        out.evaluation.contact_points = self.contact_points(parameters, poses)?;
        Ok(out)
    }

    /// The same without looking for places where surfaces are near, for configurations where contact isn't asked for.
    pub(super) fn linearise_apart<'a>(
        &'a self,
        parameters: &'a Parameters,
        q: &DVector<f64>,
        time: f64,
    ) -> Result<Linearisation<'a>> {
        let kinematics = self.kinematics(q)?;
        self.differentiable()?;
        let water = match self.in_water(parameters) {
            true => Some(self.water(&kinematics)?),
            false => None,
        };
        let fluid = (water.as_ref()).map_or(FluidMomenta::Still, |w| w.fluid.clone());
        let report =
            (water.as_ref()).map_or_else(Default::default, |w| w.linearised.report().clone());
        Ok(Linearisation {
            evaluation: Evaluation::new(self, parameters, q, time, kinematics, fluid, report),
            water: water.map_or_else(OnceLock::new, OnceLock::from),
        })
    }

    /// The water of bodies that don't feel each other.
    fn water_apart<'c>(
        coupling: &'c dyn Linearise,
        poses: &[Pose],
        added: &'c [Mat6],
    ) -> Result<Water<'c>> {
        // No pose changes it: nobody asks for its derivatives on a basis.
        let none = DMatrix::zeros(6 * poses.len(), 0);
        Ok(Water {
            linearised: coupling.linearise(poses, &none)?,
            fluid: FluidMomenta::Apart(added),
        })
    }

    fn water(&self, kinematics: &Kinematics) -> Result<Water<'_>> {
        let coupling = self.differentiable()?;
        if let Some(added) = self.coupling.apart() {
            let poses: Vec<_> = self.submerged().map(|(b, _)| kinematics.poses[b]).collect();
            return Self::water_apart(coupling, &poses, added);
        }
        if let Some(placed) = self.fluid_scattered(kinematics)? {
            return Ok(Water {
                linearised: Box::new(ScatteredLinearised::of(placed.clone())),
                fluid: FluidMomenta::Scattered(placed),
            });
        }
        let basis = self.basis(kinematics);
        let linearised = coupling.linearise(&basis.poses, &basis.twists)?;
        Ok(Water {
            fluid: self.fluid_coupled(kinematics, linearised.momenta()),
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
    /// Spatial momenta of the bodies at unit density, of water that acts or not, for coefficients on the basis.
    pub(super) fn momenta_in(&self, water: &Water, direction: &DVector<f64>) -> Vec<Vec6> {
        (water.fluid).along(self.system, &self.kinematics, direction)
    }

    /// The same where many bodies that are coupled by products don't feel each other, without places of contact; none of others.
    ///
    /// # Errors
    /// None of them.
    pub(super) fn alone(&self) -> Result<Option<Linearisation<'a>>> {
        let Some(at) = self.scattered() else {
            return Ok(None);
        };
        let (alone, system) = (at.alone(), self.system);
        let poses: Vec<_> = (system.submerged())
            .map(|(b, _)| self.kinematics.poses[b])
            .collect();
        let water = System::water_apart(alone, &poses, alone.added_masses())?;
        let evaluation = Evaluation::new(
            system,
            self.parameters,
            &self.q,
            self.time,
            self.kinematics.clone(),
            water.fluid.clone(),
            Default::default(),
        );
        Ok(Some(Linearisation {
            evaluation,
            water: OnceLock::from(water),
        }))
    }

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
