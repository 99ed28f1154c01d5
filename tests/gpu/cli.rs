//! The command line's GPU flags, on an adapter that is there and on one that isn't.

use super::fixture::{context, difference};
use crate::support::command::{command, json, scene, text};
use std::process::Output;

/// The one JSON object on standard output, whatever the end.
fn object(output: &Output) -> serde_json::Value {
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!message.contains("panicked"), "{message}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn list(value: &serde_json::Value) -> Vec<f64> {
    let items = value.as_array().unwrap().iter();
    items.map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn a_run_on_the_gpu_is_the_cpus_and_says_what_it_ran_on() {
    let ball = scene("falling_ball");
    // Steps with films run on the CPU.
    let base = ["run", &ball, "--faces", "80", "--steps", "2", "--no-films"];
    let cpu = json(&base);
    assert_eq!(
        (&cpu["backend"], &cpu["backend_used"]),
        (&"cpu".into(), &"cpu".into())
    );
    assert!(cpu["device"].is_null() && cpu["backend_reason"].is_null());
    for arithmetic in ["double", "two-float"] {
        if arithmetic == "double" && !context().adapter().double {
            continue;
        }
        let flags = ["--backend", "gpu", "--gpu-arithmetic", arithmetic];
        let gpu = json(&[&base[..], &flags].concat());
        assert_eq!(
            (&gpu["backend"], &gpu["backend_used"]),
            (&"gpu".into(), &"gpu".into())
        );
        let device = &gpu["device"];
        assert_eq!(device["arithmetic"], arithmetic);
        for count in ["peak_memory", "dispatches", "read_backs", "bytes_back"] {
            assert!(device[count].as_u64().unwrap() > 0, "{count}");
        }
        let off = difference(&list(&gpu["final_q"]), &list(&cpu["final_q"]));
        assert!(off < 1e-7, "{arithmetic}: {off:e}");
    }
    let said = text(&[&base[..], &["--backend", "gpu"]].concat());
    let name = context().adapter().name.as_str();
    for word in [name, "peak memory", "dispatches", "read-backs"] {
        assert!(said.contains(word), "no {word:?} in {said}");
    }
    assert!(text(&base).contains("backend cpu"));
}

#[test]
fn other_commands_run_on_the_gpu() {
    let ball = scene("falling_ball");
    let mass = ["added-mass", &ball, "--faces", "80"];
    let rows = |report: &serde_json::Value| -> Vec<f64> {
        let rows = report["added_mass"].as_array().unwrap().iter();
        rows.flat_map(list).collect()
    };
    let (cpu, gpu) = (
        json(&mass),
        json(&[&mass[..], &["--backend", "gpu"]].concat()),
    );
    assert_eq!(gpu["backend_used"], "gpu");
    assert!(difference(&rows(&gpu), &rows(&cpu)) < 1e-6);

    let flags = [
        "--faces",
        "20",
        "--steps",
        "1",
        "--directions",
        "1",
        "--no-growth",
    ];
    let check = [&["gradcheck", &ball][..], &flags, &["--backend", "gpu"]].concat();
    let report = json(&check);
    assert_eq!(
        (&report["ok"], &report["backend_used"]),
        (&true.into(), &"gpu".into())
    );
    println!("{}", report["max_rel_error"]);
}

#[test]
fn a_fallback_is_taken_and_said() {
    let ball = scene("falling_ball");
    let base = ["run", &ball, "--faces", "80", "--steps", "1"];
    let wanted = ["--backend", "gpu", "--adapter", "nobody's card"];
    let wanted = [&base[..], &wanted].concat();
    let done = command(&wanted).arg("--json").output().unwrap();
    assert_eq!(done.status.code(), Some(1));
    let message = object(&done)["error"].to_string();
    assert!(message.contains("nobody's card") && message.contains("backend cpu"));

    let fallen = [&wanted[..], &["--gpu-fallback"]].concat();
    let report = json(&fallen);
    assert_eq!(report["backend_used"], "cpu");
    for place in ["backend_reason", "warnings"] {
        assert!(report[place].to_string().contains("nobody's card"));
    }
    assert_eq!(report["final_q"], json(&base)["final_q"]);
    let said = text(&fallen);
    assert!(said.contains("backend cpu, for all that gpu was asked for"));
    assert!(said.contains("nobody's card"), "{said}");
}

#[test]
fn gpu_info_lists_what_is_there() {
    let report = json(&["gpu-info"]);
    let adapters = report["adapters"].as_array().unwrap();
    assert_eq!(adapters.len(), hydrograd::gpu::adapters().len());
    for a in adapters {
        for key in ["name", "driver", "interface", "kind"] {
            assert!(a[key].is_string(), "{key}: {a}");
        }
        assert!(a["double"].is_boolean() && a["largest_buffer"].as_u64().unwrap() > 0);
        assert!(a.get("lacks").is_some());
    }
    assert!(report["used"]["adapter"].is_string());
    let two = json(&["gpu-info", "--gpu-arithmetic", "two-float"]);
    assert_eq!(two["used"]["arithmetic"], "two-float");
    let said = text(&["gpu-info"]);
    assert!(said.contains("used with --backend gpu"), "{said}");

    // None of that name: the list all the same, and a failure.
    let done = command(&["gpu-info", "--json", "--adapter", "nobody's card"])
        .output()
        .unwrap();
    assert_eq!(done.status.code(), Some(1));
    let report = object(&done);
    assert!(report["used"].is_null() && report["adapters"].is_array());
    assert!(report["error"].as_str().unwrap().contains("nobody's card"));
}

/// Where Vulkan is the interface, its loader can be told that there is no driver.
#[cfg(target_os = "linux")]
#[test]
fn without_an_adapter_it_is_said_what_to_install() {
    let ball = scene("falling_ball");
    let run = ["run", &ball, "--faces", "80", "--steps", "1"];
    let run = [&run[..], &["--backend", "gpu"]].concat();
    for arguments in [&["gpu-info"][..], &run] {
        let mut bare = command(arguments);
        bare.arg("--json");
        for name in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
            bare.env(name, "/nowhere.json");
        }
        let done = bare.output().unwrap();
        assert_eq!(done.status.code(), Some(1), "{arguments:?}");
        let message = object(&done)["error"].to_string();
        for word in ["install", "Vulkan", "mesa-vulkan-drivers", "backend cpu"] {
            assert!(message.contains(word), "no {word:?} in {message}");
        }
    }
}
