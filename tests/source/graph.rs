//! Which file of a crate imports from which: `use` lines and paths, followed through re-exports to the file that
//! defines the item.
//!
//! A module that only hands on what its children define imports nothing. Comments and unit tests don't count.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A path in the source, segment by segment.
type Segments = Vec<String>;

/// One source file as a module.
struct Module {
    /// File, relative to the crate's root.
    file: PathBuf,
    /// Its code, without comments, unit tests and `use` lines.
    text: String,
    /// Names that `use` lines bring in, with what they stand for.
    names: BTreeMap<String, Segments>,
    /// Modules all of whose names are brought in.
    globs: Vec<Segments>,
    /// Items that the file itself defines.
    items: BTreeSet<String>,
}

/// What a path leads to.
enum Found {
    Module(String),
    /// An item, and the module that defines it.
    Item(String),
}

/// The modules of a crate by path (`""` is the root, `a::b` a file `a/b.rs` or `a/b/mod.rs`).
pub struct Crate {
    modules: BTreeMap<String, Module>,
}

/// Rust files below a folder.
pub fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut out = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(at) = folders.pop() {
        for entry in std::fs::read_dir(&at).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                out.push(path);
            }
        }
    }
    out.sort();
    out
}

/// Code without comments.
pub fn code(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    let lines = text.lines().map(|l| l.split("//").next().unwrap_or(""));
    lines.collect::<Vec<_>>().join("\n")
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Unit tests stand last in their file.
fn without_tests(text: &str) -> &str {
    let at = text.find("#[cfg(test)]\nmod ");
    match at {
        Some(at) if text[at..].lines().nth(1).is_some_and(|l| l.ends_with('{')) => &text[..at],
        _ => text,
    }
}

/// Members of a brace group at its outer level; `text` begins behind the brace.
pub fn split_group(text: &str) -> Vec<&str> {
    let (mut depth, mut from, mut out) = (0, 0, Vec::new());
    for (i, c) in text.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' | '}' if depth == 0 => {
                out.push(text[from..i].trim());
                from = i + 1;
                if c == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    out.retain(|m| !m.is_empty());
    out
}

/// Leaves of a `use` tree: what is imported, and its name here (`*` for all).
fn leaves(tree: &str, before: &[String], out: &mut Vec<(Segments, String)>) {
    let tree = tree.trim();
    if let Some(at) = tree.find('{') {
        let mut path = before.to_vec();
        path.extend(segments(tree[..at].trim_end_matches("::")));
        for member in split_group(&tree[at + 1..]) {
            leaves(member, &path, out);
        }
        return;
    }
    let (path, alias) = match tree.split_once(" as ") {
        Some((path, alias)) => (path.trim(), Some(alias.trim())),
        None => (tree, None),
    };
    let mut all = before.to_vec();
    all.extend(segments(path));
    if all.last().is_some_and(|s| s == "self") && all.len() > 1 {
        all.pop();
    }
    if all.last().is_some_and(|s| s == "*") {
        all.pop();
        out.push((all, "*".into()));
    } else if let Some(last) = all.last().cloned() {
        out.push((all, alias.unwrap_or(&last).to_string()));
    }
}

fn segments(path: &str) -> Segments {
    let parts = path.split("::").map(str::trim);
    parts
        .filter(|s| !s.is_empty())
        .map(str::to_string)
        .collect()
}

/// `use` lines of a text, and the text without them.
fn uses(text: &str) -> (Vec<(Segments, String)>, String) {
    let (mut out, mut rest) = (Vec::new(), String::new());
    let mut left = text;
    while let Some(at) = left.find("use ") {
        let (before, after) = left.split_at(at);
        let line = before.rsplit('\n').next().unwrap_or("").trim();
        if !(line.is_empty() || line.starts_with("pub")) {
            rest += &left[..at + 4];
            left = &left[at + 4..];
            continue;
        }
        let end = after.find(';').unwrap_or(after.len());
        leaves(&after[4..end], &[], &mut out);
        rest += before;
        left = &after[end..];
    }
    (out, rest + left)
}

fn items(text: &str) -> BTreeSet<String> {
    let kinds = [
        "fn ",
        "struct ",
        "enum ",
        "trait ",
        "const ",
        "static ",
        "type ",
        "union ",
        "macro_rules! ",
    ];
    let mut out = BTreeSet::new();
    for kind in kinds {
        for (at, _) in text.match_indices(kind) {
            if text[..at].chars().next_back().is_some_and(is_word) {
                continue;
            }
            let name: String = text[at + kind.len()..]
                .chars()
                .take_while(|c| is_word(*c))
                .collect();
            out.insert(name);
        }
    }
    out
}

/// Paths of two segments and more.
fn paths(text: &str) -> Vec<Segments> {
    let mut out = Vec::new();
    let mut left = 0;
    while let Some(at) = text[left..].find("::").map(|i| left + i) {
        let start = text[..at].rfind(|c| !is_word(c)).map_or(0, |i| {
            i + text[i..].chars().next().map_or(1, char::len_utf8)
        });
        let mut end = at;
        while text[end..].starts_with("::") {
            let word = text[end + 2..].find(|c| !is_word(c));
            let word = word.map_or(text.len(), |i| end + 2 + i);
            if word == end + 2 {
                break;
            }
            end = word;
        }
        if start < at && !text[..start].ends_with("::") && end > at {
            out.push(segments(&text[start..end]));
        }
        left = end.max(at + 2);
    }
    out
}

