//! The nearest points of two convex bodies that are known by their outermost points.
//!
//! The differences of their points make a convex body too, and the distance is that of its nearest point v
//! to the origin. v is found among simplices of outermost points: the one in the direction −v joins, and those that the
//! new nearest point doesn't need leave. With n = v/|v| the distance lies between n · w, w outermost
//! along −n, and |v|: that says when to stop.
//!
//! # References
//! E. G. Gilbert, D. W. Johnson, S. S. Keerthi, "A fast procedure for computing the distance between
//! complex objects in three-dimensional space", IEEE J. Robot. Autom. 4 (1988) 193.

use hydrograd_adjoint::lie::{Mat3, Vec3};

/// Rounds, at most: polyhedra take about ten, curved bodies up to fifty.
const ROUNDS: usize = 200;
/// Distance that counts as none, of the bodies' size.
pub(super) const TOUCHING: f64 = 1e-13;
/// Square of the sine of an angle below which a triangle is a line.
const FLAT: f64 = 1e-28;

/// Outermost point of a body in a direction of any length.
pub(super) type Outermost<'a> = &'a dyn Fn(&Vec3) -> Vec3;

/// Nearest points of bodies that are apart.
pub(crate) struct Nearest {
    /// m; above zero.
    pub distance: f64,
    /// Unit vector from the second to the first.
    pub normal: Vec3,
    /// Of the first and the second, m.
    pub points: [Vec3; 2],
}

/// A difference of two outermost points.
#[derive(Clone, Copy)]
struct Corner {
    difference: Vec3,
    points: [Vec3; 2],
}

/// Corners with their parts of the nearest point, which is given as well.
struct Simplex {
    corners: Vec<(Corner, f64)>,
    nearest: Vec3,
}

/// None if they overlap or are nearer than [`TOUCHING`] of `size`. `start` leads from the second to the first, roughly.
pub(super) fn nearest(
    first: Outermost,
    second: Outermost,
    start: &Vec3,
    size: f64,
) -> Option<Nearest> {
    let towards = |v: &Vec3| {
        let points = [first(&-v), second(v)];
        Corner {
            difference: points[0] - points[1],
            points,
        }
    };
    let corner = towards(start);
    let mut simplex = Simplex {
        nearest: corner.difference,
        corners: vec![(corner, 1.0)],
    };
    for _ in 0..ROUNDS {
        let distance = simplex.nearest.norm();
        if distance <= TOUCHING * size {
            return None;
        }
        let normal = simplex.nearest / distance;
        let corner = towards(&normal);
        let left = distance - normal.dot(&corner.difference);
        let known = |(c, _): &(Corner, f64)| c.difference == corner.difference;
        if left <= f64::EPSILON * size || simplex.corners.iter().any(known) {
            break;
        }
        let joined = join(corner, &simplex.corners)?;
        // Rounding: no nearer point than this one.
        if joined.nearest.norm_squared() >= simplex.nearest.norm_squared() {
            break;
        }
        simplex = joined;
    }
    let distance = simplex.nearest.norm();
    let point = |k: usize| {
        let parts = simplex.corners.iter();
        parts.map(|(c, part)| *part * c.points[k]).sum()
    };
    (distance > TOUCHING * size).then(|| Nearest {
        distance,
        normal: simplex.nearest / distance,
        points: [point(0), point(1)],
    })
}

/// The part of the simplex of a new corner and old ones that has the nearest point to the origin; none if the origin
/// is inside.
fn join(new: Corner, old: &[(Corner, f64)]) -> Option<Simplex> {
    let p = new.difference;
    let mut best = Simplex {
        nearest: p,
        corners: vec![(new, 1.0)],
    };
    let mut take = |nearest: Vec3, corners: &[(Corner, f64)]| {
        if nearest.norm_squared() < best.nearest.norm_squared() {
            best = Simplex {
                nearest,
                corners: corners.to_vec(),
            };
        }
    };
    let way = |k: usize| old[k].0.difference - p;
    for i in 0..old.len() {
        let e = way(i);
        let t = -p.dot(&e) / e.norm_squared();
        if t > 0.0 && t <= 1.0 {
            take(p + t * e, &[(new, 1.0 - t), (old[i].0, t)]);
        }
        for j in i + 1..old.len() {
            let f = way(j);
            let up = e.cross(&f);
            let square = up.norm_squared();
            if square <= FLAT * e.norm_squared() * f.norm_squared() {
                continue;
            }
            let (s, t) = (f.cross(&p).dot(&up) / square, p.cross(&e).dot(&up) / square);
            if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
                // A point of the simplex even where a thin one has no plane to rounding.
                let foot = p + s * e + t * f;
                let parts = [(new, 1.0 - s - t), (old[i].0, s), (old[j].0, t)];
                take(foot, &parts);
            }
        }
    }
    if old.len() == 3 {
        let sides = Mat3::from_columns(&[way(0), way(1), way(2)]);
        let parts = sides.try_inverse().map(|m| m * -p);
        if parts.is_some_and(|l| l.iter().all(|x| *x > 0.0) && l.sum() < 1.0) {
            return None;
        }
    }
    Some(best)
}
