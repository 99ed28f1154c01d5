//! The velocity form of the equations of motion (Eq. 2–3) and its transpose.
//!
//! With v̇ = 0 the momentum of body b would change at the rate
//! `V ×* h_r + M_r C` (rigid) and `V ×* h_f + D_g M_f[V] V' + M_f (C − U × V)` (fluid), where
//! V' = V − U is the velocity through the water and C the bias of [`crate::multibody`]. What the
//! balance ḣ = ½∂E/∂g + U ×* h_f + external leaves over accelerates:
//!
//! ```text
//! M v̇ = Sᵀ { external + ρ(F + U ×* h_f) − V ×* h − ρ D_gM_f[V] V' − M_r C − ρ M_f (C − U×V) } + τ
//! ```

use super::balance::rigid_parameters_vjp;
use super::force::{Loads, Velocity};
use super::shape::Bilinear;
use super::slopes::unit;
use super::{Evaluation, ForceCotangents, Linearisation, Slopes};
use crate::Result;
use crate::adjoint::lie::{Vec6, cross_force, cross_motion};
use crate::coupling::Direction;
use crate::error::in_order;
use crate::multibody::{Cotangents, Fields, Virtual};
use nalgebra::DVector;
use rayon::prelude::*;

impl Evaluation<'_> {
    /// C − U × V of every submerged body, zero for dry ones.
    fn fluid_bias(&self, fields: &Fields) -> Vec<Vec6> {
        let current = self.current_twist();
        let mut out = vec![Vec6::zeros(); self.system.len()];
        for (b, _) in self.system.submerged() {
            out[b] = fields.bias[b] - cross_motion(&current, &fields.twist[b]);
        }
        out
    }
}

