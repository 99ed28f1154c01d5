//! Where a straight edge or another rim, the first body, passes over the rim of a cylinder's end.
//!
//! Such a point x moves along its own curve, with unit tangent e, so that it stays as far from the axis as the rim is: q · dx =
//! 0 with q the unit vector from the axis. Its gap is the height over the end, so these are the corners of what two flat
//! ends have in common. They fade out as the curve leans from the end (the lowest points take over) and as it
//! becomes parallel to the rim.

use super::core_core::{DEPTH_RAMP, END, LEAVE};
use super::point::{ContactPoint, Rows3, carry, rotate};
use super::rim::{TILT, sine};
use super::weight::Weight;
use crate::geometry::convex::{Cylinder, Disc, Edge, Field, Round, across, perpendicular};
use hydrograd_adjoint::lie::{Mat3, Pose, Vec3, Vec6};

/// Rounds of Newton's method for a point over two rims.
const ROUNDS: usize = 20;

/// Square of the sine of the angle between a curve and the rim below which the point where it comes over fades. It goes with the
/// way that the curve still has to the rim's outermost point.
const ALONG: f64 = 0.1;

/// Share of its radius that an axis is still over an end where it has faded.
const SUNK: f64 = 0.2;

/// The rim of a cylinder's end, world frame.
pub(super) struct Rim {
    pub center: Vec3,
    /// Unit vector out of the end.
    pub out: Vec3,
    /// m.
    pub radius: f64,
}

impl Rim {
    pub fn new(cylinder: &Cylinder, at: &Pose, side: f64) -> Self {
        Self {
            center: cylinder.end(at, side).translation,
            out: side * at.rotation.column(2),
            radius: cylinder.radius,
        }
    }

    /// That of its disc: z leads out.
    pub fn frame(&self) -> Pose {
        let u = perpendicular(&self.out);
        let v = self.out.cross(&u);
        Pose::new(Mat3::from_columns(&[u, v, self.out]), self.center)
    }
}

/// A point of a curve of the first body that is over the rim.
struct Over {
    x: Vec3,
    /// How it moves with its body at its place on the curve.
    carried: Rows3,
    /// Unit tangent of the curve.
    along: Vec3,
    /// Second derivative of the curve, 1/m.
    bend: Vec3,
}

impl Over {
    /// As a contact with a radius about the curve, and the slope of how far along the curve it is; not faded but where the
    /// curve is parallel to the rim. None below all reach and weight.
    fn contact(&self, rim: &Rim, radius: f64, depth: f64) -> Option<(ContactPoint, Vec6, Weight)> {
        let height = rim.out.dot(&(self.x - rim.center));
        if height <= -depth {
            return None;
        }
        let flat = across(&rim.out);
        let outward = flat * (self.x - rim.center) / rim.radius;
        let through = outward.dot(&self.along);
        let carried = self.carried;
        let along_slope = -carried.tr_mul(&outward) / through;
        let motion: Rows3 = carried + self.along * along_slope.transpose();
        let field = Field::flat(height, rim.out);
        let point = ContactPoint::probe(&self.x, &motion, [radius, 0.0], &field);
        // How the curve passes through the rim: fades where it is along it.
        let tangent_slope: Rows3 = rotate(&self.along) + self.bend * along_slope.transpose();
        let through_slope =
            motion.tr_mul(&(flat * self.along)) / rim.radius + tangent_slope.tr_mul(&outward);
        let mut weight = Weight::full();
        let slope = 2.0 * through / ALONG * through_slope;
        weight.fade(through * through / ALONG, &slope);
        if depth.is_finite() {
            let ramp = DEPTH_RAMP * depth;
            weight.fade((height + depth) / ramp, &(point.slopes.gap / ramp));
        }
        (weight.value > 0.0).then_some((point, along_slope, weight))
    }
}

fn weighed(mut point: ContactPoint, weight: &Weight) -> Option<ContactPoint> {
    point.weight = weight.value;
    point.slopes.weight = weight.slope;
    (point.weight > 0.0).then_some(point)
}

/// Where a straight edge with a radius about it comes over the rim and leaves it. `depth` is that at which an overlap has
/// faded out.
pub(super) fn edge_over(
    edge: &Edge,
    radius: f64,
    rim: &Rim,
    reach: f64,
    depth: f64,
) -> [Option<ContactPoint>; 2] {
    line_over((edge, carry), radius, rim, reach, depth)
}

