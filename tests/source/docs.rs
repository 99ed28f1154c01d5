//! Documents: their links lead somewhere, and the book has all pages.

use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Documents at the top, and the book's pages.
fn documents() -> Vec<PathBuf> {
    let top = ["README.md", "CHANGELOG.md", "adjoint/README.md"].map(|name| root().join(name));
    let pages = std::fs::read_dir(root().join("docs")).unwrap();
    let pages = pages.map(|entry| entry.unwrap().path());
    let pages = pages.filter(|path| path.extension().is_some_and(|e| e == "md"));
    let mut out: Vec<PathBuf> = top.into_iter().chain(pages).collect();
    out.sort();
    out
}

/// Targets of a document's links, outside of its listings.
fn links(text: &str) -> Vec<String> {
    let mut out = Vec::new();
    let mut listing = false;
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            listing = !listing;
        }
        if listing {
            continue;
        }
        for part in line.split("](").skip(1) {
            if let Some((target, _)) = part.split_once(')') {
                out.push(target.to_string());
            }
        }
    }
    out
}

/// Headings as links name them.
fn anchors(text: &str) -> Vec<String> {
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let anchor = |line: &str| -> String {
        let title = line.trim_start_matches('#').trim().to_lowercase();
        let kept = title
            .chars()
            .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    headings.map(anchor).collect()
}

#[test]
fn links_lead_somewhere() {
    let mut dead = Vec::new();
    let mut count = 0;
    for document in documents() {
        let text = std::fs::read_to_string(&document).unwrap();
        for link in links(&text).iter().filter(|link| !link.contains("://")) {
            count += 1;
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = match file {
                "" => document.clone(),
                file => document.parent().unwrap().join(file),
            };
            let found = target.exists()
                && (anchor.is_empty()
                    || anchors(&std::fs::read_to_string(&target).unwrap_or_default())
                        .iter()
                        .any(|a| a == anchor));
            if !found {
                dead.push(format!("{}: {link}", document.display()));
            }
        }
    }
    assert!(count > 100, "{count}");
    assert!(dead.is_empty(), "{dead:#?}");
}

#[test]
fn the_book_has_all_pages() {
    let summary = std::fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap();
    let listed = links(&summary);
    for page in documents() {
        let name = page.file_name().unwrap().to_str().unwrap().to_string();
        let in_book = page.parent() == Some(&root().join("docs")) && name != "SUMMARY.md";
        assert!(
            !in_book || listed.contains(&name),
            "{name} isn't in docs/SUMMARY.md"
        );
    }
}

/// mdBook itself builds it, each page under its title.
#[test]
fn the_book_builds() {
    let folder = tempfile::tempdir().unwrap();
    let mut book = mdbook_driver::MDBook::load(root().join("docs")).unwrap();
    book.config.build.build_dir = folder.path().to_path_buf();
    book.build().unwrap();
    for page in documents() {
        let name = page.file_stem().unwrap().to_str().unwrap();
        if page.parent() != Some(&root().join("docs")) || name == "SUMMARY" {
            continue;
        }
        let text = std::fs::read_to_string(&page).unwrap();
        let title = text.lines().next().unwrap().trim_start_matches("# ");
        let built =
            std::fs::read_to_string(folder.path().join(name).with_extension("html")).unwrap();
        assert!(built.contains(&format!(">{title}</a></h1>")), "{name}");
    }
}

/// Every key of a scene file stands in the page on scenes, and its example runs.
#[test]
fn the_page_on_scenes_has_every_key() {
    let page = std::fs::read_to_string(root().join("docs/scenes.md")).unwrap();
    let sources = [
        "scene/mod.rs",
        "scene/contact.rs",
        "scene/site.rs",
        "scene/passive.rs",
        "scene/servo.rs",
        "scene/mimic.rs",
        "scene/robot/mod.rs",
        "scene/robot/link.rs",
        "scene/robot/joint.rs",
        "scene/force/spring.rs",
        "scene/force/lubrication.rs",
        "shape/description.rs",
        "geometry/wall.rs",
        "geometry/refine/mod.rs",
    ];
    let mut keys = 0;
    for source in sources {
        let text = std::fs::read_to_string(root().join("src").join(source)).unwrap();
        let (mut serde, mut skipped) = (false, false);
        for line in text.lines() {
            // What isn't read is no key.
            let skips = std::mem::replace(&mut skipped, line.trim() == "#[serde(skip)]");
            if line.starts_with("#[derive") {
                serde = line.contains("Deserialize");
            }
            if line.starts_with('}') {
                serde = false;
            }
            let field = line.trim_start().trim_start_matches("pub ");
            let Some((key, _)) = field.split_once(": ") else {
                continue;
            };
            let is_key = key.chars().all(|c| c.is_ascii_lowercase() || c == '_');
            let indented = line.starts_with("    ") && line.trim_end().ends_with(',');
            if skips || !(serde && is_key && indented) {
                continue;
            }
            keys += 1;
            let word = |c: char| !(c.is_alphanumeric() || c == '_');
            assert!(
                page.split(word).any(|w| w == key),
                "{source}: `{key}` isn't in docs/scenes.md"
            );
        }
    }
    assert!(keys > 60, "{keys}");

    let example = page.split("```toml\n").nth(1).unwrap();
    let example = example.split("```").next().unwrap();
    let scene = hydrograd::Scene::from_toml(example, ".").unwrap();
    scene.validate().unwrap();
    let settings = hydrograd::Settings::default().fidelity(hydrograd::Fidelity::Reduced);
    let simulator = hydrograd::Simulator::new(&scene, settings).unwrap();
    let rollout = simulator.rollout(&hydrograd::Controls::zeros(&simulator, 5));
    assert_eq!(rollout.unwrap().steps(), 5);
    for name in ["stone.mass", "lid.drag.linear", "spring 1.stiffness"] {
        assert!(simulator.parameters().get(name).is_ok(), "{name}");
    }
}

/// What documents tell a reader to run is there: examples, benches, tests, scripts, subcommands, and their options.
#[test]
fn commands_name_what_is_there() {
    let exists = |kind: &str, name: &str| {
        match kind {
            "--example" => ["examples", ""],
            "--bench" => ["benches", "adjoint/benches"],
            _ => ["tests", ""],
        }
        .iter()
        .filter(|folder| !folder.is_empty())
        .any(|folder| {
            let at = root().join(folder).join(name);
            at.with_extension("rs").exists() || at.join("main.rs").exists()
        })
    };
    let manual = |arguments: &[&str]| {
        // Without the feature `cli` there is no program to ask.
        let program = option_env!("CARGO_BIN_EXE_hydrograd")?;
        let help = std::process::Command::new(program)
            .args(arguments)
            .arg("--help")
            .output()
            .unwrap();
        help.status
            .success()
            .then(|| String::from_utf8(help.stdout).unwrap())
    };
    let mut wrong = Vec::new();
    let mut count = 0;
    for document in documents() {
        if document.ends_with("CHANGELOG.md") || document.ends_with("cli.md") {
            continue;
        }
        let text = std::fs::read_to_string(&document).unwrap();
        let marked = text
            .split('`')
            .chain(text.lines())
            .filter(|c| !c.contains('`') && !c.contains('…') && !c.trim().contains('\n'));
        for command in marked {
            let words: Vec<&str> = command.split_whitespace().collect();
            let mut bad = |what: String| wrong.push(format!("{}: {what}", document.display()));
            match words[..] {
                ["cargo", "run" | "bench" | "test", ..] => {
                    for pair in words.windows(2) {
                        if ["--example", "--bench", "--test"].contains(&pair[0]) {
                            count += 1;
                            let name = pair[1].trim_end_matches([':', ',', ')']);
                            if !exists(pair[0], name) {
                                bad(format!("{} {name}", pair[0]));
                            }
                        }
                    }
                }
                ["python", script, ..] if script.ends_with(".py") => {
                    count += 1;
                    if !root().join(script).exists() {
                        bad(script.to_string());
                    }
                }
                ["hydrograd", subcommand, ..]
                    if !subcommand.starts_with('-') && cfg!(feature = "cli") =>
                {
                    count += 1;
                    let Some(help) = manual(&[subcommand]) else {
                        bad(format!("hydrograd {subcommand}"));
                        continue;
                    };
                    for option in words.iter().filter(|w| w.starts_with("--")) {
                        let option = option.split('=').next().unwrap();
                        if !help.contains(option) {
                            bad(format!("hydrograd {subcommand} {option}"));
                        }
                    }
                }
                _ => {}
            }
        }
    }
    assert!(count > 60, "{count}");
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// What a newcomer reads first is short.
#[test]
fn the_readme_is_short() {
    let lines = std::fs::read_to_string(root().join("README.md"))
        .unwrap()
        .lines()
        .count();
    assert!(lines <= 120, "{lines} lines");
}
