//! Second derivatives along one displacement: the tangent of the first.

use super::placed::{PanelSolution, PlacedPanels, scaled};
use crate::Result;
use crate::adjoint::kernel::{double_hvp, double_jvp, double_vjp, single_hvp, single_jvp};
use crate::adjoint::lie::{Vec3, Vec6, linear, point_wrench, six};
use crate::coupling::Tangent;
use crate::coupling::pair::{Pair, vector};
use crate::coupling::response::symmetrised;
use crate::solver::Columns;
use nalgebra::DVector;

/// Tangents of φ and μ.
pub(super) struct Moved {
    pub phi: Columns,
    pub mu: Columns,
}

/// Of a pair's points, in the frame of the panels.
pub(super) struct Displacements {
    /// As the panels see them.
    pub points: Vec<Vec3>,
    /// Where they aren't held off.
    arms: Vec<Vec3>,
}

impl PlacedPanels<'_> {
    /// The tangent along z of the energy of the first with the last of one or two columns:
    /// A δφ = δS q − δA φ, Aᵀ δμ = −δAᵀ μ.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn second(&self, solution: &PanelSolution, z: &[Vec6]) -> Result<Tangent> {
        let n = solution.twists.ncols();
        let bodies = self.coupled.bodies.len();
        // δSᵀ μ
        let mut back = Columns::zeros(self.coupled.rows(), n);
        let films = self.films.along(z);
        let displacements = self.displacements(z);
        let moved = self.moved(solution, &displacements)?;
        let pairs = || {
            let given = solution.fields().iter().zip(&displacements);
            self.pairs.iter().zip(given)
        };
        for (pair, Displacements { points: d, .. }) in self.pairs.iter().zip(&displacements) {
            let (panels, points) = self.ranges(pair);
            if self.reads(pair.target) {
                let triangles = self.coupled.bodies[pair.target].panels().triangles();
                let mu = scaled(pair.image.sign, solution.mu.slice(&points));
                let out = back.slice_mut(&panels);
                single_jvp(triangles, &pair.points, d, &mu, n, out);
            }
        }
        let momentum = |k: usize| -> DVector<f64> {
            let mut h = self.impulse(&moved.phi.column(k), &moved.mu.column(k));
            for (b, body) in self.coupled.bodies.iter().enumerate() {
                if !self.reads(b) {
                    continue;
                }
                let mut part = Vec6::zeros();
                for (i, at) in self.coupled.faces[b].clone().enumerate() {
                    part += body.faces.twist_flux(i) * (back.at(at, k) / body.faces.areas[i]);
                }
                let mut rows = h.fixed_rows_mut::<6>(6 * b);
                rows += 0.5 * part;
            }
            h
        };
        let mut gradient = vec![Vec6::zeros(); bodies];
        let mut wrench = vec![Vec6::zeros(); bodies];
        for (pair, given) in pairs() {
            let (w, dw) = self.pair_tangent(pair, given, solution, &moved);
            let pose = &self.poses[pair.target];
            pair.apply(pose, &w, &mut gradient);
            pair.apply_jvp(pose, &w, &dw, &z[pair.target], &mut wrench);
            if let Some((apart, film)) = pair.moving(&films) {
                let (w, dw) = apart.wrench_and_rate(film, [&linear(&w), &linear(&dw)]);
                film.placed.apply(&w, &mut gradient);
                film.apply_rate((&w, &dw), z, &mut wrench);
            }
        }
        Ok(Tangent {
            momentum_x: momentum(0),
            momentum_y: momentum(n - 1),
            gradient,
            wrench,
        })
    }

    /// Of the points of all pairs as the bodies are displaced along z.
    pub fn displacements(&self, z: &[Vec6]) -> Vec<Displacements> {
        let films = self.films.along(z);
        let displacement = |pair: &Pair| {
            let arms = pair.displacements(&self.poses[pair.target], z);
            let held = pair.moving(&films);
            let shift = held.map_or(Vec3::zeros(), |(apart, film)| apart.rate(film));
            Displacements {
                points: arms.iter().map(|d| d + shift).collect(),
                arms,
            }
        };
        self.pairs.iter().map(displacement).collect()
    }

    /// Rates of φ and μ of all columns there.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn moved(
        &self,
        solution: &PanelSolution,
        displacements: &[Displacements],
    ) -> Result<Moved> {
        let n = solution.twists.ncols();
        let mut right = Columns::zeros(self.coupled.rows(), n);
        let mut transposed = Columns::zeros(self.coupled.rows(), n);
        let given = solution.fields().iter().zip(displacements);
        for (pair, (fields, Displacements { points: d, .. })) in self.pairs.iter().zip(given) {
            let (panels, points) = self.ranges(pair);
            self.add_moved(pair, fields, d, &mut right);
            let triangles = self.coupled.bodies[pair.target].panels().triangles();
            let mu = scaled(-pair.image.sign, solution.mu.slice(&points));
            let out = transposed.slice_mut(&panels);
            double_jvp(triangles, &pair.points, d, &mu, n, out);
        }
        let ([phi, mu], _) = self.system.solve(&right, &transposed)?;
        Ok(Moved { phi, mu })
    }

    /// Adds δS q − δA φ at the points of a pair, from its fields there.
    pub(super) fn add_moved(
        &self,
        pair: &Pair,
        fields: &[f64],
        displacement: &[Vec3],
        right: &mut Columns,
    ) {
        let (_, points) = self.ranges(pair);
        let n = right.columns;
        for (i, d) in displacement.iter().enumerate() {
            for k in 0..n {
                right.data[(points.start + i) * n + k] += d.dot(&vector(fields, n, i, k));
            }
        }
    }

    /// Wrench on the points of a pair and its tangent, in the frame of the panels, from the fields and displacements there.
    fn pair_tangent(
        &self,
        pair: &Pair,
        (fields, moving): (&Vec<f64>, &Displacements),
        solution: &PanelSolution,
        moved: &Moved,
    ) -> (Vec6, Vec6) {
        let (n, d) = (solution.twists.ncols(), &moving.points);
        let (panels, points) = self.ranges(pair);
        let triangles = self.coupled.bodies[pair.target].panels().triangles();
        let sign = pair.image.sign;
        let mut dfields = vec![0.0; fields.len()];
        if let Some(q) = self.normal_velocity(pair.target, &solution.twists) {
            let q = scaled(sign, &q);
            single_hvp(triangles, &pair.points, d, &q, n, &mut dfields);
        }
        let phi = scaled(-sign, solution.phi.slice(&panels));
        double_hvp(triangles, &pair.points, d, &phi, n, &mut dfields);
        let dphi = scaled(-sign, moved.phi.slice(&panels));
        double_vjp(triangles, &pair.points, &dphi, n, &mut dfields);
        let (mut w, mut dw) = (Vec6::zeros(), Vec6::zeros());
        for (i, s) in pair.positions.iter().enumerate() {
            let (mut f, mut df) = (Vec3::zeros(), Vec3::zeros());
            let at = points.start + i;
            for &(x, y, weight) in symmetrised(n) {
                let (field, dfield) = (vector(fields, n, i, y), vector(&dfields, n, i, y));
                f += weight * solution.mu.at(at, x) * field;
                df += weight * (moved.mu.at(at, x) * field + solution.mu.at(at, x) * dfield);
            }
            w += point_wrench(s, &f);
            dw += six(&df, &(moving.arms[i].cross(&f) + s.cross(&df)));
        }
        (w, dw)
    }
}
