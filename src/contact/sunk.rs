//! Where a straight edge has sunk into the rim of a cylinder's end.
//!
//! At the angle θ of the rim, with tangent t, and y the vector to x(θ) from the edge's line with unit vector e, the common normal is
//! n = ± t × e/|t × e| where y · (t − e (e · t)) = 0: stationary, and so also where the two touch and overlap.

use super::arc::{Arc, Top};
use super::core_core::{DEPTH_RAMP, END, LEAVE, PARALLEL};
use super::over_rim::Rim;
use super::point::{ContactPoint, Rows3, Slopes, carry, rotate};
use super::weight::Weight;
use crate::geometry::convex::{Disc, Edge, Round, across};
use hydrograd_adjoint::lie::{Vec3, skew};

/// Angle beyond the normals of an edge at which tops are looked for, rad: more than the weight reaches.
const ROOM: f64 = 1.2 * LEAVE;
/// Sine of the angle to the axis below which a direction leads to no place of the rim.
const FLAT: f64 = 1e-6;

/// The overlaps, the cylinder with the rim being the first body; none where there is none, or it has faded out. `depth` is that
/// at which an overlap has faded out.
pub(super) fn sunk(rim: &Rim, edge: &Edge, radius: f64, depth: f64) -> Vec<ContactPoint> {
    let frame = rim.frame();
    let (from, along) = (
        frame.apply_inverse(&edge.from),
        frame.rotation.tr_mul(&edge.along),
    );
    // All of it over the end, or beside the cylinder.
    let flat = along.xy();
    let aside = from.xy().perp(&flat).abs() / flat.norm();
    if from.z.min(from.z + edge.length * along.z) >= 0.0 || aside >= rim.radius {
        return Vec::new();
    }
    let disc = Disc { radius: rim.radius };
    let tops = Arc::of(edge, ROOM).tops(|n| disc.support(&frame, n));
    let at = |top: Top| {
        let out = -(across(&rim.out) * top.normal).try_normalize(FLAT)?;
        overlap(rim, edge, &out, radius, depth)
    };
    tops.into_iter().filter_map(at).collect()
}

/// That where the rim leads `out` from the axis.
fn overlap(rim: &Rim, edge: &Edge, out: &Vec3, radius: f64, depth: f64) -> Option<ContactPoint> {
    let (out, tangent) = (*out, rim.out.cross(out));
    let y = rim.center + rim.radius * out - edge.from;
    let line = across(&edge.along);
    let slope = rim.radius * (line * tangent).norm_squared() - (line * y).dot(&out);
    if slope <= 0.0 {
        return None;
    }
    let cross = tangent.cross(&edge.along);
    let sine = cross.norm();
    if sine <= PARALLEL {
        return None;
    }
    // Out of the edge's body, and into the cylinder.
    let sign = 1f64.copysign(-cross.dot(&(out + rim.out)));
    let normal = sign * cross / sine;
    let apart = normal.dot(&y);
    let s = edge.along.dot(&y);
    let ends = [s, edge.length - s];
    if apart >= 0.0 || apart <= -depth || ends.iter().any(|x| *x <= 0.0) {
        return None;
    }
    let x = edge.from + y;
    let angle_slope =
        -(carry(&x).tr_mul(&(line * tangent)) + rotate(&tangent).tr_mul(&(line * y))) / slope;
    let motion: Rows3 = carry(&x) + rim.radius * tangent * angle_slope.transpose();
    let tangent_slope: Rows3 = rotate(&tangent) - out * angle_slope.transpose();
    let out_slope: Rows3 = rotate(&out) + tangent * angle_slope.transpose();
    let cross_slope = -skew(&edge.along) * tangent_slope;
    let normal_slope: Rows3 = across(&normal) * cross_slope * (sign / sine);
    let gap_slope = carry(&x).tr_mul(&normal);
    let end_slope = motion.tr_mul(&edge.along);

    let mut weight = Weight::full();
    let ramp = 2.0 * PARALLEL;
    weight.fade(
        (sine - PARALLEL) / ramp,
        &(cross_slope.tr_mul(&normal) * sign / ramp),
    );
    let ramp = DEPTH_RAMP * depth;
    weight.fade((apart + depth) / ramp, &(gap_slope / ramp));
    let width = (END * edge.length.min(rim.radius)).hypot(apart);
    let width_slope = apart / width * gap_slope;
    for (x, slope) in ends.iter().zip([end_slope, -end_slope]) {
        weight.fade(x / width, &((slope - x / width * width_slope) / width));
    }
    for (d, turned) in [(-out, -out_slope), (-rim.out, rotate(&-rim.out))] {
        let slope = normal_slope.tr_mul(&d) + turned.tr_mul(&normal);
        weight.fade(1.0 + normal.dot(&d) / LEAVE, &(slope / LEAVE));
    }
    for d in edge.inward.iter().flatten() {
        let slope = normal_slope.tr_mul(d);
        weight.fade(1.0 - normal.dot(d) / LEAVE, &(-slope / LEAVE));
    }
    let to: Rows3 = edge.along * end_slope.transpose();
    (weight.value > 0.0).then(|| ContactPoint {
        gap: apart - radius,
        weight: weight.value,
        normal,
        position: x + 0.5 * (radius * normal - apart * normal),
        slopes: Slopes {
            gap: gap_slope,
            weight: weight.slope,
            normal: normal_slope,
            position: 0.5 * (motion + to + radius * normal_slope),
        },
    })
}
