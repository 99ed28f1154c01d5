//! What the commands print.

use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use serde::Serialize;

use crate::simulate::{BackendReport, Simulator};

/// Where results go.
#[derive(Clone, Copy, Debug)]
pub(super) struct Output {
    pub json: bool,
}

impl Output {
    /// Prints a result: as one JSON object, or as text for people.
    pub fn result(&self, result: &(impl Serialize + Display)) {
        if self.json {
            let text = serde_json::to_string(result);
            print_line(&text.unwrap_or_else(|e| error_object(&e.to_string())));
        } else {
            print_line(&result.to_string());
        }
    }

    /// Prints what went wrong: for people on standard error, for programs on standard output.
    pub fn error(&self, error: &impl Display) {
        self.error_for_people(error);
        if self.json {
            print_error_object(&error.to_string());
        }
    }

    /// Prints what went wrong on standard error only.
    pub fn error_for_people(&self, error: &impl Display) {
        note(error);
    }
}

/// Prints a line on standard error.
pub(super) fn note(message: impl Display) {
    let _ = writeln!(std::io::stderr(), "hydrograd: {message}");
}

/// `{"error": message}` on standard output.
pub(super) fn print_error_object(message: &str) {
    print_line(&error_object(message));
}

fn error_object(message: &str) -> String {
    serde_json::json!({ "error": message }).to_string()
}

/// Whether something that was to be printed is lost.
static LOST: AtomicBool = AtomicBool::new(false);

/// Whether something that was to be printed is lost: on a full disk, say.
pub(super) fn lost() -> bool {
    LOST.load(Ordering::Relaxed)
}

/// Prints text that ends with its own line, help say.
pub(super) fn print_text(text: &str) {
    print_line(text.trim_end_matches('\n'));
}

/// A reader that has gone away (`hydrograd … | head`) is no error.
fn print_line(text: &str) {
    let mut out = std::io::stdout().lock();
    if let Err(error) = writeln!(out, "{text}").and_then(|()| out.flush())
        && error.kind() != ErrorKind::BrokenPipe
    {
        LOST.store(true, Ordering::Relaxed);
        note(format_args!("standard output: write failed: {error}"));
    }
}

/// Largest memory this process has held, MB (10⁶ bytes); `None` where the system doesn't tell.
pub(super) fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024.0 / 1e6)
}

/// A number for people, or a dash.
pub(super) fn or_dash(value: Option<f64>, unit: &str) -> String {
    value.map_or_else(|| "-".into(), |x| format!("{x:.4} {unit}"))
}

/// Warnings, one a line, for the end of a summary.
pub(super) fn write_warnings(
    f: &mut std::fmt::Formatter<'_>,
    warnings: &[String],
) -> std::fmt::Result {
    warnings
        .iter()
        .try_for_each(|warning| write!(f, "\nwarning: {warning}"))
}

/// A bar on standard error over `steps` steps of some work; hidden unless standard error is a terminal.
pub(super) fn progress_bar(what: &'static str, steps: usize) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(steps as u64).with_message(what);
    let style =
        ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}  {elapsed} passed, {eta} to go");
    if let Ok(style) = style {
        bar.set_style(style);
    }
    bar.with_finish(ProgressFinish::AndClear)
}

/// So many steps are done of so many.
pub(super) fn set_progress(bar: &ProgressBar, done: usize, all: usize) {
    bar.set_length(all as u64);
    bar.set_position(done as u64);
}

/// By what a scene was simulated.
#[derive(Clone, Debug, Serialize)]
pub(super) struct ChoicesReport {
    pub fidelity: &'static str,
    /// What `auto` came to; the fidelity itself otherwise.
    pub fidelity_used: &'static str,
    /// What `auto` chose for each body and pair, and why.
    pub chosen: Vec<String>,
    #[serde(flatten)]
    pub backend: BackendReport,
    pub method: &'static str,
    pub integrator: &'static str,
}

impl ChoicesReport {
    pub fn new(simulator: &Simulator) -> Self {
        let choices = simulator.choices();
        Self {
            fidelity: choices.water.fidelity.into(),
            fidelity_used: simulator.fidelity().into(),
            chosen: simulator.reasons().to_vec(),
            backend: simulator.backend(),
            method: choices.water.method_used().into(),
            integrator: choices.integrator.into(),
        }
    }
}
