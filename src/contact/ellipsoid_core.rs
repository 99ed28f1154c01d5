//! An ellipsoid and a core: the one point of their common normal.
//!
//! With n from the core to the ellipsoid, the signed distance of two convex bodies is the largest
//! of f(n) = n · (x_E − x_C) over unit n, with the support points of the two along −n and n. Over
//! the normals of a face x_C may be any point of the face, over those of an edge any of the edge: the
//! largest is found at a face that has the ellipsoid's lowest point over it, at an edge that is
//! lowest over the ellipsoid in between its ends with n between the normals of its faces, or at a
//! corner with n in the cone of its faces' normals. Where one hands over to the next they are the
//! same point with the same normal, outside and for overlaps less deep than the ellipsoid is curved.

use super::core::{Core, Face};
use super::ellipsoid::Ellipsoid;
use super::point::{ContactPoint, Rows3, carry, rotate};
use crate::geometry::HalfSpace;
use hydrograd_adjoint::lie::{Pose, Vec3};

/// Room for rounding where a feature hands over to the next.
const SLACK: f64 = 1e-9;

/// The point of contact if its gap is below `reach`; the ellipsoid is the first body. Deep inside,
/// where no feature has a common normal, it is that of the face with the least overlap.
pub(super) fn contact(
    ellipsoid: &Ellipsoid,
    ellipsoid_at: &Pose,
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
        let found = ellipsoid.against_plane(ellipsoid_at, &plane);
        let foot = core_at.apply_inverse(&found.position);
        if face.is_below(&foot, SLACK * core.diameter()) {
            take(&mut best, found.clone());
        }
        take(&mut highest, found);
    }
    // Apart, and so the nearest of all.
    if best.as_ref().is_some_and(|b| b.gap >= 0.0) {
        return best.filter(|b| b.gap < reach);
    }
    let to_ellipsoid = ellipsoid_at.inverse().compose(core_at);
    // A point so many radii from the centre is at least that far away.
    let near = |radii: f64| ellipsoid.semi_axes.min() * (radii - 1.0) - core.radius < reach;
    let seen = |x: &Vec3, motion: &Rows3| {
        let field = ellipsoid.field(&ellipsoid_at.apply_inverse(x));
        let field = field.rotated(&ellipsoid_at.rotation);
        ContactPoint::probe(x, motion, [core.radius, 0.0], &field)
    };
    let inward =
        |found: &ContactPoint, d: &Vec3| found.normal.dot(&(core_at.rotation * d)) >= -SLACK;
    let center = to_ellipsoid.apply_inverse(&Vec3::zeros());
    let behind = |f: &Face| f.normal.dot(&center) < f.offset;
    let mut pierced = !core.faces.is_empty() && core.faces.iter().all(behind);
    // Features beyond the reach are looked at only where what was found overlaps: a face on the far side does for a body that is
    // apart, and then the nearest feature is one of those.
    for beyond in [false, true] {
        if beyond && best.as_ref().is_none_or(|b| b.gap >= 0.0) {
            break;
        }
        for edge in &core.edges {
            let (from, along) = (
                to_ellipsoid.apply(&edge.from),
                to_ellipsoid.rotation * edge.along,
            );
            let (_, radii) = ellipsoid.approach(&from, &along, edge.length);
            pierced |= radii < 1.0;
            if near(radii) == beyond {
                continue;
            }
            let Some(s) = ellipsoid.lowest(&from, &along, edge.length) else {
                continue;
            };
            let x = core_at.apply(&(edge.from + s * edge.along));
            let along = core_at.rotation * edge.along;
            let still = seen(&x, &carry(&x));
            if edge.inward.iter().flatten().all(|d| inward(&still, d)) {
                take(&mut best, seen(&x, &sliding(&still, &x, &along)).swapped());
            }
        }
        for (corner, spokes) in core.corners.iter().zip(&core.spokes) {
            let there = to_ellipsoid.apply(corner);
            if near(there.component_div(&ellipsoid.semi_axes).norm()) == beyond {
                continue;
            }
            let x = core_at.apply(corner);
            let found = seen(&x, &carry(&x));
            if spokes.iter().all(|d| inward(&found, d)) {
                take(&mut best, found.swapped());
            }
        }
    }
    if best.is_none() && pierced {
        best = highest;
    }
    best.filter(|b| b.gap < reach)
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
