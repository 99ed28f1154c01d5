//! First derivatives with the bodies' displacement.

use super::placed::{PlacedPanels, Solution, field_at};
use crate::coupling::PairTensor;
use crate::coupling::pair::Pair;
use crate::solver::{Columns, transposed_product};

impl PlacedPanels<'_> {
    /// ∇_g E of all pairs of columns.
    pub fn gradient(&self, solution: &Solution) -> PairTensor {
        let mut out = PairTensor::zeros(self.coupled.bodies.len(), solution.twists.ncols());
        for pair in &self.pairs {
            out.add_pair(
                pair,
                &self.poses[pair.target],
                &self.pair_tensor(pair, solution),
            );
        }
        out
    }

    /// Σ_i arm_i ∇(S q_x − Ω/4π φ_x) μ_y, rows 6·x + component, columns y, in the frame of the panels.
    fn pair_tensor(&self, pair: &Pair, solution: &Solution) -> Columns {
        let k = solution.twists.ncols();
        let fields = self.fields(pair, solution);
        let mut arms = vec![0.0; pair.positions.len() * 6 * k];
        for (i, s) in pair.positions.iter().enumerate() {
            for x in 0..k {
                let field = field_at(&fields, k, i, x);
                let at = (i * k + x) * 6;
                arms[at..at + 3].copy_from_slice(field.as_slice());
                arms[at + 3..at + 6].copy_from_slice(s.cross(&field).as_slice());
            }
        }
        let range = &self.coupled.faces[pair.source];
        let mu = Columns {
            rows: range.len(),
            columns: k,
            data: solution.mu.slice(range).to_vec(),
        };
        transposed_product(&arms, 6 * k, &mu)
    }
}
