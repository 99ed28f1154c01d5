//! The contact shape of a body, or of a convex piece of it.

use super::facets::facets;
use crate::error::Result;
use crate::geometry::convex::{Core, Form};
use crate::geometry::{Ball, Solid, TriMesh};
use crate::shape::{self, Shape};
use hydrograd_adjoint::lie::{Pose, Vec3};
use std::path::Path;

/// What a body, or a piece of one, is for contact: a ball, a capsule, an ellipsoid, a cylinder or a convex polyhedron, placed in
/// the body's frame.
#[derive(Clone, Debug)]
pub struct ContactShape {
    pub(super) solid: Solid,
    /// A ball around it, frame of the body.
    ball: Ball,
}

impl ContactShape {
    /// That of a shape with the pose `offset` in its body (shape to body). Shapes by formula are exact, whatever
    /// number of faces they ask for. Mesh files are relative to `base_dir`.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) if a parameter of the shape can't be, what reading a
    /// mesh can give, and what [`Self::of_mesh`] can.
    pub fn of_shape(shape: &Shape, offset: Pose, base_dir: &Path) -> Result<Self> {
        match shape::solid(shape, offset)? {
            Some(solid) => Ok(Self::new(solid)),
            None => Self::of_mesh(&shape::build(shape, base_dir, None)?, offset),
        }
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
        let form = Form::Core(Core::polyhedron(mesh.name(), corners, &loops)?);
        Ok(Self::new(Solid { form, offset }))
    }

    fn new(solid: Solid) -> Self {
        Self {
            ball: solid.ball(),
            solid,
        }
    }

    /// A ball around the body, world frame, for the pose of the body.
    pub fn ball_at(&self, pose: &Pose) -> Ball {
        self.ball.transformed(pose)
    }

    /// Smallest and largest coordinates, frame of the body, m.
    pub fn bounds(&self) -> [Vec3; 2] {
        self.solid.bounds()
    }

    /// A ball around the body, frame of the body.
    pub fn ball(&self) -> Ball {
        self.ball
    }

    /// Its radius, m.
    pub fn radius(&self) -> f64 {
        self.ball.radius
    }
}
