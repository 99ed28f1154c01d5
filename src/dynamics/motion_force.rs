//! What of the rate f(q, v, u) of the frame momenta the motion itself makes: quadratic in the velocities through the water and of the bodies, no load.

use super::fluid::FluidMomenta;
use super::force::Loads;
use super::slopes::unit;
use super::{ForceCotangents, Linearisation, Slopes};
use crate::Result;
use nalgebra::DVector;

impl Linearisation<'_> {
    /// Whether bodies feel each other, or walls, through water that acts.
    pub(super) fn is_coupled(&self) -> bool {
        let coupled = matches!(
            self.fluid,
            FluidMomenta::Coupled(_) | FluidMomenta::Scattered(_)
        );
        coupled && self.acting().is_some()
    }

    /// That part at the velocity `v`.
    ///
    /// # Errors
    /// A coupling that fails.
    pub(super) fn motion_force(&self, v: &DVector<f64>) -> Result<DVector<f64>> {
        let twists = self.system.tree.twists(&self.kinematics, v);
        let none = Loads::zeros(twists.len(), v.len());
        self.force_with(v, &twists, none)
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
        Ok(out)
    }

    /// Derivatives of its entries `entries`; the others have none.
    ///
    /// # Errors
    /// As [`Linearisation::motion_force_vjp`].
    pub(super) fn motion_force_slopes(
        &self,
        v: &DVector<f64>,
        entries: &[usize],
    ) -> Result<Slopes> {
        let rows = entries
            .iter()
            .map(|i| self.motion_force_vjp(v, &unit(v.len(), *i)));
        let rows = rows.collect::<Result<Vec<_>>>()?;
        let zero = ForceCotangents::zeros(self);
        Ok(Slopes::from_rows(v.len(), entries, &rows, &zero))
    }
}
