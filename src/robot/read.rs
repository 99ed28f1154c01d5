//! The file: its text as XML, what of it is read, and its typed form, which for MJCF is that of URDF as well ([`mjcf`]).
//!
//! `urdf-rs` gives the typed form. It passes over what it doesn't know and says neither where an error is nor what was left out, so the text
//! is first looked through as XML: what can't be is refused there with line and name, what isn't used is listed, and what is used alone is handed on ([`kept`](mod@super::kept)).

use super::file::{
    File, JointText, LARGEST, check_depth, document, guarded, numbers_asked, parse_error,
};
use super::kept::kept;
use super::known::{needed_attributes, read_attributes};
use super::mjcf;
use super::report::Unused;
use crate::{Error, Result};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// Reads a file.
pub(super) fn read(path: &Path) -> Result<File> {
    let failed = |source| Error::File {
        path: path.to_owned(),
        action: "read",
        source,
    };
    if path.is_dir() {
        let why = "this is a folder; give the URDF file itself, e.g. robot.urdf";
        return Err(failed(io::Error::new(io::ErrorKind::IsADirectory, why)));
    }
    let bytes = std::fs::read(path).map_err(failed)?;
    let text = String::from_utf8(bytes).map_err(|e| {
        let good = e.utf8_error().valid_up_to();
        let line = 1 + e.as_bytes()[..good].iter().filter(|b| **b == b'\n').count();
        let message = format!(
            "line {line}: byte {good} is not UTF-8 text; a URDF file is XML saved as UTF-8"
        );
        parse_error(path, message)
    })?;
    parse(path, &text)
}

fn parse(path: &Path, text: &str) -> Result<File> {
    let document = document(path, text)?;
    check_depth(path, &document)?;
    if document.root_element().tag_name().name() == "mujoco" {
        return mjcf::parse(path, &document);
    }
    let mut look = Look {
        path,
        document: &document,
        version: version(&document.root_element()),
        unused: BTreeMap::new(),
    };
    look.root()?;
    let joints = elements(&document.root_element(), "joint").map(|joint| {
        let limit = elements(&joint, "limit").next();
        let gives = |name: &str| limit.is_some_and(|l| l.has_attribute(name));
        JointText {
            line: Some(look.line(&joint)),
            has_range: gives("lower") || gives("upper"),
            has_limit: limit.is_some(),
        }
    });
    let joints = joints.collect();
    let text = kept(&document.root_element(), look.version)
        .map_err(|e| parse_error(path, format!("can't be written anew: {e}")))?;
    let robot = guarded(path, "a URDF file", || urdf_rs::read_from_string(&text))?;
    let unused = look.unused.into_iter();
    Ok(File {
        joints,
        unused: unused
            .map(|(what, (count, line))| Unused { what, count, line })
            .collect(),
        ..File::new(path, robot)
    })
}

fn elements<'a, 'd>(
    node: &Node<'a, 'd>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'd>> + use<'a, 'd> {
    let namespace = node.tag_name().namespace();
    node.children().filter(move |child| {
        let tag = child.tag_name();
        child.is_element() && tag.name() == name && tag.namespace() == namespace
    })
}

/// The format's version, 1.0 if the file gives none or no such.
fn version(robot: &Node) -> [u32; 2] {
    let given = robot.attribute("version").and_then(|text| {
        let (major, minor) = text.trim().split_once('.')?;
        Some([major.parse().ok()?, minor.parse().ok()?])
    });
    given.unwrap_or([1, 0])
}

/// The elements of which an element must have one each.
fn needed_elements(tag: &str) -> &'static [&'static str] {
    match tag {
        "inertial" => &["mass", "inertia"],
        "visual" | "collision" => &["geometry"],
        "joint" => &["parent", "child"],
        _ => &[],
    }
}

