//! A cylinder and another, or an ellipsoid.
//!
//! Two cylinders: of each, the point of either rim nearest to the other and the points of the rims that stay in place
//! ([`super::rim`]), and where its rims, and its side lying across, come over those of the other ([`super::over_rim`]); and where the two cross side
//! to side. An ellipsoid has the one point of its common normal with an end, a rim or the side.

use super::core_core::{DEPTH, END, crossing};
use super::cylinder::{line, thickness};
use super::over_rim::{Rim, rim_over, side_over, tangent_over};
use super::plane;
use super::point::ContactPoint;
use super::rim::{self, SIDES, axis};
use super::round_core::{SLACK, on_edge};
use super::round_pair::{self, FARTHEST};
use crate::geometry::HalfSpace;
use crate::geometry::convex::{Cylinder, Disc, Edge, Ellipsoid, Round, Support, common_normal};
use hydrograd_adjoint::lie::{Pose, Vec3};

/// Sine of the angle between a normal and a disc's axis below which they are the same to rounding.
const FLAT: f64 = 1e-9;

/// Parts of the thinner cylinder's thickness by which discs are drawn in to where they are apart.
const DRAWN_IN: [f64; 4] = [0.25, 0.1, 0.02, 0.004];

/// Outermost points, world frame.
type Outermost<'a> = &'a dyn Fn(&Vec3) -> Support;

/// The outermost point of a cylinder: of the end that the direction leads to.
fn outermost(c: &Cylinder, at: &Pose, direction: &Vec3) -> Support {
    let side = 1f64.copysign(direction.dot(&axis(at)));
    c.disc().support(&c.end(at, side), direction)
}

/// How far a step may lead from a normal, rad: short of the axis, along which a disc's outermost points are many.
fn short_of(normal: &Vec3, at: &Pose) -> f64 {
    FARTHEST.min(0.7 * normal.cross(&axis(at)).norm())
}

/// All points of two cylinders with a gap below `reach`.
pub(super) fn contacts(
    a: &Cylinder,
    a_at: &Pose,
    b: &Cylinder,
    b_at: &Pose,
    reach: f64,
) -> Vec<ContactPoint> {
    let mut out = rims(a, a_at, b, b_at, reach);
    let theirs = rims(b, b_at, a, a_at, reach).into_iter();
    out.extend(theirs.map(ContactPoint::swapped));
    let radii = [a.radius, b.radius];
    let depth = DEPTH * thickness(a).min(thickness(b));
    let shell = a.radius + b.radius;
    let (first, second) = (line(a, a_at), line(b, b_at));
    out.extend(crossing(&first, &second, radii, shell, depth));
    // A side that lies across an end, whose rims stand out on both sides.
    for side in SIDES {
        let over = |axis: &Edge, radius: f64, rim: &Rim| {
            let crossing = side_over(axis, radius, rim, reach, depth);
            let tangent = tangent_over(axis, [radius; 2], rim, reach, depth);
            crossing.into_iter().chain([tangent]).flatten()
        };
        out.extend(over(&first, a.radius, &Rim::new(b, b_at, side)));
        let theirs = over(&second, b.radius, &Rim::new(a, a_at, side));
        out.extend(theirs.map(ContactPoint::swapped));
    }
    out.retain(|p| p.gap < reach && p.weight > 0.0);
    out
}

/// The points of the rims of the first.
fn rims(a: &Cylinder, a_at: &Pose, b: &Cylinder, b_at: &Pose, reach: f64) -> Vec<ContactPoint> {
    let near = SIDES.into_iter();
    let depth = DEPTH * thickness(a).min(thickness(b));
    let near = near.filter_map(|side| {
        let found = nearest(a, a_at, side, b, b_at, reach)?;
        rim::lowest(a_at, rim::shallow(found, depth))
    });
    let mut out: Vec<ContactPoint> = near.collect();
    let field = |x: &Vec3, into: &[Vec3; 2]| {
        let into = into.map(|d| b_at.rotation.tr_mul(&d));
        let found = b.field_of_corner(&b_at.apply_inverse(x), &into);
        Some(found.rotated(&b_at.rotation))
    };
    let shell = END * thickness(a).min(thickness(b));
    out.extend(rim::standing(a, a_at, [0.0, shell], field));
    for side in SIDES {
        for other in SIDES {
            let (ours, theirs) = (Rim::new(a, a_at, side), Rim::new(b, b_at, other));
            out.extend(rim_over(&ours, &theirs, reach, depth).into_iter().flatten());
        }
    }
    out
}

/// Of the common normals found with parts of a body: that of the largest signed distance.
struct Best(Option<ContactPoint>);

impl Best {
    fn take(&mut self, found: ContactPoint) {
        if self.0.as_ref().is_none_or(|best| found.gap > best.gap) {
            self.0 = Some(found);
        }
    }

    /// Apart, and so the nearest of all.
    fn is_apart(&self) -> bool {
        self.0.as_ref().is_some_and(|best| best.gap >= 0.0)
    }
}

/// The end of a cylinder as a plane.
fn end_plane(b: &Cylinder, b_at: &Pose, side: f64) -> HalfSpace {
    HalfSpace {
        point: b.end(b_at, side).translation,
        normal: side * axis(b_at),
    }
}

