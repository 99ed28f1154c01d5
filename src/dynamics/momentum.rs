//! Generalised momentum p = M(q) v + p_rest(q) and its transpose.

use super::balance::rigid_parameters_vjp;
use super::{Evaluation, ForceCotangents, Linearisation};
use crate::Result;
use crate::adjoint::lie::{Vec6, cross_force};
use crate::multibody::{Cotangents, Virtual};
use nalgebra::DVector;

impl Evaluation<'_> {
    /// Generalised momentum at velocity `v`, user coordinates (kg m/s, kg m²/s); of what may drift with the water that relative to its drift
    /// ([`Drift`](super::Drift)).
    pub fn momentum(&self, v: &DVector<f64>) -> DVector<f64> {
        &self.mass_matrix * v + &self.rest_momentum
    }

    /// What it lacks where bodies may drift: Σ Jᵀ I W, the momentum of the bodies' own masses that drift.
    pub(super) fn drift_momentum(&self) -> DVector<f64> {
        let drift = &self.system.drift;
        let wrenches = (0..self.system.len())
            .map(|b| self.rigid_momentum(b, drift.of(b)))
            .collect();
        self.system.tree.project(&self.kinematics.columns, wrenches)
    }

    /// The same in frame coordinates, X⁻ᵀ p.
    pub fn frame_momentum(&self, v: &DVector<f64>) -> DVector<f64> {
        self.frame_dual(&self.momentum(v))
    }

    /// X⁻ᵀ p: momenta or forces of joints in frame coordinates.
    pub(super) fn frame_dual(&self, p: &DVector<f64>) -> DVector<f64> {
        (self.system.tree).per_joint(&self.q, p, |j, q, p| j.frame_momentum(q, p))
    }

    /// p = Xᵀ p̂.
    pub fn user_momentum(&self, hat: &DVector<f64>) -> DVector<f64> {
        (self.system.tree).per_joint(&self.q, hat, |j, q, p| j.frame_momentum_transpose(q, p))
    }

    /// X w.
    pub fn frame_velocity(&self, w: &DVector<f64>) -> DVector<f64> {
        (self.system.tree).per_joint(&self.q, w, |j, q, w| j.frame_velocity(q, w))
    }

    /// X⁻¹ w.
    pub(super) fn frame_velocity_inverse(&self, w: &DVector<f64>) -> DVector<f64> {
        (self.system.tree).per_joint(&self.q, w, |j, q, w| j.frame_velocity_inverse(q, w))
    }
}

impl Linearisation<'_> {
    /// Gradient of `wᵀ (M(q) v + p_rest(q))` over q, v and the parameters.
    ///
    /// # Errors
    /// A solve of the coupling that misses its tolerance.
    pub fn momentum_vjp(&self, v: &DVector<f64>, w: &DVector<f64>) -> Result<ForceCotangents> {
        self.bilinear_vjp(v, w, Some(self.current_twist()))
    }

    /// Gradient of `wᵀ M(q) v`, without the current.
    ///
    /// # Errors
    /// A solve of the coupling that misses its tolerance.
    pub fn mass_vjp(&self, v: &DVector<f64>, w: &DVector<f64>) -> Result<ForceCotangents> {
        self.bilinear_vjp(v, w, None)
    }

    fn bilinear_vjp(
        &self,
        v: &DVector<f64>,
        w: &DVector<f64>,
        current: Option<Vec6>,
    ) -> Result<ForceCotangents> {
        let tree = &self.system.tree;
        let rho = self.parameters.density();
        let mut out = ForceCotangents::zeros(self);
        let fields = tree.fields(&self.kinematics, &self.q, v, Virtual::User(w));
        let mut bar = Cotangents::zeros(self.system.len());
        for b in 0..self.system.len() {
            let drift = current.map_or(Vec6::zeros(), |_| *self.system.drift.of(b));
            let (twist, virt) = (&(fields.twist[b] - drift), &fields.virtual_twist[b]);
            let (h, h_virtual) = (self.rigid_momentum(b, twist), self.rigid_momentum(b, virt));
            bar.virtual_twist[b] += h;
            bar.twist[b] += h_virtual;
            bar.pose[b] -= cross_force(twist, &h_virtual) + cross_force(virt, &h);
            rigid_parameters_vjp(self, b, virt, twist, &mut out.parameters);
        }
        if let Some(water) = self.water()? {
            let direction = match current {
                Some(_) => self.through_water(v),
                None => self.virtual_direction(v),
            };
            let current = current.unwrap_or_else(Vec6::zeros);
            let virtual_direction = self.virtual_direction(w);
            let (momenta, momenta_virtual) =
                (water.momenta(&direction), water.momenta(&virtual_direction));
            let pair = water.linearised.gradient(&virtual_direction, &direction)?;
            let pair = self.from_submerged(&pair);
            for (b, _) in self.system.submerged() {
                let relative = fields.twist[b] - current;
                let virt = &fields.virtual_twist[b];
                *out.parameters.density_mut() += virt.dot(&momenta[b]);
                bar.virtual_twist[b] += rho * momenta[b];
                bar.twist[b] += rho * momenta_virtual[b];
                bar.pose[b] += rho
                    * (pair[b]
                        - cross_force(&relative, &momenta_virtual[b])
                        - cross_force(virt, &momenta[b]));
            }
        }
        let (q_bar, v_bar) = tree.reverse(&self.kinematics, v, Virtual::User(w), &fields, bar);
        out.q += q_bar;
        out.v += v_bar;
        Ok(out)
    }
}
