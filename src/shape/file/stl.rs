//! STL, text and binary. Coordinates are in single precision, and each face has vertices of its
//! own: they are merged afterwards.

use super::{Parsed, Raw, brief};
use crate::geometry::TriMesh;
use hydrograd_adjoint::lie::Vec3;
use std::fs::File;
use std::io::{self, BufWriter, Cursor, Write};
use std::path::Path;

/// Header, count; then so many bytes a face.
const PREFIX: usize = 84;
const FACE: usize = 50;

/// Reads all faces, text or binary by what is inside: many binary files begin with "solid", as
/// text does.
pub(super) fn parse(bytes: &[u8]) -> Parsed {
    let declared = bytes
        .get(80..PREFIX)
        .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let needed = declared.map(|n| PREFIX + FACE * n);
    let text = String::from_utf8_lossy(bytes).to_ascii_lowercase();
    let start = text.trim_start_matches(['\u{feff}', ' ', '\t', '\r', '\n']);
    let is_text = needed != Some(bytes.len())
        && start.starts_with("solid")
        && (start.contains("facet") || start.contains("endsolid"));
    let mesh = if is_text {
        stl_io::read_stl(&mut Cursor::new(one_solid(start)?)).map_err(|e| {
            format!(
                "{}; the file may be cut off or not be text STL: export it again, as binary",
                brief(&e.to_string())
            )
        })?
    } else {
        let length = bytes.len();
        let Some((n, needed)) = declared.zip(needed) else {
            return Err(format!(
                "{length} bytes are too few for an STL file; export it again"
            ));
        };
        if needed > length {
            return Err(format!(
                "not a complete binary STL: it declares {n} faces, which take {needed} bytes, \
                 and has {length}; export it again"
            ));
        }
        // A header that looks like text would be taken for it.
        let mut binary = bytes.to_vec();
        binary[..80].fill(b' ');
        stl_io::read_stl(&mut Cursor::new(binary)).map_err(|e| format!("{e}; export it again"))?
    };
    let vertices = mesh.vertices.iter();
    let vertices = vertices.map(|v| Vec3::from(v.0.map(f64::from)));
    Ok(Raw {
        vertices: vertices.collect(),
        faces: mesh.faces.iter().map(|f| f.vertices).collect(),
        ..Raw::default()
    })
}

/// All solids of a (lower-case) text as one: the reader stops after the first.
fn one_solid(text: &str) -> std::result::Result<String, String> {
    let mut body = String::with_capacity(text.len() + 32);
    body.push_str("solid all\n");
    let (mut begun, mut ended) = (0, 0);
    for line in text.lines() {
        match line.split_whitespace().next() {
            Some("solid") => begun += 1,
            Some("endsolid") => ended += 1,
            _ => {
                body.push_str(line);
                body.push('\n');
            }
        }
    }
    if begun != ended {
        return Err(format!(
            "{begun} `solid` and {ended} `endsolid`: the file is cut off; export it again"
        ));
    }
    body.push_str("endsolid\n");
    Ok(body)
}

/// Writes a mesh as binary STL, in single precision.
///
/// # Errors
/// A file that can't be written.
pub(super) fn write(mesh: &TriMesh, path: &Path) -> io::Result<()> {
    let single = |x: &Vec3| stl_io::Vector::new([x.x as f32, x.y as f32, x.z as f32]);
    let triangle = |f: usize| stl_io::Triangle {
        normal: single(&mesh.normal(f)),
        vertices: mesh.faces()[f].map(|v| single(&mesh.vertices()[v])),
    };
    let triangles: Vec<stl_io::Triangle> = (0..mesh.faces().len()).map(triangle).collect();
    let mut out = BufWriter::new(File::create(path)?);
    stl_io::write_stl(&mut out, triangles.iter())?;
    out.flush()
}
