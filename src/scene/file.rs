//! Scene files: TOML text to [`Scene`] and back, with errors that name line, key and remedy.
//!
//! The keys are those of the structs in [`crate::scene`], so what is known is asked of serde: its
//! own errors carry the list of keys or kinds that would have fitted.

use std::io;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{Scene, Shape};
use crate::{Error, Result};

impl Scene {
    /// Reads a scene file. Paths of meshes are taken relative to the file's folder.
    ///
    /// What the scene says is checked by [`Scene::validate`], not here.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let text = read_text(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        parse(&text, folder).map_err(|message| parse_error(path, message))
    }

    /// A scene from TOML text. Paths of meshes are taken relative to `folder`.
    pub fn from_toml(text: &str, folder: impl AsRef<Path>) -> Result<Self> {
        parse(text, folder.as_ref()).map_err(|message| parse_error("scene text".as_ref(), message))
    }

    /// The scene as TOML text; what stands at its default is left out. [`Scene::from_toml`] reads
    /// it back to an equal scene.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|e| {
            Error::input(
                format!("scene {:?}", self.name),
                e.to_string(),
                "every number must fit a TOML number (whole numbers below 2^63)",
            )
        })
    }
}

fn parse_error(path: &Path, message: String) -> Error {
    Error::Parse {
        path: path.to_owned(),
        message,
    }
}

/// The text of a file, or an error that says what the path is instead.
fn read_text(path: &Path) -> Result<String> {
    let failed = |source| Error::File {
        path: path.to_owned(),
        action: "read",
        source,
    };
    if path.is_dir() {
        let why = "this is a folder; give the scene file itself, e.g. scene.toml";
        return Err(failed(io::Error::new(io::ErrorKind::IsADirectory, why)));
    }
    let bytes = std::fs::read(path).map_err(|source| {
        if source.kind() != io::ErrorKind::NotFound {
            return failed(source);
        }
        let why = match nearest_file(path) {
            Some(near) => format!("no such file; did you mean {}?", near.display()),
            None => "no such file; check the path, which is relative to the current folder".into(),
        };
        failed(io::Error::new(io::ErrorKind::NotFound, why))
    })?;
    String::from_utf8(bytes).map_err(|e| {
        let good = e.utf8_error().valid_up_to();
        let line = line_of(&e.as_bytes()[..good]);
        parse_error(
            path,
            format!(
                "line {line}: byte {good} is not UTF-8 text; a scene file is TOML text saved as \
                 UTF-8"
            ),
        )
    })
}

/// The file of the same folder whose name is nearest to the missing one's.
fn nearest_file(path: &Path) -> Option<PathBuf> {
    let wanted = path.file_name()?.to_str()?;
    let folder = path.parent()?;
    let listed = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let names: Vec<String> = std::fs::read_dir(listed)
        .ok()?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    nearest(wanted, names.iter().map(String::as_str)).map(|name| folder.join(name))
}

/// The candidate most like `wanted`, if any is near enough to be meant.
pub(crate) fn nearest<'a>(
    wanted: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    candidates
        .into_iter()
        .map(|name| (strsim::jaro_winkler(wanted, name), name))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

fn parse(text: &str, folder: &Path) -> std::result::Result<Scene, String> {
    let blank = |line: &str| {
        let line = line.trim_start_matches('\u{feff}').trim();
        line.is_empty() || line.starts_with('#')
    };
    if text.lines().all(blank) {
        return Err(
            "line 1: nothing but blanks or comments; a scene needs time_step, steps, a [fluid] \
             and one or more [[bodies]]"
                .into(),
        );
    }
    let mut scene: Scene = toml::from_str(text).map_err(|e| explain(text, &e))?;
    for body in &mut scene.bodies {
        if let Some(Shape::Mesh { path, .. }) = &mut body.shape {
            *path = folder.join(&*path);
        }
    }
    Ok(scene)
}

/// One step from a table to what it holds.
#[derive(Clone, PartialEq)]
enum Step {
    Key(String),
    Index(usize),
}