/// How many numbers an attribute has; none if it is a word.
fn numbers(tag: &str, attribute: &str) -> Option<usize> {
    match (tag, attribute) {
        (_, "name" | "type" | "link" | "filename" | "joint" | "version") => None,
        ("limit", "effort") => Some(1),
        (_, "quat_xyzw") => Some(4),
        (_, "xyz" | "rpy" | "size" | "scale") => Some(3),
        _ => Some(1),
    }
}

const JOINTS: [&str; 6] = [
    "fixed",
    "revolute",
    "continuous",
    "prismatic",
    "planar",
    "floating",
];

/// A walk through the file.
struct Look<'a, 'd> {
    path: &'a Path,
    document: &'a Document<'d>,
    /// The format's.
    version: [u32; 2],
    /// What isn't read: how often it stands there, and where first.
    unused: BTreeMap<String, (usize, u32)>,
}

impl Look<'_, '_> {
    fn line(&self, node: &Node) -> u32 {
        self.document.text_pos_at(node.range().start).row
    }

    /// The link or joint that an element is in, or is.
    fn place(&self, node: &Node) -> String {
        let line = self.line(node);
        let named = node.ancestors().find(|a| {
            a.is_element()
                && matches!(a.tag_name().name(), "link" | "joint")
                && a.parent_element()
                    .is_some_and(|p| p.parent_element().is_none())
        });
        match named {
            Some(of) => format!(
                "line {line}: {} {:?}",
                of.tag_name().name(),
                of.attribute("name").unwrap_or("")
            ),
            None => format!("line {line}"),
        }
    }

    fn wrong(&self, node: &Node, what: String) -> Error {
        parse_error(self.path, format!("{}: {what}", self.place(node)))
    }

    fn root(&mut self) -> Result<()> {
        let root = self.document.root_element();
        let instead = match root.tag_name().name() {
            "robot" => None,
            "sdf" | "model" => Some("this is SDF, which isn't read: convert it to URDF"),
            _ => Some("give a URDF file, whose outermost element is <robot>"),
        };
        if let Some(instead) = instead {
            let what = format!("<{}>: {instead}", root.tag_name().name());
            return Err(self.wrong(&root, what));
        }
        let macros = root.descendants().find(|node| {
            let namespace = node.tag_name().namespace().unwrap_or_default();
            namespace.contains("xacro") && node.is_element()
        });
        if let Some(node) = macros {
            let name = node.tag_name().name();
            let what = format!(
                "<xacro:{name}>: macros must be expanded first: `xacro FILE.xacro > robot.urdf`"
            );
            return Err(self.wrong(&node, what));
        }
        self.element(root, "")?;
        if elements(&root, "link").next().is_none() {
            return Err(self.wrong(&root, "no <link>: a robot needs one or more".into()));
        }
        Ok(())
    }

    fn note(&mut self, what: String, node: &Node) {
        let line = self.line(node);
        self.unused.entry(what).or_insert((0, line)).0 += 1;
    }

    /// Checks an element and what is in it; the depth is known to be small.
    fn element(&mut self, node: Node, parent: &str) -> Result<()> {
        let tag = node.tag_name().name();
        // A file may have one namespace for all that is its own.
        let root = self.document.root_element();
        let own = node.tag_name().namespace() == root.tag_name().namespace();
        let read = read_attributes(parent, tag).filter(|_| own);
        let Some(attributes) = read else {
            let what = match parent {
                "geometry" if own => {
                    let known = "known are box, cylinder, sphere, capsule and mesh";
                    return Err(self.wrong(&node, format!("<{tag}> is no geometry; {known}")));
                }
                "robot" => format!("<{tag}>"),
                _ => format!("<{tag}> of <{parent}>"),
            };
            let what = match own || read_attributes(parent, tag).is_none() {
                true => what,
                false => format!("{what}, of another namespace"),
            };
            self.note(what, &node);
            return Ok(());
        };
        let needed = needed_attributes(tag, self.version);
        for name in needed {
            if node.attribute(*name).is_none_or(|v| v.trim().is_empty()) {
                return Err(self.wrong(&node, format!("<{tag}> needs the attribute {name}")));
            }
        }
        for attribute in node.attributes() {
            let name = attribute.name();
            if attribute.namespace().is_some() {
                self.note(format!("{name} of <{tag}>, of another namespace"), &node);
                continue;
            }
            if name == "quat_xyzw" && self.version < [1, 1] && attributes.contains(&name) {
                let why = "which only versions from 1.1 have: <robot version=\"1.1\">";
                self.note(format!("{name} of <{tag}>, {why}"), &node);
                continue;
            }
            if attributes.contains(&name) || needed.contains(&name) {
                self.check_numbers(&node, name, attribute.value())?;
            }
            if !attributes.contains(&name) {
                self.note(format!("{name} of <{tag}>"), &node);
            }
        }
        self.check_turn(&node)?;
        self.children(&node)
    }

