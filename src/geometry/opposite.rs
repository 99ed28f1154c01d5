//! What lies opposite a surface: how far a point is from it, with two derivatives.

use super::casing::Casing;
use super::convex::{Field, Form, Solid};
use super::mesh::TriMesh;
use super::tree::MeshTree;
use super::triangle::Feature;
use super::wall::HalfSpace;
use hydrograd_adjoint::lie::Vec3;

/// A surface that distances are taken from: of a shape by formula, of a mesh, or a wall.
pub(crate) struct Opposite(Kind);

enum Kind {
    /// In the frame of its body.
    Solid(Box<Solid>),
    /// In the frame of its body.
    Mesh(Box<MeshTree>),
    /// In the world's frame.
    Wall(HalfSpace),
}

impl Opposite {
    /// That of a body: the shape by formula, where there is one, or else its mesh.
    pub fn of_body(solid: Option<&Solid>, mesh: &TriMesh) -> Self {
        match solid {
            Some(solid) => Self(Kind::Solid(Box::new(solid.clone()))),
            None => Self(Kind::Mesh(Box::new(MeshTree::new(mesh)))),
        }
    }

    /// A wall.
    pub fn of_wall(wall: HalfSpace) -> Self {
        Self(Kind::Wall(wall))
    }

    /// Whether it is known to be convex: a shape by formula, or a wall.
    pub fn is_convex(&self) -> bool {
        !matches!(self.0, Kind::Mesh(_))
    }

    /// A box around it, if it is a body.
    pub fn casing(&self) -> Option<Casing> {
        match &self.0 {
            Kind::Solid(solid) => Some(Casing::new(solid.bounds())),
            Kind::Mesh(tree) => Some(tree.casing()),
            Kind::Wall(_) => None,
        }
    }

    /// The wall's normal, if it is one.
    pub fn wall_normal(&self) -> Option<&Vec3> {
        match &self.0 {
            Kind::Wall(wall) => Some(&wall.normal),
            _ => None,
        }
    }

    /// Signed distance of a point, in the frame of the surface.
    pub fn field(&self, p: &Vec3) -> Field {
        match &self.0 {
            Kind::Solid(solid) => solid.field(p),
            Kind::Wall(wall) => Field::flat(wall.height(p), wall.normal),
            Kind::Mesh(tree) => {
                let (nearest, face) = tree.closest(p);
                let triangle = &tree.triangles[face];
                match triangle.closest(p).1 {
                    Feature::Face => {
                        let height = (p - nearest).dot(&triangle.normal);
                        Field::flat(height, triangle.normal)
                    }
                    Feature::Edge(k) => {
                        let [a, b] = [0, 1].map(|i| triangle.corners[(k + i) % 3]);
                        Field::round(p - nearest, Some(&(b - a).normalize()), 0.0)
                    }
                    Feature::Corner(_) => Field::round(p - nearest, None, 0.0),
                }
            }
        }
    }
}

impl Solid {
    /// Whether any of its surface is: of all but polyhedra.
    pub(crate) fn is_curved(&self) -> bool {
        match &self.form {
            Form::Core(core) => core.radius > 0.0,
            Form::Ellipsoid(_) | Form::Cylinder(_) => true,
        }
    }

    /// Whether any of its surface is flat.
    pub(crate) fn has_faces(&self) -> bool {
        match &self.form {
            Form::Core(core) => !core.faces.is_empty(),
            Form::Ellipsoid(_) => false,
            Form::Cylinder(_) => true,
        }
    }

    /// Signed distance of a point in the frame of the body.
    pub(crate) fn field(&self, p: &Vec3) -> Field {
        let own = self.form.field(&self.offset.apply_inverse(p));
        let about = Field {
            distance: own.distance - self.form.radius(),
            ..own
        };
        about.rotated(&self.offset.rotation)
    }
}