/// Line, place, problem and remedy of a failed reading.
fn explain(text: &str, error: &toml::de::Error) -> String {
    let message = error.message();
    let span = error.span().unwrap_or(0..0);
    let line = |at: usize| line_of(&text.as_bytes()[..at.min(text.len())]);
    let here = line(span.start);
    let (Ok(document), Ok(values)) = (DeTable::parse(text), toml::from_str(text)) else {
        return format!("line {here}: {message}; this is not TOML yet");
    };
    let values: toml::Table = values;

    // Errors inside a table with a `kind` carry the table's span; the rest that of key or value.
    let mut path = Vec::new();
    find_span(document.get_ref(), &span, &mut path);
    let table = table_at(document.get_ref(), &path);
    let names = quoted(message);
    let asked = names.first().copied().unwrap_or_default();

    if message.starts_with("unknown field") {
        let at = match table.and_then(|t| key_start(t, asked)) {
            Some(start) => line(start),
            None => {
                path.pop();
                here
            }
        };
        return format!(
            "line {at}: {} has no key `{asked}`; {}",
            place(&path, &values),
            suggestion(asked, &names[1..], "keys")
        );
    }
    if message.starts_with("unknown variant") {
        let mut at = here;
        if let Some(table) = table {
            let kind = table.get("kind").and_then(|k| k.get_ref().as_str());
            let key = if kind == Some(asked) {
                Some("kind".to_owned())
            } else {
                culprit(&values, &path, table)
            };
            if let Some(key) = key {
                at = key_start(table, &key).map_or(here, line);
                path.push(Step::Key(key));
            }
        }
        return format!(
            "line {at}: {}: `{asked}` is not known; {}",
            place(&path, &values),
            suggestion(asked, &names[1..], "choices")
        );
    }
    if message.starts_with("missing field") {
        let choices = if asked == "kind" {
            kinds(&values, &path)
        } else {
            String::new()
        };
        return format!(
            "line {here}: {} lacks the key `{asked}`; add `{asked} = …`{choices}",
            place(&path, &values)
        );
    }
    let mut at = here;
    if let Some(table) = table
        && let Some(key) = culprit(&values, &path, table)
    {
        at = key_start(table, &key).map_or(here, line);
        path.push(Step::Key(key));
    }
    format!(
        "line {at}: {}: {}",
        place(&path, &values),
        plain_words(message)
    )
}

/// Number of the line that follows this text's last character, from 1.
fn line_of(before: &[u8]) -> usize {
    before.iter().filter(|&&b| b == b'\n').count() + 1
}

/// What stands between backticks, in order.
fn quoted(message: &str) -> Vec<&str> {
    message.split('`').skip(1).step_by(2).collect()
}

