//! Nearest points to rounding.
//!
//! Along rims and edges the search for nearest points ends in simplices like needles, some 10⁻¹⁰ of the bodies' size from the
//! truth. So the distance of the one body is brought to its least over the faces, edges, rims and sides of the other near the
//! points found. Each distance taken is one between two points of the bodies, and the least of them theirs.

use super::Form;
use super::core::Core;
use super::cylinder::Cylinder;
use super::field::Field;
use super::nearest::Nearest;
use super::round::lowest;
use hydrograd_adjoint::lie::{Pose, Vec3};

/// Rounds of Newton's method around a rim.
const ROUNDS: usize = 30;
/// How far from the points found edges are looked at, of the bodies' size.
const AROUND: f64 = 1e-3;
/// Sine of an angle below which directions are the same to rounding.
const SAME: f64 = 1e-9;

/// A body, placed, and the other as it is seen.
struct View<'a> {
    at: &'a Pose,
    /// Distance from the other, without its radius.
    field: &'a dyn Fn(&Vec3) -> Field,
    /// The outermost point of the other.
    outermost: &'a dyn Fn(&Vec3) -> Vec3,
    /// The point found.
    point: Vec3,
    size: f64,
}

/// The nearest points found of two bodies without their radii, which are apart, made better; the second at `there`.
pub(super) fn polish(found: Nearest, a: &Form, b: &Form, there: &Pose, size: f64) -> Nearest {
    let here = Pose::identity();
    let mut best = found;
    for (of_first, form, at, other, other_at) in
        [(true, a, &here, b, there), (false, b, there, a, &here)]
    {
        let field = |x: &Vec3| {
            let field = other.field(&other_at.apply_inverse(x));
            field.rotated(&other_at.rotation)
        };
        let outermost = |n: &Vec3| other_at.apply(&other.outermost(&other_at.rotation.tr_mul(n)));
        let view = View {
            at,
            field: &field,
            outermost: &outermost,
            point: best.points[usize::from(!of_first)],
            size,
        };
        // A point of this body, the way to it from the other one's, and how far it is.
        let mut take = |point: Vec3, normal: Vec3, distance: f64| {
            if distance > 0.0 && distance < best.distance {
                let other = point - distance * normal;
                best = Nearest {
                    distance,
                    normal: if of_first { normal } else { -normal },
                    points: if of_first {
                        [point, other]
                    } else {
                        [other, point]
                    },
                };
            }
        };
        match (form, other) {
            (Form::Cylinder(cylinder), _) => on_cylinder(cylinder, &view, &mut take),
            (Form::Core(core), Form::Ellipsoid(_) | Form::Cylinder(_)) => {
                on_core(core, &view, &mut take);
            }
            _ => {}
        }
    }
    best
}

/// The least distances from the rim, side and end of a cylinder near the point found.
fn on_cylinder(c: &Cylinder, view: &View, take: &mut impl FnMut(Vec3, Vec3, f64)) {
    let at = view.at;
    let y = at.apply_inverse(&view.point);
    let side = 1f64.copysign(y.z);
    let place = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        let out = Vec3::new(cos, sin, 0.0);
        let x = at.apply(&(c.radius * out + Vec3::new(0.0, 0.0, side * c.half)));
        let tangent = at.rotation * Vec3::new(-sin, cos, 0.0);
        (x, at.rotation * out, tangent)
    };
    let mut angle = y.y.atan2(y.x);
    for _ in 0..ROUNDS {
        let (x, out, tangent) = place(angle);
        let field = (view.field)(&x);
        let bend = c.radius * tangent.dot(&(field.hessian * tangent)) - field.gradient.dot(&out);
        let step = field.gradient.dot(&tangent) / bend;
        if bend <= 0.0 || step.is_nan() || step.abs() > 1.0 {
            break;
        }
        angle -= step;
        if step.abs() <= 1e-16 {
            break;
        }
    }
    let (x, ..) = place(angle);
    let field = (view.field)(&x);
    take(x, field.gradient, field.distance);

    let from = at.apply(&Vec3::new(0.0, 0.0, -c.half));
    let along = at.rotation.column(2).into_owned();
    let length = 2.0 * c.half;
    let first = (y.z + c.half).clamp(0.0, length);
    if let Some(s) = lowest(view.field, &from, &along, length, first) {
        let x = from + s * along;
        let field = (view.field)(&x);
        if field.gradient.dot(&along).abs() <= SAME {
            let normal = field.gradient;
            take(x - c.radius * normal, normal, field.distance - c.radius);
        }
    }

    let out = side * along;
    let lowest = (view.outermost)(&-out);
    let foot = at.apply_inverse(&lowest);
    let height = side * foot.z - c.half;
    if foot.x.hypot(foot.y) <= c.radius {
        take(lowest - height * out, -out, height);
    }
}

/// The least distances from the corners, edges and faces of a core near the point found.
fn on_core(core: &Core, view: &View, take: &mut impl FnMut(Vec3, Vec3, f64)) {
    let at = view.at;
    let y = at.apply_inverse(&view.point);
    let around = AROUND * view.size;
    for corner in core.corners.iter().filter(|c| (*c - y).norm() <= around) {
        let x = at.apply(corner);
        let field = (view.field)(&x);
        take(x, field.gradient, field.distance);
    }
    for edge in &core.edges {
        let first = (y - edge.from).dot(&edge.along).clamp(0.0, edge.length);
        if (y - edge.from - first * edge.along).norm() > around {
            continue;
        }
        let (from, along) = (at.apply(&edge.from), at.rotation * edge.along);
        if let Some(s) = lowest(view.field, &from, &along, edge.length, first) {
            let x = from + s * along;
            let field = (view.field)(&x);
            take(x, field.gradient, field.distance);
        }
    }
    for face in &core.faces {
        if (face.normal.dot(&y) - face.offset).abs() > around {
            continue;
        }
        let out = at.rotation * face.normal;
        let lowest = (view.outermost)(&-out);
        let foot = at.apply_inverse(&lowest);
        let height = face.normal.dot(&foot) - face.offset;
        if face.is_below(&foot, 0.0) {
            take(lowest - height * out, -out, height);
        }
    }
}
