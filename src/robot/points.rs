//! Points whose convex hull stands for a shape by formula.

use crate::Result;
use crate::shape::{Shape, build};
use hydrograd_adjoint::lie::Vec3;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Points on a circle.
const ROUND: usize = 48;
/// Faces of a ball.
const BALL: usize = 1280;

/// Points, m, in the shape's frame, whose hull has its volume: corners are where they are, round surfaces a little outside of themselves as flat faces cut off what
/// lies between.
///
/// # Errors
/// As [`build`].
pub(super) fn points(shape: &Shape) -> Result<Vec<Vec3>> {
    Ok(match *shape {
        Shape::Box { size, .. } => corners(size),
        Shape::Cylinder { radius, length, .. } => [-0.5 * length, 0.5 * length]
            .into_iter()
            .flat_map(|z| ring(radius, z))
            .collect(),
        Shape::Sphere { radius, .. } => ball([radius; 3])?,
        Shape::Ellipsoid { semi_axes, .. } => ball(semi_axes)?,
        Shape::Capsule { radius, length, .. } => {
            let ball = ball([radius; 3])?;
            // The ball is its own mirror image: what lies on the equator, to rounding, is at both ends.
            let half = |end: f64| {
                let side = ball.iter().filter(move |x| end * x.z >= -1e-9 * radius);
                side.map(move |x| x + Vec3::z() * (0.5 * end * length))
            };
            half(1.0).chain(half(-1.0)).collect()
        }
        Shape::Prism { .. } | Shape::Mesh { .. } | Shape::Triangles { .. } => {
            build(shape, Path::new(""), None)?.vertices().to_vec()
        }
    })
}

fn corners(size: [f64; 3]) -> Vec<Vec3> {
    let side = |k: usize, bit: usize| size[bit] * if k >> bit & 1 == 1 { 0.5 } else { -0.5 };
    (0..8)
        .map(|k| Vec3::new(side(k, 0), side(k, 1), side(k, 2)))
        .collect()
}

/// A polygon of a circle's area.
fn ring(radius: f64, z: f64) -> impl Iterator<Item = Vec3> {
    let step = TAU / ROUND as f64;
    let radius = radius * (TAU / (ROUND as f64 * step.sin())).sqrt();
    (0..ROUND).map(move |k| {
        let (sine, cosine) = (k as f64 * step).sin_cos();
        Vec3::new(radius * cosine, radius * sine, z)
    })
}

fn ball(semi_axes: [f64; 3]) -> Result<Vec<Vec3>> {
    let unit = build(&Shape::sphere(1.0), Path::new(""), Some(BALL))?;
    let factor = (4.0 / 3.0 * PI / unit.mass_properties().volume).cbrt();
    let axes = Vec3::from(semi_axes) * factor;
    let all = unit.vertices().iter();
    Ok(all.map(|x| x.component_mul(&axes)).collect())
}
