//! Scene files: TOML text to [`Scene`] and back, with errors that name line, key and remedy.
//!
//! The keys are those of the structs in [`crate::scene`], so what is known is asked of serde: it tells [`problem::Problem`]
//! which keys or kinds would have fitted, and `serde_path_to_error` where.

use std::io;
use std::path::{Path, PathBuf};

use serde_path_to_error::Segment;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Value};

use super::problem::{Problem, Reader};
use super::{Body, Fluid, Force, Origin, Scene};
use crate::{Error, Result};

/// Stands for the file of a scene that is read from text.
const TEXT: &str = "scene text";

impl Scene {
    /// Reads a scene file. Paths of meshes are taken relative to the file's folder, and are absolute in the scene.
    ///
    /// What the scene says is checked by [`Scene::validate`], not here.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let text = read_text(path)?;
        let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let folder = whole.parent().unwrap_or(Path::new(""));
        let scene = parse(&text, folder, path).map_err(|message| parse_error(path, message))?;
        with_robots(scene, folder)
    }

    /// A scene from TOML text. Paths of meshes are taken relative to `folder`, and are absolute in the scene; with an empty one they stay what they are.
    pub fn from_toml(text: &str, folder: impl AsRef<Path>) -> Result<Self> {
        let name = Path::new(TEXT);
        let folder = folder.as_ref();
        let scene = parse(text, folder, name).map_err(|message| parse_error(name, message))?;
        with_robots(scene, folder)
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

impl Force {
    /// A force from the keys that it has in a scene file, "kind" among them, as a JSON object; a key whose value is null is as if it weren't there.
    ///
    /// # Errors
    /// Keys that don't fit, as those of a scene file are told: which, and what would.
    pub fn from_json(keys: &str) -> Result<Self> {
        let refused = |message: String| parse_error(Path::new("force"), message);
        let table = serde_json::from_str::<serde_json::Map<String, serde_json::Value>>(keys);
        let mut table = table.map_err(|e| refused(e.to_string()))?;
        table.retain(|_, value| !value.is_null());
        let table = Value::try_from(table).map_err(|e| refused(e.to_string()))?;
        // A force is read as it is in a scene.
        let scene = Scene::new(Fluid::fresh_water());
        let mut values = Value::try_from(scene).map_err(|e| refused(e.to_string()))?;
        if let Value::Table(keys) = &mut values {
            keys.insert("forces".into(), Value::Array(vec![table]));
        }
        match read(values.clone()) {
            Ok(mut scene) => (scene.forces.pop()).ok_or_else(|| refused("none was read".into())),
            Err((path, problem)) => {
                let (_, message) = told(&values, path, &problem);
                let message = message.replacen("forces[0].", "", 1);
                Err(refused(message.replacen("forces[0]", "it", 1)))
            }
        }
    }
}

/// The scene with the bodies of its robots.
#[cfg(feature = "urdf")]
fn with_robots(mut scene: Scene, folder: &Path) -> Result<Scene> {
    scene.expand_robots(folder)?;
    Ok(scene)
}

#[cfg(not(feature = "urdf"))]
fn with_robots(scene: Scene, _folder: &Path) -> Result<Scene> {
    Ok(scene)
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

fn parse(text: &str, folder: &Path, file: &Path) -> std::result::Result<Scene, String> {
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
    let line = |at: usize| line_of(&text.as_bytes()[..at.min(text.len())]);
    let broken = |e: toml::de::Error| {
        let here = line(e.span().map_or(0, |s| s.start));
        format!("line {here}: {}; this is not TOML yet", e.message())
    };
    let values = toml::from_str(text).map(Value::Table).map_err(broken)?;
    let mut scene = read(values.clone()).map_err(|(path, problem)| match DeTable::parse(text) {
        Ok(document) => explain(document.get_ref(), &values, path, &problem, line),
        Err(error) => broken(error),
    })?;
    let document = DeTable::parse(text).map_err(broken)?;
    for (b, body) in scene.bodies.iter_mut().enumerate() {
        body.origin = origin(document.get_ref(), (b, body), file, line);
    }
    for path in scene.mesh_paths_mut() {
        if !path.as_os_str().is_empty() && !folder.as_os_str().is_empty() {
            // What it is doesn't depend on the folder in which the program goes on.
            let joined = folder.join(&*path);
            *path = std::path::absolute(&joined).unwrap_or(joined);
        }
    }
    Ok(scene)
}

/// Where the surfaces of a body, by its number, stand.
fn origin(
    document: &DeTable<'_>,
    (b, body): (usize, &Body),
    file: &Path,
    line: impl Fn(usize) -> usize,
) -> Origin {
    let key = |name: &str| Step::Key(name.into());
    let at = |shape: &[Step]| {
        let path = [&[key("bodies"), Step::Index(b)], shape, &[key("path")]].concat();
        line(start(document, &path))
    };
    let piece = |k: usize| at(&[key("collision"), Step::Index(k), key("shape")]);
    let pieces = (0..body.collision.len()).map(piece).collect();
    Origin::new(file.into(), at(&[key("shape")]), pieces)
}

/// One step from a table to what it holds.
#[derive(Clone, PartialEq)]
enum Step {
    Key(String),
    Index(usize),
}

/// The scene of these values, or where they don't fit and why.
fn read(values: Value) -> std::result::Result<Scene, (Vec<Step>, Problem)> {
    let read = serde_path_to_error::deserialize(Reader(values));
    read.map_err(|e: serde_path_to_error::Error<Problem>| {
        let step = |segment: &Segment| match segment {
            Segment::Map { key } => Some(Step::Key(key.clone())),
            Segment::Seq { index } => Some(Step::Index(*index)),
            Segment::Enum { .. } | Segment::Unknown => None,
        };
        let path = e.path().iter().filter_map(step).collect();
        (path, e.into_inner())
    })
}

/// Line, place, problem and remedy of values that don't fit.
fn explain(
    document: &DeTable<'_>,
    values: &Value,
    path: Vec<Step>,
    problem: &Problem,
    line: impl Fn(usize) -> usize,
) -> String {
    let (path, message) = told(values, path, problem);
    format!("line {}: {message}", line(start(document, &path)))
}

/// The same without the line: the path to what doesn't fit, and what is to be said of it.
fn told(values: &Value, mut path: Vec<Step>, problem: &Problem) -> (Vec<Step>, String) {
    if let Problem::UnknownKey { key, .. } = problem {
        // The path ends with the key itself where the table is that of a struct.
        let inside = table_at(values, &path).is_some_and(|t| t.contains_key(key));
        if !inside {
            path.pop();
        }
    }
    // Tables with a `kind` are read at once: the path ends at them, whatever in them is wrong.
    if let Some(table) = table_at(values, &path) {
        match problem {
            Problem::UnknownChoice { name, .. } if kind(table) == Some(name) => {
                path.push(Step::Key("kind".into()));
            }
            Problem::UnknownChoice { .. } | Problem::Other(_) => {
                path.extend(culprit(values, &path, table, problem).map(Step::Key));
            }
            Problem::UnknownKey { .. } | Problem::Missing { .. } => {}
        }
    }
    let of = place(&path, values);
    let message = match problem {
        Problem::UnknownKey { key, known } => {
            path.push(Step::Key(key.clone()));
            format!(
                "{of} has no key `{key}`; {}",
                suggestion(key, known, "keys")
            )
        }
        Problem::UnknownChoice { name, known } => {
            let what = suggestion(name, known, "choices");
            format!("{of}: `{name}` is not known; {what}")
        }
        Problem::Missing { key } => {
            let choices = match *key {
                "kind" => kinds(values, &path),
                _ => String::new(),
            };
            format!("{of} lacks the key `{key}`; add `{key} = …`{choices}")
        }
        Problem::Other(message) => format!("{of}: {}", plain_words(message)),
    };
    (path, message)
}

fn kind(table: &toml::Table) -> Option<&str> {
    table.get("kind").and_then(Value::as_str)
}

/// Number of the line that follows this text's last character, from 1.
fn line_of(before: &[u8]) -> usize {
    before.iter().filter(|&&b| b == b'\n').count() + 1
}

/// What users of other formats call what a key here has, where another key is nearer by its letters.
const CALLED: &[(&str, &[&str])] = &[(
    "placement",
    &[
        "position",
        "pose",
        "pos",
        "orientation",
        "rotation",
        "xyz",
        "rpy",
        "quat",
        "euler",
    ],
)];

fn suggestion(asked: &str, known: &[&str], noun: &str) -> String {
    let list = format!("{noun}: {}", known.join(", "));
    let called = CALLED
        .iter()
        .find(|(key, names)| known.contains(key) && names.contains(&asked));
    let near = match called {
        Some((key, _)) => Some(*key),
        None => nearest(asked, known.iter().copied()),
    };
    match near {
        Some(near) => format!("did you mean `{near}`? ({list})"),
        None if known.is_empty() => "remove it; no key but `kind` belongs here".into(),
        None => format!("remove it or use one of the {list}"),
    }
}

/// Where in the text the key, or the element of a list, at this path begins: the nearest that there is.
fn start(document: &DeTable<'_>, path: &[Step]) -> usize {
    let (mut at, mut table, mut value): (_, _, Option<&Spanned<DeValue<'_>>>) =
        (0, Some(document), None);
    for step in path {
        let next = match step {
            Step::Key(key) => table.and_then(|t| {
                let (k, v) = t.iter().find(|(k, _)| k.get_ref() == key)?;
                Some((k.span().start, v))
            }),
            Step::Index(i) => value.and_then(|v| {
                let v = v.get_ref().as_array()?.get(*i)?;
                Some((v.span().start, v))
            }),
        };
        let Some((begin, found)) = next else { break };
        (at, value) = (begin, Some(found));
        table = found.get_ref().as_table();
    }
    at
}

fn table_at<'a>(root: &'a Value, path: &[Step]) -> Option<&'a toml::Table> {
    let into = |value: &'a Value, step: &Step| match step {
        Step::Key(key) => value.get(key),
        Step::Index(i) => value.get(*i),
    };
    path.iter().try_fold(root, into)?.as_table()
}

