//! First derivatives with the bodies' displacement.

use super::placed::{PlacedBodies, Solution, beside};
use super::system::Solved;
use crate::adjoint::lie::{Vec6, point_wrench};
use crate::coupling::PairTensor;
use crate::coupling::pair::{Pair, vector, wrench};
use crate::coupling::response::body_twists;
use crate::solver::{Columns, transposed_product};

impl PlacedBodies<'_> {
    /// ∇_g E of all pairs of columns by products of matrices, for many columns.
    pub fn tensor(&self, solution: &Solution) -> PairTensor {
        let mut out = PairTensor::zeros(self.model.bodies.len(), solution.columns());
        for pair in &self.pairs {
            out.add_pair(
                pair,
                &self.poses[pair.target],
                &self.pair_tensor(pair, solution),
            );
        }
        out
    }

    /// Σ_j arm_j { (∇P_x − ∇μ_x) a_y + ∇r_x λ_y }, rows 6·x + component, columns y, in the target's frame.
    fn pair_tensor(&self, pair: &Pair, solution: &Solution) -> Columns {
        let k = solution.columns();
        let body = &self.model.bodies[pair.target];
        let twists = body_twists(&solution.twists, pair.target);
        let active: Vec<usize> = (0..k).filter(|x| twists[*x] != Vec6::zeros()).collect();
        let own: Vec<Vec6> = active.iter().map(|x| twists[*x]).collect();
        let Solved { a, lambda, r, mu } = &solution.solved;
        let bar = beside(mu, r, &self.model.faces[pair.target]);
        let fields = body.vjp(&pair.points, &bar, 2 * k);
        let potential = body.potential_vjp(&pair.points, &body.readout_rows(&own), own.len());
        let sources = pair.positions.len();
        let mut charge = vec![0.0; sources * 6 * k];
        let mut residual = vec![0.0; sources * 6 * k];
        for (j, s) in pair.positions.iter().enumerate() {
            for x in 0..k {
                let mut q = -vector(&fields, 2 * k, j, x);
                if let Some(at) = active.iter().position(|i| *i == x) {
                    q += vector(&potential, own.len(), j, at);
                }
                let rho = vector(&fields, 2 * k, j, k + x);
                let at = (j * k + x) * 6;
                charge[at..at + 6].copy_from_slice(point_wrench(s, &q).as_slice());
                residual[at..at + 6].copy_from_slice(point_wrench(s, &rho).as_slice());
            }
        }
        let range = &self.model.sources[pair.source];
        let mut out = transposed_product(&charge, 6 * k, &a.part(range));
        out.add(&transposed_product(&residual, 6 * k, &lambda.part(range)));
        out
    }

    /// ∇_g E of all pairs of columns by plain sums, which for one or two columns cost less than
    /// setting up the products of [`PlacedBodies::tensor`].
    pub fn few(&self, solution: &Solution) -> PairTensor {
        let k = solution.columns();
        let combinations: Vec<(usize, usize)> =
            (0..k).flat_map(|x| (x..k).map(move |y| (x, y))).collect();
        let bodies = self.model.bodies.len();
        let mut sums = vec![vec![Vec6::zeros(); bodies]; combinations.len()];
        let Solved { a, lambda, r, mu } = &solution.solved;
        for pair in &self.pairs {
            let t = pair.target;
            let body = &self.model.bodies[t];
            let bar = beside(mu, r, &self.model.faces[t]);
            let fields = body.vjp(&pair.points, &bar, 2 * k);
            let rows = body.readout_rows(&body_twists(&solution.twists, t));
            let potential = body.potential_vjp(&pair.points, &rows, k);
            let at = self.model.sources[pair.source].start;
            for ((x, y), out) in combinations.iter().copied().zip(&mut sums) {
                let w = wrench(&pair.positions, |j| {
                    let (g, p) = (
                        |k2| vector(&fields, 2 * k, j, k2),
                        |k1| vector(&potential, k, j, k1),
                    );
                    let s = at + j;
                    0.5 * ((p(x) - g(x)) * a.at(s, y)
                        + g(k + x) * lambda.at(s, y)
                        + (p(y) - g(y)) * a.at(s, x)
                        + g(k + y) * lambda.at(s, x))
                });
                pair.apply(&self.poses[t], &w, out);
            }
        }
        let mut out = PairTensor::zeros(bodies, k);
        for (at, sums) in combinations.into_iter().zip(&sums) {
            for (b, w) in sums.iter().enumerate() {
                out.add(b, at, w);
            }
        }
        out
    }
}
