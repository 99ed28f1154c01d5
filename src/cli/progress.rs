//! A progress bar on standard error, if a person is there to see it.

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use std::io::IsTerminal;

/// A bar over `steps` steps of some work; hidden unless standard error is a terminal.
pub(super) fn bar(what: &'static str, steps: usize) -> ProgressBar {
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
pub(super) fn set(bar: &ProgressBar, done: usize, all: usize) {
    bar.set_length(all as u64);
    bar.set_position(done as u64);
}
