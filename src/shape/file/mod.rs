//! Mesh files: OBJ, STL (text and binary), PLY (text and binary) and, with the feature `urdf`, DAE (COLLADA), told apart by extension.
//!
//! Whatever is in the file, the answer is a mesh or an error with the path, never a panic.

#[cfg(feature = "urdf")]
mod dae;
mod hull;
mod obj;
mod ply;
mod polygon;
mod repair;
mod stl;

pub use obj::write_obj;

use crate::error::{Error, Result};
use crate::geometry::{MeshReport, TriMesh, check_parts, check_scale};
use hydrograd_adjoint::lie::Vec3;
use serde::Serialize;
use std::io;
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
/// closed (in STL and DAE always), with the numbers in [`FileMesh::repairs`].
///
/// # Errors
/// [`Error::File`] if the file can't be read, [`Error::Parse`] if it is empty, truncated, of
/// unknown extension or not understood, [`Error::Input`] if `scale` isn't finite and positive.
pub fn read_unchecked(path: &Path, scale: f64) -> Result<FileMesh> {
    let name = path.display().to_string();
    check_scale(&name, scale)?;
    if path.is_dir() {
        let why = "this is a folder; give the mesh file itself, e.g. hull.obj";
        return Err(Error::File {
            path: path.to_owned(),
            action: "read",
            source: io::Error::new(io::ErrorKind::IsADirectory, why),
        });
    }
    let wrong = |message: String| Error::Parse {
        path: path.to_owned(),
        message,
    };
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let extension = extension.to_ascii_lowercase();
    let parse = match extension.as_str() {
        "obj" => obj::parse,
        "stl" => stl::parse,
        "ply" => ply::parse,
        #[cfg(feature = "urdf")]
        "dae" => dae::parse,
        _ => {
            let known = match cfg!(feature = "urdf") {
                true => "known are .obj, .stl, .ply and .dae",
                false => "known are .obj, .stl and .ply",
            };
            return Err(wrong(format!("unknown extension {extension:?}; {known}")));
        }
    };
    let bytes = std::fs::read(path).map_err(|source| Error::File {
        path: path.to_owned(),
        action: "read",
        source,
    })?;
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(wrong("the file is empty; export it again".into()));
    }
    // The parsers of others may panic on what no exporter writes; here that is an error.
    let raw = catch_unwind(AssertUnwindSafe(|| parse(&bytes)))
        .unwrap_or_else(|_| Err("the contents can't be understood; export it again".into()))
        .map_err(wrong)?;
    if raw.faces.is_empty() {
        let message = "no faces found; export the surface as polygons or triangles";
        return Err(wrong(message.into()));
    }
    let mut mesh = repair::mend(raw, extension == "stl" || extension == "dae");
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

/// Writes a mesh to a file, by its extension: .obj with all digits, .stl (binary) in single precision; m.
///
/// # Errors
/// [`Error::Input`] for another extension, [`Error::File`] if it can't be written.
pub fn write(mesh: &TriMesh, path: &Path) -> Result<()> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    match extension.to_ascii_lowercase().as_str() {
        "obj" => write_obj(path, mesh),
        "stl" => stl::write(mesh, path).map_err(|source| Error::File {
            path: path.to_owned(),
            action: "write",
            source,
        }),
        _ => Err(Error::input(
            path.display().to_string(),
            format!("extension {extension:?}"),
            "meshes are written as .obj or .stl",
        )),
    }
}

/// What was done to a file's contents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Repairs {
    /// Polygons with more than three corners that were split into triangles.
    pub polygons_split: usize,
    /// Vertices merged with one of exactly the same coordinates.
    pub merged_same: usize,
    /// Vertices merged with one nearby (within 1e-6 of the diameter, or the coordinates' single
    /// precision).
    pub merged_near: usize,
    /// Faces that had no area after the merge and were left out.
    pub collapsed: usize,
}

/// What a parser returns: vertices in file units, triangles with any index.
#[derive(Default)]
struct Raw {
    pub vertices: Vec<Vec3>,
    pub faces: Vec<[usize; 3]>,
    pub repairs: Repairs,
}

impl Raw {
    /// Adds a face, split into triangles where it has more than three corners.
    ///
    /// # Errors
    /// Too many corners: how many, and the remedy.
    fn add_face(&mut self, corners: &[usize]) -> std::result::Result<(), String> {
        match corners {
            [a, b, c] => self.faces.push([*a, *b, *c]),
            _ if corners.len() > polygon::MAX_CORNERS => {
                return Err(format!(
                    "{} corners (at most {}); export triangles",
                    corners.len(),
                    polygon::MAX_CORNERS
                ));
            }
            _ => {
                self.repairs.polygons_split += 1;
                let triangles = polygon::triangles(corners, &self.vertices);
                self.faces.extend(triangles);
            }
        }
        Ok(())
    }
}

/// What is wrong with the contents, and the remedy.
type Parsed = std::result::Result<Raw, String>;

/// A message or line of a file on one line, and not longer than a reader reads.
fn brief(text: &str) -> String {
    let mut line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if let Some((end, _)) = line.char_indices().nth(200) {
        line.truncate(end);
        line.push('…');
    }
    line
}
