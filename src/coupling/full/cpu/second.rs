//! Second derivatives along one displacement: the tangent of the first.

use super::placed::{PlacedBodies, Solution, beside, unit_twists};
use super::system::Solved;
use crate::Result;
use crate::adjoint::lie::{Vec3, Vec6, point_wrench, six};
use crate::adjoint::solve::{Columnwise, Moved};
use crate::coupling::Tangent;
use crate::coupling::pair::{Pair, vector};
use crate::coupling::response::{body_twists, symmetrised};
use crate::solver::Columns;
use nalgebra::DVector;

/// First derivatives of one pair that the second pass uses again.
struct PairFields {
    displacement: Vec<Vec3>,
    /// ∇ of Σ μ, r over the target's faces, `[j][μ.., r..][3]`.
    fields: Vec<f64>,
    /// ∇ of the readout of the directions, `[j][x][3]`.
    readout: Vec<f64>,
}

impl PlacedBodies<'_> {
    /// The tangent along z of the energy of the first with the last of one or two columns.
    pub fn second(&self, solution: &Solution, z: &[Vec6]) -> Result<Tangent> {
        let n = solution.columns();
        let Solved { a, lambda, r, mu } = &solution.solved;
        let (right, left) = (a.beside(lambda), mu.beside(r));
        let bodies = self.model.bodies.len();

        let mut dk = Columns::zeros(self.model.rows(), 2 * n);
        let mut dkr = Columns::zeros(right.rows, n);
        let mut dg = Columns::zeros(right.rows, n);
        let mut impulse = vec![vec![Vec6::zeros(); n]; bodies];
        let mut kept = Vec::with_capacity(self.pairs.len());
        for pair in &self.pairs {
            let body = &self.model.bodies[pair.target];
            let faces = &self.model.faces[pair.target];
            let sources = &self.model.sources[pair.source];
            let d = pair.displacements(&self.poses[pair.target], z);
            body.jvp(
                &pair.points,
                &d,
                right.slice(sources),
                2 * n,
                dk.slice_mut(faces),
            );
            let fields = body.vjp(&pair.points, left.slice(faces), 2 * n);
            let mut readout = vec![0.0; 3 * n * d.len()];
            let units = unit_twists();
            let twists = body_twists(&solution.twists, pair.target);
            let six_fields = match self.readout[pair.target] {
                Some(_) => body.potential_vjp(&pair.points, &body.readout_rows(&units), 6),
                None => Vec::new(),
            };
            for (j, dj) in d.iter().enumerate() {
                let s = sources.start + j;
                for (k, twist) in twists.iter().enumerate() {
                    dkr.data[s * n + k] += dj.dot(&vector(&fields, 2 * n, j, n + k));
                    dg.data[s * n + k] -= dj.dot(&vector(&fields, 2 * n, j, k));
                    if six_fields.is_empty() {
                        continue;
                    }
                    let mut field = Vec3::zeros();
                    for (m, part) in impulse[pair.target][k].iter_mut().enumerate() {
                        let g = vector(&six_fields, 6, j, m);
                        field += g * twist[m];
                        *part += dj.dot(&g) * right.at(s, k);
                    }
                    dg.data[s * n + k] += dj.dot(&field);
                    let at = 3 * (j * n + k);
                    readout[at..at + 3].copy_from_slice(field.as_slice());
                }
            }
            kept.push(PairFields {
                displacement: d,
                fields,
                readout,
            });
        }
        let (dka, dkl) = dk.split(n);
        let (tangent, _) = self.system.respond_jvp(&Moved {
            a: &dka,
            lambda: &dkl,
            r: &dkr,
            g: &dg,
        })?;

        let momenta: Vec<DVector<f64>> = (0..n)
            .map(|k| {
                let mut h = self.impulse(&tangent, k);
                for (b, parts) in impulse.iter().enumerate() {
                    let mut rows = h.fixed_rows_mut::<6>(6 * b);
                    rows += 0.5 * parts[k];
                }
                h
            })
            .collect();

        let mut gradient = vec![Vec6::zeros(); bodies];
        let mut wrench = vec![Vec6::zeros(); bodies];
        for (pair, first) in self.pairs.iter().zip(&kept) {
            let (w, dw) = self.pair_tangent(pair, first, solution, &left, &tangent);
            pair.apply(&self.poses[pair.target], &w, &mut gradient);
            pair.apply_jvp(
                &self.poses[pair.target],
                &w,
                &dw,
                &z[pair.target],
                &mut wrench,
            );
        }
        Ok(Tangent {
            momentum_x: momenta[0].clone(),
            momentum_y: momenta[n - 1].clone(),
            gradient,
            wrench,
        })
    }

    /// δa along z at constant twists, of all columns: `N δa = δKᵀ r − Kᵀ δK a`.
    pub fn strength_rates(&self, solution: &Solution, z: &[Vec6]) -> Result<Columns> {
        let n = solution.columns();
        let Solved { a, r, .. } = &solution.solved;
        let mut dk = Columns::zeros(self.model.rows(), n);
        let mut dkr = Columns::zeros(a.rows, n);
        for pair in &self.pairs {
            let body = &self.model.bodies[pair.target];
            let faces = &self.model.faces[pair.target];
            let sources = &self.model.sources[pair.source];
            let d = pair.displacements(&self.poses[pair.target], z);
            let strengths = a.slice(sources);
            body.jvp(&pair.points, &d, strengths, n, dk.slice_mut(faces));
            let fields = body.vjp(&pair.points, r.slice(faces), n);
            for (j, dj) in d.iter().enumerate() {
                for k in 0..n {
                    let rate = dj.dot(&vector(&fields, n, j, k));
                    dkr.data[(sources.start + j) * n + k] += rate;
                }
            }
        }
        let none = Columns::zeros(a.rows, n);
        let (tangent, _) = self.system.respond_jvp(&Moved {
            a: &dk,
            lambda: &Columns::zeros(self.model.rows(), n),
            r: &dkr,
            g: &none,
        })?;
        Ok(tangent.a)
    }

    /// Wrench on the sources of a pair and its tangent, in the target's frame.
    fn pair_tangent(
        &self,
        pair: &Pair,
        first: &PairFields,
        solution: &Solution,
        left: &Columns,
        tangent: &Solved,
    ) -> (Vec6, Vec6) {
        let n = solution.columns();
        let body = &self.model.bodies[pair.target];
        let faces = &self.model.faces[pair.target];
        let d = &first.displacement;
        let moved = beside(&tangent.mu, &tangent.r, faces);
        let dfields = body.vjp(&pair.points, &moved, 2 * n);
        let bent = body.hvp(&pair.points, d, left.slice(faces), 2 * n);
        let twists = body_twists(&solution.twists, pair.target);
        let bent_readout = body.potential_hvp(&pair.points, d, &body.readout_rows(&twists), n);
        let at = self.model.sources[pair.source].start;
        let (mut w, mut dw) = (Vec6::zeros(), Vec6::zeros());
        for (j, s) in pair.positions.iter().enumerate() {
            let (mut f, mut df) = (Vec3::zeros(), Vec3::zeros());
            let source = at + j;
            for &(x, y, weight) in symmetrised(n) {
                let charge = vector(&first.readout, n, j, x) - vector(&first.fields, 2 * n, j, x);
                let residual = vector(&first.fields, 2 * n, j, n + x);
                let dcharge = vector(&bent_readout, n, j, x)
                    - vector(&bent, 2 * n, j, x)
                    - vector(&dfields, 2 * n, j, x);
                let dresidual = vector(&bent, 2 * n, j, n + x) + vector(&dfields, 2 * n, j, n + x);
                let (a, lambda) = (
                    solution.solved.a.at(source, y),
                    solution.solved.lambda.at(source, y),
                );
                let (da, dlambda) = (tangent.a.at(source, y), tangent.lambda.at(source, y));
                f += weight * (charge * a + residual * lambda);
                df +=
                    weight * (dcharge * a + charge * da + dresidual * lambda + residual * dlambda);
            }
            w += point_wrench(s, &f);
            dw += six(&df, &(d[j].cross(&f) + s.cross(&df)));
        }
        (w, dw)
    }
}
