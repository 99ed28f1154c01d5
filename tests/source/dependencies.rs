//! Crates that hydrograd is built from, on every platform: their licences, where they come from, and what is banned, as `deny.toml` says.

use cargo_metadata::{CargoOpt, MetadataCommand, Package};
use std::collections::BTreeSet;
use std::path::Path;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn rules() -> toml::Table {
    let text = std::fs::read_to_string(root().join("deny.toml")).unwrap();
    text.parse().unwrap()
}

fn list(rules: &toml::Table, part: &str, key: &str) -> Vec<String> {
    let listed = rules[part][key].as_array().unwrap().iter();
    listed.map(|x| x.as_str().unwrap().to_string()).collect()
}

fn packages() -> Vec<Package> {
    let mut command = MetadataCommand::new();
    command.manifest_path(root().join("Cargo.toml"));
    command.features(CargoOpt::AllFeatures);
    command.other_options(["--locked".to_string()]);
    command.exec().unwrap().packages
}

#[test]
fn crates_are_as_the_rules_say() {
    let rules = rules();
    let allowed = list(&rules, "licenses", "allow");
    let exceptions = rules["licenses"]["exceptions"].as_array().unwrap();
    let excepted = |name: &str, license: &str| {
        let of = exceptions
            .iter()
            .filter(|e| e["crate"].as_str() == Some(name));
        let mut licenses = of.flat_map(|e| e["allow"].as_array().unwrap());
        licenses.any(|l| l.as_str() == Some(license))
    };
    let banned = list(&rules, "bans", "deny");
    let mut used = BTreeSet::new();
    let mut wrong = Vec::new();
    let mut registries = BTreeSet::new();
    let all = packages();
    for package in &all {
        let name = format!("{} {}", package.name, package.version);
        let license = package.license.as_deref().unwrap_or_default();
        let parsed = spdx::Expression::parse_mode(license, spdx::ParseMode::LAX);
        let may = parsed.is_ok_and(|expression| {
            expression.evaluate(|asked| {
                let asked = asked.to_string();
                let may = allowed.contains(&asked);
                let excepted = excepted(&package.name, &asked);
                used.extend(may.then_some(asked));
                may || excepted
            })
        });
        if !may {
            wrong.push(format!("{name}: licence {license:?}"));
        }
        if banned.contains(&package.name.to_string()) {
            wrong.push(format!("{name}: banned"));
        }
        // What has no source lies here.
        let source = package.source.as_ref().map(|s| s.repr.clone());
        match &source {
            Some(from) if from.starts_with("registry+") => drop(registries.insert(from.clone())),
            Some(from) => wrong.push(format!("{name}: comes from {from}")),
            None => {}
        }
        for needed in &package.dependencies {
            let here = source.is_none() && needed.path.is_none();
            if here && needed.req == cargo_metadata::semver::VersionReq::STAR {
                wrong.push(format!("{name}: any version of {}", needed.name));
            }
        }
    }
    assert!(all.len() > 100, "{}", all.len());
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(registries.len(), 1, "{registries:?}");
    // A licence that nothing has is let in by mistake.
    let unused: Vec<_> = allowed.iter().filter(|l| !used.contains(*l)).collect();
    assert!(unused.is_empty(), "{unused:?}");
}

/// Crates with their features, as one build has them.
fn built(arguments: &[&str]) -> BTreeSet<String> {
    let mut cargo = std::process::Command::new(env!("CARGO"));
    let form = [
        "tree", "--locked", "--prefix", "none", "--format", "{p} {f}",
    ];
    let made = cargo.current_dir(root()).args(form).args(arguments);
    let made = made.output().unwrap();
    let said = String::from_utf8_lossy(&made.stderr);
    assert!(made.status.success(), "{said}");
    let lines = String::from_utf8(made.stdout).unwrap();
    lines
        .lines()
        .map(|line| line.trim_end_matches(" (*)").to_string())
        .collect()
}

/// The Python package is built from what the tests are, but for crates of its own: otherwise the library is compiled once more for it.
#[test]
fn python_and_the_tests_share_what_is_compiled() {
    const OWN: [&str; 9] = [
        "hydrograd-python",
        "inventory",
        "ndarray",
        "numpy",
        "pyo3",
        "pyo3-build-config",
        "pyo3-ffi",
        "rustc-hash",
        "target-lexicon",
    ];
    let tests = built(&["--features", "cli,gpu", "--edges", "normal,build,dev"]);
    let python = ["--manifest-path", "python/Cargo.toml", "--edges"];
    let python = built(&[&python[..], &["normal,build"]].concat());
    let own = |line: &&String| OWN.iter().any(|own| line.starts_with(&format!("{own} ")));
    let unlike: Vec<&String> = python.difference(&tests).filter(|l| !own(l)).collect();
    assert!(
        unlike.is_empty(),
        "ask for the features of these in python/Cargo.toml, or among the tests' dependencies: {unlike:#?}"
    );
}