fn table_at_mut<'a>(root: &'a mut Value, path: &[Step]) -> Option<&'a mut toml::Table> {
    let into = |value: &'a mut Value, step: &Step| match step {
        Step::Key(key) => value.get_mut(key),
        Step::Index(i) => value.get_mut(*i),
    };
    path.iter().try_fold(root, into)?.as_table_mut()
}

/// The problem with the table at this path changed.
fn problem_with(
    values: &Value,
    path: &[Step],
    change: impl FnOnce(&mut toml::Table),
) -> Option<Problem> {
    let mut changed = values.clone();
    change(table_at_mut(&mut changed, path)?);
    read(changed).err().map(|(_, problem)| problem)
}

/// The key of this table whose value can't be read: the one without which the problem changes.
fn culprit(
    values: &Value,
    path: &[Step],
    table: &toml::Table,
    problem: &Problem,
) -> Option<String> {
    kind(table)?;
    let mut keys = table.keys().filter(|k| *k != "kind");
    let without = |key: &&String| {
        let then = problem_with(values, path, |t| drop(t.remove(*key)));
        then.as_ref() != Some(problem)
    };
    keys.find(without).cloned()
}

/// The kinds that this table could have, from the problem with one that can't be.
fn kinds(values: &Value, path: &[Step]) -> String {
    let wrong = |t: &mut toml::Table| drop(t.insert("kind".into(), "?".into()));
    match problem_with(values, path, wrong) {
        Some(Problem::UnknownChoice { known, .. }) => format!(", one of {}", known.join(", ")),
        _ => String::new(),
    }
}

/// `body "coin": shape.radius` or `fluid.density`.
fn place(path: &[Step], values: &Value) -> String {
    let (head, rest) = match path {
        [Step::Key(bodies), Step::Index(i), rest @ ..] if bodies == "bodies" => {
            let body = values.get("bodies").and_then(|b| b.get(*i));
            let name = body.and_then(|b| b.get("name")).and_then(|n| n.as_str());
            let head = match name {
                Some(name) => format!("body \"{name}\""),
                None => format!("bodies[{i}] (unnamed)"),
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
