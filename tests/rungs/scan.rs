//! Rungs in the source, by name.

use std::collections::BTreeSet;
use std::path::Path;

/// Rungs that aren't named by the ladder's suffixes.
pub const OTHERS: [&str; 3] = ["reverse", "gradient", "gradient_along"];

/// Paths of all rungs below `folder`: module, type of the impl block, function. Files named after a
/// rung (`vjp.rs`) count as part of the module that holds them.
pub fn rungs(folder: &str, prefix: &str) -> BTreeSet<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut out = BTreeSet::new();
    let mut folders = vec![root.clone()];
    while let Some(at) = folders.pop() {
        for entry in std::fs::read_dir(&at).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let inside = path.strip_prefix(&root).unwrap().with_extension("");
            let last = inside.file_name().unwrap().to_str().unwrap();
            // Checks and tests are no rungs.
            if path.extension().is_none_or(|e| e != "rs") || ["registry", "tests"].contains(&last) {
                continue;
            }
            let skip = ["mod", "lib", "value", "jvp", "vjp", "hvp"];
            let module: Vec<&str> = inside
                .iter()
                .map(|p| p.to_str().unwrap())
                .filter(|p| !skip.contains(p))
                .collect();
            for name in functions(&std::fs::read_to_string(&path).unwrap()) {
                out.insert(format!("{prefix}{}::{name}", module.join("::")));
            }
        }
    }
    out
}

fn is_rung(name: &str) -> bool {
    let last = name.rsplit('_').next().unwrap_or(name);
    ["jvp", "vjp", "hvp"].contains(&last) || OTHERS.contains(&name)
}

/// Rungs defined in a file, `Type::name` where they are methods; declarations without a body and
/// everything from the file's test module on are left out.
pub fn functions(text: &str) -> Vec<String> {
    let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or("");
    let word = |s: &str| -> String {
        s.chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect()
    };
    let mut owner: Option<String> = None;
    let mut out = Vec::new();
    for (at, line) in text.match_indices('\n').map(|(i, _)| i + 1).map(|i| {
        let line = text[i..].lines().next().unwrap_or("");
        (i, line)
    }) {
        let code = line.trim_start();
        if line.starts_with("impl") {
            // `impl<..> Trait for Type<..>` or `impl<..> Type<..>`.
            let head = line.trim_start_matches("impl");
            let head = match head.strip_prefix('<') {
                Some(rest) => rest.split_once('>').map_or("", |(_, r)| r),
                None => head,
            };
            let name = head.split(" for ").last().unwrap_or("").trim();
            owner = Some(word(name));
        } else if line.starts_with("pub trait") || line.starts_with("trait") {
            let name = line.split("trait ").nth(1).unwrap_or("");
            owner = Some(word(name));
        } else if line.starts_with('}') {
            owner = None;
        }
        let Some(start) = code.find("fn ").filter(|_| !code.starts_with("//")) else {
            continue;
        };
        // A function's own line: nothing but qualifiers before `fn`.
        let before = code[..start].trim();
        let qualifier = |w: &str| w.starts_with("pub") || ["const", "unsafe", "in"].contains(&w);
        if !before
            .split([' ', '(', ')'])
            .all(|w| w.is_empty() || qualifier(w) || ["super", "crate", "self"].contains(&w))
        {
            continue;
        }
        let name = word(&code[start + 3..]);
        let rest = &text[at..];
        let declared = rest.find(";\n").unwrap_or(rest.len());
        let has_body = rest.find('{').is_some_and(|body| body < declared);
        if is_rung(&name) && has_body {
            out.push(match &owner {
                Some(owner) => format!("{owner}::{name}"),
                None => name,
            });
        }
    }
    out
}

#[test]
fn functions_are_found_with_their_types() {
    let text = "
pub fn a_vjp(x: f64) -> [f64; 1] { [x] }
pub(super) fn b_jvp<T>(
    x: T,
) -> T {
}
impl<T: Copy> Policy for Pd<T> {
    fn act_vjp(&self) {}
    fn act(&self) {}
}
pub trait Policy {
    fn act_vjp(&self);
    fn hvp(&self) { self.x() }
}
// fn c_vjp() {}
fn d_vjpx() {}
impl Tree {
    pub fn reverse(&self) {}
}
#[cfg(test)]
mod tests {
    fn e_vjp() {}
}
";
    assert_eq!(
        functions(text),
        [
            "a_vjp",
            "b_jvp",
            "Pd::act_vjp",
            "Policy::hvp",
            "Tree::reverse"
        ]
    );
}
