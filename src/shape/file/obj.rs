//! Wavefront OBJ: vertex positions and faces; groups, materials, normals and textures are
//! passed over.

use super::{Parsed, Raw, brief};
use crate::error::{Error, Result};
use crate::geometry::TriMesh;
use hydrograd_adjoint::lie::Vec3;
use std::fmt::Write;
use std::path::Path;

/// Reads vertices and faces of all groups as one mesh.
pub(super) fn parse(bytes: &[u8]) -> Parsed {
    // Comments and names may be in any encoding.
    let text = String::from_utf8_lossy(bytes);
    // A mark of the encoding would belong to the first word.
    let lines = statements(text.trim_start_matches('\u{feff}'));
    // The loader passes over faces with fewer than three corners, as points and lines.
    for (number, line) in &lines {
        let mut words = line.split_whitespace();
        if words.next() == Some("f") && words.count() < 3 {
            return Err(format!(
                "line {number}: `{}`: a face has at least three corners; delete the others",
                brief(line)
            ));
        }
    }
    let model = load(lines.iter().map(|(_, l)| l.as_str())).map_err(|e| explain(e, &lines))?;
    let Some(model) = model else {
        return Ok(Raw::default());
    };
    let numbers = numbers(&lines)
        .filter(|numbers| 3 * numbers.len() == model.positions.len())
        .ok_or("the faces can't be understood; export it again")?;
    let mut raw = Raw {
        vertices: vec![Vec3::zeros(); numbers.len()],
        ..Raw::default()
    };
    for (x, &n) in model.positions.chunks_exact(3).zip(&numbers) {
        raw.vertices[n] = Vec3::from_column_slice(x);
    }
    let corners = model.indices.iter().map(|&i| numbers[i as usize]);
    let corners: Vec<usize> = corners.collect();
    // No arities: all faces are triangles.
    let mut arities = model.face_arities;
    if arities.is_empty() {
        arities = vec![3; corners.len() / 3];
    }
    let mut rest = corners.as_slice();
    for arity in arities {
        let (face, tail) = rest
            .split_at_checked(arity as usize)
            .ok_or("the faces can't be understood; export it again")?;
        rest = tail;
        raw.add_face(face)
            .map_err(|e| format!("a polygon with {e}"))?;
    }
    Ok(raw)
}

/// The vertex and face statements with their line numbers; a backslash continues a line.
/// Everything else only splits the surface into groups, and is left out.
fn statements(text: &str) -> Vec<(usize, String)> {
    let mut all = Vec::new();
    let mut lines = text.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        let mut statement = line.trim().to_owned();
        while statement.ends_with('\\') {
            statement.pop();
            let Some((_, more)) = lines.next() else { break };
            statement.push_str(more.trim_end());
        }
        let keyword = statement.split_whitespace().next().unwrap_or_default();
        if matches!(keyword, "v" | "f") {
            // A comment may follow on the line.
            let end = statement.find('#').unwrap_or(statement.len());
            statement.truncate(end);
            all.push((number + 1, statement));
        }
    }
    all
}

/// The loader numbers vertices as faces first name them, and leaves out the others. For each of them its number in the file's order, from 0 and without those left out;
/// of statements that the loader has understood.
fn numbers(lines: &[(usize, String)]) -> Option<Vec<usize>> {
    let is_vertex = |line: &str| line.split_whitespace().next() == Some("v");
    let count = lines.iter().filter(|(_, line)| is_vertex(line)).count();
    // By the file's numbers those of the loader.
    let mut met: Vec<Option<usize>> = vec![None; count];
    let (mut above, mut distinct) = (0, 0);
    for (_, line) in lines {
        if is_vertex(line) {
            above += 1;
            continue;
        }
        for word in line.split_whitespace().skip(1) {
            let given: isize = word.split('/').next()?.parse().ok()?;
            // Negative numbers count back from the face.
            let at = if given < 0 { above + given } else { given - 1 };
            let place = met.get_mut(usize::try_from(at).ok()?)?;
            if place.is_none() {
                *place = Some(distinct);
                distinct += 1;
            }
        }
    }
    let mut numbers = vec![0; distinct];
    for (n, &loaders) in met.iter().flatten().enumerate() {
        numbers[loaders] = n;
    }
    Some(numbers)
}

fn load<'a>(
    lines: impl Iterator<Item = &'a str>,
) -> std::result::Result<Option<tobj::Mesh>, tobj::LoadError> {
    let text: String = lines.flat_map(|line| [line, "\n"]).collect();
    let options = tobj::LoadOptions {
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| {
        Ok((Vec::new(), Default::default()))
    })?;
    // Without groups there is at most one.
    Ok(models.into_iter().next().map(|model| model.mesh))
}

/// The line at which loading fails: the first whose prefix of the file fails.
fn explain(error: tobj::LoadError, lines: &[(usize, String)]) -> String {
    let out_of_range = error == tobj::LoadError::FaceVertexOutOfBounds;
    let fails = |count: usize| {
        // A face may name a vertex that follows: then all vertices are kept.
        let kept = lines.iter().enumerate().filter(|(i, (_, line))| {
            *i < count || (out_of_range && line.trim_start().starts_with('v'))
        });
        load(kept.map(|(_, (_, line))| line.as_str())).is_err()
    };
    let (mut good, mut bad) = (0, lines.len());
    while bad - good > 1 {
        let middle = usize::midpoint(good, bad);
        if fails(middle) {
            bad = middle;
        } else {
            good = middle;
        }
    }
    let place = bad
        .checked_sub(1)
        .and_then(|i| lines.get(i))
        .map(|(number, line)| format!("line {number}: `{}`: ", brief(line)))
        .unwrap_or_default();
    let remedy = match error {
        tobj::LoadError::FaceVertexOutOfBounds => {
            "faces name vertices that are in the file, counted from 1"
        }
        tobj::LoadError::FaceParseError => {
            "a face is `f` and vertex numbers, as in `f 1 2 3` or `f 1/1/1 2/2/2 3/3/3`"
        }
        _ => "a vertex is `v` and three numbers",
    };
    format!("{place}{error}; {remedy}")
}

/// Writes a mesh as OBJ, coordinates in m with all their digits.
///
/// # Errors
/// [`Error::File`] if the file can't be written.
pub fn write_obj(path: &Path, mesh: &TriMesh) -> Result<()> {
    let mut text = String::new();
    // Writing into a string can't fail.
    let _ = writeln!(text, "# lengths in metres");
    for p in mesh.vertices() {
        let _ = writeln!(text, "v {:?} {:?} {:?}", p.x, p.y, p.z);
    }
    for [a, b, c] in mesh.faces() {
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    std::fs::write(path, text).map_err(|source| Error::File {
        path: path.to_owned(),
        action: "write",
        source,
    })
}