    /// An orientation is given once, and by what is one.
    fn check_turn(&self, node: &Node) -> Result<()> {
        let given = node.attribute("quat_xyzw");
        let Some(quaternion) = given.filter(|_| self.version >= [1, 1]) else {
            return Ok(());
        };
        let tag = node.tag_name().name();
        let what = if node.has_attribute("rpy") {
            format!("<{tag}>: rpy and quat_xyzw both turn it; leave one out")
        } else if (quaternion.split_whitespace()).all(|x| x.parse() == Ok(0.0)) {
            format!(
                "<{tag}>: quat_xyzw = {quaternion:?}: a rotation's quaternion can't be zero; no rotation is 0 0 0 1"
            )
        } else {
            return Ok(());
        };
        Err(self.wrong(node, what))
    }

    fn children(&mut self, node: &Node) -> Result<()> {
        let tag = node.tag_name().name();
        for name in needed_elements(tag) {
            if elements(node, name).next().is_none() {
                return Err(self.wrong(node, format!("<{tag}> needs an element <{name}>")));
            }
        }
        let once = |name: &str| match tag {
            "robot" => false,
            "link" => name == "inertial",
            _ => true,
        };
        let inner: Vec<Node> = node.children().filter(Node::is_element).collect();
        let namespace = node.tag_name().namespace();
        let own = (inner.iter()).filter(|child| child.tag_name().namespace() == namespace);
        let own: Vec<&Node> = own.collect();
        for (i, child) in own.iter().enumerate() {
            let name = child.tag_name().name();
            let again = (own[..i].iter()).any(|c| c.tag_name() == child.tag_name());
            let known = read_attributes(tag, name).is_some();
            if (again && once(name) && known) || (tag == "geometry" && i > 0) {
                let what = format!("<{name}> is one too many in <{tag}>; leave one");
                return Err(self.wrong(child, what));
            }
        }
        if tag == "geometry" && own.is_empty() {
            let what = "<geometry> is empty; give a box, cylinder, sphere, capsule or mesh";
            return Err(self.wrong(node, what.into()));
        }
        if tag == "joint"
            && let Some(kind) = node.attribute("type")
            && !JOINTS.contains(&kind)
        {
            let what = format!("type {kind:?} is unknown; known are {}", JOINTS.join(", "));
            return Err(self.wrong(node, what));
        }
        inner
            .into_iter()
            .try_for_each(|child| self.element(child, tag))
    }

    fn check_numbers(&self, node: &Node, name: &str, value: &str) -> Result<()> {
        let tag = node.tag_name().name();
        let Some(count) = numbers(tag, name) else {
            return Ok(());
        };
        let found: Vec<Option<f64>> = (value.split_whitespace())
            .map(|word| word.parse::<f64>().ok())
            .collect();
        // A limit at infinity is none.
        let may = |x: &f64| x.abs() <= LARGEST || (tag == "limit" && x.is_infinite());
        let right = found.len() == count && found.iter().all(|x| x.as_ref().is_some_and(may));
        match right {
            true => Ok(()),
            false => {
                let numbers = numbers_asked([count; 2], value);
                let what = format!("<{tag}>: {name} = {value:?} must be {numbers}");
                Err(self.wrong(node, what))
            }
        }
    }
}