impl Crate {
    /// The crate whose root is `folder`.
    pub fn read(folder: &Path) -> Self {
        let mut modules = BTreeMap::new();
        for path in sources(folder) {
            let file = path.strip_prefix(folder).unwrap().to_path_buf();
            let mut name = segments(
                &file
                    .with_extension("")
                    .display()
                    .to_string()
                    .replace('/', "::"),
            );
            let last = name.last().cloned().unwrap_or_default();
            if name.len() == 1 && ["lib", "main"].contains(&last.as_str()) || last == "mod" {
                name.pop();
            }
            // Unit tests in files of their own, and programs beside the library.
            if name.iter().any(|s| s == "tests") || name.first().is_some_and(|s| s == "bin") {
                continue;
            }
            let all = code(&path);
            let (used, text) = uses(without_tests(&all));
            let mut module = Module {
                file,
                items: items(&text),
                text,
                names: BTreeMap::new(),
                globs: Vec::new(),
            };
            for (path, alias) in used {
                match alias.as_str() {
                    "*" => module.globs.push(path),
                    _ => drop(module.names.insert(alias, path)),
                }
            }
            modules.insert(name.join("::"), module);
        }
        Self { modules }
    }

    fn child(&self, module: &str, name: &str) -> Option<String> {
        let path = match module {
            "" => name.to_string(),
            _ => format!("{module}::{name}"),
        };
        self.modules.contains_key(&path).then_some(path)
    }

    /// Where a path of the module `from` leads; `None` outside the crate, and for what is no path of modules.
    fn resolve(&self, from: &str, path: &[String], depth: usize) -> Option<Found> {
        if depth > 20 {
            return None;
        }
        let parent = |m: &str| m.rsplit_once("::").map_or("", |(p, _)| p).to_string();
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => self.inside("", rest, depth),
            "self" => self.inside(from, rest, depth),
            "super" => {
                let (mut at, mut rest) = (parent(from), rest);
                while rest.first().is_some_and(|s| s == "super") {
                    (at, rest) = (parent(&at), &rest[1..]);
                }
                self.inside(&at, rest, depth)
            }
            _ if self.child(from, first).is_some()
                || self.modules[from].names.contains_key(first) =>
            {
                self.inside(from, path, depth)
            }
            _ => None,
        }
    }

    /// The same for a path that begins in a module.
    fn inside(&self, module: &str, path: &[String], depth: usize) -> Option<Found> {
        let Some((first, rest)) = path.split_first() else {
            return Some(Found::Module(module.to_string()));
        };
        if let Some(child) = self.child(module, first) {
            return self.inside(&child, rest, depth);
        }
        let here = self.modules.get(module)?;
        if here.items.contains(first) {
            return Some(Found::Item(module.to_string()));
        }
        if let Some(target) = here.names.get(first) {
            let whole: Segments = target.iter().chain(rest).cloned().collect();
            return self.resolve(module, &whole, depth + 1);
        }
        for glob in &here.globs {
            let Some(Found::Module(target)) = self.resolve(module, glob, depth + 1) else {
                continue;
            };
            if target != module
                && let Some(found) = self.inside(&target, path, depth + 1)
                && !matches!(&found, Found::Item(m) if !self.modules[m].items.contains(first))
            {
                return Some(found);
            }
        }
        // Not seen to be defined anywhere: by a macro, or outside.
        None
    }

    /// Files that each file imports from, with a path that says so.
    pub fn imports(&self) -> BTreeMap<&Path, BTreeMap<&Path, String>> {
        let mut out = BTreeMap::new();
        for (name, module) in &self.modules {
            let mut to: BTreeMap<&Path, String> = BTreeMap::new();
            let mut add = |found: Option<Found>, path: &[String]| {
                if let Some(Found::Item(target)) = found
                    && target != *name
                {
                    let file = self.modules[&target].file.as_path();
                    to.entry(file).or_insert_with(|| path.join("::"));
                }
            };
            let word = |alias: &str| {
                let found = module.text.match_indices(alias).any(|(at, _)| {
                    let before = module.text[..at].chars().next_back();
                    let after = module.text[at + alias.len()..].chars().next();
                    !before.is_some_and(is_word) && !after.is_some_and(is_word)
                });
                found || alias == "_"
            };
            // What is only handed on is no import; a trait's methods are called without its name.
            for (alias, path) in &module.names {
                let found = self.resolve(name, path, 0);
                let facade = module.file.ends_with("mod.rs") || name.is_empty();
                if !facade || word(alias) {
                    add(found, path);
                }
            }
            for path in paths(&module.text) {
                add(self.resolve(name, &path, 0), &path);
            }
            for glob in &module.globs {
                if let Some(Found::Module(target)) = self.resolve(name, glob, 0) {
                    for item in &self.modules[&target].items {
                        if word(item) {
                            let path = [glob.clone(), vec![item.clone()]].concat();
                            add(self.resolve(name, &path, 0), &path);
                        }
                    }
                }
            }
            out.insert(module.file.as_path(), to);
        }
        out
    }
}

/// Groups of nodes that reach each other.
pub fn circles<N: Ord + Clone>(edges: &BTreeMap<N, BTreeSet<N>>) -> Vec<Vec<N>> {
    let reach: BTreeMap<&N, BTreeSet<&N>> = edges
        .keys()
        .map(|from| {
            let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
            while let Some(at) = open.pop() {
                for next in edges.get(at).into_iter().flatten() {
                    if seen.insert(next) {
                        open.push(next);
                    }
                }
            }
            (from, seen)
        })
        .collect();
    let mut out: Vec<Vec<N>> = Vec::new();
    for (node, reached) in &reach {
        if out.iter().any(|c| c.contains(node)) {
            continue;
        }
        let mutual = reached
            .iter()
            .filter(|n| reach.get(*n).is_some_and(|r| r.contains(node)));
        let circle: Vec<N> = mutual.map(|n| (*n).clone()).collect();
        if circle.len() > 1 {
            out.push(circle);
        }
    }
    out
}
