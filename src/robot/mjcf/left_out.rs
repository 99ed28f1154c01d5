//! What of an MJCF file isn't read: said where it changes little, refused where bodies or joints would be missing. And what can't be.

use super::super::report::Unused;
use super::attributes::{self, DRIVE, DRIVES, check, read, unread};
use super::classes::KINDS;
use super::element::{Element, TURNS};
use crate::Result;
use std::collections::BTreeMap;
use std::path::Path;

/// Elements of bodies that are read.
const OF_BODIES: [&str; 7] = [
    "body",
    "inertial",
    "joint",
    "freejoint",
    "geom",
    "site",
    "frame",
];
/// Equalities that are read, or told to be there.
const EQUALITIES: [&str; 4] = ["joint", "connect", "weld", "tendon"];

/// What of a file, and of those that it includes, isn't read: what, how often, and the line of the first.
pub(super) struct LeftOut<'p> {
    /// The file that was read first.
    path: &'p Path,
    found: BTreeMap<String, (usize, u32)>,
}

impl<'p> LeftOut<'p> {
    /// Of a file that is read from here.
    pub fn new(path: &'p Path) -> Self {
        Self {
            path,
            found: BTreeMap::new(),
        }
    }

    /// For the report.
    pub fn unused(self) -> impl Iterator<Item = Unused> {
        let each = self.found.into_iter();
        each.map(|(what, (count, line))| Unused { what, count, line })
    }

    /// Looks through a whole file.
    ///
    /// # Errors
    /// What would silently lack bodies or joints, models within models, and values of attributes that can't be.
    pub fn look(&mut self, file: &Element) -> Result<()> {
        self.attributes(file, "mujoco", "the file")?;
        for section in &file.children {
            match &section.tag[..] {
                "compiler" => self.attributes(section, "compiler", "the file")?,
                "default" => self.class(section, "main")?,
                "asset" => self.assets(section)?,
                "worldbody" => self.body(section, "the world", 0)?,
                "equality" => self.equalities(section)?,
                "actuator" => self.actuators(section)?,
                "option" | "size" | "statistic" | "visual" => {
                    self.note(format!("<{}>", section.tag), section);
                }
                _ => self.rest(section, &section.tag),
            }
        }
        Ok(())
    }

    fn note(&mut self, what: String, element: &Element) {
        let what = match *element.file == *self.path {
            true => what,
            false => format!("{what} in {}", element.file.display()),
        };
        self.found.entry(what).or_insert((0, element.line)).0 += 1;
    }

    /// Elements within one that isn't read, or is but for these.
    fn rest(&mut self, section: &Element, of: &str) {
        for child in &section.children {
            self.note(format!("<{}> of <{of}>", child.tag), child);
        }
        if section.children.is_empty() {
            self.note(format!("<{of}>"), section);
        }
    }

    /// Checks the attributes of an element of this kind, within a body or a class.
    fn attributes(&mut self, element: &Element, kind: &str, of: &str) -> Result<()> {
        check(element, kind, of)?;
        for (name, _) in &element.attributes {
            if read(kind, name).is_none() {
                self.note(unread(kind, &element.tag, name), element);
            }
        }
        Ok(())
    }

    /// An element that is read and has nothing in it that is.
    fn leaf(&mut self, element: &Element, kind: &str, of: &str) -> Result<()> {
        self.attributes(element, kind, of)?;
        for child in &element.children {
            self.note(format!("<{}> of <{}>", child.tag, element.tag), child);
        }
        Ok(())
    }

    fn class(&mut self, section: &Element, outer: &str) -> Result<()> {
        let name = section.get("class").unwrap_or(outer);
        let of = format!("class {name:?}");
        self.attributes(section, "default", &of)?;
        for inner in &section.children {
            match &inner.tag[..] {
                "default" => self.class(inner, name)?,
                kind if KINDS.contains(&kind) || DRIVES.contains(&kind) => {
                    self.leaf(inner, attributes::kind(kind), &of)?;
                    if inner.get("name").is_some() {
                        self.note(format!("name of <{kind}> of <default>"), inner);
                    }
                }
                tag => self.note(format!("<{tag}> of <default>"), inner),
            }
        }
        Ok(())
    }

