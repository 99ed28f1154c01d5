//! The shapes of a scene as numbers that may be changed.

use super::{Scene, Shape};
use crate::shape;
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

impl Scene {
    /// The files of meshes, of all bodies and of their pieces for contact, in their order.
    pub(crate) fn mesh_paths(&self) -> impl Iterator<Item = &PathBuf> {
        let shapes = self.bodies.iter().flat_map(|body| {
            let pieces = body.collision.iter().map(|piece| &piece.shape);
            body.shape.iter().chain(pieces)
        });
        shapes.filter_map(|shape| match shape {
            Shape::Mesh { path, .. } => Some(path),
            _ => None,
        })
    }

    /// The same, to be changed.
    pub(crate) fn mesh_paths_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let shapes = self.bodies.iter_mut().flat_map(|body| {
            let pieces = body.collision.iter_mut().map(|piece| &mut piece.shape);
            body.shape.iter_mut().chain(pieces)
        });
        shapes.filter_map(|shape| match shape {
            Shape::Mesh { path, .. } => Some(path),
            _ => None,
        })
    }

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
        self.with_shape_parameters([(name, value)])
    }

    /// The same of several at once, which are checked together.
    ///
    /// # Errors
    /// As [`Scene::with_shape_parameter`].
    pub fn with_shape_parameters<'n>(
        &self,
        values: impl IntoIterator<Item = (&'n str, f64)>,
    ) -> Result<Self> {
        let mut out = self.clone();
        let mut changed: BTreeMap<usize, Vec<String>> = BTreeMap::new();
        for (name, value) in values {
            let b = out.set_shape_parameter(name, value)?;
            changed
                .entry(b)
                .or_default()
                .push(format!("{name} = {value}"));
        }
        for (b, told) in changed {
            let Some(shape) = &out.bodies[b].shape else {
                continue;
            };
            let place = format!("shape parameter {}", told.join(", "));
            shape::validate(shape, &place)?;
            if let Shape::Triangles { .. } = shape {
                shape::build(shape, Path::new(""), None).map_err(|e| e.of(&place))?;
            }
        }
        Ok(out)
    }

    /// Sets one, unchecked; its body.
    fn set_shape_parameter(&mut self, name: &str, value: f64) -> Result<usize> {
        let refused = |right: String| Error::input("shape parameter", format!("{name:?}"), right);
        for (b, body) in self.bodies.iter_mut().enumerate() {
            // One body's name may begin with another's.
            let own = name
                .strip_prefix(&body.name)
                .and_then(|n| n.strip_prefix('.'));
            let (Some(own), Some(shape)) = (own, &mut body.shape) else {
                continue;
            };
            let known = shape.parameters();
            if let Some(at) = known.iter().position(|(known, _)| known == own) {
                *shape = shape.with_nth_parameter(at, value);
                return Ok(b);
            }
            match (shape, vertex(own)) {
                (Shape::Triangles { vertices, .. }, Some((v, axis))) => {
                    let count = vertices.len();
                    let at = vertices.get_mut(v);
                    *at.map(|x| &mut x[axis])
                        .ok_or_else(|| refused(format!("the mesh has {count} vertices")))? = value;
                    return Ok(b);
                }
                (Shape::Mesh { .. }, Some(_)) => {
                    return Err(refused(
                        "the vertices of a file are the file's: give the shape as triangles".into(),
                    ));
                }
                _ => {}
            }
        }
        let known = self.shape_parameters().into_iter().map(|(name, _)| name);
        let known: Vec<String> = known.collect();
        Err(refused(format!("must be one of {known:?}")))
    }
}

/// Number and axis of `vertex.17.x`.
fn vertex(name: &str) -> Option<(usize, usize)> {
    let (number, axis) = name.strip_prefix("vertex.")?.split_once('.')?;
    let axis = ["x", "y", "z"].iter().position(|a| *a == axis)?;
    Some((number.parse().ok()?, axis))
}
