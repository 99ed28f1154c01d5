//! What is wrong with a mesh, where, and what to do about it.
//!
//! All thresholds are relative to the mesh itself, so a verdict doesn't depend on the unit of
//! length. Whether faces cross is looked for where all else is right, by exact predicates.

mod crossing;
mod scan;

pub use scan::check_parts;
pub(super) use scan::check_rounded;
#[cfg(feature = "meshio")]
pub(crate) use scan::has_area;

use crate::error::{Error, Result};
use serde::Serialize;
use std::fmt;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// The mesh can't be simulated.
    Error,
    /// It can; look at it.
    Warning,
}

/// What was found. Declared in the order in which [`MeshReport::into_result`] names them: a cause
/// before its consequences.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// No faces or no vertices.
    Empty,
    /// A face names a vertex that doesn't exist.
    IndexOutOfRange,
    /// A vertex with NaN or infinite coordinates, or so far away that products of lengths leave double precision.
    NotFinite,
    /// A face given twice.
    DuplicateFace,
    /// A face without area.
    ZeroArea,
    /// An edge with more than two faces.
    NonManifoldEdge,
    /// An edge with one face.
    OpenEdge,
    /// A face oriented against its neighbours.
    Orientation,
    /// A surface with one side only.
    OneSided,
    /// A vertex whose faces fold back on each other, so that it has no normal.
    FoldedVertex,
    /// A closed piece without volume.
    NoVolume,
    /// A closed piece with its normals pointing inward.
    Inward,
    /// Faces that pass through each other, or share an area.
    Crossing,
    /// A piece inside another, where the surface winds twice.
    Nested,
    /// Faces so long that not all that come near each other were looked at for crossings.
    Unsearched,
    /// Several pieces that share no edge.
    Components,
    /// Long thin faces.
    Aspect,
    /// Several vertices at one place.
    DuplicateVertex,
    /// A vertex that no face uses.
    UnreferencedVertex,
}

impl Kind {
    /// How bad it is: warnings are declared last.
    fn severity(self) -> Severity {
        match self < Self::Unsearched {
            true => Severity::Error,
            false => Severity::Warning,
        }
    }
}

/// One kind of problem, with all its occurrences counted and the first one located.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What.
    pub kind: Kind,
    /// How bad.
    pub severity: Severity,
    /// How many faces, edges, vertices or pieces.
    pub count: usize,
    /// First (for aspect: worst) face concerned, counted from 0.
    pub face: Option<usize>,
    /// Where: face centroid, middle of the edge or vertex, m, frame of the shape.
    pub position: Option<[f64; 3]>,
    /// In words, with the count.
    pub problem: String,
    /// How to mend it.
    pub remedy: String,
}

impl Finding {
    /// First place in words: face number and coordinates in m.
    pub fn location(&self) -> String {
        let face = self.face.map(|f| format!("face {f}, counted from 0"));
        let at = self.position.map(|p| format!("at {}", point(&p)));
        let parts: Vec<String> = face.into_iter().chain(at).collect();
        match parts.is_empty() {
            true => "the whole mesh".into(),
            false => parts.join(", "),
        }
    }
}

/// All that [`check_parts`] found, and the size of the mesh.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshReport {
    /// File or shape name.
    pub name: String,
    /// Number of vertices.
    pub vertices: usize,
    /// Number of faces.
    pub faces: usize,
    /// Number of pieces that share no edge.
    pub components: usize,
    /// Smallest and largest coordinates, m.
    pub bounds: [[f64; 3]; 2],
    /// Volume inside, m³; `None` unless the mesh is without errors.
    pub volume: Option<f64>,
    /// Area of all faces that have finite corners, m².
    pub area: f64,
    /// Largest aspect ratio of a face, longest edge over (2√3 inradius): 1 if equilateral.
    pub worst_aspect: f64,
    /// Errors first, causes before consequences.
    pub findings: Vec<Finding>,
}

impl MeshReport {
    /// Whether nothing was found that keeps the mesh from being simulated.
    pub fn is_ok(&self) -> bool {
        self.errors().next().is_none()
    }

    /// The findings that are errors.
    pub fn errors(&self) -> impl Iterator<Item = &Finding> {
        let findings = self.findings.iter();
        findings.filter(|f| f.severity == Severity::Error)
    }

    /// The finding of a kind, if there is one.
    pub fn find(&self, kind: Kind) -> Option<&Finding> {
        self.findings.iter().find(|f| f.kind == kind)
    }

    /// The report itself if the mesh has no errors.
    ///
    /// # Errors
    /// [`Error::Mesh`] naming the first error (a cause comes before its consequences) and the
    /// number of further ones.
    pub fn into_result(self) -> Result<Self> {
        let Some(first) = self.errors().next() else {
            return Ok(self);
        };
        let more = match self.errors().count() - 1 {
            0 => String::new(),
            1 => ", and one more kind of error".into(),
            n => format!(", and {n} more kinds of error"),
        };
        Err(Error::Mesh {
            problem: format!("{}{more}", first.problem),
            location: match first.count {
                1 => first.location(),
                _ => format!("first: {}", first.location()),
            },
            remedy: first.remedy.clone(),
            name: self.name.clone(),
        })
    }
}

impl fmt::Display for MeshReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "mesh {}: {}, {}, {}, area {} m², worst aspect ratio {:.1}",
            self.name,
            counted(self.vertices, "vertex", "vertices"),
            counted(self.faces, "face", "faces"),
            counted(self.components, "piece", "pieces"),
            number(self.area),
            self.worst_aspect,
        )?;
        let [low, high] = &self.bounds;
        writeln!(f, "  from {} to {}", point(low), point(high))?;
        for finding in &self.findings {
            let label = match finding.severity {
                Severity::Error => "error",
                Severity::Warning => "warning",
            };
            writeln!(f, "  {label}: {} ({})", finding.problem, finding.location())?;
            writeln!(f, "    {}", finding.remedy)?;
        }
        match self.volume {
            Some(v) => write!(f, "  ok: closed, turned outward, volume {} m³", number(v)),
            None => write!(f, "  not usable: see the errors above"),
        }
    }
}

/// "1 face", "3 faces".
fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// A number with six digits, in exponent form only where that is shorter to read.
fn number(x: f64) -> String {
    if x == 0.0 || (1e-3..1e5).contains(&x.abs()) {
        let text = format!("{x:.6}");
        let text = text.trim_end_matches('0').trim_end_matches('.');
        text.to_owned()
    } else {
        format!("{x:.6e}")
    }
}

fn point(p: &[f64; 3]) -> String {
    let [x, y, z] = p.map(number);
    format!("({x}, {y}, {z}) m")
}
