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
                let nearest = tree.nearest(p, 0.0);
                let triangle = &tree.triangles[nearest.face];
                let away = p - nearest.point;
                let round = match nearest.feature {
                    Feature::Face => {
                        return Field::flat(away.dot(&triangle.normal), triangle.normal);
                    }
                    Feature::Edge(k) => {
                        let [a, b] = [0, 1].map(|i| triangle.corners[(k + i) % 3]);
                        Field::round(away, Some(&(b - a).normalize()), 0.0)
                    }
                    Feature::Corner(_) => Field::round(away, None, 0.0),
                };
                // In a body an edge or a corner is the nearest where the surface has a notch.
                match nearest.square > 0.0 && tree.inside(p, &nearest) {
                    true => round.negated(),
                    false => round,
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A prism along z over an L whose inner edge is at x = y = 1.
    fn notched() -> TriMesh {
        let outline = [[0., 0.], [2., 0.], [2., 1.], [1., 1.], [1., 2.], [0., 2.]];
        let caps = [[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]];
        let level = |z: f64| outline.map(|[x, y]| Vec3::new(x, y, z));
        let sides = (0..6).flat_map(|i| {
            let j = (i + 1) % 6;
            [[i, j, j + 6], [i, j + 6, i + 6]]
        });
        let ends = caps
            .into_iter()
            .flat_map(|[a, b, c]: [usize; 3]| [[a, c, b], [a + 6, b + 6, c + 6]]);
        let faces = sides.chain(ends).collect();
        TriMesh::new("L", [level(-1.0), level(1.0)].concat(), faces).unwrap()
    }

    #[test]
    fn in_a_notched_body_distances_are_negative() {
        // Split, the inner edge has a vertex in its middle.
        for mesh in [notched(), notched().split()] {
            let surface = Opposite::of_body(None, &mesh);
            let inside = surface.field(&Vec3::new(0.9, 0.9, 0.0));
            assert!((inside.distance + 0.1 * 2f64.sqrt()).abs() < 1e-15);
            // By the inner edge from inside, over a face, by an outer edge and an outer corner.
            for (p, sign) in [
                ([0.9, 0.85, 0.3], -1.0),
                ([0.95, 0.7, -0.4], -1.0),
                ([1.1, 1.3, 0.3], 1.0),
                ([2.1, -0.2, 0.3], 1.0),
                ([2.1, -0.2, 1.2], 1.0),
            ] {
                let p = Vec3::from(p);
                let field = surface.field(&p);
                assert!(sign * field.distance > 0.0, "{p:?}: {field:?}");
                let h = 1e-5;
                for k in 0..3 {
                    let [above, below] = [h, -h].map(|h| surface.field(&(p + Vec3::ith(k, h))));
                    let slope = (above.distance - below.distance) / (2.0 * h);
                    assert!((slope - field.gradient[k]).abs() < 1e-8, "{p:?} {k}");
                    let bend = (above.gradient - below.gradient) / (2.0 * h);
                    let off = (bend - field.hessian.column(k)).amax();
                    assert!(off < 1e-6, "{p:?} {k}: {off:e}");
                }
            }
        }
    }
}
