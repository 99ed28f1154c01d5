//! An ellipsoid or a disc, and a core: the one point of their common normal.
//!
//! With n from the core to the ellipsoid, the signed distance of two convex bodies is the largest
//! of f(n) = n · (x_E − x_C) over unit n, with the support points of the two along −n and n. Over
//! the normals of a face x_C may be any point of the face, over those of an edge any of the edge: the
//! largest is found at a face that has the ellipsoid's lowest point over it, at an edge that is
//! lowest over the ellipsoid in between its ends with n between the normals of its faces, or at a
//! corner with n in the cone of its faces' normals. Where one hands over to the next they are the
//! same point with the same normal, outside and for overlaps less deep than the ellipsoid is curved.
//!
//! A disc is an ellipsoid without height. Where the normal is its axis, it has no outermost point of its own, and whoever
//! asks must look at that.

use super::plane;
use super::point::{ContactPoint, Rows3, carry, rotate};
use crate::geometry::HalfSpace;
use crate::geometry::convex::{Core, Edge, Face, Round};
use hydrograd_adjoint::lie::{Pose, Vec3};

/// Room for rounding where a feature hands over to the next.
pub(super) const SLACK: f64 = 1e-9;

/// The point of contact if its gap is below `reach`; the ellipsoid or disc is the first body. Deep inside,
/// where no feature has a common normal, it is that of the face with the least overlap.
pub(super) fn contact<R: Round>(
    round: &R,
    round_at: &Pose,
    core: &Core,
    core_at: &Pose,
    reach: f64,
) -> Option<ContactPoint> {
    let mut best: Option<ContactPoint> = None;
    let take = |best: &mut Option<ContactPoint>, found: ContactPoint| {
        if best.as_ref().is_none_or(|b| found.gap > b.gap) {
            *best = Some(found);
        }
    };
    let mut highest: Option<ContactPoint> = None;
    for face in &core.faces {
        let normal = core_at.rotation * face.normal;
        let plane = HalfSpace {
            point: core_at.apply(&(face.offset * face.normal)),
            normal,
        };
        let found = plane::lowest(round, round_at, &plane);
        let foot = core_at.apply_inverse(&found.position);
        if face.is_below(&foot, SLACK * core.diameter())
            && (R::HAS_INSIDE || found.gap >= 0.0 || within(core, core_at, &found))
        {
            take(&mut best, found.clone());
        }
        take(&mut highest, found);
    }
    // Apart, and so the nearest of all.
    if best.as_ref().is_some_and(|b| b.gap >= 0.0) {
        return best.filter(|b| b.gap < reach);
    }
    let to_round = round_at.inverse().compose(core_at);
    let near = |least: f64| least - core.radius < reach;
    let inward =
        |found: &ContactPoint, d: &Vec3| found.normal.dot(&(core_at.rotation * d)) >= -SLACK;
    let center = to_round.apply_inverse(&Vec3::zeros());
    let behind = |f: &Face| f.normal.dot(&center) < f.offset;
    let mut pierced = !core.faces.is_empty() && core.faces.iter().all(behind);
    // Features beyond the reach are looked at only where what was found overlaps: a face on the far side does for a body that is
    // apart, and then the nearest feature is one of those.
    for beyond in [false, true] {
        if beyond && best.as_ref().is_none_or(|b| b.gap >= 0.0) {
            break;
        }
        for edge in &core.edges {
            let (from, along) = (to_round.apply(&edge.from), to_round.rotation * edge.along);
            let approach = round.approach(&from, &along, edge.length);
            pierced |= approach.pierced;
            if near(approach.least) == beyond {
                continue;
            }
            let on = on_edge(round, round_at, edge, core_at, core.radius);
            let Some((still, moving)) = on else {
                continue;
            };
            if edge.inward.iter().flatten().all(|d| inward(&still, d)) {
                take(&mut best, moving.swapped());
            }
        }
        for (corner, spokes) in core.corners.iter().zip(&core.spokes) {
            if near(round.least(&to_round.apply(corner))) == beyond {
                continue;
            }
            let x = core_at.apply(corner);
            let found = seen(round, round_at, &x, &carry(&x), core.radius);
            if spokes.iter().all(|d| inward(&found, d)) {
                take(&mut best, found.swapped());
            }
        }
    }
    if best.is_none() && pierced && R::HAS_INSIDE {
        best = highest;
    }
    best.filter(|b| b.gap < reach)
}

/// Whether the first body's point of a contact lies within a core: not beyond it, under a face that it is far below.
fn within(core: &Core, core_at: &Pose, found: &ContactPoint) -> bool {
    let x = core_at.apply_inverse(&(found.position + 0.5 * found.gap * found.normal));
    let slack = SLACK * core.diameter();
    core.faces
        .iter()
        .all(|f| f.normal.dot(&x) <= f.offset + slack)
}

/// A point of a core with this radius, which moves by `motion`, seen from an ellipsoid or a disc.
fn seen(
    round: &impl Round,
    round_at: &Pose,
    x: &Vec3,
    motion: &Rows3,
    radius: f64,
) -> ContactPoint {
    let field = round.field(&round_at.apply_inverse(x));
    let field = field.rotated(&round_at.rotation);
    ContactPoint::probe(x, motion, [radius, 0.0], &field)
}

/// Where an edge, the first body, with a radius about it is lowest over an ellipsoid or a disc: carried along at its
/// place on the edge, and sliding along that; none at an end.
pub(super) fn on_edge(
    round: &impl Round,
    round_at: &Pose,
    edge: &Edge,
    edge_at: &Pose,
    radius: f64,
) -> Option<(ContactPoint, ContactPoint)> {
    let to_round = round_at.inverse().compose(edge_at);
    let (from, along) = (to_round.apply(&edge.from), to_round.rotation * edge.along);
    let s = round.lowest(&from, &along, edge.length)?;
    let x = edge_at.apply(&(edge.from + s * edge.along));
    let along = edge_at.rotation * edge.along;
    let still = seen(round, round_at, &x, &carry(&x), radius);
    let moving = seen(round, round_at, &x, &sliding(&still, &x, &along), radius);
    Some((still, moving))
}

/// Motion of the lowest point of an edge: carried along, and sliding by ds so that n · e stays
/// zero: eᵀ H (dp + e ds) + n · (ω × e) = 0. `still` is the point at `x` without sliding.
fn sliding(still: &ContactPoint, x: &Vec3, along: &Vec3) -> Rows3 {
    let carried = carry(x);
    let rotated = still.slopes.normal.tr_mul(along) + rotate(along).tr_mul(&still.normal);
    // H e from its columns: along the translation the normal's slope is H.
    let curvature = along.dot(&(still.slopes.normal.fixed_columns::<3>(0) * along));
    if curvature > 0.0 {
        carried - along * (rotated / curvature).transpose()
    } else {
        carried
    }
}