/// The point of a straight axis with a radius about it that is nearest to the cylinder's own axis, in the distance of the end. Where the axis passes level
/// over the rim along its tangent, the points above have faded and the nearest point of the rim isn't one yet; this one
/// has the weight that they lack. `shell` is what of the radius counts as overlap.
pub(super) fn tangent_over(
    axis: &Edge,
    [radius, shell]: [f64; 2],
    rim: &Rim,
    reach: f64,
    depth: f64,
) -> Option<ContactPoint> {
    let lean = axis.along.dot(&rim.out);
    if lean.abs() >= TILT {
        return None;
    }
    let flat = across(&rim.out);
    let (start, step) = (flat * (axis.from - rim.center), flat * axis.along);
    let square = step.norm_squared();
    let s = -start.dot(&step) / square;
    let ends = [s, axis.length - s];
    let x = axis.from + s * axis.along;
    let height = rim.out.dot(&(x - rim.center));
    if height <= 0.0 || ends.iter().any(|x| *x <= 0.0) {
        return None;
    }
    // It slides so that q · e stays zero, q from the cylinder's axis.
    let q = start + s * step;
    let turned = rotate(&axis.along);
    let slid = -(carry(&x).tr_mul(&step) + turned.tr_mul(&q)) / square;
    let motion: Rows3 = carry(&x) + axis.along * slid.transpose();
    let disc = Disc { radius: rim.radius };
    let frame = rim.frame();
    let field = disc
        .field(&frame.apply_inverse(&x))
        .rotated(&frame.rotation);
    let point = ContactPoint::probe(&x, &motion, [radius, 0.0], &field);
    if point.gap >= reach {
        return None;
    }
    let mut weight = Weight::full();
    let through = 1.0 - q.norm_squared() / (rim.radius * rim.radius);
    let slope = motion.tr_mul(&q) * (-2.0 / (rim.radius * rim.radius * ALONG));
    weight.fade_out(through / ALONG, &slope);
    let (sine, slope) = sine(
        (&point.normal, &point.slopes.normal),
        (&rim.out, &Rows3::zeros()),
    );
    weight.fade_out(sine / TILT, &(slope / TILT));
    let slope = turned.tr_mul(&rim.out) * lean.signum();
    weight.fade_out(lean.abs() / TILT, &(slope / TILT));
    if depth.is_finite() {
        let ramp = DEPTH_RAMP * depth;
        let above = point.gap + radius - shell;
        weight.fade((above + depth) / ramp, &(point.slopes.gap / ramp));
    }
    // Gone before the axis is at the end itself, beyond which it has sunk in.
    let slope = motion.tr_mul(&rim.out);
    weight.fade(height / (SUNK * radius), &(slope / (SUNK * radius)));
    let width = END * axis.length.min(rim.radius);
    for (x, slope) in ends.iter().zip([slid, -slid]) {
        weight.fade(x / width, &(slope / width));
    }
    weighed(point, &weight)
}

/// Where a cylinder's side about this axis comes over the rim and leaves it: of the line on it that is lowest over the end.
pub(super) fn side_over(
    axis: &Edge,
    radius: f64,
    rim: &Rim,
    reach: f64,
    depth: f64,
) -> [Option<ContactPoint>; 2] {
    let lean = axis.along.dot(&rim.out);
    if lean.abs() >= TILT {
        return [None, None];
    }
    // m = (n − e (e · n))/√(1 − (e · n)²), and how it turns with e.
    let sine = (1.0 - lean * lean).sqrt();
    let up = (rim.out - lean * axis.along) / sine;
    let turned = rotate(&axis.along);
    let leaning = turned.tr_mul(&rim.out);
    let up_slope: Rows3 =
        across(&up) * (axis.along * leaning.transpose() + lean * turned) * (-1.0 / sine);
    let line = Edge {
        from: axis.from - radius * up,
        inward: None,
        ..axis.clone()
    };
    let carried = |x: &Vec3| carry(&(x + radius * up)) - radius * up_slope;
    line_over((&line, carried), 0.0, rim, reach, depth)
}

