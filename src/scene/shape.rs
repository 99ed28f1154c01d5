//! The shapes of a scene as numbers that may be changed.

use super::{Scene, Shape};
use crate::{Error, Result};

impl Scene {
    /// The parameters of all bodies' shapes with their values, m (a mesh's scale: 1): `body.radius`, `body.size.y` … ([`Shape::parameters`]).
    pub fn shape_parameters(&self) -> Vec<(String, f64)> {
        let mut out = Vec::new();
        for body in &self.bodies {
            let own = body.shape.iter().flat_map(Shape::parameters);
            out.extend(own.map(|(name, value)| (format!("{}.{name}", body.name), value)));
        }
        out
    }

    /// The scene with another value of a shape parameter: one of [`Scene::shape_parameters`], or a coordinate of a vertex of triangles given number by number
    /// (`hull.vertex.17.x`).
    ///
    /// # Errors
    /// A name that isn't there, or a value that would invert the body or that its shape can't have.
    pub fn with_shape_parameter(&self, name: &str, value: f64) -> Result<Self> {
        let refused = |right: String| Error::input("shape parameter", format!("{name:?}"), right);
        let of = |body: &super::Body| {
            name.strip_prefix(&body.name)?
                .strip_prefix('.')
                .map(str::len)
        };
        // The longest name that fits, should one body's name begin with another's.
        let fitting = self.bodies.iter().enumerate();
        let fitting = fitting.filter_map(|(b, body)| Some((of(body)?, b)));
        let found = fitting.min().and_then(|(rest, b)| {
            let shape = self.bodies[b].shape.as_ref()?;
            Some((b, shape, &name[name.len() - rest..]))
        });
        let Some((b, shape, own)) = found else {
            let known = self.shape_parameters().into_iter().map(|(name, _)| name);
            let known: Vec<String> = known.collect();
            return Err(refused(format!("must be one of {known:?}")));
        };
        let changed = match (shape, vertex(own)) {
            (Shape::Triangles { vertices, faces }, Some((v, axis))) => {
                let mut vertices = vertices.clone();
                let count = vertices.len();
                let at = vertices.get_mut(v);
                *at.map(|x| &mut x[axis])
                    .ok_or_else(|| refused(format!("the mesh has {count} vertices")))? = value;
                Shape::triangles(vertices, faces.clone())
            }
            (Shape::Mesh { .. }, Some(_)) => {
                return Err(refused(
                    "the vertices of a file are the file's: give the shape as triangles".into(),
                ));
            }
            _ => (shape.with_parameter(own, value))
                .map_err(|e| e.of(&format!("body {:?}", self.bodies[b].name)))?,
        };
        let mut out = self.clone();
        out.bodies[b].shape = Some(changed);
        Ok(out)
    }
}

/// Number and axis of `vertex.17.x`.
fn vertex(name: &str) -> Option<(usize, usize)> {
    let (number, axis) = name.strip_prefix("vertex.")?.split_once('.')?;
    let axis = ["x", "y", "z"].iter().position(|a| *a == axis)?;
    Some((number.parse().ok()?, axis))
}