fn suggestion(asked: &str, known: &[&str], noun: &str) -> String {
    let list = format!("{noun}: {}", known.join(", "));
    match nearest(asked, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`? ({list})"),
        None if known.is_empty() => "remove it; no key but `kind` belongs here".into(),
        None => format!("remove it or use one of the {list}"),
    }
}

/// Path to the key or value with exactly this span.
fn find_span(table: &DeTable<'_>, span: &std::ops::Range<usize>, path: &mut Vec<Step>) -> bool {
    for (key, value) in table.iter() {
        path.push(Step::Key(key.get_ref().to_string()));
        if key.span() == *span || find_in_value(value, span, path) {
            return true;
        }
        path.pop();
    }
    false
}

fn find_in_value(
    value: &Spanned<DeValue<'_>>,
    span: &std::ops::Range<usize>,
    path: &mut Vec<Step>,
) -> bool {
    // Inside first: an array of tables has the span of its first header, as its first table has.
    let inside = match value.get_ref() {
        DeValue::Table(table) => find_span(table, span, path),
        DeValue::Array(items) => items.iter().enumerate().any(|(i, item)| {
            path.push(Step::Index(i));
            let found = find_in_value(item, span, path);
            if !found {
                path.pop();
            }
            found
        }),
        _ => false,
    };
    inside || value.span() == *span
}

fn table_at<'a, 'i>(root: &'a DeTable<'i>, path: &[Step]) -> Option<&'a DeTable<'i>> {
    let Some((Step::Key(first), rest)) = path.split_first() else {
        return Some(root);
    };
    let mut value = root.get(first.as_str())?.get_ref();
    for step in rest {
        value = match step {
            Step::Key(key) => value.as_table()?.get(key.as_str())?.get_ref(),
            Step::Index(i) => value.get(*i)?.get_ref(),
        };
    }
    value.as_table()
}

fn key_start(table: &DeTable<'_>, name: &str) -> Option<usize> {
    let mut keys = table.keys();
    keys.find(|k| k.get_ref() == name).map(|k| k.span().start)
}

fn table_at_mut<'a>(root: &'a mut toml::Table, path: &[Step]) -> Option<&'a mut toml::Table> {
    let Some((Step::Key(first), rest)) = path.split_first() else {
        return Some(root);
    };
    let mut value = root.get_mut(first)?;
    for step in rest {
        value = match step {
            Step::Key(key) => value.get_mut(key.as_str())?,
            Step::Index(i) => value.get_mut(*i)?,
        };
    }
    value.as_table_mut()
}

fn message_of(values: toml::Table) -> Option<String> {
    let read: std::result::Result<Scene, _> = values.try_into();
    read.err().map(|e| e.message().to_owned())
}

/// The key of this table whose value can't be read: the one without which the complaint changes.
fn culprit(values: &toml::Table, path: &[Step], table: &DeTable<'_>) -> Option<String> {
    let complaint = message_of(values.clone());
    let mut keys = table.keys().map(|k| k.get_ref().to_string());
    keys.find(|key| {
        let mut without = values.clone();
        let Some(at) = table_at_mut(&mut without, path) else {
            return false;
        };
        at.remove(key);
        key != "kind" && message_of(without) != complaint
    })
}

/// The kinds that this table could have, from the complaint about one that can't be.
fn kinds(values: &toml::Table, path: &[Step]) -> String {
    let mut with = values.clone();
    if let Some(at) = table_at_mut(&mut with, path) {
        at.insert("kind".into(), "?".into());
    }
    match message_of(with) {
        Some(m) if m.starts_with("unknown variant `?`") => {
            format!(", one of {}", quoted(&m)[1..].join(", "))
        }
        _ => String::new(),
    }
}

/// `body "coin": shape.radius` or `fluid.density`.
fn place(path: &[Step], values: &toml::Table) -> String {
    let (head, rest) = match path {
        [Step::Key(bodies), Step::Index(i), rest @ ..] if bodies == "bodies" => {
            let body = values.get("bodies").and_then(|b| b.get(*i));
            let name = body.and_then(|b| b.get("name")).and_then(|n| n.as_str());
            let head = match name {
                Some(name) => format!("body \"{name}\""),
                None => format!("body number {} (unnamed)", i + 1),
            };
            (Some(head), rest)
        }
        _ => (None, path),
    };
    let mut tail = String::new();
    for step in rest {
        match step {
            Step::Key(key) if tail.is_empty() => tail.push_str(key),
            Step::Key(key) => tail.push_str(&format!(".{key}")),
            Step::Index(i) => tail.push_str(&format!("[{i}]")),
        }
    }
    match (head, tail.is_empty()) {
        (Some(head), true) => head,
        (Some(head), false) => format!("{head}: {tail}"),
        (None, true) => "the scene".into(),
        (None, false) => tail,
    }
}

/// A message of serde without the names of Rust types.
fn plain_words(message: &str) -> String {
    let mut words = message.to_owned();
    for (rust, plain) in [
        ("expected f64", "expected a number"),
        ("expected usize", "expected a whole number, zero or more"),
        ("expected a boolean", "expected true or false"),
        ("expected a sequence", "expected a list [ … ]"),
        ("expected an array of length", "expected a list of length"),
    ] {
        words = words.replace(rust, plain);
    }
    words
}
