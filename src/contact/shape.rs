//! The contact shape of a body.

use super::core::Core;
use super::ellipsoid::Ellipsoid;
use super::facets::facets;
use crate::error::Result;
use crate::geometry::{Ball, TriMesh};
use crate::shape::{self, Shape};
use hydrograd_adjoint::lie::{Pose, Vec3};
use std::f64::consts::TAU;
use std::path::Path;

/// Sides of the polyhedron that stands for a cylinder, with its corners on the rims: it is thinner
/// than the cylinder by at most 0.0022 of the radius.
pub const CYLINDER_SIDES: usize = 48;

/// What a body is for contact: a ball, a capsule, an ellipsoid or a convex polyhedron, placed in
/// the body's frame.
#[derive(Clone, Debug)]
pub struct ContactShape {
    pub(super) solid: Solid,
    /// Frame of the shape to frame of the body.
    pub(super) offset: Pose,
    /// A ball around it, frame of the shape.
    ball: Ball,
}

#[derive(Clone, Debug)]
pub(super) enum Solid {
    Ellipsoid(Ellipsoid),
    Core(Core),
}

impl ContactShape {
    /// That of a shape with the pose `offset` in its body (shape to body). Spheres, capsules and
    /// ellipsoids are exact, whatever number of faces the shape asks for; a cylinder is a
    /// polyhedron of [`CYLINDER_SIDES`] sides. Mesh files are relative to `base_dir`.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) if a parameter of the shape can't be, what reading a
    /// mesh can give, and what [`Self::of_mesh`] can.
    pub fn of_shape(shape: &Shape, offset: Pose, base_dir: &Path) -> Result<Self> {
        let name = shape::shape_name(shape);
        shape::validate(shape, &name)?;
        let core = match shape {
            Shape::Sphere { radius, .. } => Core::ball(*radius),
            Shape::Capsule { radius, length, .. } => Core::capsule(*radius, *length),
            Shape::Ellipsoid { semi_axes, .. } => {
                let semi_axes = Vec3::from(*semi_axes);
                let solid = Solid::Ellipsoid(Ellipsoid { semi_axes });
                return Ok(Self::new(solid, offset));
            }
            Shape::Box { size, .. } => {
                let [x, y, z] = size.map(|l| 0.5 * l);
                let profile = [[-y, -z], [y, -z], [y, z], [-y, z]];
                extrude(&name, &profile, x, along_x)?
            }
            Shape::Prism {
                profile, length, ..
            } => extrude(&name, &corners_of(profile), 0.5 * length, along_x)?,
            Shape::Cylinder { radius, length, .. } => {
                let rim: [_; CYLINDER_SIDES] = std::array::from_fn(|k| {
                    let (sin, cos) = (TAU * k as f64 / CYLINDER_SIDES as f64).sin_cos();
                    [radius * cos, radius * sin]
                });
                let along_z = |z: f64, [x, y]: [f64; 2]| Vec3::new(x, y, z);
                extrude(&name, &rim, 0.5 * length, along_z)?
            }
            Shape::Mesh { .. } | Shape::Triangles { .. } => {
                return Self::of_mesh(&shape::build(shape, base_dir, None)?, offset);
            }
        };
        Ok(Self::new(Solid::Core(core), offset))
    }

    /// That of a convex mesh with the pose `offset` in its body (mesh to body). Triangles that lie
    /// in one plane to within 10⁻⁶ of the mesh's diameter are one face.
    ///
    /// # Errors
    /// [`Error::Unsupported`](crate::Error::Unsupported) if a vertex lies outside the plane of a
    /// face by more than 10⁻⁵ of the diameter, saying by how much, or if the mesh has more than
    /// 20 000 triangles; [`Error::Mesh`](crate::Error::Mesh) if its flat parts don't fit together.
    pub fn of_mesh(mesh: &TriMesh, offset: Pose) -> Result<Self> {
        let (corners, loops) = facets(mesh)?;
        let core = Core::polyhedron(mesh.name(), corners, &loops)?;
        Ok(Self::new(Solid::Core(core), offset))
    }

    fn new(solid: Solid, offset: Pose) -> Self {
        let ball = match &solid {
            Solid::Ellipsoid(e) => Ball {
                center: Vec3::zeros(),
                radius: e.semi_axes.max(),
            },
            Solid::Core(core) => {
                let ball = Ball::around(core.corners.iter());
                Ball {
                    radius: ball.radius + core.radius,
                    ..ball
                }
            }
        };
        Self {
            solid,
            offset,
            ball,
        }
    }

    /// A ball around the body, world frame, for the pose of the body.
    pub fn ball_at(&self, pose: &Pose) -> Ball {
        self.ball.transformed(&self.offset).transformed(pose)
    }

    /// Radius of the ball around the body, m.
    pub fn radius(&self) -> f64 {
        self.ball.radius
    }
}

/// A prism over a counter-clockwise profile, from −`half` to `half` along the axis that `place`
/// gives it; `place` must keep the handedness.
fn extrude(
    name: &str,
    profile: &[[f64; 2]],
    half: f64,
    place: impl Fn(f64, [f64; 2]) -> Vec3,
) -> Result<Core> {
    let n = profile.len();
    let end = |at: f64| profile.iter().map(move |&p| (at, p));
    let corners = end(-half)
        .chain(end(half))
        .map(|(at, p)| place(at, p))
        .collect();
    let mut loops = vec![(0..n).rev().collect(), (n..2 * n).collect()];
    loops.extend((0..n).map(|k| {
        let next = (k + 1) % n;
        vec![k, next, n + next, n + k]
    }));
    Core::polyhedron(name, corners, &loops)
}

/// Length along x, profile in the y-z plane.
fn along_x(x: f64, [y, z]: [f64; 2]) -> Vec3 {
    Vec3::new(x, y, z)
}

/// The corners of a convex profile, counter-clockwise.
fn corners_of(profile: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let [[ax, ay], [bx, by], [cx, cy]] = [profile[0], profile[1], profile[2]];
    let mut corners = profile.to_vec();
    if (bx - ax) * (cy - by) < (by - ay) * (cx - bx) {
        corners.reverse();
    }
    corners
}
