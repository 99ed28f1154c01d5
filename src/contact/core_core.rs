//! Two cores: corners of either against the other, and edges across edges.
//!
//! Edges e_A, e_B with u = a₀ − b₀ between their beginnings: c = e_A × e_B, common normal n = ±c/|c|,
//! gap n · u, nearest points at s = −u · (e_B × n)/(n · c) and t = −u · (e_A × n)/(n · c).

use super::point::{ContactPoint, Rows3, Slopes, carry, rotate};
use super::weight::Weight;
use crate::geometry::convex::{AtCorner, Core, Edge, across};
use hydrograd_adjoint::lie::{Pose, Vec3, skew};

/// Sine of the angle between two edges below which they have no contact point across one another; the
/// weight grows from there to 1 at three times this. Nearly parallel edges have theirs at their corners.
pub const PARALLEL: f64 = 0.02;
/// Share of the shorter edge over which a crossing fades out towards an end; at least as long as
/// the overlap is deep, for less than that from the end the corner is the way out.
pub(super) const END: f64 = 0.02;
/// Cosines of the angle between a normal and the ways into a body from its corner between which the corner fades out.
const BESIDE: [f64; 2] = [-0.6, -0.9];
/// Sine of the angle by which the common normal may leave the normals of an edge's faces before
/// the crossing has faded out.
pub(super) const LEAVE: f64 = 0.05;
/// Share of the thinner body's thickness at which an overlap of edges has faded out (from half of
/// it): deeper ones are of far sides, not of those in contact.
pub(super) const DEPTH: f64 = 0.5;
/// Share of that depth over which it fades out.
pub(super) const DEPTH_RAMP: f64 = 0.5;

/// All points with a gap below `reach`.
pub(super) fn contacts(
    a: &Core,
    a_at: &Pose,
    b: &Core,
    b_at: &Pose,
    reach: f64,
) -> Vec<ContactPoint> {
    let mut out = Vec::new();
    let shell = END * a.thickness.min(b.thickness);
    if a.is_ball() || !b.is_ball() {
        let limit = reach + a.radius + b.radius;
        let field = |y: &Vec3, into: &[Vec3]| b.field_of_corner(y, into, limit);
        let within = [reach, shell];
        corners(a, a_at, (&field, b.radius), b_at, within, |p| out.push(p));
    }
    if !a.is_ball() {
        let limit = reach + b.radius + a.radius;
        let field = |y: &Vec3, into: &[Vec3]| a.field_of_corner(y, into, limit);
        let within = [reach, shell];
        corners(b, b_at, (&field, a.radius), a_at, within, |p| {
            out.push(p.swapped())
        });
    }
    let beside = reach + a.radius + b.radius;
    let ours = placed(a, a_at, b, b_at, beside);
    let theirs = placed(b, b_at, a, a_at, beside);
    let depth = DEPTH * a.thickness.min(b.thickness);
    for first in &ours {
        for second in &theirs {
            let far = 0.5 * (first.length + second.length) + beside;
            if (first.middle() - second.middle()).norm_squared() > far * far {
                continue;
            }
            let radii = [a.radius, b.radius];
            let found = crossing(first, second, radii, 0.0, depth);
            out.extend(found.filter(|p| p.gap < reach));
        }
    }
    out
}

/// Signed distances of corners from which bodies lead into some directions, where they are looked at.
type Distances<'a> = &'a dyn Fn(&Vec3, &[Vec3]) -> Option<AtCorner>;

/// Corners of `a`, which moves, against a body with a signed distance in its own frame and a radius about that; `shell` as in [`beside`].
pub(super) fn corners(
    a: &Core,
    a_at: &Pose,
    (field, radius): (Distances, f64),
    b_at: &Pose,
    [reach, shell]: [f64; 2],
    mut found: impl FnMut(ContactPoint),
) {
    let to_b = b_at.inverse().compose(a_at);
    let radii = [a.radius, radius];
    let mut into = Vec::new();
    for (corner, spokes) in a.corners.iter().zip(&a.spokes) {
        into.clear();
        // The ends of a capsule are round: they leave to all sides.
        if !a.faces.is_empty() {
            into.extend(spokes.iter().map(|d| to_b.rotation * d));
        }
        let Some(at_corner) = field(&to_b.apply(corner), &into) else {
            continue;
        };
        let x = a_at.apply(corner);
        let seen = at_corner.field.rotated(&b_at.rotation);
        let mut point = ContactPoint::probe(&x, &carry(&x), radii, &seen);
        if point.gap < reach {
            if at_corner.over {
                for d in &into {
                    let above = at_corner.field.distance;
                    point = beside(point, &(b_at.rotation * d), above, shell);
                }
            }
            found(point);
        }
    }
}

/// The point of a corner of the first body, `above` a face of the second, from which the first leads into the direction `into` (world frame), as far as it may touch there: where it
/// leads on through the face the corner is beside what the body stands on, and what crosses there touches. Farther off than `shell` such a corner stands for a crossing that
/// has faded.
pub(super) fn beside(mut point: ContactPoint, into: &Vec3, above: f64, shell: f64) -> ContactPoint {
    let along = point.normal.dot(into);
    if along >= BESIDE[0] || above >= shell {
        return point;
    }
    let slope = point.slopes.normal.tr_mul(into) + rotate(into).tr_mul(&point.normal);
    let width = BESIDE[0] - BESIDE[1];
    let [mut through, mut near] = [Weight::full(), Weight::full()];
    through.fade_out((along - BESIDE[1]) / width, &(slope / width));
    near.fade_out(above / shell, &(point.slopes.gap / shell));
    let gone = through.value * near.value;
    let gone_slope = through.value * near.slope + near.value * through.slope;
    point.slopes.weight = (1.0 - gone) * point.slopes.weight - point.weight * gone_slope;
    point.weight *= 1.0 - gone;
    point
}

