//! The rate of the frame momenta and the velocity that is read out from them, transposed together.
//!
//! With E the water's energy the sweep through both asks for `D²E(v, v)[Z]/2 − D E(w, v)`, w being what the momenta's cotangent makes of Z: the derivative of `D E(v, v)/2` as bodies are displaced
//! along Z and v changes at the rate −w. Where products couple many bodies, w and the charges' answer to the displacement are one system ([`Recoiling::carried`]).
//!
//! [`Recoiling::carried`]: super::recoil::Recoiling

use super::balance::Rows;
use super::balance_water::Told;
use super::inertia::Inertia;
use super::momentum::Pair;
use super::{ForceCotangents, Linearisation};
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::multibody::Virtual;
use nalgebra::DVector;

impl Linearisation<'_> {
    /// Of a velocity v that is read out from momenta, and has the cotangent `v_bar` beside what `ẑᵀ f(q, v, u)` makes of it: w with M w = v̄ + (∂f/∂v)ᵀ ẑ on the rows
    /// `free`, and the gradient of `ẑᵀ f − wᵀ (M v + p_rest)` over q, u and the parameters, v held. None where the mass matrix is formed, or bodies don't feel each other: then it is
    /// [`Linearisation::force_vjp`], a solve and [`Linearisation::momentum_vjp`].
    ///
    /// # Errors
    /// A solve of the coupling that misses its tolerance.
    pub(super) fn force_readout_vjp(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        z: &DVector<f64>,
        free: &[usize],
        v_bar: &DVector<f64>,
    ) -> Result<Option<(DVector<f64>, ForceCotangents)>> {
        let (Some(water), Some(_)) = (self.acting(), self.scattered()) else {
            return Ok(None);
        };
        let Inertia::Recoiling(many) = self.factored(free)? else {
            return Ok(None);
        };
        let dry = self.dry_vjps(v, control, std::slice::from_ref(z), Rows::Whole);
        let Some((fields, mut bars, mut out)) = dry else {
            return Ok(None);
        };
        let (Some(fields), Some(mut bar), Some(mut out)) = (fields.first(), bars.pop(), out.pop())
        else {
            return Ok(None);
        };
        let (tree, rho) = (&self.system.tree, self.parameters.density());
        let direction = self.through_water(v);
        let momenta = self.momenta_in(water, &direction);
        let carried = self.carried_on(fields);
        // What reaches the velocity without the water's answer.
        let mut before = bar.clone();
        for (turning, momentum) in before.turning.iter_mut().zip(&momenta) {
            *turning += rho * momentum;
        }
        let reverse = |bar| tree.reverse(&self.kinematics, v, Virtual::Frame(z), fields, bar);
        let right = v_bar + &out.v + reverse(before).1;
        let (w, found) = many.carried(
            &right,
            &direction,
            &self.submerged_twists(&carried),
            &self.submerged_field(&fields.virtual_twist),
        );
        for (b, k) in self.system.submerged() {
            let told = Told {
                momentum: momenta[b],
                carried: carried[b],
                impulse: found.momentum.fixed_rows::<6>(6 * k).into_owned(),
                wrench: found.wrench[k],
                pose_force: 0.5 * found.gradient[k],
            };
            self.add_told(b, &told, fields, &mut bar, &mut out);
        }
        out.q += reverse(bar).0;
        // What w has in it itself; the water has told of what it moves.
        let at = Pair {
            fields: &self.still_fields(v),
            v,
            w,
            is_unit: false,
            by_parameters: true,
        };
        let still = vec![Vec6::zeros(); self.system.len()];
        let told = [&momenta[..], &still, &still];
        let own = self.bilinear_row(&at, Some(self.current_twist()), Some(told));
        out.q -= own.q;
        out.parameters.add_scaled(-1.0, &own.parameters);
        self.check()?;
        out.v.fill(0.0);
        Ok(Some((at.w, out)))
    }
}
