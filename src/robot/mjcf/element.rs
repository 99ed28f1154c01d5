//! The elements of an MJCF file and of those that it includes, as one tree.

use super::super::file::parse_error;
use crate::Error;
use std::path::Path;
use std::rc::Rc;

/// Attributes that turn a frame, of which one stands for all.
pub(super) const TURNS: [&str; 5] = ["quat", "axisangle", "xyaxes", "zaxis", "euler"];

/// An element, and where it stands.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub tag: String,
    pub attributes: Vec<(String, String)>,
    pub children: Vec<Element>,
    pub file: Rc<Path>,
    pub line: u32,
}

impl Element {
    /// One without attributes and children, where another stands.
    pub fn at(tag: &str, other: &Self) -> Self {
        Self {
            tag: tag.into(),
            attributes: Vec::new(),
            children: Vec::new(),
            file: other.file.clone(),
            line: other.line,
        }
    }

    pub fn get(&self, name: &str) -> Option<&str> {
        let mut all = self.attributes.iter();
        all.find(|(n, _)| n == name).map(|(_, value)| &value[..])
    }

    /// Puts a value in place of what the attribute had; of those that turn a frame also of the others.
    pub fn set(&mut self, name: &str, value: &str) {
        let turns = TURNS.contains(&name);
        self.attributes
            .retain(|(n, _)| n != name && !(turns && TURNS.contains(&&n[..])));
        self.attributes.push((name.into(), value.into()));
    }

    /// Children of this tag.
    pub fn all<'e>(&'e self, tag: &'e str) -> impl Iterator<Item = &'e Self> {
        self.children.iter().filter(move |child| child.tag == tag)
    }

    /// An error there; `what` begins with what is wrong.
    pub fn wrong(&self, what: impl std::fmt::Display) -> Error {
        let message = format!("line {}: <{}>: {what}", self.line, self.tag);
        parse_error(&self.file, message)
    }

    /// The same for an element of something.
    pub fn wrong_of(&self, of: &str, what: impl std::fmt::Display) -> Error {
        let message = format!("line {}: <{}> of {of}: {what}", self.line, self.tag);
        parse_error(&self.file, message)
    }
}
