//! The first derivative of E on the basis, as a tensor.

use super::pair::Pair;
use crate::adjoint::lie::{Pose, Vec6};
use crate::solver::Columns;
use nalgebra::{DMatrix, DVector};

/// ∇_g E for all pairs of basis columns.
#[derive(Clone, Debug)]
pub struct PairTensor {
    /// Columns k of the basis.
    columns: usize,
    /// Per body 6 × k², column `i·k + j` the spatial wrench of ∂E(e_i, e_j); symmetric in i, j.
    wrenches: Vec<DMatrix<f64>>,
}

impl PairTensor {
    /// From the wrenches per body, 6 × k² with column `i·k + j`.
    pub fn new(columns: usize, wrenches: Vec<DMatrix<f64>>) -> Self {
        Self { columns, wrenches }
    }

    /// All zero.
    pub fn zeros(bodies: usize, columns: usize) -> Self {
        Self::new(columns, vec![DMatrix::zeros(6, columns * columns); bodies])
    }

    /// Adds the derivatives of one pair, from `raw`: rows 6·x + component of the wrench on its points that column x makes with column y, in
    /// the target's frame.
    pub(super) fn add_pair(&mut self, pair: &Pair, pose: &Pose, raw: &Columns) {
        for x in 0..self.columns {
            for y in 0..=x {
                let w = Vec6::from_fn(|c, _| 0.5 * (raw.at(6 * x + c, y) + raw.at(6 * y + c, x)));
                let world = pose.wrench_to_world(&w);
                self.add(pair.source, (x, y), &pair.image.twist_vjp(&world));
                self.add(pair.target, (x, y), &-world);
            }
        }
    }

    /// Adds to the wrench of a body in E(e_x, e_y), and in E(e_y, e_x) where that is another.
    pub fn add(&mut self, body: usize, (x, y): (usize, usize), wrench: &Vec6) {
        let k = self.columns;
        for (x, y) in [(x, y), (y, x)].into_iter().take(1 + usize::from(x != y)) {
            let mut column = self.wrenches[body].fixed_view_mut::<6, 1>(0, x * k + y);
            column += wrench;
        }
    }

    /// ∇_g E(x, y): a spatial wrench on each body.
    pub fn contract(&self, x: &DVector<f64>, y: &DVector<f64>) -> Vec<Vec6> {
        let k = self.columns;
        self.wrenches
            .iter()
            .map(|w| {
                let mut out = Vec6::zeros();
                for i in 0..k {
                    for j in 0..k {
                        let c = x[i] * y[j];
                        if c != 0.0 {
                            out += w.fixed_view::<6, 1>(0, i * k + j) * c;
                        }
                    }
                }
                out
            })
            .collect()
    }

    /// `D_g E(e_i, y)[Z]` for every basis column e_i.
    pub fn along(&self, y: &DVector<f64>, z: &[Vec6]) -> DVector<f64> {
        let k = self.columns;
        let mut out = DVector::zeros(k);
        for (w, z) in self.wrenches.iter().zip(z) {
            let dots = w.tr_mul(z);
            for i in 0..k {
                for j in 0..k {
                    out[i] += dots[i * k + j] * y[j];
                }
            }
        }
        out
    }
}
