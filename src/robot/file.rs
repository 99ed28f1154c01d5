//! What a file says of a robot, in the form of URDF.

use super::report::Unused;
use crate::shape::Shape;
use crate::{Error, Result};
use roxmltree::{Document, Node};
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Deepest nesting of elements; URDF needs six, MJCF one a body in a chain.
pub(super) const DEEPEST: usize = 128;
/// Largest number that is taken: squares and products of such stay finite.
pub(super) const LARGEST: f64 = 1e30;

/// What a value must be that isn't so many numbers, the fewest and the most: where one is too large, how large it may be.
pub(super) fn numbers_asked([fewest, most]: [usize; 2], value: &str) -> String {
    let count = match (fewest, most) {
        (1, 1) => "one finite number".into(),
        (a, b) if a == b => format!("{a} finite numbers between blanks"),
        (a, b) => format!("{a} to {b} finite numbers between blanks"),
    };
    let each = value.split_whitespace().flat_map(str::parse::<f64>);
    match each.into_iter().any(|x| x.is_finite() && x.abs() > LARGEST) {
        true => format!("{count} of at most {LARGEST:e} in size"),
        false => count,
    }
}

/// A robot's file.
pub(super) struct File {
    pub path: PathBuf,
    pub robot: urdf_rs::Robot,
    /// What the typed form doesn't tell of each joint.
    pub joints: Vec<JointText>,
    /// What isn't read.
    pub unused: Vec<Unused>,
    /// What joints have beside what URDF says of them, by name.
    pub extras: HashMap<String, Extra>,
    /// Joints that are driven, by name, and the stiffness and damping of those that are held at a target; none of a file that doesn't say.
    pub drives: Option<HashMap<String, Option<[f64; 2]>>>,
    /// What pushes at links.
    pub thrusters: Vec<SiteThruster>,
    /// Shapes that URDF lacks, by the name that stands in a mesh's place.
    pub shapes: HashMap<String, Shape>,
    /// What is to be told.
    pub notes: Vec<String>,
    /// The element by which a joint follows another one.
    pub coupled_by: &'static str,
}

impl File {
    /// Of a robot of which nothing more is known.
    pub fn new(path: &Path, robot: urdf_rs::Robot) -> Self {
        Self {
            path: path.to_owned(),
            robot,
            joints: Vec::new(),
            unused: Vec::new(),
            extras: HashMap::new(),
            drives: None,
            thrusters: Vec::new(),
            shapes: HashMap::new(),
            notes: Vec::new(),
            coupled_by: "<mimic>",
        }
    }
}

/// What drives and springs add to a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Extra {
    /// N/m or N m/rad.
    pub stiffness: f64,
    /// Coordinate at which the spring doesn't push.
    pub rest: f64,
    /// kg or kg m².
    pub armature: f64,
    /// Coordinate at which it starts unless told otherwise.
    pub start: f64,
}

/// What pushes the body of a link.
pub(super) struct SiteThruster {
    pub name: String,
    /// The link, at whose origin it is.
    pub link: String,
    /// Along which it pushes, link's frame, of length one.
    pub axis: [f64; 3],
    /// N a unit of its control.
    pub push: f64,
    /// Moment about the axis per newton, m.
    pub torque: f64,
}

/// What stands at a joint.
pub(super) struct JointText {
    pub line: Option<u32>,
    /// Whether its `<limit>` gives a range.
    pub has_range: bool,
    /// Whether it has a `<limit>`.
    pub has_limit: bool,
}

/// An error of a file's contents.
pub(super) fn parse_error(path: &Path, message: impl Into<String>) -> Error {
    Error::Parse {
        path: path.to_owned(),
        message: message.into(),
    }
}

/// The text of a file as XML.
///
/// # Errors
/// What isn't XML, and document type definitions.
pub(super) fn document<'t>(path: &Path, text: &'t str) -> Result<Document<'t>> {
    Document::parse(text).map_err(|error| {
        let message = match error {
            roxmltree::Error::DtdDetected => {
                "document type definitions (<!DOCTYPE …>) aren't read: take it away, and write out what its entities stand for"
                    .into()
            }
            error => format!("{error}; this is not XML yet"),
        };
        parse_error(path, message)
    })
}

/// What another's parser makes of a file, which may panic on what no exporter writes: here that is an error. `kind` is what the file isn't yet.
pub(super) fn guarded<T, E: std::fmt::Display>(
    path: &Path,
    kind: &str,
    read: impl FnOnce() -> std::result::Result<T, E>,
) -> Result<T> {
    let why = match catch_unwind(AssertUnwindSafe(read)) {
        Ok(Ok(made)) => return Ok(made),
        Ok(Err(error)) => {
            let why = error.to_string();
            let why = why.split_whitespace().collect::<Vec<_>>().join(" ");
            format!("{why}; this is not {kind} yet")
        }
        Err(_) => "the contents can't be understood; export it again".into(),
    };
    Err(parse_error(path, why))
}

/// What is wrong with elements within elements without end.
pub(super) fn too_deep() -> String {
    format!(
        "elements are nested over {DEEPEST} deep: a longer chain of bodies can be a URDF, whose links stand side by side"
    )
}

/// Refuses elements within elements without end.
pub(super) fn check_depth(path: &Path, document: &Document) -> Result<()> {
    let mut open = vec![(document.root_element(), 1)];
    while let Some((node, level)) = open.pop() {
        if level > DEEPEST {
            let line = document.text_pos_at(node.range().start).row;
            let name = node.tag_name().name();
            let message = format!("line {line}: <{name}>: {}", too_deep());
            return Err(parse_error(path, message));
        }
        let inner = node.children().filter(Node::is_element);
        open.extend(inner.map(|child| (child, level + 1)));
    }
    Ok(())
}
