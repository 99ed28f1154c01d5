//! A link at given poses: what charges at its ends see of each other, and what they pull with, with the tangents of both.

use super::ReducedBody;
use super::link::Link;
use super::views::{FLUX, interleave, view};
use crate::adjoint::kernel::{
    Points, Write, potential_fill, potential_hvp, potential_jvp, potential_sum, potential_vjp,
};
use crate::adjoint::lie::{Pose, Vec3, Vec6, linear, point_velocity, point_wrench, six};
use crate::coupling::film::{MovingFilms, PlacedFilms};
use crate::coupling::pair::{Pair, vector, wrench};
use faer::{Mat, MatRef};
use std::sync::Arc;

/// A link at given poses.
pub(in crate::coupling) struct PlacedSkeletons<'a> {
    pub link: &'a Link,
    pub pair: Pair,
    /// The source body's centre in the target's frame, less the target's.
    pub between: Vec3,
    pub centre: Vec3,
    /// Weight at the present distance, with two derivatives.
    pub weight: [f64; 3],
}

/// A link along a displacement.
pub(in crate::coupling) struct Moved {
    /// Of each source point as it is seen, in the target's frame relative to the target, m.
    pub points: Vec<Vec3>,
    /// Of the source body's own points.
    pub arms: Vec<Vec3>,
    /// Of the source body's centre.
    pub centre: Vec3,
    /// Rate of the distance of the centres.
    pub rate: f64,
    /// Of the source body against the target, in the target's frame.
    pub local: Vec6,
    /// Velocity of the point at its origin, with that of what is held off.
    pub shifted: Vec3,
}

/// What charges change of the potentials that they see of each other as a link's bodies are displaced.
pub(in crate::coupling) struct LinkTangent {
    /// `[point][column]`, of the target's points.
    pub on_target: Vec<f64>,
    /// Of the source's.
    pub on_source: Vec<f64>,
    /// ∇ of the potentials at the source's points that the target's charges make, `[point][column][3]`.
    pub field: Vec<f64>,
}

/// A column of charges at one end of a link, and how they change.
#[derive(Clone, Copy)]
pub(in crate::coupling) struct Charge<'c> {
    pub value: &'c [f64],
    pub rate: &'c [f64],
}

/// Of one source point of a link: the force on it, the energy that its weight fades, and their rates.
#[derive(Clone, Copy, Default)]
pub(in crate::coupling) struct PointTangent {
    pub force: Vec3,
    pub dforce: Vec3,
    pub energy: f64,
    pub denergy: f64,
}

impl Link {
    /// The link at the poses, unless it has faded out.
    pub(in crate::coupling) fn place(
        &self,
        bodies: &[Arc<ReducedBody>],
        poses: &[Pose],
        films: &PlacedFilms,
    ) -> Option<PlacedSkeletons<'_>> {
        let (t, s) = (self.target, self.source);
        let (centre, between, weight) = self.reach(bodies, poses);
        let points = &bodies[s].parts().points;
        (weight[0] > 0.0).then(|| PlacedSkeletons {
            link: self,
            pair: Pair::new((t, &poses[t]), (s, &poses[s]), &self.image, points).held_off(films),
            between,
            centre,
            weight,
        })
    }
}

