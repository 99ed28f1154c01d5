//! The program, run as a person or a script does.

use serde_json::Value;
use std::process::{Command, Output};

pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hydrograd"));
    command.args(arguments);
    command
}

pub fn hydrograd(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

/// Name of an example scene's file.
pub fn scene(name: &str) -> String {
    super::example_path(name).display().to_string()
}

/// Text for people of a run that succeeds.
#[track_caller]
pub fn text(arguments: &[&str]) -> String {
    let done = hydrograd(arguments);
    let message = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{arguments:?}: {message}");
    String::from_utf8(done.stdout).unwrap()
}

/// The one JSON object of a run that succeeds.
#[track_caller]
pub fn json(arguments: &[&str]) -> Value {
    let text = text(&[arguments, &["--json"]].concat());
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{arguments:?}: {e}: {text}"))
}

/// Fails with this code and these words, without a panic, and in the same words as one JSON object if asked.
#[track_caller]
pub fn fails(arguments: &[&str], code: i32, words: &[&str]) {
    for form in [&[][..], &["--json"]] {
        let arguments = [arguments, form].concat();
        let done = hydrograd(&arguments);
        let message = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(code), "{arguments:?}: {message}");
        assert!(!message.contains("panicked"), "{message}");
        super::says(&message, words);
        let out = String::from_utf8(done.stdout).unwrap();
        if form.is_empty() {
            assert_eq!(out, "", "{arguments:?}");
        } else {
            let value: Value = serde_json::from_str(&out).unwrap();
            super::says(value["error"].as_str().unwrap(), words);
        }
    }
}
