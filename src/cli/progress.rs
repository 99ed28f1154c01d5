//! A progress bar on standard error, if a person is there to see it.

use std::io::IsTerminal;

use indicatif::ProgressStyle;

/// A bar over `steps` steps of some work; hidden unless standard error is a terminal.
pub(super) struct ProgressBar(indicatif::ProgressBar);

impl ProgressBar {
    pub fn new(what: &'static str, steps: usize) -> Self {
        if !std::io::stderr().is_terminal() {
            return Self(indicatif::ProgressBar::hidden());
        }
        let bar = indicatif::ProgressBar::new(steps as u64).with_message(what);
        let style = ProgressStyle::with_template(
            "{msg} {wide_bar} {pos}/{len}  {elapsed} passed, {eta} to go",
        );
        if let Ok(style) = style {
            bar.set_style(style);
        }
        Self(bar)
    }

    /// So many steps are done.
    pub fn set(&self, done: usize) {
        self.0.set_position(done as u64);
    }

    /// So many steps are done of so many.
    pub fn set_of(&self, done: usize, all: usize) {
        self.0.set_length(all as u64);
        self.0.set_position(done as u64);
    }
}

impl Drop for ProgressBar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
