//! First and second derivatives along many directions at once: what doesn't depend on the direction is summed up once.

use super::linearised::{PULL, ReducedLinearised};
use super::placed::{Moved, PlacedSkeletons, PointTangent};
use super::second::TANGENT;
use super::views::{FLUX, view_mut};
use crate::adjoint::kernel::{potential_hvp, potential_jvp, potential_vjp};
use crate::adjoint::lie::{Vec3, Vec6, angular, linear, point_wrench};
use crate::coupling::Tangent;
use crate::coupling::film::MovingFilms;
use crate::coupling::pair::{vector, wrench};
use nalgebra::{DMatrix, DVector};

/// A link along many displacements of one direction's charges.
struct Bent {
    moved: Vec<Moved>,
    /// ∇ of the potentials at the source points that the target's charges make, `[j][3]`.
    field: Vec<f64>,
    /// Its slopes along each axis.
    bends: [Vec<f64>; 3],
    /// Changes of the potentials, points × displacements.
    on_target: DMatrix<f64>,
    on_source: DMatrix<f64>,
}

impl ReducedLinearised<'_> {
    /// [`Linearised::respond`](crate::coupling::Linearised::respond).
    pub(super) fn respond_many(
        &self,
        twists: &DMatrix<f64>,
        x: &DVector<f64>,
    ) -> (DMatrix<f64>, Vec<Vec<Vec6>>) {
        if twists.iter().all(|x| *x == 0.0) {
            let still = vec![Vec6::zeros(); self.reduced.bodies.len()];
            return (twists.clone(), vec![still; twists.ncols()]);
        }
        let mut a = &self.solution * twists;
        self.factor.solve(view_mut(&mut a));
        let charges = self.charges(twists, &a);
        let mut wrenches = self.pull_back_pairs(&charges, &(&self.alpha * x));
        let other = &self.basis * x;
        for (twist, out) in twists.column_iter().zip(&mut wrenches) {
            self.films.add_wrenches(&twist.into_owned(), &other, out);
        }
        (self.impulses(twists, &a), wrenches)
    }

    /// The forces among the charges of every column of `x` and those of y: wrenches on the bodies.
    fn pull_back_pairs(&self, x: &DMatrix<f64>, y: &DVector<f64>) -> Vec<Vec<Vec6>> {
        let count = x.ncols();
        let columns = count + 1;
        let mut both = x.clone().insert_column(count, 0.0);
        both.set_column(count, y);
        let one = |placed: &PlacedSkeletons| -> Vec<(Vec6, Vec3)> {
            let link = placed.link;
            let (t, s) = (self.range(link.target), self.range(link.source));
            let bar = both.rows(t.start, t.len()).transpose();
            let mut field = vec![0.0; 3 * columns * s.len()];
            let (targets, sources) = (self.targets(placed), &placed.pair.points);
            potential_vjp(targets, sources, bar.as_slice(), columns, &mut field);
            let sums = (placed.fading())
                .then(|| placed.sums(&self.reduced.bodies, bar.as_slice(), columns));
            let strength = FLUX * link.factor;
            let charge = |j: usize, k: usize| both[(s.start + j, k)];
            let of = |k: usize| {
                let mut total = wrench(&placed.pair.positions, |j| {
                    let at = |k| vector(&field, columns, j, k);
                    let force = at(k) * charge(j, count) + at(count) * charge(j, k);
                    strength * placed.weight[0] * force
                });
                let force = linear(&total);
                if let Some(p) = &sums {
                    let pair = |j: usize| {
                        let p = &p[columns * j..columns * (j + 1)];
                        p[k] * charge(j, count) + p[count] * charge(j, k)
                    };
                    let energy: f64 = (0..s.len()).map(pair).sum();
                    let slope = strength * placed.weight[1] * energy;
                    let force = placed.between.normalize() * slope;
                    total += point_wrench(&placed.centre, &force);
                }
                (total, force)
            };
            (0..count).map(of).collect()
        };
        let wrenches = self.reduced.over(&self.placed, PULL * columns, one);
        let mut out = vec![vec![Vec6::zeros(); self.reduced.bodies.len()]; count];
        for (placed, wrenches) in self.placed.iter().zip(&wrenches) {
            for ((wrench, force), out) in wrenches.iter().zip(&mut out) {
                placed.apply(&self.poses, &self.films, (wrench, force), out);
            }
        }
        out
    }

    /// [`ReducedLinearised::second`] of one direction with itself along many displacements. What the charges' potentials are at the points, and how they bend there, is
    /// summed up once; bodies being rigid, a displacement combines it.
    pub(super) fn second_many(&self, x: &DVector<f64>, z: &[Vec<Vec6>]) -> Vec<Tangent> {
        let (alpha, twists) = (&self.alpha * x, &self.basis * x);
        let films: Vec<_> = z.iter().map(|z| self.films.along(z)).collect();
        let one = |placed: &PlacedSkeletons| self.bend(placed, &alpha, z, &films);
        let bent = self.reduced.over(&self.placed, TANGENT, one);
        let mut psi = DMatrix::zeros(alpha.len(), z.len());
        for (placed, bent) in self.placed.iter().zip(&bent) {
            let ends = [
                (placed.link.target, &bent.on_target),
                (placed.link.source, &bent.on_source),
            ];
            for (b, values) in ends {
                let mut rows = psi.rows_mut(self.range(b).start, values.nrows());
                rows += values;
            }
        }
        let (dalpha, dmomenta) = self.tangent_solution(&psi);
        let links: Vec<_> = self.placed.iter().zip(&bent).collect();
        let one = |(placed, bent): &(&PlacedSkeletons, &Bent)| {
            self.link_tangents(placed, bent, &alpha, &dalpha)
        };
        let parts = self.reduced.over(&links, TANGENT, one);
        let each = z.iter().enumerate().map(|(k, z)| {
            let links = parts.iter().map(|p| p[k]).collect::<Vec<_>>();
            let momenta = vec![dmomenta.column(k).into_owned()];
            self.gathered(z, &films[k], &links, &[&twists], momenta)
        });
        each.collect()
    }

    /// A link's part of the potentials along all displacements, and what they are combined from.
    fn bend(
        &self,
        placed: &PlacedSkeletons,
        alpha: &DVector<f64>,
        z: &[Vec<Vec6>],
        films: &[MovingFilms],
    ) -> Bent {
        let link = placed.link;
        let (t, s) = (self.range(link.target), self.range(link.source));
        let (at_target, at_source) = (&alpha.as_slice()[t.clone()], &alpha.as_slice()[s.clone()]);
        let (targets, points) = (self.targets(placed), &placed.pair.points);
        let positions = &placed.pair.positions;
        // Σ ∇P α and Σ ∇P α x, each component of ∇ by itself.
        let arms: Vec<f64> = (positions.iter().zip(at_source))
            .flat_map(|(x, a)| [*a, a * x.x, a * x.y, a * x.z])
            .collect();
        let along = [0, 1, 2].map(|c| vec![Vec3::ith(c, 1.0); s.len()]);
        let slopes = along.each_ref().map(|d| {
            let mut out = vec![0.0; 4 * t.len()];
            potential_jvp(targets, points, d, &arms, 4, &mut out);
            out
        });
        let mut field = vec![0.0; 3 * s.len()];
        potential_vjp(targets, points, at_target, 1, &mut field);
        let bends = along.each_ref().map(|d| {
            let mut out = vec![0.0; 3 * s.len()];
            potential_hvp(targets, points, d, at_target, 1, &mut out);
            out
        });
        let moved = z
            .iter()
            .zip(films)
            .map(|(z, films)| placed.moved(&self.poses, z, films));
        let moved: Vec<Moved> = moved.collect();
        let [w, dw, _] = placed.weight.map(|w| link.factor * w);
        let mut on_target = DMatrix::zeros(t.len(), z.len());
        let mut on_source = DMatrix::zeros(s.len(), z.len());
        for (k, moved) in moved.iter().enumerate() {
            let (u, o) = (moved.shifted, angular(&moved.local));
            for i in 0..t.len() {
                let g = |c: usize, part: usize| slopes[c][4 * i + part];
                let still: f64 = (0..3).map(|c| u[c] * g(c, 0)).sum();
                // (ω × x)·∇P.
                let turned = o.x * (g(2, 2) - g(1, 3))
                    + o.y * (g(0, 3) - g(2, 1))
                    + o.z * (g(1, 1) - g(0, 2));
                on_target[(i, k)] = w * (still + turned);
            }
            for (j, d) in moved.points.iter().enumerate() {
                on_source[(j, k)] = w * d.dot(&vector(&field, 1, j, 0));
            }
        }
        if placed.fading() {
            let p = placed.potentials(&self.reduced.bodies);
            for (i, row) in p.chunks_exact(s.len()).enumerate() {
                for (j, p) in row.iter().enumerate() {
                    for (k, moved) in moved.iter().enumerate() {
                        on_target[(i, k)] += dw * moved.rate * p * at_source[j];
                        on_source[(j, k)] += dw * moved.rate * p * at_target[i];
                    }
                }
            }
        }
        Bent {
            moved,
            field,
            bends,
            on_target,
            on_source,
        }
    }

    /// [`PlacedSkeletons::tangent`] along all displacements.
    fn link_tangents(
        &self,
        placed: &PlacedSkeletons,
        bent: &Bent,
        alpha: &DVector<f64>,
        dalpha: &DMatrix<f64>,
    ) -> Vec<([Vec6; 2], [Vec3; 2])> {
        let (link, count) = (placed.link, bent.moved.len());
        let (t, s) = (self.range(link.target), self.range(link.source));
        let changes = dalpha.rows(t.start, t.len()).transpose();
        let mut changed = vec![0.0; 3 * count * s.len()];
        let (targets, points) = (self.targets(placed), &placed.pair.points);
        potential_vjp(targets, points, changes.as_slice(), count, &mut changed);
        let sums = placed.fading().then(|| {
            let own = placed.sums(&self.reduced.bodies, &alpha.as_slice()[t.clone()], 1);
            (
                own,
                placed.sums(&self.reduced.bodies, changes.as_slice(), count),
            )
        });
        let each = bent.moved.iter().enumerate().map(|(k, moved)| {
            let of = |j: usize| {
                let (a, da) = (alpha[s.start + j], dalpha[(s.start + j, k)]);
                let e = vector(&bent.field, 1, j, 0);
                let d = &moved.points[j];
                let bends = (0..3).map(|c| vector(&bent.bends[c], 1, j, 0) * d[c]);
                let de = vector(&changed, count, j, k) + bends.sum::<Vec3>();
                let (p, dp) = sums
                    .as_ref()
                    .map_or((0.0, 0.0), |(p, dp)| (p[j], dp[count * j + k]));
                // Twice: the direction is paired with itself.
                PointTangent {
                    force: 2.0 * e * a,
                    dforce: 2.0 * (de * a + e * da),
                    energy: 2.0 * p * a,
                    denergy: 2.0 * (dp * a + p * da),
                }
            };
            placed.pushed(moved, of)
        });
        each.collect()
    }
}