impl PlacedSkeletons<'_> {
    /// Whether the weight changes at this distance.
    pub fn fading(&self) -> bool {
        self.weight[1] != 0.0 || self.weight[2] != 0.0
    }

    fn targets<'b>(&self, bodies: &'b [Arc<ReducedBody>]) -> &'b Points {
        bodies[self.link.target].targets()
    }

    /// P, target points × source points, row-major.
    pub fn potentials(&self, bodies: &[Arc<ReducedBody>]) -> Vec<f64> {
        let targets = self.targets(bodies);
        let stride = self.pair.points.len();
        let mut out = vec![0.0; targets.len() * stride];
        potential_fill(targets, &self.pair.points, Write::Set, &mut out, stride, 0);
        out
    }

    /// [L, Ū]ᵀ P [L, Ū]: (modes + 6) × (modes + 6).
    pub fn block(&self, bodies: &[Arc<ReducedBody>]) -> Mat<f64> {
        let (target, source) = (&bodies[self.link.target], &bodies[self.link.source]);
        let p = self.potentials(bodies);
        let p = MatRef::from_row_major_slice(&p, target.points(), source.points());
        let (left, right) = (view(target.basis()), view(source.basis()));
        let (m, n) = (left.ncols(), right.ncols());
        // The cheaper order of the two products.
        if target.points() * n <= source.points() * m {
            left.transpose() * (p * right)
        } else {
            (left.transpose() * p) * right
        }
    }

    /// `[j][k]: Σ_i bar[i][k] P_ij`.
    pub fn sums(&self, bodies: &[Arc<ReducedBody>], bar: &[f64], columns: usize) -> Vec<f64> {
        let mut out = vec![0.0; columns * self.pair.points.len()];
        let (targets, sources) = (self.targets(bodies), &self.pair.points);
        potential_sum(targets, sources, bar, columns, &mut out);
        out
    }

    /// 4π α_xᵀ δP α_y of charges at the target and at the source, each x and y: the wrench on the source, in the target's frame, and the force on its points alone.
    pub fn pull_back(
        &self,
        bodies: &[Arc<ReducedBody>],
        at_target: [&[f64]; 2],
        [x, y]: [&[f64]; 2],
    ) -> (Vec6, Vec3) {
        // Equal charges need one field.
        let same = at_target[0] == at_target[1] && x == y;
        let columns = if same { 1 } else { 2 };
        let bar = interleave(&at_target[..columns]);
        let n = x.len();
        let mut field = vec![0.0; 3 * columns * n];
        let (targets, sources) = (self.targets(bodies), &self.pair.points);
        potential_vjp(targets, sources, &bar, columns, &mut field);
        let strength = FLUX * self.link.factor;
        let last = columns - 1;
        let mut total = wrench(&self.pair.positions, |j| {
            let at = |k| vector(&field, columns, j, k);
            strength * self.weight[0] * (at(0) * y[j] + at(last) * x[j])
        });
        let force = linear(&total);
        if self.fading() {
            let p = self.sums(bodies, &bar, columns);
            let of = |j: usize| p[columns * j] * y[j] + p[columns * j + last] * x[j];
            let energy: f64 = (0..n).map(of).sum();
            let force = self.between.normalize() * (strength * self.weight[1] * energy);
            total += point_wrench(&self.centre, &force);
        }
        (total, force)
    }

    /// How it is displaced as the bodies are by spatial twists.
    pub fn moved(&self, poses: &[Pose], z: &[Vec6], films: &MovingFilms) -> Moved {
        let pose = &poses[self.link.target];
        let relative = self.pair.image.twist(&z[self.link.source]) - z[self.link.target];
        let local = pose.twist_to_body(&relative);
        let centre = point_velocity(&local, &self.centre);
        let rate = if self.fading() {
            self.between.normalize().dot(&centre)
        } else {
            0.0
        };
        let arms = self.pair.displacements(pose, z);
        let held = self.pair.moving(films);
        let shift = held.map_or(Vec3::zeros(), |(apart, film)| apart.rate(film));
        Moved {
            points: arms.iter().map(|d| d + shift).collect(),
            arms,
            centre,
            rate,
            local,
            shifted: linear(&local) + shift,
        }
    }

    /// `DP[Z] α` at both ends, a column for each of the charges there.
    pub fn tangent_potentials(
        &self,
        bodies: &[Arc<ReducedBody>],
        moved: &Moved,
        at_target: &[&[f64]],
        at_source: &[&[f64]],
    ) -> LinkTangent {
        let k = at_target.len();
        let (at_target, at_source) = (interleave(at_target), interleave(at_source));
        let (targets, points) = (self.targets(bodies), &self.pair.points);
        let n = points.len();
        let mut on_target = vec![0.0; k * targets.len()];
        potential_jvp(
            targets,
            points,
            &moved.points,
            &at_source,
            k,
            &mut on_target,
        );
        let mut field = vec![0.0; 3 * k * n];
        potential_vjp(targets, points, &at_target, k, &mut field);
        let mut on_source: Vec<f64> = (0..n)
            .flat_map(|j| (0..k).map(move |c| (j, c)))
            .map(|(j, c)| moved.points[j].dot(&vector(&field, k, j, c)))
            .collect();
        let [w, dw, _] = self.weight;
        let (w, dw) = (self.link.factor * w, self.link.factor * dw * moved.rate);
        on_target
            .iter_mut()
            .chain(&mut on_source)
            .for_each(|x| *x *= w);
        if self.fading() {
            let p = self.potentials(bodies);
            for (i, row) in p.chunks_exact(n).enumerate() {
                for (j, p) in row.iter().enumerate() {
                    for c in 0..k {
                        on_target[i * k + c] += dw * p * at_source[j * k + c];
                        on_source[j * k + c] += dw * p * at_target[i * k + c];
                    }
                }
            }
        }
        LinkTangent {
            on_target,
            on_source,
            field,
        }
    }

    /// The tangent of [`PlacedSkeletons::pull_back`] of the first with the last column, in the target's frame: wrench and its rate; and of the forces on the points alone.
    /// `field` is that of [`LinkTangent`].
    pub fn tangent(
        &self,
        bodies: &[Arc<ReducedBody>],
        (moved, field): (&Moved, &[f64]),
        at_target: &[Charge],
        at_source: &[Charge],
    ) -> ([Vec6; 2], [Vec3; 2]) {
        let (n, last) = (at_target.len(), at_target.len() - 1);
        let values: Vec<&[f64]> = at_target.iter().map(|c| c.value).collect();
        let changes: Vec<&[f64]> = at_target.iter().map(|c| c.rate).collect();
        let both = [&values[..], &changes].concat();
        let sums = match self.fading() {
            true => self.sums(bodies, &interleave(&both), 2 * n),
            false => Vec::new(),
        };
        let (values, changes) = (interleave(&values), interleave(&changes));
        let (targets, points) = (self.targets(bodies), &self.pair.points);
        // ∇ of the potentials of δx.., added to the tangent of that of x..
        let mut bent = vec![0.0; 3 * n * points.len()];
        potential_vjp(targets, points, &changes, n, &mut bent);
        potential_hvp(targets, points, &moved.points, &values, n, &mut bent);
        let of = |j: usize| {
            let mut out = PointTangent::default();
            for (x, y) in [(0, last), (last, 0)] {
                let (a, da) = (at_source[y].value[j], at_source[y].rate[j]);
                let e = vector(field, n, j, x);
                out.force += e * a;
                out.dforce += vector(&bent, n, j, x) * a + e * da;
                if !sums.is_empty() {
                    let p = &sums[2 * n * j..2 * n * (j + 1)];
                    out.energy += p[x] * a;
                    out.denergy += p[n + x] * a + p[x] * da;
                }
            }
            out
        };
        self.pushed(moved, of)
    }

    /// Adds its wrench, and what that does by way of what holds it apart, of which the second part is by forces on the points.
    pub fn apply(
        &self,
        poses: &[Pose],
        films: &PlacedFilms,
        (wrench, force): (&Vec6, &Vec3),
        out: &mut [Vec6],
    ) {
        self.pair.apply(&poses[self.link.target], wrench, out);
        if let Some((apart, film)) = self.pair.film(films) {
            film.apply(&apart.wrench(film, force), out);
        }
    }

    /// The tangent of [`PlacedSkeletons::apply`].
    pub fn apply_jvp(
        &self,
        poses: &[Pose],
        films: &MovingFilms,
        ([wrench, dwrench], [force, dforce]): ([&Vec6; 2], [&Vec3; 2]),
        z: &[Vec6],
        out: &mut [Vec6],
    ) {
        let t = self.link.target;
        (self.pair).apply_jvp(&poses[t], wrench, dwrench, &z[t], out);
        if let Some((apart, film)) = self.pair.moving(films) {
            let (w, dw) = apart.wrench_and_rate(film, [force, dforce]);
            film.apply_rate((&w, &dw), z, out);
        }
    }

    /// Wrench on the sources and its tangent, in the target's frame; and of the forces on the points alone.
    pub fn pushed(
        &self,
        moved: &Moved,
        of: impl Fn(usize) -> PointTangent,
    ) -> ([Vec6; 2], [Vec3; 2]) {
        let strength = FLUX * self.link.factor;
        let [weight, slope, bend] = self.weight.map(|w| strength * w);
        let (mut w, mut dw) = (Vec6::zeros(), Vec6::zeros());
        let (mut energy, mut denergy) = (0.0, 0.0);
        for (j, at) in self.pair.positions.iter().enumerate() {
            let point = of(j);
            let (f, df) = (point.force, point.dforce);
            energy += point.energy;
            denergy += point.denergy + f.dot(&moved.points[j]);
            let (force, dforce) = (weight * f, weight * df + slope * moved.rate * f);
            w += point_wrench(at, &force);
            dw += six(&dforce, &(moved.arms[j].cross(&force) + at.cross(&dforce)));
        }
        let forces = [linear(&w), linear(&dw)];
        if self.fading() {
            let distance = self.between.norm();
            let e = self.between / distance;
            let de = (moved.centre - e * moved.rate) / distance;
            let force = slope * energy * e;
            let dforce = (bend * moved.rate * energy + slope * denergy) * e + slope * energy * de;
            w += point_wrench(&self.centre, &force);
            dw += six(
                &dforce,
                &(moved.centre.cross(&force) + self.centre.cross(&dforce)),
            );
        }
        ([w, dw], forces)
    }
}
