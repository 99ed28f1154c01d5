//! The water's part of the rate of the frame momenta, transposed.

use super::balance::Rows;
use super::shape::Bilinear;
use super::{ForceCotangents, Linearisation};
use crate::Result;
use crate::adjoint::lie::{Vec6, cross_force, cross_motion};
use crate::coupling::{Carried, Tangent};
use crate::multibody::{Cotangents, Fields};
use nalgebra::{DMatrix, DVector};

/// What the water tells of a body: at unit density, spatial but for the impulse.
pub(super) struct Told {
    /// Its momentum in the water.
    pub momentum: Vec6,
    /// D'.
    pub carried: Vec6,
    /// What its momentum changes by as bodies are displaced and change their twists at given rates, D' or what a readout makes of it, body frame.
    pub impulse: Vec6,
    /// By what half the slope of the energy changes so.
    pub wrench: Vec6,
    /// ½ D_g E(v, v).
    pub pose_force: Vec6,
}

/// Impulses, wrenches and a tangent of one column whose sums alone are known.
fn summed(found: Carried) -> (DMatrix<f64>, Vec<Vec<Vec6>>, Vec<Tangent>) {
    let none = DVector::zeros(found.momentum.len());
    let tangent = Tangent {
        momentum_x: none.clone(),
        momentum_y: none,
        wrench: vec![Vec6::zeros(); found.gradient.len()],
        gradient: found.gradient,
    };
    let impulses = DMatrix::from_columns(&[found.momentum]);
    (impulses, vec![found.wrench], vec![tangent])
}

impl Linearisation<'_> {
    /// The fluid's part: the gradient of `ρ {(D − U × Z) · h_f + ½ D_g E(v, v)[Z]}` of each field.
    pub(super) fn fluid_force_vjps(
        &self,
        v: &DVector<f64>,
        fields: &[Fields],
        bars: &mut [Cotangents],
        out: &mut [ForceCotangents],
        rows: Rows,
    ) -> Result<()> {
        let Some(water) = self.water()? else {
            return Ok(());
        };
        let direction = self.through_water(v);
        let momenta = self.momenta_in(water, &direction);
        // (D − U × Z) · h_f: one bilinear form with the direction D' = D − U × Z.
        let carried: Vec<Vec<Vec6>> = fields.iter().map(|f| self.carried_on(f)).collect();
        let columns = carried.iter().map(|field| self.submerged_twists(field));
        let columns = DMatrix::from_columns(&columns.collect::<Vec<_>>());
        let virt = fields
            .iter()
            .map(|f| self.submerged_field(&f.virtual_twist));
        let virt: Vec<Vec<Vec6>> = virt.collect();
        let together = match &virt[..] {
            [z] => (water.linearised).carried(&direction, &columns.column(0).into_owned(), z)?,
            _ => None,
        };
        let (impulses, pairs, tangents) = match together {
            Some(found) => summed(found),
            None => {
                let (impulses, pairs) = water.linearised.respond(&columns, &direction)?;
                // ½ D_g E(v, v)[Z].
                let tangents = (water.linearised).displaced(&direction, &virt)?;
                (impulses, pairs, tangents)
            }
        };
        if rows.by_parameters() && !self.system.shapes.water.is_empty() {
            let relative: Vec<Vec6> = fields[0].twist.iter().map(|t| self.relative(t)).collect();
            let through = (Some(&direction), relative.as_slice());
            for ((fields, carried), out) in fields.iter().zip(&carried).zip(out.iter_mut()) {
                let (half, virt) = (0.5, fields.virtual_twist.as_slice());
                let terms = [
                    (1.0, (None, carried.as_slice()), None),
                    (half, through, Some(virt)),
                ];
                let terms = terms.map(|(weight, x, along)| Bilinear {
                    weight,
                    x,
                    y: through,
                    along,
                });
                self.add_shape_vjp(water, &terms, &mut out.parameters)?;
            }
        }
        for (k, tangent) in tangents.iter().enumerate() {
            for (b, w) in self.system.submerged() {
                let carried_on = impulses.fixed_view::<6, 1>(6 * w, k).into_owned();
                let impulse = tangent.momentum_x.fixed_rows::<6>(6 * w).into_owned();
                // The water carries it to bodies behind other joints.
                let answers = [carried_on, impulse, pairs[k][w], tangent.wrench[w]];
                if rows.skips(&fields[k], b) && answers == [Vec6::zeros(); 4] {
                    continue;
                }
                let told = Told {
                    momentum: momenta[b],
                    carried: carried[k][b],
                    impulse: carried_on + impulse,
                    wrench: pairs[k][w] + 0.5 * tangent.wrench[w],
                    pose_force: 0.5 * tangent.gradient[w],
                };
                self.add_told(b, &told, &fields[k], &mut bars[k], &mut out[k]);
            }
        }
        Ok(())
    }

    /// Adds what the water tells of body `b`.
    pub(super) fn add_told(
        &self,
        b: usize,
        told: &Told,
        fields: &Fields,
        bar: &mut Cotangents,
        out: &mut ForceCotangents,
    ) {
        let (rho, current) = (self.parameters.density(), self.current_twist());
        let Told {
            momentum,
            carried,
            impulse,
            wrench,
            pose_force,
        } = told;
        let impulse = &self.kinematics.poses[b].wrench_to_world(impulse);
        let relative = self.relative(&fields.twist[b]);
        let virt = &fields.virtual_twist[b];
        let rate = pose_force + cross_force(&current, momentum);
        *out.parameters.density_mut() += fields.turning[b].dot(momentum) + virt.dot(&rate);
        bar.turning[b] += rho * momentum;
        bar.virtual_twist[b] += rho * rate;
        bar.twist[b] += rho * impulse;
        bar.pose[b] += rho
            * (wrench
                - cross_force(&relative, impulse)
                - cross_force(carried, momentum)
                - cross_force(virt, pose_force));
    }

    /// D' = D − U × Z.
    pub(super) fn carried_on(&self, fields: &Fields) -> Vec<Vec6> {
        let current = self.current_twist();
        let both = fields.turning.iter().zip(&fields.virtual_twist);
        both.map(|(d, z)| d - cross_motion(&current, z)).collect()
    }
}
