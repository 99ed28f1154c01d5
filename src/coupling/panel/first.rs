//! First derivatives with the bodies' displacement.

use super::placed::{PanelSolution, PlacedPanels};
use crate::adjoint::lie::{Vec3, point_wrench};
use crate::coupling::PairTensor;
use crate::coupling::pair::{Pair, vector};
use crate::solver::{Columns, transposed_product};

impl PlacedPanels<'_> {
    /// ∇_g E of all pairs of columns.
    pub fn gradient(&self, solution: &PanelSolution) -> PairTensor {
        let mut out = PairTensor::zeros(self.coupled.bodies.len(), solution.twists.ncols());
        for (pair, fields) in self.pairs.iter().zip(solution.fields()) {
            let tensor = self.pair_tensor(pair, fields, solution);
            out.add_pair(pair, &self.poses[pair.target], &tensor);
            if let Some((apart, film)) = pair.film(&self.films) {
                for (x, y) in (0..tensor.columns).flat_map(|x| (0..=x).map(move |y| (x, y))) {
                    let of = |x: usize, y: usize, c: usize| 0.5 * tensor.at(6 * x + c, y);
                    let force = Vec3::from_fn(|c, _| of(x, y, c) + of(y, x, c));
                    for (body, wrench) in film.spread(&apart.wrench(film, &force)) {
                        out.add(body, (x, y), &wrench);
                    }
                }
            }
        }
        out
    }

    /// Σ_i arm_i ∇(S q_x − Ω/4π φ_x) μ_y, rows 6·x + component, columns y, in the frame of the panels.
    fn pair_tensor(&self, pair: &Pair, fields: &[f64], solution: &PanelSolution) -> Columns {
        let k = solution.twists.ncols();
        let mut arms = Vec::with_capacity(pair.positions.len() * 6 * k);
        for (i, s) in pair.positions.iter().enumerate() {
            for x in 0..k {
                arms.extend_from_slice(point_wrench(s, &vector(fields, k, i, x)).as_slice());
            }
        }
        let mu = solution.mu.part(&self.coupled.faces[pair.source]);
        transposed_product(&arms, 6 * k, &mu)
    }
}