    fn assets(&mut self, section: &Element) -> Result<()> {
        for asset in &section.children {
            match &asset.tag[..] {
                "mesh" => {
                    let name = asset.get("name").or(asset.get("file")).unwrap_or_default();
                    self.leaf(asset, "mesh", &format!("asset {name:?}"))?;
                }
                "model" => {
                    return Err(asset.wrong("models within models aren't read: write them out"));
                }
                tag => self.note(format!("<{tag}> of <asset>"), asset),
            }
        }
        Ok(())
    }

    fn equalities(&mut self, section: &Element) -> Result<()> {
        for equality in &section.children {
            match &equality.tag[..] {
                "joint" => {
                    let of = "the equalities";
                    self.leaf(equality, "coupling", of)?;
                    if equality.get("joint1").is_none() {
                        return Err(equality.wrong_of(of, "needs the attribute joint1"));
                    }
                }
                // Of these it is told what they are.
                tag if EQUALITIES.contains(&tag) => {}
                tag => self.note(format!("<{tag}> of <equality>"), equality),
            }
        }
        Ok(())
    }

    fn actuators(&mut self, section: &Element) -> Result<()> {
        for actuator in &section.children {
            match DRIVES.contains(&&actuator.tag[..]) {
                true => self.leaf(actuator, DRIVE, "the actuators")?,
                false => self.note(format!("<{}> of <actuator>", actuator.tag), actuator),
            }
        }
        Ok(())
    }

    /// What is in a body, in a frame of it, or in the world; `of` is the body, so many bodies from the world.
    fn body(&mut self, from: &Element, of: &str, depth: usize) -> Result<()> {
        self.attributes(from, &from.tag, of)?;
        let mut weighed = false;
        for inner in &from.children {
            let tag = &inner.tag[..];
            match tag {
                "replicate" | "attach" | "composite" | "flexcomp" => {
                    let why = "isn't read, and its bodies would be missing: write them out";
                    return Err(inner.wrong_of(of, why));
                }
                "joint" | "freejoint" | "inertial" if from.tag == "frame" => {
                    let why = "isn't read within a <frame>: write it out of it";
                    return Err(inner.wrong_of(of, why));
                }
                "joint" | "freejoint" | "inertial" if from.tag == "worldbody" => {
                    return Err(inner.wrong_of(of, "the world has none: put it into a body"));
                }
                "joint" | "freejoint" if depth > 1 && is_free(inner) => {
                    let why = "is free within another body: only bodies that are right in the <worldbody> may be; take the body out there";
                    return Err(inner.wrong_of(of, why));
                }
                "body" => {
                    let name = inner.get("name");
                    let name = name.map_or("a body without a name".into(), |name| {
                        format!("body {name:?}")
                    });
                    self.body(inner, &name, depth + 1)?;
                }
                "frame" => self.body(inner, of, depth)?,
                "inertial" => {
                    self.inertial(inner, of, weighed)?;
                    weighed = true;
                }
                _ if OF_BODIES.contains(&tag) => self.leaf(inner, tag, of)?,
                _ => self.note(format!("<{tag}> of bodies"), inner),
            }
        }
        Ok(())
    }

    fn inertial(&mut self, element: &Element, of: &str, second: bool) -> Result<()> {
        self.leaf(element, "inertial", of)?;
        let has = |name: &str| element.get(name).is_some();
        let turned = TURNS.iter().any(|name| has(name));
        let wrong = [
            (second, "is one too many in a body; leave one"),
            (!has("mass"), "needs the attribute mass"),
            (
                has("fullinertia") && has("diaginertia"),
                "fullinertia and diaginertia both tell its inertia; leave one",
            ),
            (
                has("fullinertia") && turned,
                "fullinertia is in the body's axes, and nothing turns it; leave the orientation out, or give diaginertia",
            ),
        ];
        match wrong.into_iter().find(|(is_so, _)| *is_so) {
            Some((_, what)) => Err(element.wrong_of(of, what)),
            None => Ok(()),
        }
    }
}

fn is_free(joint: &Element) -> bool {
    joint.tag == "freejoint" || joint.get("type") == Some("free")
}
