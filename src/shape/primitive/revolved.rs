//! Cylinders and capsules: rings about z.
//!
//! Ends: ring k (from the pole) has s·k vertices, so triangles stay near-equilateral down to the
//! pole and no fan of slivers appears; s = 6 suits a flat disc, s = 4 a hemisphere. Sides: an
//! even number of bands between rings that are rotated by half a step one after the other. Rings and bands of a cylinder shorter
//! than its radius are finer towards the edges, as those of a box.

use super::{Parts, graded, misfit};
use hydrograd_adjoint::lie::Vec3;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

/// A cylinder about z, centred at the origin (m), with about `target` faces (at least 36).
pub(in crate::shape) fn cylinder(radius: f64, length: f64, target: usize) -> Parts {
    let (rings, bands) = choose(6, radius, length, 1.0, target as f64);
    // Along a long side the flow is even, and the ends are a small part. By the shape alone: two meshes of one shape must be graded alike.
    let thin = length < radius;
    let along = |t: f64| if thin { graded(t) } else { t };
    let end = |k: usize| (radius * along(k as f64 / rings as f64), 0.0);
    revolve(6, rings, bands, (radius, length), end, along)
}

/// A capsule about z, centred at the origin, with `length` between the hemispheres (m), and
/// about `target` faces (at least 24).
pub(in crate::shape) fn capsule(radius: f64, length: f64, target: usize) -> Parts {
    let (rings, bands) = choose(4, radius, length, FRAC_PI_2, target as f64);
    let end = |k: usize| {
        if k == rings {
            return (radius, 0.0);
        }
        let angle = FRAC_PI_2 * k as f64 / rings as f64;
        (radius * angle.sin(), radius * angle.cos())
    };
    revolve(4, rings, bands, (radius, length), end, |t| t)
}

/// Loss of cross-section, as a part of it, that weighs as much as cells stretched e-fold.
const LOSS: f64 = 0.02;

/// Faces from which a mesh has a coarser one beside it, of half the rings and bands.
const HALVED: f64 = 400.0;
/// Pairs of bands for which half of an odd number isn't much like half. Sides that call for still less are of a thin body, to which they matter little.
const SHORT: Range<f64> = 0.25..4.0;
/// Rings from which half of an odd number is like half.
const MANY: usize = 12;

/// Rings of an end and bands of the side. `arc` is the length of the end's generatrix over the
/// radius. A slender body gets cells stretched along it rather than a coarse polygon for its
/// cross-section.
fn choose(sectors: usize, radius: f64, length: f64, arc: f64, target: f64) -> (usize, usize) {
    let s = sectors as f64;
    let mut best = (f64::INFINITY, (1, 2));
    let most = (target / (2.0 * s)).sqrt() as usize + 2;
    for rings in 1..=most {
        let m = rings as f64;
        // Height of equilateral triangles, a compromise with the end's spacing.
        let edge = TAU * radius / (s * m);
        let spacing = arc * radius / m;
        let height = (edge * 3f64.sqrt() / 2.0 * spacing).sqrt();
        // Area of the circle less that of the polygon in it, to leading order.
        let loss = (TAU / (s * m)).powi(2) / 6.0 / LOSS;
        let exact = (length / height / 2.0).max(1e-9);
        // Only where half of both makes a mesh do two meshes tell what the error of so short a side is.
        let short = target >= HALVED && SHORT.contains(&exact);
        if short && rings % 2 == 1 && rings < MANY {
            continue;
        }
        let even = if short { 2.0 } else { 1.0 };
        let whole = |half: f64| [(half / even).floor() * even, (half / even).ceil() * even];
        for half in whole(exact) {
            // What meets the count, for the same reason.
            let counted = (target / (2.0 * s * m) - m) / 2.0;
            for half in [[half; 2], whole(counted)].concat() {
                let half = half.max(even);
                let faces = 2.0 * s * m * (m + 2.0 * half);
                let stretch = if half == even && exact < even {
                    1.0
                } else {
                    half / exact
                };
                let cost = misfit(faces, target, &[stretch]) + loss * loss;
                // `as` saturates; a count that large has a hopeless cost.
                if cost < best.0 {
                    best = (cost, (rings, 2 * half as usize));
                }
            }
        }
    }
    best.1
}

/// The closed surface of a `(radius, length)`. `end(k)` gives radius and height above the side's end of ring k; `along` spaces the bands of
/// the side over −1 … 1.
fn revolve(
    sectors: usize,
    rings: usize,
    bands: usize,
    (radius, length): (f64, f64),
    end: impl Fn(usize) -> (f64, f64),
    along: impl Fn(f64) -> f64,
) -> Parts {
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    let around = sectors * rings;
    let direction = |revolution: f64| {
        let (sin, cos) = (TAU * revolution).sin_cos();
        Vec3::new(cos, sin, 0.0)
    };

    // Side, bottom to top; heights exactly odd about the middle.
    for j in 0..=bands {
        let half = (bands / 2) as f64;
        let z = length / 2.0 * along((j as f64 - half) / half);
        let shift = if j % 2 == 0 { 0.0 } else { 0.5 };
        for i in 0..around {
            let revolution = (i as f64 + shift) / around as f64;
            vertices.push(radius * direction(revolution) + Vec3::new(0.0, 0.0, z));
        }
    }
    for j in 0..bands {
        let [low, high] = [j * around, (j + 1) * around];
        for i in 0..around {
            let next = (i + 1) % around;
            if j % 2 == 0 {
                faces.push([low + i, low + next, high + i]);
                faces.push([low + next, high + next, high + i]);
            } else {
                faces.push([low + i, low + next, high + next]);
                faces.push([low + i, high + next, high + i]);
            }
        }
    }

    for top in [false, true] {
        let up = if top { 1.0 } else { -1.0 };
        let rim = if top { bands * around } else { 0 };
        let mut push = |r: f64, h: f64, revolution: f64| {
            vertices.push(r * direction(revolution) + Vec3::new(0.0, 0.0, up * (length / 2.0 + h)));
            vertices.len() - 1
        };
        // First vertex of each ring; the last ring is the rim of the side.
        let mut first = Vec::with_capacity(rings + 1);
        for k in 0..rings {
            let (r, h) = end(k);
            let count = (sectors * k).max(1);
            let mut start = None;
            for i in 0..count {
                let v = push(r, h, i as f64 / count as f64);
                start.get_or_insert(v);
            }
            first.extend(start);
        }
        first.push(rim);
        for k in 1..=rings {
            let (inner, outer) = ((sectors * (k - 1)).max(1), sectors * k);
            for sector in 0..sectors {
                for i in 0..k {
                    let out = |i: usize| first[k] + (sector * k + i) % outer;
                    let inn = |i: usize| first[k - 1] + (sector * (k - 1) + i) % inner;
                    let mut triangle = |[a, b, c]: [usize; 3]| {
                        faces.push(if top { [a, b, c] } else { [a, c, b] });
                    };
                    triangle([inn(i), out(i), out(i + 1)]);
                    if i + 1 < k {
                        triangle([inn(i), out(i + 1), inn(i + 1)]);
                    }
                }
            }
        }
    }
    (vertices, faces)
}
