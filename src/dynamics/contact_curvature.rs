//! How contact's generalised forces change with the velocity: −∂g/∂v, the Hessian of its potential, by its entries. Those of a contact are on the
//! velocities that move its two bodies, of a damper on those that it ties together, of a joint's limit on its own.

use super::island_matrix::IslandMatrix;
use super::{Evaluation, PairContact};
use crate::adjoint::contact::{Push, Rates, contact_force_jvp};
use crate::adjoint::lie::{Vec3, Vec6, angular, point_velocity};
use nalgebra::{DMatrix, DVector, Matrix6, Matrix6xX};

impl Evaluation<'_> {
    /// Hands `add` the entries on and below the diagonal of −∂g/∂v at the velocity `v`, the user's coordinates: row, column, value; several of one place add up.
    /// The order is always the same.
    pub(super) fn contact_curvature(
        &self,
        v: &DVector<f64>,
        mut add: impl FnMut(usize, usize, f64),
    ) {
        let twists = self.system.tree.twists(&self.kinematics, v);
        for contact in &self.contact_points {
            let Some(slopes) = slopes(contact, &twists) else {
                continue;
            };
            let (velocities, rates) = self.moving_by(contact);
            let own = rates.tr_mul(&(slopes * &rates));
            for (k, i) in velocities.iter().enumerate() {
                for (l, j) in velocities.iter().enumerate().take(k + 1) {
                    add(*i, *j, -0.5 * (own[(k, l)] + own[(l, k)]));
                }
            }
        }
        if self.damps() {
            self.damping_matrix().lower(|i, j, x| add(i, j, -x));
        }
        for l in &self.limits {
            add(l.v, l.v, -l.forces_jvp(self.q[l.q], v[l.v], 1.0));
        }
    }

    /// The velocities that move the bodies of a contact against one another, ascending, and the rates of the point by each: its velocity and spin, 6 × velocities.
    fn moving_by(&self, contact: &PairContact) -> (Vec<usize>, Matrix6xX<f64>) {
        let tree = &self.system.tree;
        let mut found: Vec<(usize, Vec6)> = Vec::new();
        let sides = [(Some(contact.first), 1.0), (contact.second, -1.0)];
        for (body, sign) in sides {
            for a in body.into_iter().flat_map(|b| tree.carrying(b)) {
                for (column, k) in tree.links()[a].terms() {
                    let twist = sign * self.kinematics.columns[column];
                    match found.iter_mut().find(|(i, _)| *i == k) {
                        Some((_, sum)) => *sum += twist,
                        None => found.push((k, twist)),
                    }
                }
            }
        }
        found.retain(|(_, twist)| *twist != Vec6::zeros());
        found.sort_by_key(|(k, _)| *k);
        let x = &contact.point.position;
        let mut rates = Matrix6xX::zeros(found.len());
        for ((_, twist), mut column) in found.iter().zip(rates.column_iter_mut()) {
            column
                .fixed_rows_mut::<3>(0)
                .copy_from(&point_velocity(twist, x));
            column.fixed_rows_mut::<3>(3).copy_from(&angular(twist));
        }
        (found.into_iter().map(|(k, _)| k).collect(), rates)
    }

    /// What the dampers that are solved with contact do, which is linear in the velocity.
    fn damping_matrix(&self) -> IslandMatrix {
        let islands = self.damped_islands();
        let tree = &self.system.tree;
        let product = |dv: &DVector<f64>| {
            let twists = tree.twists(&self.kinematics, dv);
            let mut wrenches = vec![Vec6::zeros(); twists.len()];
            self.add_damping(&twists, dv, &mut wrenches);
            tree.project(&self.kinematics.columns, wrenches)
        };
        let products: Vec<_> = islands.changes().iter().map(product).collect();
        IslandMatrix::new(islands, &products)
    }

    /// ∂g/∂v in the user's coordinates, column by column: symmetric, negative semi-definite.
    pub(super) fn contact_jacobian(&self, v: &DVector<f64>) -> DMatrix<f64> {
        let n = v.len();
        let mut out = DMatrix::zeros(n, n);
        for k in 0..n {
            let unit = DVector::from_fn(n, |i, _| f64::from(i == k));
            out.set_column(k, &self.contact_force_jvp(v, &unit));
        }
        out
    }
}

/// Slopes of force and torque at a contact, by velocity and spin; none where nothing presses.
fn slopes(contact: &PairContact, twists: &[Vec6]) -> Option<Matrix6<f64>> {
    let state = contact.point_state(twists);
    let mut out = Matrix6::zeros();
    for (k, mut column) in out.column_iter_mut().enumerate() {
        let unit = |from: usize| Vec3::from_fn(|i, _| f64::from(from + i == k));
        let along = Rates {
            velocity: unit(0),
            spin: unit(3),
        };
        let Push { force, torque } = contact_force_jvp(&contact.law, &state, &along);
        column.fixed_rows_mut::<3>(0).copy_from(&force);
        column.fixed_rows_mut::<3>(3).copy_from(&torque);
    }
    (out != Matrix6::zeros()).then_some(out)
}
