//! Files into meshes.

use super::raw::Repairs;
use super::{obj, ply, repair, stl};
use crate::error::{Error, Result};
use crate::geometry::{MeshReport, TriMesh, check_parts};
use hydrograd_adjoint::lie::Vec3;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// What a file holds, mended where that is safe, and not yet judged.
#[derive(Clone, Debug)]
pub struct FileMesh {
    /// The path, for messages.
    pub name: String,
    /// Vertices, m.
    pub vertices: Vec<Vec3>,
    /// Faces, vertex numbers counted from 0; any number can stand here.
    pub faces: Vec<[usize; 3]>,
    /// What was done to close the surface.
    pub repairs: Repairs,
}

impl FileMesh {
    /// All that is wrong with it.
    pub fn check(&self) -> MeshReport {
        check_parts(&self.name, &self.vertices, &self.faces)
    }

    /// The mesh, if nothing is wrong with it.
    ///
    /// # Errors
    /// As [`TriMesh::new`].
    pub fn into_mesh(self) -> Result<TriMesh> {
        TriMesh::new(self.name, self.vertices, self.faces)
    }
}

/// Reads a closed mesh; `scale` is the factor from file units to m.
///
/// # Errors
/// As [`read_unchecked`], and [`Error::Mesh`] if the check finds an error.
pub fn read(path: &Path, scale: f64) -> Result<TriMesh> {
    read_unchecked(path, scale)?.into_mesh()
}

/// Reads whatever mesh a file holds; `scale` is the factor from file units to m. Polygons are
/// split into triangles. Vertices at the same place are merged where a surface needs it to be
/// closed (in STL always), with the numbers in [`FileMesh::repairs`].
///
/// # Errors
/// [`Error::File`] if the file can't be read, [`Error::Parse`] if it is empty, truncated, of
/// unknown extension or not understood, [`Error::Input`] if `scale` isn't finite and positive.
pub fn read_unchecked(path: &Path, scale: f64) -> Result<FileMesh> {
    let name = path.display().to_string();
    if !(scale.is_finite() && scale > 0.0) {
        return Err(Error::input(
            format!("{name}: scale"),
            scale,
            "give a finite, positive factor (0.001 for a file in millimetres)",
        ));
    }
    let extension = path
        .extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default();
    let parse = match extension.as_str() {
        "obj" => obj::parse,
        "stl" => stl::parse,
        "ply" => ply::parse,
        _ => {
            return Err(parse_error(
                path,
                format!("unknown extension {extension:?}; known are .obj, .stl and .ply"),
            ));
        }
    };
    let bytes = std::fs::read(path).map_err(|source| Error::File {
        path: path.to_owned(),
        action: "read",
        source,
    })?;
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(parse_error(path, "the file is empty; export it again"));
    }
    // The parsers of others may panic on what no exporter writes; here that is an error.
    let raw = catch_unwind(AssertUnwindSafe(|| parse(&bytes)))
        .unwrap_or_else(|_| Err("the contents can't be understood; export it again".into()))
        .map_err(|message| parse_error(path, message))?;
    if raw.faces.is_empty() {
        return Err(parse_error(
            path,
            "no faces found; export the surface as polygons or triangles",
        ));
    }
    let mut mesh = repair::mend(raw, extension == "stl");
    for v in &mut mesh.vertices {
        *v *= scale;
    }
    Ok(FileMesh {
        name,
        vertices: mesh.vertices,
        faces: mesh.faces,
        repairs: mesh.repairs,
    })
}

fn parse_error(path: &Path, message: impl Into<String>) -> Error {
    Error::Parse {
        path: path.to_owned(),
        message: message.into(),
    }
}
