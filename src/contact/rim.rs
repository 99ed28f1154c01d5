//! Points of a cylinder's rims: the lowest one, and those that stay in place.
//!
//! The lowest point of a rim over a face is exact, and jumps from one side to the other as the face tips past the end of the
//! cylinder. So it fades out, with the square of the tilt, as the two become parallel, and points at fixed
//! places of the rim take over, by which an end stands on the face. Where the tilt isn't zero the lowest point is among
//! those with a weight, and where it is zero all points of the rim are lowest. Of the points in place only those near the
//! lowest one fade: the others say where a rim that rocks will land.

use super::core_core::{DEPTH_RAMP, beside};
use super::point::{ContactPoint, Rows3, carry, rotate};
use super::weight::Weight;
use crate::geometry::convex::{AtCorner, Cylinder};
use hydrograd_adjoint::lie::{Pose, Vec3, Vec6, skew};
use std::f64::consts::TAU;

/// Points of each rim that stay in place.
pub const RIM_POINTS: usize = 8;
/// Sine of the angle between a normal and a cylinder's axis from which on a rim has its lowest point alone.
pub const TILT: f64 = 0.1;
/// Cosine of the angle around the rim to its lowest point from which on a point in place has faded.
const BESIDE: f64 = 0.5;

/// The two ends of a cylinder.
pub(super) const SIDES: [f64; 2] = [-1.0, 1.0];

/// Sine of the angle between two unit vectors, with its slope from theirs.
pub(super) fn sine((a, a_slope): (&Vec3, &Rows3), (b, b_slope): (&Vec3, &Rows3)) -> (f64, Vec6) {
    let cross = a.cross(b);
    let sine = cross.norm();
    if sine == 0.0 {
        return (0.0, Vec6::zeros());
    }
    let slope = skew(a) * b_slope - skew(b) * a_slope;
    (sine, slope.tr_mul(&(cross / sine)))
}

/// The axis of a cylinder at a pose.
pub(super) fn axis(at: &Pose) -> Vec3 {
    at.rotation.column(2).into_owned()
}

/// The lowest point of a rim of the first body, a cylinder at `at`, with its weight; none where that is zero.
pub(super) fn lowest(at: &Pose, mut point: ContactPoint) -> Option<ContactPoint> {
    let axis = axis(at);
    let (normal, turned) = (&point.normal, &point.slopes.normal);
    let (sine, slope) = sine((&axis, &rotate(&axis)), (normal, turned));
    let mut weight = Weight {
        value: point.weight,
        slope: point.slopes.weight,
    };
    weight.fade(sine / TILT, &(slope / TILT));
    point.weight = weight.value;
    point.slopes.weight = weight.slope;
    (point.weight > 0.0).then_some(point)
}

/// A point that fades out where it overlaps deeper than `depth`, from that less its ramp on: it is of a far side then.
pub(super) fn shallow(mut point: ContactPoint, depth: f64) -> ContactPoint {
    let mut weight = Weight {
        value: point.weight,
        slope: point.slopes.weight,
    };
    let ramp = DEPTH_RAMP * depth;
    weight.fade((point.gap + depth) / ramp, &(point.slopes.gap / ramp));
    point.weight = weight.value;
    point.slopes.weight = weight.slope;
    point
}

/// A point of a rim of the first body, a cylinder at `at`, that stays in place, `out` from the axis; none where its weight is
/// zero: where the rim leans and is lowest near there.
fn fixed(at: &Pose, out: &Vec3, mut point: ContactPoint) -> Option<ContactPoint> {
    let axis = axis(at);
    let (normal, turned) = (&point.normal, &point.slopes.normal);
    let (sine, slope) = sine((&axis, &rotate(&axis)), (normal, turned));
    let mut replaced = Weight::full();
    replaced.fade(sine / TILT, &(slope / TILT));
    if replaced.value > 0.0 {
        let down = -out.dot(normal) / sine;
        let down_slope =
            -(rotate(out).tr_mul(normal) + turned.tr_mul(out)) / sine - slope * (down / sine);
        replaced.fade(down / BESIDE, &(down_slope / BESIDE));
    }
    let left = 1.0 - replaced.value;
    point.slopes.weight = left * point.slopes.weight - point.weight * replaced.slope;
    point.weight *= left;
    (point.weight > 0.0).then_some(point)
}

/// The points of both rims that stay in place, in the distance field (world frame) of the second body, which has `radius`
/// about that; it is told of the directions into the first as well. `shell` as in [`beside`].
pub(super) fn standing(
    cylinder: &Cylinder,
    at: &Pose,
    [radius, shell]: [f64; 2],
    field: impl Fn(&Vec3, &[Vec3; 2]) -> Option<AtCorner>,
) -> Vec<ContactPoint> {
    let point = |side: f64, k: usize| {
        let (sin, cos) = (TAU * k as f64 / RIM_POINTS as f64).sin_cos();
        let (x, y) = (cylinder.radius * cos, cylinder.radius * sin);
        let x = at.apply(&Vec3::new(x, y, side * cylinder.half));
        let out = at.rotation * Vec3::new(cos, sin, 0.0);
        let into = [-out, -side * axis(at)];
        let at_corner = field(&x, &into)?;
        let mut found = ContactPoint::probe(&x, &carry(&x), [0.0, radius], &at_corner.field);
        if at_corner.over {
            for d in &into {
                found = beside(found, d, at_corner.field.distance, shell);
            }
        }
        fixed(at, &out, found)
    };
    let places = SIDES.map(|side| (0..RIM_POINTS).map(move |k| (side, k)));
    let places = places.into_iter().flatten();
    places.filter_map(|(side, k)| point(side, k)).collect()
}
