//! The transpose of the strengths of all sources and of their rates.

use super::Cpu;
use super::placed::{PlacedBodies, beside};
use super::system::Solved;
use crate::Result;
use crate::adjoint::lie::{Vec3, Vec6};
use crate::adjoint::solve::{Columnwise, Moved};
use crate::coupling::pair::vector;
use crate::coupling::surface_back::wrenches;
use crate::coupling::{Motion, MotionBar};
use crate::solver::Columns;

impl Cpu {
    /// Adds the gradient of βᵀa + β'ᵀa', strengths and their rates, two columns of `beta`: with Λ_c = cᵀ a, c = β' first, its product with the Hessian along the
    /// displacement, the rates of the twists and dc = β ([`least_squares_jvp`](crate::adjoint::solve::least_squares_jvp)),
    ///
    /// ```text
    /// δΛ = −μᵀ δK a + rᵀ δK λ + μᵀ F δx̄,   N λ = c
    /// ```
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub(crate) fn strengths_vjp(
        &self,
        motion: &Motion,
        beta: &Columns,
        bar: &mut MotionBar,
    ) -> Result<()> {
        let (z, columns) = (motion.displacement, motion.columns());
        let none = columns.columns(0, 0).into_owned();
        let placed = PlacedBodies::new(self, motion.poses, &none);
        let (model, bodies) = (placed.model, placed.poses.len());
        let (through, gained) = placed.face_side(&columns).split(1);
        let (of_values, of_rates) = beta.split(1);
        let (solved, _) = placed.system.respond(&through, &of_rates)?;
        let Solved { a, lambda, r, mu } = &solved;
        let (right, left) = (a.beside(lambda), mu.beside(r));

        let mut dk = Columns::zeros(model.rows(), 2);
        let mut dkr = Columns::zeros(a.rows, 1);
        let mut dg = of_values;
        let mut kept: Vec<(Vec<Vec3>, Vec<f64>)> = Vec::with_capacity(placed.pairs.len());
        for pair in &placed.pairs {
            let body = &model.bodies[pair.target];
            let faces = &model.faces[pair.target];
            let sources = &model.sources[pair.source];
            let d = pair.displacements(&placed.poses[pair.target], z);
            let strengths = right.slice(sources);
            body.jvp(&pair.points, &d, strengths, 2, dk.slice_mut(faces));
            let fields = body.vjp(&pair.points, left.slice(faces), 2);
            for (j, dj) in d.iter().enumerate() {
                let s = sources.start + j;
                dkr.data[s] += dj.dot(&vector(&fields, 2, j, 1));
                dg.data[s] -= dj.dot(&vector(&fields, 2, j, 0));
            }
            kept.push((d, fields));
        }
        let (dka, dkl) = dk.split(1);
        let (tangent, _) = placed.system.respond_jvp(&Moved {
            a: &Columns::sum(1.0, &dka, -1.0, &gained),
            lambda: &dkl,
            r: &dkr,
            g: &dg,
        })?;

        for (b, body) in model.bodies.iter().enumerate() {
            let read = |mu: &Columns| -> Vec6 {
                let rows = body.twist_rows.iter().zip(mu.slice(&model.faces[b]));
                rows.map(|(row, m)| row * *m).sum()
            };
            bar.add_twists(b, &[read(&tangent.mu), read(mu)]);
        }
        let (mut gradient, mut wrench) = (vec![Vec6::zeros(); bodies], vec![Vec6::zeros(); bodies]);
        for (pair, (d, fields)) in placed.pairs.iter().zip(&kept) {
            let body = &model.bodies[pair.target];
            let faces = &model.faces[pair.target];
            let moved = beside(&tangent.mu, &tangent.r, faces);
            let dfields = body.vjp(&pair.points, &moved, 2);
            let bent = body.hvp(&pair.points, d, left.slice(faces), 2);
            let from = model.sources[pair.source].start;
            let forces = (0..d.len()).map(|j| {
                let s = from + j;
                let field = |k: usize| vector(fields, 2, j, k);
                let rate = |k: usize| vector(&dfields, 2, j, k) + vector(&bent, 2, j, k);
                let (a, lambda) = (a.at(s, 0), lambda.at(s, 0));
                let (da, dlambda) = (tangent.a.at(s, 0), tangent.lambda.at(s, 0));
                [
                    lambda * field(1) - a * field(0),
                    dlambda * field(1) + lambda * rate(1) - da * field(0) - a * rate(0),
                ]
            });
            let [w, dw] = wrenches(pair, d, forces);
            let pose = &placed.poses[pair.target];
            pair.apply(pose, &w, &mut gradient);
            pair.apply_jvp(pose, &w, &dw, &z[pair.target], &mut wrench);
        }
        bar.add_pull(z, &gradient, &wrench);
        Ok(())
    }
}
