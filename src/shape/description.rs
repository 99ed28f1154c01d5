//! What a user writes of a shape, in Rust or in a scene file.

use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Faces of a shape that doesn't ask for a number: four times refined icosahedron for spheres.
pub const DEFAULT_FACES: usize = 1280;
/// Most faces that a shape may ask for.
pub const MAX_FACES: usize = 4_000_000;

/// A closed surface, by formula or from a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, strum::IntoStaticStr)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[strum(serialize_all = "kebab-case")]
pub enum Shape {
    /// Sphere, a subdivided icosahedron.
    Sphere {
        /// Radius, m.
        radius: f64,
        /// Target number of faces; the nearest that the subdivision allows is taken.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        faces: Option<usize>,
    },
    /// Ellipsoid along the axes, a stretched subdivided icosahedron.
    Ellipsoid {
        /// Semi-axes, m.
        semi_axes: [f64; 3],
        /// Target number of faces.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        faces: Option<usize>,
    },
    /// Box along the axes.
    Box {
        /// Edge lengths, m.
        size: [f64; 3],
        /// Target number of faces.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        faces: Option<usize>,
    },
    /// Cylinder along z.
    Cylinder {
        /// Radius, m.
        radius: f64,
        /// Length along z, m.
        length: f64,
        /// Target number of faces.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        faces: Option<usize>,
    },
    /// Capsule along z: a cylinder with hemispherical ends.
    Capsule {
        /// Radius, m.
        radius: f64,
        /// Length of the cylindrical part along z, m.
        length: f64,
        /// Target number of faces.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        faces: Option<usize>,
    },
    /// Prism along x: a convex profile in the y-z plane, extruded.
    Prism {
        /// Corners of the profile, (y, z), m, in either order around it; must be convex.
        profile: Vec<[f64; 2]>,
        /// Length along x, m; the prism reaches from −length/2 to length/2.
        length: f64,
        /// Target number of faces.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        faces: Option<usize>,
    },
    /// A closed triangle mesh in a file (OBJ, STL, PLY; DAE with the feature `urdf`).
    Mesh {
        /// The file; relative to the scene file.
        path: PathBuf,
        /// Factor from file units to metres.
        #[serde(default = "one")]
        scale: f64,
    },
    /// A closed triangle mesh given number by number.
    Triangles {
        /// Vertices, m.
        vertices: Vec<[f64; 3]>,
        /// Vertex numbers of each face, counted from 0, counter-clockwise seen from outside.
        faces: Vec<[usize; 3]>,
    },
}

fn one() -> f64 {
    1.0
}

impl Shape {
    /// A sphere of this radius, m.
    pub fn sphere(radius: f64) -> Self {
        Self::Sphere {
            radius,
            faces: None,
        }
    }

    /// An ellipsoid with these semi-axes along x, y, z, m.
    pub fn ellipsoid(semi_axes: [f64; 3]) -> Self {
        Self::Ellipsoid {
            semi_axes,
            faces: None,
        }
    }

    /// A box with these edge lengths along x, y, z, m.
    pub fn cuboid(size: [f64; 3]) -> Self {
        Self::Box { size, faces: None }
    }

    /// A cylinder along z: radius and length, m.
    pub fn cylinder(radius: f64, length: f64) -> Self {
        Self::Cylinder {
            radius,
            length,
            faces: None,
        }
    }

    /// A capsule along z: radius, and length of its cylindrical part, m.
    pub fn capsule(radius: f64, length: f64) -> Self {
        Self::Capsule {
            radius,
            length,
            faces: None,
        }
    }

    /// A prism along x, centred at x = 0: corners (y, z) of its convex profile and its length, m.
    pub fn prism(profile: impl Into<Vec<[f64; 2]>>, length: f64) -> Self {
        Self::Prism {
            profile: profile.into(),
            length,
            faces: None,
        }
    }

    /// A closed triangle mesh in an OBJ, STL, PLY or DAE file, in metres.
    pub fn mesh(path: impl Into<PathBuf>) -> Self {
        Self::Mesh {
            path: path.into(),
            scale: 1.0,
        }
    }

    /// A closed triangle mesh: vertices, m, and faces as triples of their numbers, counted from 0, counter-clockwise seen
    /// from outside.
    pub fn triangles(
        vertices: impl Into<Vec<[f64; 3]>>,
        faces: impl Into<Vec<[usize; 3]>>,
    ) -> Self {
        Self::Triangles {
            vertices: vertices.into(),
            faces: faces.into(),
        }
    }

    /// With this target number of faces; a mesh stays as it is.
    pub fn faces(mut self, faces: usize) -> Self {
        self.set_faces(faces);
        self
    }

    /// Whether it is a mesh, given by its faces; else it is given by formula.
    pub fn is_mesh(&self) -> bool {
        matches!(self, Self::Mesh { .. } | Self::Triangles { .. })
    }

    /// The shape's name in a scene file.
    pub fn kind(&self) -> &'static str {
        self.into()
    }

    /// The target number of faces that it asks for.
    pub(crate) fn asked_faces(&self) -> Option<usize> {
        match self {
            Self::Sphere { faces, .. }
            | Self::Ellipsoid { faces, .. }
            | Self::Box { faces, .. }
            | Self::Cylinder { faces, .. }
            | Self::Capsule { faces, .. }
            | Self::Prism { faces, .. } => *faces,
            Self::Mesh { .. } | Self::Triangles { .. } => None,
        }
    }

    /// Sets the target number of faces; a mesh stays as it is.
    pub fn set_faces(&mut self, target: usize) {
        match self {
            Self::Sphere { faces, .. }
            | Self::Ellipsoid { faces, .. }
            | Self::Box { faces, .. }
            | Self::Cylinder { faces, .. }
            | Self::Capsule { faces, .. }
            | Self::Prism { faces, .. } => *faces = Some(target),
            Self::Mesh { .. } | Self::Triangles { .. } => {}
        }
    }
}
