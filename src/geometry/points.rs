//! Bounds of points and balls around them, areas of triangles, normals at vertices, winding numbers.

use hydrograd_adjoint::kernel;
use hydrograd_adjoint::lie::{Pose, Vec3};
use std::f64::consts::PI;

/// Normal times area of a triangle.
#[inline]
pub(crate) fn area_vector([a, b, c]: &[Vec3; 3]) -> Vec3 {
    (b - a).cross(&(c - a)) * 0.5
}

/// Smallest and largest coordinates; zero without points.
pub(crate) fn bounds<'a>(points: impl Iterator<Item = &'a Vec3>) -> [Vec3; 2] {
    let mut low = Vec3::repeat(f64::INFINITY);
    let mut high = Vec3::repeat(f64::NEG_INFINITY);
    for p in points {
        for i in 0..3 {
            low[i] = low[i].min(p[i]);
            high[i] = high[i].max(p[i]);
        }
    }
    if low.iter().zip(high.iter()).any(|(l, h)| l > h) {
        return [Vec3::zeros(), Vec3::zeros()];
    }
    [low, high]
}

/// Signed volume inside some faces, m³, about the middle of their own bounding box.
pub(super) fn signed_volume(corners: &[[Vec3; 3]]) -> f64 {
    let [low, high] = bounds(corners.iter().flatten());
    let reference = low + (high - low) * 0.5;
    corners
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|x| x - reference);
            a.dot(&b.cross(&c)) / 6.0
        })
        .sum()
}

/// At each vertex the sum of the unit normals of its faces, weighted with their angles there.
pub(super) fn vertex_normal_sums(vertices: &[Vec3], faces: &[[usize; 3]]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::zeros(); vertices.len()];
    for t in faces {
        let c = t.map(|v| vertices[v]);
        let normal = (c[1] - c[0]).cross(&(c[2] - c[0])).normalize();
        for k in 0..3 {
            let (e, f) = (c[(k + 1) % 3] - c[k], c[(k + 2) % 3] - c[k]);
            sums[t[k]] += normal * e.angle(&f);
        }
    }
    sums
}

/// How often a closed surface winds around `x`: 1 inside, 0 outside.
pub(super) fn winding_number<'a>(faces: impl Iterator<Item = &'a [Vec3; 3]>, x: &Vec3) -> f64 {
    faces.map(|c| kernel::flux(c, 1.0, x)).sum::<f64>() / (4.0 * PI)
}

/// A ball that holds a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its centre, m.
    pub center: Vec3,
    /// Its radius, m.
    pub radius: f64,
}

impl Ball {
    /// Around the middle of the bounding box of some points, as large as they need; of radius zero about the
    /// origin without points.
    pub fn around<'a>(points: impl Iterator<Item = &'a Vec3> + Clone) -> Self {
        let [low, high] = bounds(points.clone());
        let center = 0.5 * (low + high);
        let far = |r: f64, x: &Vec3| r.max((x - center).norm());
        Self {
            center,
            radius: points.fold(0.0, far),
        }
    }

    /// The ball around the body placed at `pose`.
    pub fn transformed(&self, pose: &Pose) -> Self {
        Self {
            center: pose.apply(&self.center),
            radius: self.radius,
        }
    }

    /// Between two balls, m; negative where they overlap.
    pub fn distance(&self, other: &Self) -> f64 {
        (other.center - self.center).norm() - (self.radius + other.radius)
    }
}
