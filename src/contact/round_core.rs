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

use super::arc::Arc;
use super::plane;
use super::point::{ContactPoint, Rows3, carry, rotate};
use super::round_pair::{self, FARTHEST};
use crate::geometry::HalfSpace;
use crate::geometry::convex::{Core, Edge, Face, Round, Support};
use hydrograd_adjoint::lie::{Mat3, Pose, Vec3};

/// Room for rounding where a feature hands over to the next.
pub(super) const SLACK: f64 = 1e-9;

/// The point of contact if its gap is below `reach`; the ellipsoid or disc is the first body. A disc has none with an edge that pierces it.
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
    for face in &core.faces {
        let found = over_face(round, round_at, face, core_at);
        let foot = core_at.apply_inverse(&found.position);
        if face.is_below(&foot, SLACK * core.diameter())
            && (R::HAS_INSIDE || found.gap >= 0.0 || within(core, core_at, &found))
        {
            take(&mut best, found);
        }
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
    if R::HAS_INSIDE && (pierced || best.as_ref().is_some_and(|b| b.gap < 0.0)) {
        best = overlapping(round, round_at, core, core_at);
    }
    best.filter(|b| b.gap < reach)
}

/// The point of contact of an ellipsoid and a core that overlap: that of the largest f of all faces, tops between the normals of edges, and corners. The lowest
/// places of edges don't do: an edge that passes through the middle of the ellipsoid is lowest there, on which side is rounding.
fn overlapping<R: Round>(
    round: &R,
    round_at: &Pose,
    core: &Core,
    core_at: &Pose,
) -> Option<ContactPoint> {
    let support = |n: &Vec3| round.support(round_at, n);
    let on_face = core
        .faces
        .iter()
        .map(|f| over_face(round, round_at, f, core_at));
    let on_edge = core.edges.iter().flat_map(|edge| {
        let edge = edge.placed(core_at);
        let arc = Arc::of(&edge, 0.0);
        let tops = arc.tops(support).into_iter();
        tops.map(|top| arc.contact(&top, core.radius))
            .collect::<Vec<_>>()
    });
    let on_corner = core
        .corners
        .iter()
        .zip(&core.spokes)
        .filter_map(|(corner, spokes)| {
            let x = core_at.apply(corner);
            let ways: Vec<Vec3> = spokes.iter().map(|d| core_at.rotation * d).collect();
            let inward = |p: &ContactPoint| ways.iter().all(|d| p.normal.dot(d) <= SLACK);
            let nearest = seen(round, round_at, &x, &carry(&x), core.radius).swapped();
            if inward(&nearest) {
                return Some(nearest);
            }
            // Past the middle of the ellipsoid the nearest side isn't that by which the corner came.
            if core.faces.is_empty() || nearest.gap >= 0.0 {
                return None;
            }
            let out = -ways.iter().sum::<Vec3>().try_normalize(0.0)?;
            let fixed = |_: &Vec3| Support {
                point: x,
                spread: Mat3::zeros(),
            };
            let found =
                round_pair::contact(support, fixed, |_| FARTHEST, core.diameter(), out).ok()?;
            inward(&found).then_some(found)
        });
    let all = on_face.chain(on_edge).chain(on_corner);
    all.max_by(|p, q| p.gap.total_cmp(&q.gap))
}

/// The lowest point over a face.
fn over_face(round: &impl Round, round_at: &Pose, face: &Face, core_at: &Pose) -> ContactPoint {
    let plane = HalfSpace {
        point: core_at.apply(&(face.offset * face.normal)),
        normal: core_at.rotation * face.normal,
    };
    plane::lowest(round, round_at, &plane)
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
