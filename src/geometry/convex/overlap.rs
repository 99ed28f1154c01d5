//! How far two convex bodies that overlap must be shifted to part.
//!
//! A shift along a unit vector n, from the second to the first, parts them once it is as long as
//! −f(n) = n · (x₂ − x₁) with x₁ outermost along −n and x₂ along n. For polyhedra the shortest is along the normal of a face, or
//! across an edge of either; else it is looked for around many directions.

use super::field::perpendicular;
use super::nearest::Outermost;
use hydrograd_adjoint::lie::Vec3;
use std::f64::consts::TAU;

/// Directions around which a shorter shift is looked for.
const TRIED: usize = 6;
/// Rounds, in each of which a direction gets better or the steps shorter.
const ROUNDS: usize = 100;
/// Ways to go that are tried in a round, and how much shorter steps become where none is better.
const WAYS: usize = 12;
const SHORTER: f64 = 0.7;
/// Angle by which the steps turn from round to round, rad: along a ridge only few ways lead up.
const TURN: f64 = 0.7;

/// The largest f found, m, with its direction: among `seeds`, around the best of them, and around the
/// directions of a cube's faces, edges and corners.
pub(super) fn overlap(first: Outermost, second: Outermost, mut seeds: Vec<Vec3>) -> (f64, Vec3) {
    let height = |n: &Vec3| n.dot(&(first(&-n) - second(n)));
    let sides = [-1.0, 0.0, 1.0];
    let grid = sides.map(|x| sides.map(|y| sides.map(|z| Vec3::new(x, y, z))));
    seeds.extend(grid.iter().flatten().flatten());
    let unit = seeds.iter().filter_map(|n| n.try_normalize(1e-9));
    let mut found: Vec<(f64, Vec3)> = unit.map(|n| (height(&n), n)).collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(TRIED);
    for (value, n) in &mut found {
        let mut step: f64 = 0.3;
        for round in 0..ROUNDS {
            let u = perpendicular(n);
            let v = n.cross(&u);
            let mut better = None;
            for k in 0..WAYS {
                let (sin, cos) = (TURN * round as f64 + TAU * k as f64 / WAYS as f64).sin_cos();
                let tried = (*n + step * (cos * u + sin * v)).normalize();
                let there = height(&tried);
                if there > better.map_or(*value, |(best, _)| best) {
                    better = Some((there, tried));
                }
            }
            match better {
                Some(up) => (*value, *n) = up,
                None => step *= SHORTER,
            }
        }
    }
    let best = found.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    best.unwrap_or((0.0, Vec3::x()))
}
