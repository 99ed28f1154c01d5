//! Where everything is: points, bodies' centres, cells with their sizes.

use super::Scattering;
use super::cells::Cells;
use crate::adjoint::lie::{Pose, Vec3, Vec6, point_velocity};
use crate::adjoint::multipole::{Arithmetic, Number};
use crate::geometry::Image;
use num_dual::Dual64;

/// A vector of numbers that may carry derivatives.
pub(super) type Triple<T> = [T; 3];

#[inline(always)]
pub(super) fn minus<T: Arithmetic>(a: &Triple<T>, b: &Triple<T>) -> Triple<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn dot<T: Arithmetic>(a: &Triple<T>, b: &Triple<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn cross<T: Arithmetic>(a: &Triple<T>, b: &Triple<T>) -> Triple<T> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Adds `factor` times a vector.
#[inline(always)]
pub(super) fn add<T: Arithmetic>(out: &mut Triple<T>, factor: T, x: &Triple<T>) {
    for (out, x) in out.iter_mut().zip(x) {
        *out += *x * factor;
    }
}

/// All places in the world.
pub(super) struct Places<T> {
    /// Points of all bodies, one body after the other.
    pub points: [Vec<T>; 3],
    /// Of the cells: the mean of their bodies' centres.
    pub centres: Vec<Triple<T>>,
    /// Balls about these that hold all points: a little larger, and smooth in the places.
    pub radii: Vec<T>,
    /// Parts of the radii's sums of powers, that their gradient needs.
    sizes: Vec<f64>,
}

/// The power of the sum that stands for a maximum: 64 equal ones are 7 % too large.
const POWER: i32 = 64;

impl Places<f64> {
    /// Of bodies and of what mirrors show of them.
    pub fn new(model: &Scattering, poses: &[Pose]) -> Self {
        Self::shown(model, poses, |_, _, x| [x.x, x.y, x.z])
    }
}

impl Places<Dual64> {
    /// The same as each body is displaced by a spatial twist.
    pub fn moving(model: &Scattering, poses: &[Pose], z: &[Vec6]) -> Self {
        Self::shown(model, poses, |image, b, x| {
            let rate = point_velocity(&image.twist(&z[b]), &x);
            [0, 1, 2].map(|i| Dual64::new(x[i], rate[i]))
        })
    }
}

impl<T: Number> Places<T> {
    /// From what becomes of each place of an image of a body.
    fn shown(
        model: &Scattering,
        poses: &[Pose],
        of: impl Fn(&Image, usize, Vec3) -> Triple<T>,
    ) -> Self {
        let count = model.points.last().map_or(0, |last| last.end);
        let mut points = [0; 3].map(|_| Vec::with_capacity(count));
        let mut centres = Vec::with_capacity(model.points.len());
        for image in &model.images {
            for (b, (body, pose)) in model.bodies.iter().zip(poses).enumerate() {
                let parts = body.parts();
                let placed = |x: &Vec3| of(image, b, image.linear * pose.apply(x) + image.shift);
                for own in &parts.points {
                    for (out, x) in points.iter_mut().zip(placed(own)) {
                        out.push(x);
                    }
                }
                centres.push(placed(&parts.centre));
            }
        }
        Self::of(points, &centres, &model.sizes, &model.cells)
    }
}

impl<T: Number> Places<T> {
    fn of(points: [Vec<T>; 3], bodies: &[Triple<T>], sizes: &[f64], cells: &Cells) -> Self {
        let mut out = Self {
            points,
            centres: Vec::with_capacity(cells.cells.len()),
            radii: Vec::with_capacity(cells.cells.len()),
            sizes: sizes.to_vec(),
        };
        for i in 0..cells.cells.len() {
            let own = cells.bodies(i);
            let centre = match own {
                [b] => bodies[*b],
                _ => {
                    let mut sum = [T::constant(0.0); 3];
                    let one = T::constant(1.0 / own.len() as f64);
                    own.iter().for_each(|b| add(&mut sum, one, &bodies[*b]));
                    sum
                }
            };
            let radius = match own {
                [b] => T::constant(sizes[*b]),
                _ => {
                    // The unit drops out.
                    let reaches = own.iter().map(|b| out.reach(&centre, &bodies[*b], *b));
                    let reaches: Vec<T> = reaches.collect();
                    let most = reaches.iter().map(|r| r.value()).fold(0.0, f64::max);
                    let power = |r: &T| (*r * (1.0 / most)).power(POWER);
                    let sum = reaches
                        .iter()
                        .fold(T::constant(0.0), |sum, r| sum + power(r));
                    root(sum) * most
                }
            };
            out.centres.push(centre);
            out.radii.push(radius);
        }
        out
    }

    /// A point.
    pub fn point(&self, j: usize) -> Triple<T> {
        [0, 1, 2].map(|i| self.points[i][j])
    }

    /// How far body b reaches from a centre.
    fn reach(&self, centre: &Triple<T>, body: &Triple<T>, b: usize) -> T {
        length(&minus(body, centre)) + T::constant(self.sizes[b])
    }

    /// Adds to the bodies' centres what cotangents of the cells' centres and radii are there.
    pub fn pull_back(&self, cells: &Cells, centres: &[Triple<T>], radii: &[T]) -> Vec<Triple<T>> {
        let zero = T::constant(0.0);
        let mut centres = centres.to_vec();
        let mut out = vec![[zero; 3]; cells.leaf.len()];
        for (i, bar) in radii.iter().enumerate() {
            let own = cells.bodies(i);
            if own.len() < 2 {
                continue;
            }
            // r = (Σ eⁿ)^(1/n), e the reach: ∂r/∂arm = (e/r)ⁿ⁻¹ arm/|arm|.
            for b in own {
                let at = &self.centres[cells.leaf[*b]];
                let arm = minus(at, &self.centres[i]);
                let distance = length(&arm);
                if distance.value() == 0.0 {
                    continue;
                }
                let part = self.reach(&self.centres[i], at, *b) * self.radii[i].inverse();
                let slope = *bar * part.power(POWER - 1) * distance.inverse();
                add(&mut out[*b], slope, &arm);
                add(&mut centres[i], -slope, &arm);
            }
        }
        // Each body has an equal share of its cells' centres.
        let mut shares: Vec<Triple<T>> = Vec::with_capacity(centres.len());
        for (i, cell) in cells.cells.iter().enumerate() {
            let mut share = match i {
                0 => [zero; 3],
                _ => shares[cell.parent],
            };
            add(
                &mut share,
                T::constant(1.0 / cell.count as f64),
                &centres[i],
            );
            shares.push(share);
        }
        for (out, leaf) in out.iter_mut().zip(&cells.leaf) {
            add(out, T::constant(1.0), &shares[*leaf]);
        }
        out
    }
}

/// |x|, zero without a slope at zero.
pub(super) fn length<T: Number>(x: &Triple<T>) -> T {
    let square = dot(x, x);
    match square.value() > 0.0 {
        true => square.root(),
        false => T::constant(0.0),
    }
}

/// The root of [`POWER`].
fn root<T: Number>(x: T) -> T {
    (0..POWER.trailing_zeros()).fold(x, |x, _| x.root())
}
