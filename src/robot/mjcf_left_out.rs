//! What of an MJCF file isn't read: said where it changes little, refused where bodies or joints would be missing.

use super::file::{check_depth, parse_error};
use super::report::Unused;
use crate::Result;
use roxmltree::{Document, Node};
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

/// Sections that are read, and their elements that are.
const READ: [&str; 5] = ["compiler", "default", "asset", "worldbody", "include"];
/// Elements of bodies that are.
const OF_BODIES: [&str; 7] = [
    "body",
    "inertial",
    "joint",
    "freejoint",
    "geom",
    "site",
    "frame",
];
/// Attributes that change masses, and aren't read.
const UNREAD: [(&str, &str); 4] = [
    ("compiler", "inertiagrouprange"),
    ("compiler", "balanceinertia"),
    ("geom", "shellinertia"),
    ("mesh", "inertia"),
];
/// Most files that one includes.
const FILES: usize = 100;

/// What of a file, and of those that it includes, isn't read: what, how often, and the line of the first.
#[derive(Default)]
pub(super) struct LeftOut {
    found: BTreeMap<String, (usize, u32)>,
    seen: HashSet<PathBuf>,
}

impl LeftOut {
    /// For the report.
    pub fn unused(self) -> impl Iterator<Item = Unused> {
        let each = self.found.into_iter();
        each.map(|(what, (count, line))| Unused { what, count, line })
    }

    /// Looks through a file and all that it includes.
    ///
    /// # Errors
    /// What would silently lack bodies or joints, and models within models.
    pub fn look(&mut self, path: &Path, document: &Document) -> Result<()> {
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        self.seen.insert(path.to_owned());
        let mut files = self.file(path, document)?;
        // In the order of the file; whatever can't be read is the reader's error.
        files.reverse();
        while let Some(name) = files.pop() {
            let path = folder.join(&name);
            if !self.seen.insert(path.clone()) {
                continue;
            }
            if self.seen.len() > FILES {
                let message = format!("it includes over {FILES} files");
                return Err(parse_error(&path, message));
            }
            let Ok(text) = std::fs::read_to_string(&path) else {
                continue;
            };
            let Ok(document) = Document::parse(&text) else {
                continue;
            };
            check_depth(&path, &document)?;
            let further = self.file(&path, &document)?;
            files.extend(further.into_iter().rev());
        }
        Ok(())
    }

    /// One file; the names of those that it includes.
    fn file(&mut self, path: &Path, document: &Document) -> Result<Vec<String>> {
        let line = |node: &Node| document.text_pos_at(node.range().start).row;
        let mut note = |what: String, node: &Node| {
            self.found.entry(what).or_insert((0, line(node))).0 += 1;
        };
        let refuse = |node: &Node, why: &str| {
            let name = node.tag_name().name();
            let message = format!("line {}: <{name}>: {why}", line(node));
            Err(parse_error(path, message))
        };
        let mut included = Vec::new();
        let root = document.root_element();
        for node in root.descendants().filter(Node::is_element) {
            let tag = node.tag_name().name();
            let above = node.parent_element().map_or("", |p| p.tag_name().name());
            let within = node
                .ancestors()
                .skip(1)
                .any(|a| a.is_element() && matches!(a.tag_name().name(), "worldbody" | "body"));
            match (tag, above) {
                ("include", _) if within => {
                    return refuse(
                        &node,
                        "files included within bodies aren't read: write them out",
                    );
                }
                ("include", _) => included.extend(node.attribute("file").map(String::from)),
                ("replicate" | "attach" | "composite" | "flexcomp", _) if within => {
                    return refuse(
                        &node,
                        "isn't read, and its bodies would be missing: write them out",
                    );
                }
                ("joint" | "freejoint" | "inertial", "frame") => {
                    return refuse(&node, "isn't read within a <frame>: write it out of it");
                }
                ("model", "asset") => {
                    return refuse(&node, "models within models aren't read: write them out");
                }
                _ => {}
            }
            for (of, attribute) in UNREAD {
                if tag == of && node.has_attribute(attribute) && above != "default" {
                    note(
                        format!("{attribute} of <{tag}>, which tells of masses"),
                        &node,
                    );
                }
            }
            if within && !OF_BODIES.contains(&tag) {
                note(format!("<{tag}> of bodies"), &node);
            }
        }
        for section in root.children().filter(Node::is_element) {
            let name = section.tag_name().name();
            if name == "option" || name == "size" || name == "statistic" || name == "visual" {
                note(format!("<{name}>"), &section);
            } else if name != "equality" && !READ.contains(&name) {
                for node in section.children().filter(Node::is_element) {
                    note(format!("<{}> of <{name}>", node.tag_name().name()), &node);
                }
            }
        }
        Ok(included)
    }
}