impl Linearisation<'_> {
    /// M(q) v̇: the right-hand side of Eq. 3 with all forces, user coordinates.
    ///
    /// # Errors
    /// A coupling that fails.
    pub fn inertial_force(&self, v: &DVector<f64>, control: &DVector<f64>) -> Result<DVector<f64>> {
        let tree = &self.system.tree;
        let rho = self.parameters.density();
        let zero = DVector::zeros(v.len());
        let fields = tree.fields(&self.kinematics, &self.q, v, Virtual::User(&zero));
        let direction = self.through_water(v);
        let fluid = self.fluid_momenta(&direction);
        let pose_force = self.pose_force(&direction)?;
        let fluid_bias = self.fluid_bias(&fields);
        let carried = self
            .fluid
            .transposed(self.system, &self.kinematics, &fluid_bias);
        let mut out = -rho * carried;
        let Loads {
            mut wrenches,
            joints,
        } = self.loads(&fields.twist, v, control);
        for (b, twist) in fields.twist.iter().enumerate() {
            let rigid = cross_force(twist, &self.rigid_momentum(b, twist))
                + self.rigid_momentum(b, &fields.bias[b]);
            let relative = self.relative(twist);
            let water = pose_force[b] - cross_force(&relative, &fluid[b]);
            wrenches[b] += rho * water - rigid;
        }
        if let Some(water) = self.acting() {
            let twist = self.submerged_field(&fields.twist);
            let along = water.linearised.gradient_along(&direction, &twist)?;
            out -= rho * along.rows(0, v.len());
        }
        Ok(out + tree.project(&self.kinematics.columns, wrenches) + joints)
    }

    /// Transpose of [`Linearisation::inertial_force`]: the gradient of its product with `w`.
    ///
    /// # Errors
    /// A solve of the coupling that misses its tolerance.
    pub fn inertial_force_vjp(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        w: &DVector<f64>,
    ) -> Result<ForceCotangents> {
        let tree = &self.system.tree;
        let mut out = ForceCotangents::zeros(self);
        let fields = tree.fields(&self.kinematics, &self.q, v, Virtual::User(w));
        let mut bar = Cotangents::zeros(self.system.len());
        for b in 0..self.system.len() {
            let (twist, virt, bias) = (&fields.twist[b], &fields.virtual_twist[b], &fields.bias[b]);
            // (V × W) · h_r − W · M_r C.
            let carried = cross_motion(twist, virt);
            let (h, h_carried) = (
                self.rigid_momentum(b, twist),
                self.rigid_momentum(b, &carried),
            );
            let (h_virt, h_bias) = (self.rigid_momentum(b, virt), self.rigid_momentum(b, bias));
            bar.twist[b] += h_carried + cross_force(virt, &h);
            bar.virtual_twist[b] -= cross_force(twist, &h) + h_bias;
            bar.bias[b] -= h_virt;
            bar.pose[b] -= cross_force(twist, &h_carried) + cross_force(&carried, &h);
            bar.pose[b] += cross_force(bias, &h_virt) + cross_force(virt, &h_bias);
            rigid_parameters_vjp(self, b, &carried, twist, &mut out.parameters);
            rigid_parameters_vjp(self, b, &-virt, bias, &mut out.parameters);
        }
        // W · wrenches + wᵀ τ.
        let loads = self.loads(&fields.twist, v, control);
        for (bar, wrench) in bar.virtual_twist.iter_mut().zip(&loads.wrenches) {
            *bar += wrench;
        }
        let power = Velocity {
            twists: &fields.virtual_twist,
            v: w,
        };
        self.loads_vjp(&fields.twist, v, control, &power, &mut bar, &mut out);
        self.fluid_inertial_vjp(v, w, &fields, &mut bar, &mut out)?;
        let (q_bar, v_bar) = tree.reverse(&self.kinematics, v, Virtual::User(w), &fields, bar);
        out.q += q_bar;
        out.v += v_bar;
        Ok(out)
    }

    /// Derivatives of the entries `entries` of [`Linearisation::inertial_force`]; the others have none.
    ///
    /// # Errors
    /// As [`Linearisation::inertial_force_vjp`].
    pub fn inertial_force_slopes(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        entries: &[usize],
    ) -> Result<Slopes> {
        let row = |i: &usize| self.inertial_force_vjp(v, control, &unit(v.len(), *i));
        // What answers are known when another is asked for is the same for any number of threads.
        let rows = match self.system.coupling.scattering() {
            Some(_) => entries.iter().map(row).collect::<Result<_>>()?,
            None => in_order(entries.par_iter().map(row))?,
        };
        let zero = ForceCotangents::zeros(self);
        Ok(Slopes::from_rows(v.len(), entries, &rows, &zero))
    }

    /// The fluid's part: gradient of
    /// `ρ { E(V'×W, V') − E(W, C') + ½ D E(v,v)[W] − D E(w,v)[V] }`, C' = C − U × V.
    pub(super) fn fluid_inertial_vjp(
        &self,
        v: &DVector<f64>,
        w: &DVector<f64>,
        fields: &Fields,
        bar: &mut Cotangents,
        out: &mut ForceCotangents,
    ) -> Result<()> {
        let Some(water) = self.water()? else {
            return Ok(());
        };
        let fluid = &water.linearised;
        let rho = self.parameters.density();
        let n = self.system.len();
        let (direction, virtual_direction) = (self.through_water(v), self.virtual_direction(w));
        let (through, virt) = (
            Direction::Basis(&direction),
            Direction::Basis(&virtual_direction),
        );
        let momenta = self.momenta_in(water, &direction);
        let momenta_virtual = self.momenta_in(water, &virtual_direction);
        let current = self.current_twist();
        let relative: Vec<Vec6> = fields.twist.iter().map(|t| self.relative(t)).collect();
        let carried: Vec<Vec6> = (0..n)
            .map(|b| cross_motion(&relative[b], &fields.virtual_twist[b]))
            .collect();
        let bias = self.fluid_bias(fields);
        let (momenta_carried, pair_carried) = self.respond(water, &carried, through)?;
        let (momenta_bias, pair_bias) = self.respond(water, &bias, virt)?;
        let along_virtual = fluid.hvp(
            through,
            through,
            &self.submerged_field(&fields.virtual_twist),
        )?;
        let along_twist = fluid.hvp(virt, through, &self.submerged_field(&fields.twist))?;
        let by_v = (Some(&direction), relative.as_slice());
        let by_w = (Some(&virtual_direction), fields.virtual_twist.as_slice());
        let term = |weight, x, y, along| Bilinear {
            weight,
            x,
            y,
            along,
        };
        let terms = [
            term(1.0, (None, carried.as_slice()), by_v, None),
            term(-1.0, by_w, (None, bias.as_slice()), None),
            term(0.5, by_v, by_v, Some(fields.virtual_twist.as_slice())),
            term(-1.0, by_w, by_v, Some(fields.twist.as_slice())),
        ];
        self.add_shape_vjp(water, &terms, &mut out.parameters)?;
        let impulse_virtual = self.submerged_impulses(&along_virtual.momentum_x);
        let wrench_virtual = self.from_submerged(&along_virtual.wrench);
        let impulse_w = self.submerged_impulses(&along_twist.momentum_x);
        let impulse_v = self.submerged_impulses(&along_twist.momentum_y);
        let wrench_twist = self.from_submerged(&along_twist.wrench);
        let pose_force = self.half_from_submerged(&along_virtual.gradient);
        let pair = self.from_submerged(&along_twist.gradient);
        for (b, _) in self.system.submerged() {
            let (v_rel, w_b, twist) = (&relative[b], &fields.virtual_twist[b], &fields.twist[b]);
            let h = &momenta[b];
            *out.parameters.density_mut() += carried[b].dot(h) - w_b.dot(&momenta_bias[b])
                + w_b.dot(&pose_force[b])
                - twist.dot(&pair[b]);
            bar.twist[b] += rho
                * (momenta_carried[b] + cross_force(w_b, h)
                    - cross_force(&current, &momenta_virtual[b])
                    + impulse_virtual[b]
                    - impulse_w[b]
                    - pair[b]);
            bar.virtual_twist[b] +=
                rho * (pose_force[b] - cross_force(v_rel, h) - momenta_bias[b] - impulse_v[b]);
            bar.bias[b] -= rho * momenta_virtual[b];
            bar.pose[b] += rho
                * (pair_carried[b]
                    - cross_force(v_rel, &momenta_carried[b])
                    - cross_force(&carried[b], h)
                    - pair_bias[b]
                    + cross_force(&bias[b], &momenta_virtual[b])
                    + cross_force(w_b, &momenta_bias[b])
                    + 0.5 * wrench_virtual[b]
                    - cross_force(w_b, &pose_force[b])
                    - cross_force(v_rel, &impulse_virtual[b])
                    - wrench_twist[b]
                    + cross_force(twist, &pair[b])
                    + cross_force(v_rel, &impulse_w[b])
                    + cross_force(w_b, &impulse_v[b]));
        }
        Ok(())
    }
}
