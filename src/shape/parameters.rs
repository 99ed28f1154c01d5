//! The lengths of a shape as parameters: their names, their values, and how the shape's points move with them.
//!
//! Points move as the shape's own map has it: an ellipsoid or a box is stretched, a capsule's ends keep their form as it grows longer, a corner of a prism takes its
//! sides along. The motion is told everywhere, inside and around the shape too, so that whatever was laid out there goes along; what it does to the
//! surface beside its normal motion changes no shape.

use super::description::Shape;
use crate::error::{Error, Result};
use hydrograd_adjoint::lie::Vec3;

/// x, y and z.
const AXES: [&str; 3] = ["x", "y", "z"];

impl Shape {
    /// The parameters of the shape with their values: `radius`, `semi_axes.x` …, `size.x` …, `length`, `profile.0.y` … (a prism's corners), all in m, and
    /// `scale` of a mesh in a file. None of triangles given number by number.
    pub fn parameters(&self) -> Vec<(String, f64)> {
        let axes = |of: &str, values: &[f64; 3]| -> Vec<(String, f64)> {
            let each = AXES.iter().zip(values);
            each.map(|(axis, x)| (format!("{of}.{axis}"), *x)).collect()
        };
        let named = |name: &str, value: f64| (name.to_string(), value);
        match self {
            Self::Sphere { radius, .. } => vec![named("radius", *radius)],
            Self::Ellipsoid { semi_axes, .. } => axes("semi_axes", semi_axes),
            Self::Box { size, .. } => axes("size", size),
            Self::Cylinder { radius, length, .. } | Self::Capsule { radius, length, .. } => {
                vec![named("radius", *radius), named("length", *length)]
            }
            Self::Prism {
                profile, length, ..
            } => {
                let mut out = vec![named("length", *length)];
                for (k, corner) in profile.iter().enumerate() {
                    out.push((format!("profile.{k}.y"), corner[0]));
                    out.push((format!("profile.{k}.z"), corner[1]));
                }
                out
            }
            Self::Mesh { scale, .. } => vec![named("scale", *scale)],
            Self::Triangles { .. } => Vec::new(),
        }
    }

    /// The values of [`Shape::parameters`], to be changed.
    fn parameters_mut(&mut self) -> Vec<&mut f64> {
        match self {
            Self::Sphere { radius, .. } => vec![radius],
            Self::Ellipsoid { semi_axes: of, .. } | Self::Box { size: of, .. } => {
                of.iter_mut().collect()
            }
            Self::Cylinder { radius, length, .. } | Self::Capsule { radius, length, .. } => {
                vec![radius, length]
            }
            Self::Prism {
                profile, length, ..
            } => std::iter::once(length)
                .chain(profile.iter_mut().flatten())
                .collect(),
            Self::Mesh { scale, .. } => vec![scale],
            Self::Triangles { .. } => Vec::new(),
        }
    }

    /// The shape with another value of the parameter of this name.
    ///
    /// # Errors
    /// A name that isn't among [`Shape::parameters`], or a value that the shape can't have.
    pub fn with_parameter(&self, name: &str, value: f64) -> Result<Self> {
        let known = self.parameters();
        let Some(at) = known.iter().position(|(n, _)| n == name) else {
            let names: Vec<&str> = known.iter().map(|(n, _)| n.as_str()).collect();
            return Err(Error::input(
                format!("shape parameter of a {}", self.kind()),
                format!("{name:?}"),
                match names.is_empty() {
                    true => "this shape has none; its vertices are in the scene".into(),
                    false => format!("must be one of {names:?}"),
                },
            ));
        };
        let out = self.with_nth_parameter(at, value);
        super::validate(&out, &format!("shape parameter {name} = {value}"))?;
        Ok(out)
    }

    /// The same by the number of the parameter, unchecked.
    pub(crate) fn with_nth_parameter(&self, at: usize, value: f64) -> Self {
        let mut out = self.clone();
        if let Some(x) = out.parameters_mut().into_iter().nth(at) {
            *x = value;
        }
        out
    }

    /// Velocity of the point `p` (m, the shape's frame) per unit of parameter number `at`.
    pub(crate) fn parameter_velocity(&self, at: usize, p: &Vec3) -> Vec3 {
        let stretch = |k: usize, length: f64| Vec3::ith(k, p[k] / length);
        let across = Vec3::new(p.x, p.y, 0.0);
        match self {
            Self::Sphere { radius, .. } => p / *radius,
            Self::Ellipsoid { semi_axes: of, .. } | Self::Box { size: of, .. } => {
                stretch(at, of[at])
            }
            Self::Cylinder { radius, length, .. } => match at {
                0 => across / *radius,
                _ => stretch(2, *length),
            },
            Self::Capsule { radius, length, .. } => match at {
                0 => (p - Vec3::z() * p.z.clamp(-0.5 * length, 0.5 * length)) / *radius,
                _ => Vec3::z() * (p.z / length).clamp(-0.5, 0.5),
            },
            Self::Prism {
                profile, length, ..
            } => match at.checked_sub(1) {
                None => stretch(0, *length),
                Some(n) => Vec3::ith(1 + n % 2, corner_weight(profile, n / 2, [p.y, p.z])),
            },
            Self::Mesh { scale, .. } => p / *scale,
            Self::Triangles { .. } => Vec3::zeros(),
        }
    }
}