/// Edges of `a` that may be nearer to `b` than `beside`, world frame.
fn placed(a: &Core, a_at: &Pose, b: &Core, b_at: &Pose, beside: f64) -> Vec<Edge> {
    let to_b = b_at.inverse().compose(a_at);
    let [low, high] = &b.bounds;
    let near = |edge: &&Edge| {
        let from = to_b.apply(&edge.from);
        let to = to_b.apply(&(edge.from + edge.length * edge.along));
        let apart = (low - from.sup(&to)).sup(&(from.inf(&to) - high));
        apart.max() <= beside
    };
    let near = a.edges.iter().filter(near);
    near.map(|edge| edge.placed(a_at)).collect()
}

/// Where edge `a`, which moves, crosses edge `b`; none where that has faded out. `shell` is what of the radii belongs to
/// cylinders with these axes: they begin there, other cores at their edges. `depth` is that
/// at which an overlap of the two has faded out, infinite for those without inside.
pub(super) fn crossing(
    a: &Edge,
    b: &Edge,
    radii: [f64; 2],
    shell: f64,
    depth: f64,
) -> Option<ContactPoint> {
    let cross = a.along.cross(&b.along);
    let sine = cross.norm();
    if sine <= PARALLEL {
        return None;
    }
    let u = a.from - b.from;
    let up = cross / sine;
    // The normal leads out of b and into a. Bare edges are on the side where they are.
    let into = |edge: &Edge| edge.inward.map_or(Vec3::zeros(), |[d, e]| d + e);
    let side = if a.inward.is_none() && b.inward.is_none() {
        u
    } else {
        into(a) - into(b)
    };
    let sign = 1f64.copysign(up.dot(&side));
    let normal = sign * up;
    let apart = normal.dot(&u);
    let along = sign * sine;
    let (b_side, a_side) = (b.along.cross(&normal), a.along.cross(&normal));
    let (s, t) = (-u.dot(&b_side) / along, -u.dot(&a_side) / along);
    let above = apart - shell;
    // Outside the edges, or overlapping too deep: weight zero.
    let ends = [s, a.length - s, t, b.length - t];
    if ends.iter().any(|&x| x <= 0.0) || above <= -depth {
        return None;
    }

    // With dc = (ω × e_A) × e_B: dn = P dc (n · c)⁻¹, d(n · c) = n · dc.
    let a_rotation = rotate(&a.along);
    let cross_slope = -skew(&b.along) * a_rotation;
    let along_slope = cross_slope.tr_mul(&normal);
    let normal_slope = across(&normal) * cross_slope / along;
    let start = carry(&a.from);
    let s_slope =
        -(start.tr_mul(&b_side) + normal_slope.tr_mul(&u.cross(&b.along)) + s * along_slope)
            / along;
    let t_slope = -(start.tr_mul(&a_side)
        + a_rotation.tr_mul(&normal.cross(&u))
        + normal_slope.tr_mul(&u.cross(&a.along))
        + t * along_slope)
        / along;
    let [a_point, b_point] = [a.from + s * a.along, b.from + t * b.along];
    let gap_slope = carry(&a_point).tr_mul(&normal);

    let mut weight = Weight::full();
    let ramp = 2.0 * PARALLEL;
    weight.fade((sine - PARALLEL) / ramp, &(sign / ramp * along_slope));
    if depth.is_finite() {
        let ramp = DEPTH_RAMP * depth;
        weight.fade((above + depth) / ramp, &(gap_slope / ramp));
    }
    let deep = above.min(0.0);
    let width = (END * a.length.min(b.length)).hypot(deep);
    let width_slope = deep / width * gap_slope;
    for (x, slope) in ends.iter().zip([s_slope, -s_slope, t_slope, -t_slope]) {
        weight.fade(x / width, &((slope - x / width * width_slope) / width));
    }
    for d in a.inward.iter().flatten() {
        let slope = normal_slope.tr_mul(d) + rotate(d).tr_mul(&normal);
        weight.fade(1.0 + normal.dot(d) / LEAVE, &(slope / LEAVE));
    }
    for d in b.inward.iter().flatten() {
        let slope = normal_slope.tr_mul(d);
        weight.fade(1.0 - normal.dot(d) / LEAVE, &(-slope / LEAVE));
    }

    let lean = radii[1] - radii[0];
    let a_motion: Rows3 = carry(&a_point) + a.along * s_slope.transpose();
    let b_motion: Rows3 = b.along * t_slope.transpose();
    Some(ContactPoint {
        gap: apart - radii[0] - radii[1],
        weight: weight.value,
        normal,
        position: 0.5 * (a_point + b_point + lean * normal),
        slopes: Slopes {
            gap: gap_slope,
            weight: weight.slope,
            normal: normal_slope,
            position: 0.5 * (a_motion + b_motion + lean * normal_slope),
        },
    })
    .filter(|p| p.weight > 0.0)
}