/// Whether a contact over an end is one: the point lies over it, or under it and within the body.
fn over_end(b: &Cylinder, b_at: &Pose, found: &ContactPoint) -> bool {
    let y = b_at.apply_inverse(&found.position);
    y.x.hypot(y.y) <= b.radius * (1.0 + SLACK) && found.gap > -2.0 * b.half
}

/// The axis of a cylinder in its frame, as an edge.
fn side_line(b: &Cylinder) -> Edge {
    line(b, &Pose::identity())
}

/// The disc at an end, drawn inward by `within`, and where it is.
fn drawn_in(c: &Cylinder, at: &Pose, side: f64, within: f64) -> (Disc, Pose) {
    let smaller = Cylinder {
        radius: c.radius - within,
        half: c.half - within,
    };
    (smaller.disc(), smaller.end(at, side))
}

/// The point of the rim at one end of the first cylinder nearest to the second.
fn nearest(
    a: &Cylinder,
    a_at: &Pose,
    side: f64,
    b: &Cylinder,
    b_at: &Pose,
    reach: f64,
) -> Option<ContactPoint> {
    let (disc, end) = (a.disc(), a.end(a_at, side));
    let mut best = Best(None);
    for other in SIDES {
        let found = plane::lowest(&disc, &end, &end_plane(b, b_at, other));
        if over_end(b, b_at, &found) {
            best.take(found);
        }
    }
    if !best.is_apart() {
        if let Some((still, moving)) = on_edge(&disc, &end, &side_line(b), b_at, b.radius)
            && still.normal.dot(&axis(b_at)).abs() <= SLACK
        {
            best.take(moving.swapped());
        }
        for other in SIDES {
            let there = b.end(b_at, other);
            let size = a.radius + b.radius;
            if (end.translation - there.translation).norm() - size >= reach {
                continue;
            }
            let level = |n: &Vec3, at: &Pose| n.cross(&axis(at)).norm() <= FLAT;
            let found = |normal: Vec3, first: Outermost, second: Outermost| {
                let slanting = Some(normal).filter(|n| !level(n, a_at) && !level(n, b_at))?;
                let most = |n: &Vec3| short_of(n, a_at).min(short_of(n, b_at));
                let found = round_pair::contact(first, second, most, size, slanting).ok()?;
                let out_of_b = found.normal.dot(&(other * axis(b_at)));
                let into_a = found.normal.dot(&(side * axis(a_at)));
                let faces = out_of_b >= -SLACK && (found.gap >= 0.0 || into_a <= SLACK);
                faces.then_some(found)
            };
            let apart = common_normal((&disc, &end), (&b.disc(), &there), size);
            let point = match apart {
                Some(normal) => found(normal, &|n| disc.support(&end, n), &|n| {
                    b.disc().support(&there, n)
                }),
                // From smaller ones further in, which are apart.
                None => DRAWN_IN.into_iter().find_map(|part| {
                    let within = part * thickness(a).min(thickness(b));
                    let (first, first_at) = drawn_in(a, a_at, side, within);
                    let (second, second_at) = drawn_in(b, b_at, other, within);
                    let normal = common_normal((&first, &first_at), (&second, &second_at), size)?;
                    found(normal, &|n| outermost(a, a_at, n), &|n| {
                        outermost(b, b_at, n)
                    })
                }),
            };
            if let Some(point) = point {
                best.take(point);
            }
        }
    }
    best.0.filter(|p| p.gap < reach)
}

/// The point of contact of an ellipsoid, the first body, and a cylinder if its gap is below `reach`. Deep inside, where
/// no part has a common normal, it is that of the end with the least overlap.
pub(super) fn ellipsoid(
    a: &Ellipsoid,
    a_at: &Pose,
    b: &Cylinder,
    b_at: &Pose,
    reach: f64,
) -> Option<ContactPoint> {
    let (mut best, mut highest, mut left_out) = (Best(None), Best(None), false);
    for side in SIDES {
        let found = plane::lowest(a, a_at, &end_plane(b, b_at, side));
        if over_end(b, b_at, &found) {
            best.take(found.clone());
        }
        highest.take(found);
    }
    if !best.is_apart() {
        if let Some((_, moving)) = on_edge(a, a_at, &side_line(b), b_at, b.radius) {
            best.take(moving.swapped());
        }
        for side in SIDES {
            let (disc, end) = (b.disc(), b.end(b_at, side));
            let size = a.semi_axes.max() + b.radius;
            if (end.translation - a_at.translation).norm() - size >= reach {
                left_out = true;
                continue;
            }
            let normal = common_normal((a, a_at), (&disc, &end), size).or_else(|| {
                let (inner, there) = drawn_in(b, b_at, side, DRAWN_IN[0] * thickness(b));
                common_normal((a, a_at), (&inner, &there), size)
            });
            let normal = normal.unwrap_or_else(|| {
                end.rotation * disc.field(&end.apply_inverse(&a_at.translation)).gradient
            });
            if normal.cross(&axis(b_at)).norm() <= FLAT {
                continue;
            }
            let first = |n: &Vec3| a.support(a_at, n);
            let second = |n: &Vec3| disc.support(&end, n);
            if let Ok(found) =
                round_pair::contact(first, second, |n| short_of(n, b_at), size, normal)
                && found.normal.dot(&(side * axis(b_at))) >= -SLACK
            {
                best.take(found);
            }
        }
    }
    if best.0.is_none() && !left_out {
        best = highest;
    }
    best.0.filter(|p| p.gap < reach)
}
