//! The coupled panels at given poses: what all solutions there share.

use super::PanelCoupled;
use super::system::System;
use crate::Result;
use crate::adjoint::kernel::{flux_vjp, single_sum, single_vjp};
use crate::adjoint::lie::{Pose, Vec3, Vec6};
use crate::coupling::full::Reached;
use crate::coupling::pair::Pair;
use crate::solver::Columns;
use nalgebra::{DMatrix, DVector};

/// The system at given poses.
pub(super) struct PlacedPanels<'a> {
    pub coupled: &'a PanelCoupled,
    pub poses: Vec<Pose>,
    /// Panels of the target, points of the source: all whose relative placement changes.
    pub pairs: Vec<Pair>,
    pub system: System<'a>,
    /// S F of each body's unit twists, at all points.
    pub readout: Vec<Columns>,
}

/// Twists, 6·bodies × k, and the water's solution.
pub(super) struct Solution {
    pub twists: DMatrix<f64>,
    /// Potentials φ of the panels.
    pub phi: Columns,
    /// Adjoint densities μ.
    pub mu: Columns,
    pub reached: Reached,
}

impl<'a> PlacedPanels<'a> {
    /// # Errors
    /// Bodies inside each other, or behind a wall.
    pub fn new(coupled: &'a PanelCoupled, poses: &[Pose]) -> Result<Self> {
        let system = System::new(coupled, poses)?;
        let pairs = pairs(coupled, poses);
        Ok(Self {
            coupled,
            poses: poses.to_vec(),
            readout: readouts(coupled, &pairs),
            pairs,
            system,
        })
    }

    /// D F x̄ of columns of twists: fluxes through the panels.
    pub fn flux(&self, twists: &DMatrix<f64>) -> Columns {
        let mut out = Columns::zeros(self.coupled.rows(), twists.ncols());
        for (b, body) in self.coupled.bodies.iter().enumerate() {
            for (i, at) in self.coupled.faces[b].clone().enumerate() {
                let row = body.faces.twist_flux(i);
                for k in 0..out.columns {
                    out.data[at * out.columns + k] = row.dot(&twist(twists, b, k));
                }
            }
        }
        out
    }

    /// F x̄ of the panels of one body: normal velocities.
    pub fn normal_velocity(&self, b: usize, twists: &DMatrix<f64>) -> Columns {
        let faces = &self.coupled.bodies[b].faces;
        Columns::from_fn(faces.len(), twists.ncols(), |i, k| {
            faces.twist_flux(i).dot(&twist(twists, b, k)) / faces.areas[i]
        })
    }

    /// Solves for columns of twists.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn solve(&self, twists: DMatrix<f64>) -> Result<Solution> {
        let mut right = Columns::zeros(self.coupled.rows(), twists.ncols());
        for (b, readout) in self.readout.iter().enumerate() {
            for k in 0..right.columns {
                let twist = twist(&twists, b, k);
                if twist == Vec6::zeros() {
                    continue;
                }
                for i in 0..right.rows {
                    let row = Vec6::from_row_slice(readout.row(i));
                    right.data[i * right.columns + k] += row.dot(&twist);
                }
            }
        }
        let mu = self.system.solve(&self.flux(&twists), true)?;
        let phi = self.system.solve(&right, false)?;
        let reached = [&mu, &phi].map(|s| Reached {
            iterations: s.iterations,
            residual: s.residual,
        });
        Ok(Solution {
            twists,
            phi: phi.x,
            mu: mu.x,
            reached: reached[0].worst(reached[1]),
        })
    }

    /// ½ Fᵀ {D φ + Sᵀ μ} of one column: body-frame impulses of all bodies.
    pub fn impulse(&self, phi: &[f64], mu: &[f64]) -> DVector<f64> {
        let mut out = DVector::zeros(6 * self.coupled.bodies.len());
        for (b, body) in self.coupled.bodies.iter().enumerate() {
            let mut h = Vec6::zeros();
            for (i, at) in self.coupled.faces[b].clone().enumerate() {
                h += body.faces.twist_flux(i) * phi[at];
            }
            for (i, m) in mu.iter().enumerate() {
                h += Vec6::from_row_slice(self.readout[b].row(i)) * *m;
            }
            out.fixed_rows_mut::<6>(6 * b).copy_from(&(0.5 * h));
        }
        out
    }

    /// ∇(S q − Ω/4π φ) of a pair's panels at its points, `[point][column][3]`, image's sign included: minus the velocity that they
    /// make there.
    pub fn fields(&self, pair: &Pair, solution: &Solution) -> Vec<f64> {
        let k = solution.twists.ncols();
        let body = &self.coupled.bodies[pair.target];
        let triangles = body.panels().triangles();
        let range = self.coupled.faces[pair.target].clone();
        let mut out = vec![0.0; 3 * k * pair.positions.len()];
        let q = self.normal_velocity(pair.target, &solution.twists);
        if q.data.iter().any(|q| *q != 0.0) {
            single_vjp(triangles, &pair.points, &q.data, k, &mut out);
        }
        let phi: Vec<f64> = (solution.phi.slice(&range).iter())
            .map(|phi| -phi)
            .collect();
        flux_vjp(triangles, &pair.points, &phi, k, &mut out);
        if pair.image.sign < 0.0 {
            out.iter_mut().for_each(|x| *x = -*x);
        }
        out
    }
}