/// Mean value coordinate of a point for a corner of a convex polygon: 1 there, linear along the sides, 0 on those that don't meet there.
///
/// # References
/// M. S. Floater, "Mean value coordinates", Comput. Aided Geom. Design 20 (2003) 19–27.
fn corner_weight(profile: &[[f64; 2]], corner: usize, p: [f64; 2]) -> f64 {
    let n = profile.len();
    let to = |k: usize| [profile[k % n][0] - p[0], profile[k % n][1] - p[1]];
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
    let size = profile
        .iter()
        .flatten()
        .fold(0.0, |m: f64, x| m.max(x.abs()));
    // On a side, and at its ends, where the formula is 0/0.
    for k in 0..n {
        let (a, b) = (to(k), to(k + 1));
        let side = [b[0] - a[0], b[1] - a[1]];
        let square = dot(side, side);
        let t = -dot(a, side) / square;
        let off = cross(a, side).abs() / square.sqrt();
        if off <= 1e-9 * size && (-1e-9..=1.0 + 1e-9).contains(&t) {
            return match corner {
                c if c == k => 1.0 - t,
                c if c == (k + 1) % n => t,
                _ => 0.0,
            };
        }
    }
    // tan of half the angle between two corners, seen from the point.
    let half = |k: usize| {
        let (a, b) = (to(k), to(k + 1));
        let lengths = dot(a, a).sqrt() * dot(b, b).sqrt();
        cross(a, b) / (lengths + dot(a, b))
    };
    let weight = |k: usize| (half(k + n - 1) + half(k)) / dot(to(k), to(k)).sqrt();
    let all: f64 = (0..n).map(weight).sum();
    weight(corner) / all
}

#[cfg(test)]
mod tests {
    use super::super::build;
    use super::*;
    use std::path::Path;

    /// Zero on the surface; of the order of the distance from it, over a length of the shape.
    fn level(shape: &Shape, p: &Vec3) -> f64 {
        let round = p.x.hypot(p.y);
        match shape {
            Shape::Sphere { radius, .. } => p.norm() / radius - 1.0,
            Shape::Ellipsoid { semi_axes, .. } => {
                p.component_div(&Vec3::from(*semi_axes)).norm() - 1.0
            }
            Shape::Box { size, .. } => 2.0 * p.component_div(&Vec3::from(*size)).amax() - 1.0,
            Shape::Cylinder { radius, length, .. } => {
                (round / radius).max(2.0 * p.z.abs() / length) - 1.0
            }
            Shape::Capsule { radius, length, .. } => {
                let over = (p.z.abs() - 0.5 * length).max(0.0);
                round.hypot(over) / radius - 1.0
            }
            Shape::Prism {
                profile, length, ..
            } => {
                let n = profile.len();
                let off = |k: usize| {
                    let (a, b) = (profile[k], profile[(k + 1) % n]);
                    let along = [b[0] - a[0], b[1] - a[1]];
                    let cross = along[1] * (p.y - a[0]) - along[0] * (p.z - a[1]);
                    cross / along[0].hypot(along[1])
                };
                let sides = (0..n).map(off).fold(f64::NEG_INFINITY, f64::max);
                sides.max(p.x.abs() - 0.5 * length)
            }
            Shape::Mesh { .. } | Shape::Triangles { .. } => f64::NAN,
        }
    }

    fn shapes() -> Vec<Shape> {
        vec![
            Shape::sphere(0.7),
            Shape::ellipsoid([0.5, 0.2, 0.9]),
            Shape::cuboid([0.4, 1.2, 0.1]),
            Shape::cylinder(0.3, 1.1),
            Shape::capsule(0.3, 1.1),
            Shape::prism([[0.0, 0.0], [1.0, -0.1], [1.2, 0.6], [0.2, 0.8]], 0.5),
        ]
    }

    #[test]
    fn points_of_the_surface_stay_on_the_surface_of_the_changed_shape() {
        for shape in shapes() {
            let mesh = build(&shape, Path::new(""), Some(300)).unwrap();
            for (at, (name, value)) in shape.parameters().iter().enumerate() {
                let h = 1e-5 * value.abs().max(0.1);
                let changed = shape.with_parameter(name, value + h).unwrap();
                for p in mesh.vertices() {
                    let moved = p + h * shape.parameter_velocity(at, p);
                    let off = level(&changed, &moved).abs();
                    assert!(off < 1e-8, "{} {name}: {p:?} is {off:e} off", shape.kind());
                }
            }
        }
    }

    #[test]
    fn weights_of_a_polygon_are_linear() {
        let profile = [[0.0, 0.0], [1.0, -0.1], [1.2, 0.6], [0.2, 0.8]];
        for p in [[0.5, 0.3], [0.9, 0.1], [0.6, -0.06], [1.2, 0.6], [0.1, 0.4]] {
            let weights: Vec<f64> = (0..4).map(|k| corner_weight(&profile, k, p)).collect();
            for c in 0..2 {
                let x: f64 = weights.iter().zip(&profile).map(|(w, v)| w * v[c]).sum();
                assert!((x - p[c]).abs() < 1e-12, "{p:?} {weights:?}");
            }
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_parameter_that_would_turn_a_shape_inside_out_is_refused_by_name() {
        let told = Shape::cuboid([1.0; 3]).with_parameter("size.y", -0.2);
        let told = told.unwrap_err().to_string();
        assert!(told.contains("size.y") && told.contains("-0.2"), "{told}");
        let told = Shape::sphere(1.0).with_parameter("size.y", 1.0);
        assert!(told.unwrap_err().to_string().contains("radius"));
    }
}
