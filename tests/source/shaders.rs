//! Every shader is right WGSL in every arithmetic, is called and has a twin on the CPU; no device is needed.

#[path = "../../src/gpu/source.rs"]
#[allow(dead_code)]
mod source;

use super::graph::sources;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use source::{Arithmetic, Constant, SHADERS, Shader, Surface};
use std::collections::BTreeSet;
use std::path::Path;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

const SURFACES: [Surface; 2] = [Surface::Faces, Surface::Panels];

/// A setting with as many columns in all as there are, and with one more.
fn widened(given: &Vec<(&'static str, Constant)>) -> Vec<Vec<(&'static str, Constant)>> {
    let columns = number(given, "COLUMNS");
    let with = |n: u32| [&given[..], &[("WIDE", Constant::Number(n))]].concat();
    vec![with(columns), with(columns + 1)]
}

/// The same constants, and how many fours of columns these are.
fn in_fours(given: &Vec<(&'static str, Constant)>) -> Vec<(&'static str, Constant)> {
    let quads = number(given, "WIDE").div_ceil(4);
    [&given[..], &[("QUADS", Constant::Number(quads))]].concat()
}

/// A number among constants that come before.
fn number(given: &[(&'static str, Constant)], wanted: &str) -> u32 {
    let found = given.iter().find_map(|(name, value)| match value {
        Constant::Number(n) if *name == wanted => Some(*n),
        _ => None,
    });
    found.unwrap_or_else(|| panic!("{wanted} comes before what depends on it"))
}

/// Every setting of a shader's constants that differs in kind.
fn settings(shader: &Shader) -> Vec<Vec<(&'static str, Constant)>> {
    let mut all = vec![Vec::new()];
    for name in shader.constants() {
        let values = match name {
            "COLUMNS" if shader.name == "batch_tangent" => {
                vec![Constant::Number(1), Constant::Number(2)]
            }
            "COLUMNS" => vec![Constant::Number(1), Constant::Number(12)],
            // Columns, with one more beside them or without.
            "WIDE" => {
                all = all.iter().flat_map(widened).collect();
                continue;
            }
            "QUADS" => {
                all = all.iter().map(in_fours).collect();
                continue;
            }
            "LANES" => vec![Constant::Number(64), Constant::Number(256)],
            "LEFT" if shader.name.ends_with("_hvp") => {
                vec![Constant::Number(1), Constant::Number(2)]
            }
            "LEFT" => vec![Constant::Number(1), Constant::Number(4)],
            "SURFACE" => SURFACES.map(Constant::Surface).to_vec(),
            "MOVED" | "ROTATED" | "SCALARS" => {
                let of = |s: Surface| s.constants().into_iter().find(|(n, _)| *n == name);
                SURFACES.map(|s| of(s).unwrap().1).to_vec()
            }
            _ => vec![Constant::Flag(false), Constant::Flag(true)],
        };
        all = all
            .iter()
            .flat_map(|given: &Vec<_>| {
                values.iter().map(move |v| {
                    let mut more = given.clone();
                    more.push((name, *v));
                    more
                })
            })
            .collect();
    }
    all
}

#[test]
fn every_shader_is_valid_in_every_arithmetic() {
    for shader in SHADERS {
        for arithmetic in [Arithmetic::Single, Arithmetic::Double, Arithmetic::TwoFloat] {
            for constants in settings(shader) {
                let text = shader.assemble(arithmetic, &constants).expect(shader.name);
                let place = format!("{} ({}, {constants:?})", shader.name, arithmetic.name());
                let module = naga::front::wgsl::parse_str(&text)
                    .unwrap_or_else(|e| panic!("{place}: {}", e.emit_to_string(&text)));
                let capabilities = match arithmetic {
                    Arithmetic::Double => Capabilities::FLOAT64,
                    _ => Capabilities::empty(),
                };
                if let Err(e) =
                    Validator::new(ValidationFlags::all(), capabilities).validate(&module)
                {
                    panic!("{place}: {}", e.emit_to_string(&text));
                }
                assert!(!module.entry_points.is_empty(), "{place}: no entry");
            }
        }
    }
}

#[test]
fn constants_choose_and_count() {
    let text = "\
//! constants: WIDE FLAG
fn f() {
    if FLAG {
        yes();
    } else {
        for (var k = 0u; k < WIDE; k++) {
            no(k);
        }
    }
    if !FLAG {
        also();
    }
    if other {
        kept();
    }
}
";
    let shader = Shader {
        name: "choice",
        text,
        twin: "",
    };
    for (flag, counts) in [(true, [1, 0, 0, 1]), (false, [0, 2, 1, 1])] {
        let constants = [
            ("WIDE", Constant::Number(2)),
            ("FLAG", Constant::Flag(flag)),
        ];
        let text = shader.assemble(Arithmetic::Single, &constants).unwrap();
        let found =
            ["yes();", "no(k);", "also();", "kept();"].map(|call| text.matches(call).count());
        assert_eq!(found, counts, "{text}");
        assert!(!text.contains("if FLAG") && !text.contains("if !FLAG"));
        assert_eq!(text.matches('{').count(), text.matches('}').count());
    }
}

/// Bytes of workgroup memory and storage buffers that src/gpu/context.rs asks an adapter for.
fn asked_for(name: &str) -> u32 {
    let context = std::fs::read_to_string(root().join("src/gpu/context.rs")).unwrap();
    let line = context
        .lines()
        .find(|l| l.contains(&format!("const {name}: u32")));
    let value = line
        .unwrap()
        .split(" = ")
        .nth(1)
        .unwrap()
        .trim_end_matches(';');
    match value.split_once(" << ") {
        Some((n, shift)) => n.parse::<u32>().unwrap() << shift.parse::<u32>().unwrap(),
        None => value.parse().unwrap(),
    }
}

#[test]
fn every_shader_stays_within_what_is_asked_of_an_adapter() {
    let (bytes, buffers) = (asked_for("WORKGROUP_BYTES"), asked_for("STORAGE_BUFFERS"));
    for shader in SHADERS {
        for constants in settings(shader) {
            let text = shader.assemble(Arithmetic::Double, &constants).unwrap();
            let module = naga::front::wgsl::parse_str(&text).unwrap();
            let info = Validator::new(ValidationFlags::all(), Capabilities::FLOAT64)
                .validate(&module)
                .unwrap();
            for (at, entry) in module.entry_points.iter().enumerate() {
                let used = info.get_entry_point(at);
                let (mut memory, mut storage) = (0, 0);
                for (handle, variable) in module.global_variables.iter() {
                    if used[handle].is_empty() {
                        continue;
                    }
                    match variable.space {
                        naga::AddressSpace::WorkGroup => {
                            memory += module.types[variable.ty].inner.size(module.to_ctx());
                        }
                        naga::AddressSpace::Storage { .. } => storage += 1,
                        _ => {}
                    }
                }
                let place = format!("{}::{} {constants:?}", shader.name, entry.name);
                assert!(memory <= bytes, "{place}: {memory} bytes of {bytes}");
                assert!(
                    storage <= buffers,
                    "{place}: {storage} buffers of {buffers}"
                );
            }
        }
    }
}

#[test]
fn every_shader_file_is_known_and_called_and_has_a_twin_and_a_comparison() {
    let stems = |folder: &str, extension: &str| -> BTreeSet<String> {
        std::fs::read_dir(root().join(folder))
            .unwrap()
            .map(|f| f.unwrap().path())
            .filter(|p| p.extension().is_some_and(|e| e == extension))
            .map(|p| p.file_stem().unwrap().to_string_lossy().into_owned())
            .collect()
    };
    let known: BTreeSet<String> = SHADERS.iter().map(|s| s.name.to_string()).collect();
    assert_eq!(
        stems("shaders", "wgsl"),
        known,
        "shaders and src/gpu/source.rs"
    );
    let comparisons = std::fs::read_to_string(root().join("tests/gpu/main.rs")).unwrap();
    let callers = sources(&root().join("src/gpu")).into_iter();
    let code: Vec<String> = callers
        .filter(|p| !p.ends_with("source.rs"))
        .map(|p| std::fs::read_to_string(p).unwrap())
        .collect();
    for shader in SHADERS {
        let name = shader.name;
        // As the first of a call's shader and entry, or chosen by a `match`.
        let calls = [
            format!("(\"{name}\", \""),
            format!("(\"{name}\", entry"),
            format!("(\"{name}\", self.entry"),
            format!("=> \"{name}\","),
            format!("=> (\"{name}\","),
        ];
        let called = |c: &String| calls.iter().any(|call| c.contains(call));
        assert!(
            code.iter().any(called),
            "{name}: nothing in src/gpu calls it"
        );
        let (file, function) = shader.twin.split_once("::").expect(name);
        let paths = [format!("src/{file}"), file.to_string()];
        let twin = paths
            .iter()
            .find_map(|p| std::fs::read_to_string(root().join(p)).ok());
        let twin = twin.unwrap_or_else(|| panic!("{name}: no file {file} of its twin"));
        assert!(
            twin.contains(&format!("fn {function}")),
            "{name}: no twin {}",
            shader.twin
        );
        assert!(
            comparisons.contains(&format!("\"{name}\" =>")),
            "{name}: nothing compares it in tests/gpu"
        );
    }
}
