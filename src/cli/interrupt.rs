//! Ctrl-C: a run ends after the step under way, and what it has computed is kept.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of a program that an interrupt ends, as shells have it.
const INTERRUPTED: i32 = 130;

static RUNNING: AtomicBool = AtomicBool::new(false);
static ASKED: AtomicBool = AtomicBool::new(false);

/// From here on an interrupt is heard: the first one asks, a second one, and one before steps are made, ends the program.
pub(super) fn listen() {
    // An error says that someone listens already: a program that calls the command line twice.
    let _ = ctrlc::set_handler(|| {
        if !RUNNING.load(Ordering::Relaxed) || ASKED.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED);
        }
        super::output::note("ending after this step; once more to end at once");
    });
}

/// From here on another program hears of it, whose end this one waits for.
pub(super) fn leave_to_another() {
    let _ = ctrlc::set_handler(|| {});
}

/// Makes steps by `run`, which asks after each whether to go on.
pub(super) fn while_running<T>(run: impl FnOnce(fn() -> ControlFlow<()>) -> T) -> T {
    ASKED.store(false, Ordering::Relaxed);
    RUNNING.store(true, Ordering::Relaxed);
    let out = run(|| match ASKED.load(Ordering::Relaxed) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    });
    RUNNING.store(false, Ordering::Relaxed);
    out
}
