//! First derivatives of the energy of one direction with every column of the basis.

use super::linearised::{Fields, ReducedLinearised};
use super::link::PlacedSkeletons;
use super::views::{FLUX, vector};
use crate::adjoint::kernel::potential_vjp;
use crate::adjoint::lie::{Vec3, Vec6, six};
use crate::coupling::pair::wrench;
use nalgebra::DVector;

impl ReducedLinearised<'_> {
    fn fields(&self) -> &[Fields] {
        self.fields.get_or_init(|| {
            let columns = self.alpha.ncols();
            let one = |placed: &PlacedSkeletons| {
                let (t, s) = (self.range(placed.link.target), &placed.pair.points);
                let own = self.alpha.rows(t.start, t.len()).transpose();
                let targets = self.reduced.bodies[placed.link.target].targets();
                let mut field = vec![0.0; 3 * columns * s.len()];
                potential_vjp(targets, s, own.as_slice(), columns, &mut field);
                let sums = match placed.fading() {
                    true => self.sums(placed, own.as_slice(), columns),
                    false => Vec::new(),
                };
                Fields { field, sums }
            };
            self.placed.iter().map(one).collect()
        })
    }

    /// ∇_g E(x, e_k) for every column e_k of the basis: spatial wrenches on the bodies.
    pub(super) fn pull_back_columns(&self, x: &DVector<f64>) -> Vec<Vec<Vec6>> {
        let (columns, bodies) = (x.len(), self.reduced.bodies.len());
        let mut out = vec![vec![Vec6::zeros(); bodies]; columns];
        for (placed, f) in self.placed.iter().zip(self.fields()) {
            let link = placed.link;
            let s = self.range(link.source);
            let charges = self.alpha.rows(s.start, s.len());
            let along: DVector<f64> = charges * x;
            let at = |j: usize, k: usize| vector(&f.field, columns, j, k);
            let seen: Vec<Vec3> = (0..s.len())
                .map(|j| (0..columns).map(|k| at(j, k) * x[k]).sum())
                .collect();
            let strength = FLUX * link.factor;
            for (k, out) in out.iter_mut().enumerate() {
                let mut total = wrench(&placed.pair.positions, |j| {
                    let force = seen[j] * charges[(j, k)] + at(j, k) * along[j];
                    strength * placed.weight[0] * force
                });
                if placed.fading() {
                    let p = |j: usize, k: usize| f.sums[columns * j + k];
                    let of = |j: usize| {
                        let own: f64 = (0..columns).map(|m| p(j, m) * x[m]).sum();
                        own * charges[(j, k)] + p(j, k) * along[j]
                    };
                    let energy: f64 = (0..s.len()).map(of).sum();
                    let slope = strength * placed.weight[1] * energy;
                    let force = placed.between.normalize() * slope;
                    total += six(&force, &placed.centre.cross(&force));
                }
                placed.pair.apply(&self.poses[link.target], &total, out);
            }
        }
        out
    }
}