impl Solution {
    /// One column from coefficients on those there are.
    pub fn combine(&self, coefficients: &DVector<f64>) -> Self {
        let c = coefficients.as_slice();
        let combined = |x: &Columns| Columns {
            rows: x.rows,
            columns: 1,
            data: x.combine(c),
        };
        let twists = &self.twists * coefficients;
        Self {
            twists: DMatrix::from_column_slice(twists.len(), 1, twists.as_slice()),
            phi: combined(&self.phi),
            mu: combined(&self.mu),
            reached: self.reached,
        }
    }

    /// Single columns side by side.
    pub fn beside(parts: &[Self]) -> Self {
        let all = |part: fn(&Self) -> &Columns| {
            let columns: Vec<&[f64]> = parts.iter().map(|p| part(p).data.as_slice()).collect();
            Columns::from_columns(&columns)
        };
        let rows = parts.first().map_or(0, |p| p.twists.nrows());
        let reached = parts.iter().map(|p| p.reached);
        Self {
            twists: DMatrix::from_fn(rows, parts.len(), |i, k| parts[k].twists[(i, 0)]),
            phi: all(|p| &p.phi),
            mu: all(|p| &p.mu),
            reached: reached.fold(Reached::default(), Reached::worst),
        }
    }
}

/// Twist of body `b` in a column.
fn twist(twists: &DMatrix<f64>, b: usize, k: usize) -> Vec6 {
    twists.fixed_view::<6, 1>(6 * b, k).into_owned()
}

/// Three-vector of point `i` and column `k` of `columns`.
#[inline]
pub(super) fn field_at(fields: &[f64], columns: usize, i: usize, k: usize) -> Vec3 {
    let at = 3 * (i * columns + k);
    Vec3::new(fields[at], fields[at + 1], fields[at + 2])
}

/// All but each body with its own points and with those of bodies that it doesn't feel; images count always.
fn pairs(coupled: &PanelCoupled, poses: &[Pose]) -> Vec<Pair> {
    let mut out = Vec::new();
    for target in 0..coupled.bodies.len() {
        for image in &coupled.images {
            for source in 0..coupled.bodies.len() {
                let apart = source == target || coupled.excluded.contains(source, target);
                if apart && image.is_identity() {
                    continue;
                }
                let points = &coupled.bodies[source].faces.centres;
                let (at, from) = ((target, &poses[target]), (source, &poses[source]));
                out.push(Pair::new(at, from, image, points));
            }
        }
    }
    out
}

fn readouts(coupled: &PanelCoupled, pairs: &[Pair]) -> Vec<Columns> {
    let mut out: Vec<Columns> = (coupled.bodies.iter())
        .map(|_| Columns::zeros(coupled.rows(), 6))
        .collect();
    for (b, body) in coupled.bodies.iter().enumerate() {
        let own = &coupled.faces[b];
        let own = out[b].slice_mut(own);
        for (n, x) in own.iter_mut().enumerate() {
            *x = body.single_layer()[(n / 6, n % 6)];
        }
    }
    for pair in pairs {
        let body = &coupled.bodies[pair.target];
        let q = body.normal_velocity();
        let sign = pair.image.sign;
        let q: Vec<f64> = (0..6 * q.nrows())
            .map(|n| sign * q[(n / 6, n % 6)])
            .collect();
        let points = &coupled.faces[pair.source];
        let out = out[pair.target].slice_mut(points);
        single_sum(body.panels().triangles(), &pair.points, &q, 6, out);
    }
    out
}
