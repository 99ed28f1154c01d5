//! Files within files: what they hold takes the place of the element that includes them.

use super::super::file::{DEEPEST, document, too_deep};
use super::element::Element;
use crate::{Error, Result};
use roxmltree::{Document, Node};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Most files that one includes.
const FILES: usize = 100;

/// The tree of a file with all that it includes.
///
/// # Errors
/// Files that can't be read or are no XML, one that is included twice, and elements nested too deep.
pub(super) fn expand(path: &Path, document: &Document) -> Result<Element> {
    let whole = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let mut includes = Includes {
        folder: path.parent().unwrap_or(Path::new("")).to_owned(),
        seen: vec![(whole, "it is the file that is read".into())],
    };
    let file = Rc::from(path);
    includes.element(document.root_element(), &file, 1)
}

struct Includes {
    /// That of the file which is read.
    folder: PathBuf,
    /// Files, and where each was included first.
    seen: Vec<(PathBuf, String)>,
}

/// A name; where its namespace isn't that of the file's outermost element, with that.
fn name(of: &str, namespace: Option<&str>, own: Option<&str>) -> String {
    match namespace.filter(|_| namespace != own) {
        Some(other) => format!("{other}:{of}"),
        None => of.into(),
    }
}

impl Includes {
    fn element(&mut self, node: Node, file: &Rc<Path>, depth: usize) -> Result<Element> {
        let document = node.document();
        let own = document.root_element().tag_name().namespace();
        let line = document.text_pos_at(node.range().start).row;
        let attributes = node.attributes().map(|a| {
            let name = name(a.name(), a.namespace(), None);
            (name, a.value().to_owned())
        });
        let mut made = Element {
            tag: name(node.tag_name().name(), node.tag_name().namespace(), own),
            attributes: attributes.collect(),
            children: Vec::new(),
            file: file.clone(),
            line,
        };
        if depth > DEEPEST {
            return Err(made.wrong(too_deep()));
        }
        made.children = self.children(node, file, depth)?;
        Ok(made)
    }

    fn children(&mut self, node: Node, file: &Rc<Path>, depth: usize) -> Result<Vec<Element>> {
        let mut all = Vec::new();
        for child in node.children().filter(Node::is_element) {
            let element = self.element(child, file, depth + 1)?;
            match &element.tag[..] {
                "include" => all.extend(self.include(&element, depth)?),
                _ => all.push(element),
            }
        }
        Ok(all)
    }

    /// What an included file holds: its outermost element may have any name.
    fn include(&mut self, of: &Element, depth: usize) -> Result<Vec<Element>> {
        if let Some((other, _)) = of.attributes.iter().find(|(name, _)| name != "file") {
            let what = format!("{other} isn't read, and what is included might be another thing");
            return Err(of.wrong(what));
        }
        let Some(name) = of.get("file").filter(|name| !name.trim().is_empty()) else {
            return Err(of.wrong("give the path of a file: file=\"arm.xml\""));
        };
        let beside = of.file.parent().unwrap_or(Path::new(""));
        let mut tried = vec![self.folder.join(name), beside.join(name)];
        tried.dedup();
        let Some(path) = tried.iter().find(|path| path.is_file()) else {
            let tried: Vec<String> = tried.iter().map(|p| p.display().to_string()).collect();
            let tried = tried.join(", ");
            return Err(of.wrong(format!("file {name:?}: no such file; tried {tried}")));
        };
        let whole = std::fs::canonicalize(path).unwrap_or_else(|_| path.clone());
        if let Some((_, first)) = self.seen.iter().find(|(seen, _)| *seen == whole) {
            let what =
                format!("file {name:?} is included once more; {first}. A file is included once");
            return Err(of.wrong(what));
        }
        if self.seen.len() > FILES {
            return Err(of.wrong(format!("over {FILES} files are included")));
        }
        let here = format!(
            "it was included first in {}, line {}",
            of.file.display(),
            of.line
        );
        self.seen.push((whole, here));
        let text = std::fs::read_to_string(path).map_err(|source| Error::File {
            path: path.clone(),
            action: "read",
            source,
        })?;
        let document = document(path, &text)?;
        let file = Rc::from(path.as_path());
        self.children(document.root_element(), &file, depth)
    }
}
