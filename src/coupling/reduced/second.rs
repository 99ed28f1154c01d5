//! Second derivatives along one displacement: the tangent of the first.

use super::linearised::{ReducedLinearised, ReducedResponse};
use super::link::PlacedSkeletons;
use super::views::{FLUX, interleave};
use crate::adjoint::kernel::{potential_hvp, potential_jvp, potential_vjp};
use crate::adjoint::lie::{Vec3, Vec6, linear, point_velocity, point_wrench, six};
use crate::coupling::film::MovingFilms;
use crate::coupling::pair::vector;
use crate::coupling::{Direction, Tangent};
use nalgebra::{DMatrix, DVector};

/// Work per pair of points, relative to that of the first derivative.
pub(super) const TANGENT: usize = 3;

/// A link along a displacement.
pub(super) struct Moved {
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

impl ReducedLinearised<'_> {
    pub(super) fn moved(&self, placed: &PlacedSkeletons, z: &[Vec6], films: &MovingFilms) -> Moved {
        let pose = &self.poses[placed.link.target];
        let relative = placed.pair.image.twist(&z[placed.link.source]) - z[placed.link.target];
        let local = pose.twist_to_body(&relative);
        let centre = point_velocity(&local, &placed.centre);
        let rate = if placed.fading() {
            placed.between.normalize().dot(&centre)
        } else {
            0.0
        };
        let arms = placed.pair.displacements(pose, z);
        let held = placed.pair.moving(films);
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

    /// `DG[Z] α` at all points, a column for each of `alpha`; and of each link what the second derivative
    /// takes from there.
    pub(super) fn tangent_potentials(
        &self,
        alpha: &[&[f64]],
        z: &[Vec6],
        films: &MovingFilms,
    ) -> (DMatrix<f64>, Vec<(Moved, Vec<f64>)>) {
        let k = alpha.len();
        let one = |placed: &PlacedSkeletons| {
            let link = placed.link;
            let (t, s) = (self.range(link.target), self.range(link.source));
            let moved = self.moved(placed, z, films);
            let part = |range: &std::ops::Range<usize>| {
                let columns: Vec<&[f64]> = alpha.iter().map(|a| &a[range.clone()]).collect();
                interleave(&columns)
            };
            let (at_target, at_source) = (part(&t), part(&s));
            let (targets, points) = (self.targets(placed), &placed.pair.points);
            let mut on_target = vec![0.0; k * t.len()];
            let d = &moved.points;
            potential_jvp(targets, points, d, &at_source, k, &mut on_target);
            let mut field = vec![0.0; 3 * k * s.len()];
            potential_vjp(targets, points, &at_target, k, &mut field);
            let mut on_source: Vec<f64> = (0..s.len())
                .flat_map(|j| (0..k).map(move |c| (j, c)))
                .map(|(j, c)| moved.points[j].dot(&vector(&field, k, j, c)))
                .collect();
            let [w, dw, _] = placed.weight;
            let (w, dw) = (link.factor * w, link.factor * dw * moved.rate);
            on_target
                .iter_mut()
                .chain(&mut on_source)
                .for_each(|x| *x *= w);
            if placed.fading() {
                let p = placed.potentials(&self.reduced.bodies);
                for (i, row) in p.chunks_exact(s.len()).enumerate() {
                    for (j, p) in row.iter().enumerate() {
                        for c in 0..k {
                            on_target[i * k + c] += dw * p * at_source[j * k + c];
                            on_source[j * k + c] += dw * p * at_target[i * k + c];
                        }
                    }
                }
            }
            ((on_target, on_source), (moved, field))
        };
        let parts = self.reduced.over(&self.placed, TANGENT, one);
        let mut out = DMatrix::zeros(alpha.first().map_or(0, |a| a.len()), k);
        let mut add = |b: usize, values: &[f64]| {
            let from = self.range(b).start;
            for (i, row) in values.chunks_exact(k).enumerate() {
                for (c, x) in row.iter().enumerate() {
                    out[(from + i, c)] += x;
                }
            }
        };
        let mut kept = Vec::with_capacity(parts.len());
        for (placed, ((on_target, on_source), seen)) in self.placed.iter().zip(parts) {
            add(placed.link.target, &on_target);
            add(placed.link.source, &on_source);
            kept.push(seen);
        }
        (out, kept)
    }

    pub(super) fn second(&self, x: Direction, y: Direction, z: &[Vec6]) -> Tangent {
        let directions = Direction::distinct(x, y);
        let responses: Vec<_> = directions.into_iter().map(|x| self.respond(x)).collect();
        let n = responses.len();
        let alpha: Vec<&[f64]> = responses.iter().map(|r| r.alpha.as_slice()).collect();
        let films = self.films.along(z);
        let (psi, seen) = self.tangent_potentials(&alpha, z, &films);
        let (dalpha, dmomenta) = self.tangent_solution(&psi);
        let links: Vec<_> = self.placed.iter().zip(&seen).collect();
        let one = |(placed, seen): &(&PlacedSkeletons, &(Moved, Vec<f64>))| {
            self.link_tangent(placed, seen, &responses, &dalpha)
        };
        let parts = self.reduced.over(&links, TANGENT, one);
        let momenta = (0..n).map(|k| dmomenta.column(k).into_owned()).collect();
        let twists: Vec<_> = responses.iter().map(|r| &r.twists).collect();
        self.gathered(z, &films, &parts, &twists, momenta)
    }

    /// All links and films along one displacement, for one or two directions' twists.
    pub(super) fn gathered(
        &self,
        z: &[Vec6],
        films: &MovingFilms,
        links: &[([Vec6; 2], [Vec3; 2])],
        twists: &[&DVector<f64>],
        mut momenta: Vec<DVector<f64>>,
    ) -> Tangent {
        let n = twists.len();
        let mut gradient = vec![Vec6::zeros(); self.reduced.bodies.len()];
        let mut wrench = gradient.clone();
        for (placed, ([w, dw], [f, df])) in self.placed.iter().zip(links) {
            let t = placed.link.target;
            let pose = &self.poses[t];
            self.apply(placed, w, f, &mut gradient);
            placed.pair.apply_jvp(pose, w, dw, &z[t], &mut wrench);
            if let Some((apart, film)) = placed.pair.moving(films) {
                let (w, dw) = apart.wrench_and_rate(film, [f, df]);
                film.apply_rate((&w, &dw), z, &mut wrench);
            }
        }
        films.add_tangent(twists, z, (&mut gradient, &mut wrench), &mut momenta);
        Tangent {
            momentum_x: momenta[0].clone(),
            momentum_y: momenta.swap_remove(n - 1),
            gradient,
            wrench,
        }
    }

    /// Wrench on the sources of a link and its tangent, in the target's frame; and of the forces on its points alone.
    pub(super) fn link_tangent(
        &self,
        placed: &PlacedSkeletons,
        (moved, field): &(Moved, Vec<f64>),
        responses: &[ReducedResponse],
        dalpha: &DMatrix<f64>,
    ) -> ([Vec6; 2], [Vec3; 2]) {
        let (n, last) = (responses.len(), responses.len() - 1);
        let link = placed.link;
        let (t, s) = (self.range(link.target), self.range(link.source));
        let column = |k: usize, range: &std::ops::Range<usize>| -> (Vec<f64>, Vec<f64>) {
            let tangent = dalpha.column(k).rows(range.start, range.len()).into_owned();
            (
                responses[k].alpha.as_slice()[range.clone()].to_vec(),
                tangent.as_slice().to_vec(),
            )
        };
        let at_target: Vec<_> = (0..n).map(|k| column(k, &t)).collect();
        let at_source: Vec<_> = (0..n).map(|k| column(k, &s)).collect();
        let values: Vec<&[f64]> = at_target.iter().map(|c| c.0.as_slice()).collect();
        let changes: Vec<&[f64]> = at_target.iter().map(|c| c.1.as_slice()).collect();
        let both = [&values[..], &changes].concat();
        let sums = match placed.fading() {
            true => self.sums(placed, &interleave(&both), 2 * n),
            false => Vec::new(),
        };
        let (values, changes) = (interleave(&values), interleave(&changes));
        let (targets, points) = (self.targets(placed), &placed.pair.points);
        // ∇ of the potentials of δx.., added to the tangent of that of x..
        let mut bent = vec![0.0; 3 * n * s.len()];
        potential_vjp(targets, points, &changes, n, &mut bent);
        potential_hvp(targets, points, &moved.points, &values, n, &mut bent);
        let of = |j: usize| {
            let mut out = PointTangent::default();
            for (x, y) in [(0, last), (last, 0)] {
                let (a, da) = (at_source[y].0[j], at_source[y].1[j]);
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
        placed.pushed(moved, of)
    }
}

/// Of one source point of a link: the force on it, the energy that its weight fades, and their rates.
#[derive(Clone, Copy, Default)]
pub(super) struct PointTangent {
    pub force: Vec3,
    pub dforce: Vec3,
    pub energy: f64,
    pub denergy: f64,
}

impl PlacedSkeletons<'_> {
    /// Wrench on the sources and its tangent, in the target's frame; and of the forces on the points alone.
    pub(super) fn pushed(
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
