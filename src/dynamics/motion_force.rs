//! What of the rate f(q, v, u) of the frame momenta the motion itself makes: quadratic in the velocities through the water and of the bodies, no load. Of momenta about a point that drifts
//! along with the water ([`crate::dynamics::Drift`]), so that no current is in it:
//!
//! ```text
//! c(q, v) = f(q, v, 0) − X⁻ᵀ τ − D X⁻ᵀ M v
//! ```
//!
//! τ being all loads.

use super::force::Loads;
use super::slopes::unit;
use super::{ForceCotangents, Linearisation, Slopes};
use crate::Result;
use nalgebra::DVector;

impl Linearisation<'_> {
    /// Whether c is zero at every velocity: free bodies without water keep their frame momenta.
    pub(super) fn keeps_momenta(&self) -> bool {
        let links = self.system.tree.links();
        self.acting().is_none() && links.iter().all(|link| link.parent.is_none())
    }

    /// c at the velocity `v`.
    ///
    /// # Errors
    /// A coupling that fails.
    pub(super) fn motion_force(&self, v: &DVector<f64>) -> Result<DVector<f64>> {
        let twists = self.system.tree.twists(&self.kinematics, v);
        let none = Loads::zeros(twists.len(), v.len());
        let mut force = self.force_with(v, &twists, none)?;
        let drift = &self.system.drift;
        if drift.turns() {
            force -= drift.turn(&self.frame_dual(&self.mass_times(v)));
        }
        Ok(force)
    }

    /// Transpose of [`Linearisation::motion_force`]: the gradient of its product with ẑ.
    ///
    /// # Errors
    /// A solve of the coupling that misses its tolerance.
    pub(super) fn motion_force_vjp(
        &self,
        v: &DVector<f64>,
        z: &DVector<f64>,
    ) -> Result<ForceCotangents> {
        let control = DVector::zeros(self.system.controls);
        let mut out = self.force_vjp(v, &control, z)?;
        // The loads' part, ẑᵀ X⁻ᵀ τ.
        let tau_bar = self.frame_velocity_inverse(z);
        let loads = self.user_loads_vjp(v, &control, &tau_bar);
        let hat = self.frame_dual(&self.user_loads(v, &control));
        out.q -= loads.q - self.frame_velocity_vjp(&tau_bar, &hat);
        out.v -= loads.v;
        out.control.fill(0.0);
        out.parameters.add_scaled(-1.0, &loads.parameters);
        let drift = &self.system.drift;
        if drift.turns() {
            let w = self.frame_velocity_inverse(&drift.turn_back(z));
            let momentum = self.frame_dual(&self.mass_times(v));
            let own = self.mass_vjp(v, &w)?;
            out.q -= own.q - self.frame_velocity_vjp(&w, &momentum);
            out.v -= own.v;
            out.parameters.add_scaled(-1.0, &own.parameters);
        }
        Ok(out)
    }

    /// Derivatives of [`Linearisation::motion_force`].
    ///
    /// # Errors
    /// As [`Linearisation::motion_force_vjp`].
    pub(super) fn motion_force_slopes(&self, v: &DVector<f64>) -> Result<Slopes> {
        let entries: Vec<usize> = (0..v.len()).collect();
        let rows = (entries.iter()).map(|i| self.motion_force_vjp(v, &unit(v.len(), *i)));
        let rows = rows.collect::<Result<Vec<_>>>()?;
        let zero = ForceCotangents::zeros(self);
        Ok(Slopes::from_rows(v.len(), &entries, &rows, &zero))
    }
}
