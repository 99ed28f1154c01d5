//! `hydrograd check-mesh`: whether a mesh can be simulated.

#[cfg(feature = "meshio")]
use std::path::Path;
use std::path::PathBuf;

use clap::Args;

use super::exit::Exit;
use super::output::Output;
use crate::{Error, Result};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The mesh: .obj, .stl, .ply or .dae.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Factor from the file's units to metres (0.001 for millimetres).
    #[arg(
        long,
        value_name = "FACTOR",
        default_value_t = 1.0,
        allow_negative_numbers = true
    )]
    scale: f64,
    /// Writes the mesh's convex hull, which can be simulated whatever is wrong with the mesh: .obj or .stl, in m.
    #[arg(long, value_name = "FILE")]
    hull: Option<PathBuf>,
}

/// Prints the report, good or bad; a bad mesh is a failure of the command as well.
#[cfg(feature = "meshio")]
pub(super) fn main(arguments: &Arguments, output: Output) -> Result<Exit> {
    if let Some(hull) = &arguments.hull
        && is_same(hull, &arguments.file)
    {
        return Err(Error::input(
            "--hull",
            hull.display().to_string(),
            "is the mesh that is checked, which would be lost: give another name",
        ));
    }
    let mesh = crate::shape::file::read_unchecked(&arguments.file, arguments.scale)?;
    let report = mesh.check();
    let error = report.clone().into_result().err();
    let hull = match &arguments.hull {
        None => None,
        Some(path) => {
            let hull = mesh.hull()?;
            crate::shape::file::write(&hull, path)?;
            let volume = hull.mass_properties().volume;
            let (faces, path) = (hull.faces().len(), path.display().to_string());
            Some(report::HullReport {
                path,
                faces,
                volume,
            })
        }
    };
    let water = match error {
        None => report::Divided::of(&mesh.clone().into_mesh()?),
        Some(_) => None,
    };
    output.result(&report::MeshFileReport {
        ok: error.is_none(),
        error: error.as_ref().map(ToString::to_string),
        repairs: mesh.repairs,
        hull,
        water,
        mesh: report,
    });
    let Some(error) = error else {
        return Ok(Exit::Done);
    };
    output.error_for_people(&error);
    Ok(Exit::Failed)
}

/// Whether two paths are of one file that there is.
#[cfg(feature = "meshio")]
fn is_same(a: &Path, b: &Path) -> bool {
    let found = a.canonicalize().ok();
    found.is_some() && found == b.canonicalize().ok()
}

#[cfg(not(feature = "meshio"))]
pub(super) fn main(arguments: &Arguments, _output: Output) -> Result<Exit> {
    Err(Error::Unsupported {
        what: format!("reading {}", arguments.file.display()),
        why: "this build leaves out mesh files".into(),
        instead: "build with the feature `meshio`".into(),
    })
}

#[cfg(feature = "meshio")]
mod report {
    use std::fmt;

    use serde::Serialize;

    use crate::geometry::{MeshReport, TriMesh};
    use crate::shape::file::Repairs;
    use crate::shape::{DEFAULT_FACES, Edges, divide};

    /// What was found in a mesh file.
    #[derive(Debug, Serialize)]
    pub struct MeshFileReport {
        /// Whether it can be simulated.
        pub ok: bool,
        /// The first thing that keeps it from that.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub error: Option<String>,
        /// What reading it mended.
        pub repairs: Repairs,
        /// The hull that was written.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub hull: Option<HullReport>,
        /// What the water makes of its faces, where these are too long for it.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub water: Option<Divided>,
        #[serde(flatten)]
        pub mesh: MeshReport,
    }

    /// A convex hull in a file.
    #[derive(Debug, Serialize)]
    pub struct HullReport {
        pub path: String,
        pub faces: usize,
        /// m³.
        pub volume: f64,
    }

    /// What the water makes of a mesh with long faces.
    #[derive(Debug, Serialize)]
    pub struct Divided {
        /// Faces after dividing.
        pub faces: usize,
        /// The longest edge as given, m.
        pub longest_edge: f64,
        /// The longest edge after dividing, m.
        pub divided_edge: f64,
        /// The longest edge of as many even faces as shapes by formula have, m.
        pub asked_edge: f64,
        /// Whether edges are still far too long.
        pub coarse: bool,
    }

    impl Divided {
        /// None of a mesh that stays as it is.
        pub fn of(mesh: &TriMesh) -> Option<Self> {
            let divided = divide(mesh, DEFAULT_FACES)?;
            let after = Edges::of(&divided, DEFAULT_FACES);
            Some(Self {
                faces: divided.faces().len(),
                longest_edge: Edges::of(mesh, DEFAULT_FACES).longest,
                divided_edge: after.longest,
                asked_edge: after.asked,
                coarse: after.are_long(),
            })
        }
    }

    impl fmt::Display for Divided {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(
                f,
                "\n  edges are as long as {:.3e} m: the water sees {} faces with edges of up to {:.3e} m, into which they are divided",
                self.longest_edge, self.faces, self.divided_edge
            )?;
            match self.coarse {
                false => Ok(()),
                true => write!(
                    f,
                    "\n  warning: {DEFAULT_FACES} even faces would have no edge over {:.3e} m\n    \
                     what the water does to it may be far off: remesh it with shorter, more even faces",
                    self.asked_edge
                ),
            }
        }
    }

    impl fmt::Display for MeshFileReport {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "{}", self.mesh)?;
            let mut mended = |count: usize, what: &str| match count {
                0 => Ok(()),
                _ => write!(f, "\n  mended in reading: {count} {what}"),
            };
            let Repairs {
                polygons_split,
                merged_same,
                merged_near,
                collapsed,
            } = self.repairs;
            mended(polygons_split, "polygons split into triangles")?;
            mended(merged_same, "vertices merged with one at the same place")?;
            mended(merged_near, "vertices merged with one very near")?;
            mended(collapsed, "faces without area left out after merging")?;
            if let Some(water) = &self.water {
                write!(f, "{water}")?;
            }
            match &self.hull {
                None => Ok(()),
                Some(hull) => write!(
                    f,
                    "\n  its convex hull, {} faces, {:.6e} m³, is in {}",
                    hull.faces, hull.volume, hull.path
                ),
            }
        }
    }
}
