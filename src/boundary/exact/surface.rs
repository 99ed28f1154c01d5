//! The surface of a sphere or an ellipsoid, and the potential on it when the body moves in water at rest.
//!
//! On the ellipsoid itself Lamb's potentials are polynomials: along x, and about x, with the added masses M and the volume V,
//!
//! ```text
//! φ = (M_11/V) x          φ = 5 M_44/(V (b² − c²)) y z
//! ```
//!
//! since M = ∮ φ q dA with the normal velocities q = n_x and y n_z − z n_y.
//!
//! # References
//! H. Lamb, Hydrodynamics (1932), art. 114–115.

use super::{ROUND, lamb, twist_in_shape};
use crate::Result;
use crate::adjoint::lie::{Mat6, Pose, Vec3, Vec6};
use crate::geometry::Faces;
use std::f64::consts::PI;

/// An ellipsoid's surface in patches over the faces of a mesh, body frame.
#[derive(Clone, Debug)]
pub struct EllipsoidSurface {
    /// The patches: corners of the faces, centroids on the ellipsoid, its normals and areas there.
    pub faces: Faces,
    pose: Pose,
    semi_axes: Vec3,
    /// Twist about the shape's origin, in its frame, of a body's twist.
    move_in: Mat6,
    /// Factors of x, y, z, yz, zx, xy.
    factors: Vec6,
}

impl EllipsoidSurface {
    /// The ellipsoid of `semi_axes` (m), whose frame is at `pose` in the body's frame, over the faces of a mesh of it.
    ///
    /// # Errors
    /// Semi-axes that aren't finite and positive.
    pub fn new(semi_axes: [f64; 3], pose: &Pose, faces: &Faces) -> Result<Self> {
        let axes = Vec3::from(semi_axes);
        let mass = lamb::added_mass(semi_axes)?;
        let volume = 4.0 / 3.0 * PI * axes.product();
        let square = axes.component_mul(&axes);
        let factors = Vec6::from_fn(|i, _| match i {
            0..3 => mass[(i, i)] / volume,
            _ => {
                let apart = square[(i + 1) % 3] - square[(i + 2) % 3];
                match apart.abs() > ROUND * square.max() {
                    true => 5.0 * mass[(i, i)] / (volume * apart),
                    false => 0.0,
                }
            }
        });
        let mut out = faces.clone();
        for (i, corners) in faces.corners.iter().enumerate() {
            // On the unit sphere that the ellipsoid is an image of.
            let [a, b, c] =
                corners.map(|x| pose.apply_inverse(&x).component_div(&axes).normalize());
            let middle = toward_middle(&a, &b, &c);
            let normal = middle.component_div(&axes);
            out.areas[i] = solid_angle(&a, &b, &c) * axes.product() * normal.norm();
            out.centres[i] = pose.apply(&middle.component_mul(&axes));
            out.normals[i] = pose.rotation * normal.normalize();
        }
        Ok(Self {
            faces: out,
            pose: *pose,
            semi_axes: axes,
            move_in: twist_in_shape(pose),
            factors,
        })
    }

    /// φ at the centroid of each patch for a twist of the body (m/s, rad/s), its frame: m²/s.
    pub fn potentials(&self, twist: &Vec6) -> Vec<f64> {
        let moves = self.weighed(twist);
        let of = |at: &Vec3| {
            let x = self.pose.apply_inverse(at);
            let [linear, products] = [x, Vec3::new(x.y * x.z, x.z * x.x, x.x * x.y)];
            moves[0].dot(&linear) + moves[1].dot(&products)
        };
        self.faces.centres.iter().map(of).collect()
    }

    /// ∇_s φ there, body frame: m/s.
    pub fn gradients(&self, twist: &Vec6) -> Vec<Vec3> {
        let [linear, products] = self.weighed(twist);
        let of = |(at, normal): (&Vec3, &Vec3)| {
            let x = self.pose.apply_inverse(at);
            let turned = Vec3::new(
                products.y * x.z + products.z * x.y,
                products.z * x.x + products.x * x.z,
                products.x * x.y + products.y * x.x,
            );
            let slope = self.pose.rotation * (linear + turned);
            slope - normal * normal.dot(&slope)
        };
        let places = self.faces.centres.iter().zip(&self.faces.normals);
        places.map(of).collect()
    }

    /// The point of the ellipsoid over one near it, seen from its middle; body frame, m.
    pub fn lifted(&self, x: &Vec3) -> Vec3 {
        let local = self.pose.apply_inverse(x);
        let size = local.component_div(&self.semi_axes).norm();
        match size > 0.0 {
            true => self.pose.apply(&(local / size)),
            false => *x,
        }
    }

    fn weighed(&self, twist: &Vec6) -> [Vec3; 2] {
        let moves = (self.move_in * twist).component_mul(&self.factors);
        [0, 3].map(|at| moves.fixed_rows::<3>(at).into_owned())
    }
}

/// Solid angle of the triangle of three unit vectors.
fn solid_angle(a: &Vec3, b: &Vec3, c: &Vec3) -> f64 {
    let volume = a.dot(&b.cross(c)).abs();
    2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// Direction of the centroid of the spherical triangle of three unit vectors: of ½ Σ (angle) (unit normal) over its sides.
fn toward_middle(a: &Vec3, b: &Vec3, c: &Vec3) -> Vec3 {
    let side = |p: &Vec3, q: &Vec3| {
        let normal = p.cross(q);
        let sine = normal.norm();
        match sine > 0.0 {
            true => normal * (sine.atan2(p.dot(q)) / sine),
            false => Vec3::zeros(),
        }
    };
    let sum = side(a, b) + side(b, c) + side(c, a);
    let along = match sum.dot(&(a + b + c)) < 0.0 {
        true => -sum,
        false => sum,
    };
    along
        .try_normalize(0.0)
        .unwrap_or_else(|| (a + b + c).normalize())
}