/// Of an edge, and how its points move.
fn line_over(
    (edge, carried): (&Edge, impl Fn(&Vec3) -> Rows3),
    radius: f64,
    rim: &Rim,
    reach: f64,
    depth: f64,
) -> [Option<ContactPoint>; 2] {
    let lean = edge.along.dot(&rim.out);
    if lean.abs() >= TILT {
        return [None, None];
    }
    let flat = across(&rim.out);
    let (start, step) = (flat * (edge.from - rim.center), flat * edge.along);
    let (square, half) = (step.norm_squared(), start.dot(&step));
    let rest = half * half - square * (start.norm_squared() - rim.radius * rim.radius);
    if rest <= 0.0 {
        return [None, None];
    }
    [-1.0, 1.0].map(|sign| {
        let s = (sign * rest.sqrt() - half) / square;
        let ends = [s, edge.length - s];
        if ends.iter().any(|x| *x <= 0.0) {
            return None;
        }
        let x = edge.from + s * edge.along;
        let over = Over {
            carried: carried(&x),
            x,
            along: edge.along,
            bend: Vec3::zeros(),
        };
        let (point, slope, mut weight) = over.contact(rim, radius, depth)?;
        if point.gap >= reach {
            return None;
        }
        let lean_slope = rotate(&edge.along).tr_mul(&rim.out) * lean.signum();
        weight.fade_out(lean.abs() / TILT, &(lean_slope / TILT));
        let deep = (point.gap + radius).min(0.0);
        let width = (END * edge.length.min(rim.radius)).hypot(deep);
        let width_slope = deep / width * point.slopes.gap;
        for (x, slope) in ends.iter().zip([slope, -slope]) {
            weight.fade(x / width, &((slope - x / width * width_slope) / width));
        }
        for d in edge.inward.iter().flatten() {
            let slope = rotate(d).tr_mul(&rim.out);
            weight.fade(1.0 + rim.out.dot(d) / LEAVE, &(slope / LEAVE));
        }
        weighed(point, &weight)
    })
}

/// Where a rim comes over another that it faces and leaves it.
pub(super) fn rim_over(
    moving: &Rim,
    rim: &Rim,
    reach: f64,
    depth: f64,
) -> [Option<ContactPoint>; 2] {
    let spin = rotate(&moving.out);
    let (lean, lean_slope) = sine((&moving.out, &spin), (&rim.out, &Rows3::zeros()));
    let flat = across(&rim.out);
    let aside = across(&moving.out) * (flat * (moving.center - rim.center));
    let far = aside.norm();
    let facing = moving.out.dot(&rim.out) < 0.0;
    if lean >= TILT || !facing || far <= (moving.radius - rim.radius).abs() * 0.5 || far == 0.0 {
        return [None, None];
    }
    let u = aside / far;
    let v = moving.out.cross(&u);
    // Circles in one plane; then as they are.
    let cosine = (rim.radius * rim.radius - far * far - moving.radius * moving.radius)
        / (2.0 * far * moving.radius);
    if cosine.abs() >= 1.0 + TILT {
        return [None, None];
    }
    [-1.0, 1.0].map(|sign| {
        let mut angle = sign * cosine.clamp(-0.999, 0.999).acos();
        for _ in 0..ROUNDS {
            let (sin, cos) = angle.sin_cos();
            let out = cos * u + sin * v;
            let tangent = cos * v - sin * u;
            let x = flat * (moving.center + moving.radius * out - rim.center);
            let step = (x.norm_squared() - rim.radius * rim.radius)
                / (2.0 * moving.radius * x.dot(&tangent));
            angle -= step;
            if step.abs() <= 1e-15 || step.is_nan() {
                break;
            }
        }
        let (sin, cos) = angle.sin_cos();
        let out = cos * u + sin * v;
        let x = moving.center + moving.radius * out;
        let over = Over {
            carried: carry(&x),
            x,
            along: cos * v - sin * u,
            bend: -out / moving.radius,
        };
        let off = (flat * (over.x - rim.center)).norm() - rim.radius;
        // The other root, or none.
        if off.is_nan() || off.abs() > 1e-9 * rim.radius || sin * sign <= 0.0 {
            return None;
        }
        let (point, _, mut weight) = over.contact(rim, 0.0, depth)?;
        if point.gap >= reach {
            return None;
        }
        weight.fade_out(lean / TILT, &(lean_slope / TILT));
        weighed(point, &weight)
    })
}
