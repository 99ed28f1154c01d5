//! A cylinder against walls and cores.
//!
//! - Each rim: its lowest point, and points that stay in place ([`super::rim`]).
//! - Each corner of the core in the cylinder's signed distance.
//! - Each edge of the core that passes over an end: where it comes over the rim ([`super::over_rim`]).
//! - The edge of a capsule that passes level over a rim along its tangent.
//! - Each edge of the core across the cylinder's side, which is as far as the axis less the radius.
//!
//! A ball has its centre alone.

use super::core_core::{self, DEPTH, END, crossing};
use super::over_rim::{Rim, edge_over, tangent_over};
use super::point::ContactPoint;
use super::rim::{self, SIDES, axis};
use super::sunk::sunk;
use super::{plane, round_core, weight};
use crate::geometry::HalfSpace;
use crate::geometry::convex::{AtCorner, Core, Cylinder, Edge};
use hydrograd_adjoint::lie::{Pose, Vec3};

/// The points against a wall.
pub(super) fn against_plane(cylinder: &Cylinder, at: &Pose, wall: &HalfSpace) -> Vec<ContactPoint> {
    let end = |side| {
        let found = plane::lowest(&cylinder.disc(), &cylinder.end(at, side), wall);
        rim::lowest(at, found)
    };
    let mut out: Vec<_> = SIDES.into_iter().filter_map(end).collect();
    let field = |x: &Vec3, _: &[Vec3; 2]| Some(AtCorner::flat(wall.height(x), wall.normal));
    let shell = END * thickness(cylinder);
    out.extend(rim::standing(cylinder, at, [0.0, shell], field));
    out
}

/// All points with a gap below `reach`; the cylinder is the first body.
pub(super) fn contacts(
    a: &Cylinder,
    a_at: &Pose,
    b: &Core,
    b_at: &Pose,
    reach: f64,
) -> Vec<ContactPoint> {
    let mut out = Vec::new();
    let thin = thickness(a).min(b.thickness);
    let (depth, shell) = (DEPTH * thin, END * thin);
    let edges = near_edges(a, a_at, b, b_at, reach);
    if !b.is_ball() {
        for side in SIDES {
            let end = a.end(a_at, side);
            let apart = round_core::contact(&a.disc(), &end, b, b_at, reach);
            let apart = apart.filter(|p| p.normal.cross(&axis(a_at)).norm() > FLAT);
            // The disc meets an edge that has sunk into the rim nowhere but in itself.
            let found = match apart {
                Some(found) if found.gap > 0.0 => vec![found],
                other => {
                    let overlapping = other.filter(|p| p.gap < 0.0);
                    let overlapping = overlapping.map(|p| rim::shallow(p, depth));
                    let rim = Rim::new(a, a_at, side);
                    let sunk = edges.iter().flat_map(|e| sunk(&rim, e, b.radius, depth));
                    weight::in_turn(sunk.chain(overlapping).collect())
                }
            };
            out.extend(found.into_iter().filter_map(|p| rim::lowest(a_at, p)));
        }
    }
    if !b.faces.is_empty() {
        let to_b = |x: &Vec3| b_at.apply_inverse(x);
        let field = |x: &Vec3, into: &[Vec3; 2]| {
            let into = into.map(|d| b_at.rotation.tr_mul(&d));
            let found = b.field_of_corner(&to_b(x), &into, reach + b.radius)?;
            Some(found.rotated(&b_at.rotation))
        };
        out.extend(rim::standing(a, a_at, [b.radius, shell], field));
    }
    let field = |y: &Vec3, into: &[Vec3]| Some(a.field_of_corner(y, into));
    core_core::corners(b, b_at, (&field, 0.0), a_at, [reach, shell], |p| {
        out.push(p.swapped())
    });
    let side = line(a, a_at);
    for edge in &edges {
        for end in SIDES {
            let rim = Rim::new(a, a_at, end);
            let found = edge_over(edge, b.radius, &rim, reach, depth);
            out.extend(found.into_iter().flatten().map(ContactPoint::swapped));
            if edge.inward.is_none() {
                let found = tangent_over(edge, [b.radius, 0.0], &rim, reach, depth);
                out.extend(found.map(ContactPoint::swapped));
            }
        }
        let radii = [a.radius, b.radius];
        out.extend(crossing(&side, edge, radii, a.radius, depth));
    }
    out.retain(|p| p.gap < reach && p.weight > 0.0);
    out
}

/// Sine of the angle between a normal and the axis below which they are the same to rounding.
const FLAT: f64 = 1e-9;

/// The smallest width.
pub(super) fn thickness(cylinder: &Cylinder) -> f64 {
    2.0 * cylinder.radius.min(cylinder.half)
}

/// The axis as an edge, world frame.
pub(super) fn line(cylinder: &Cylinder, at: &Pose) -> Edge {
    let edge = Edge {
        from: Vec3::new(0.0, 0.0, -cylinder.half),
        along: Vec3::z(),
        length: 2.0 * cylinder.half,
        inward: None,
    };
    edge.placed(at)
}

/// Edges of the core that may be nearer to the cylinder than `reach`, world frame.
fn near_edges(a: &Cylinder, a_at: &Pose, b: &Core, b_at: &Pose, reach: f64) -> Vec<Edge> {
    let around = a.radius.hypot(a.half) + b.radius + reach;
    let near = |edge: &Edge| {
        let offset = a_at.translation - edge.from;
        let s = offset.dot(&edge.along).clamp(0.0, edge.length);
        (offset - s * edge.along).norm() <= around
    };
    let placed = b.edges.iter().map(|edge| edge.placed(b_at));
    placed.filter(near).collect()
}
