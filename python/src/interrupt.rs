//! Long work without the interpreter's lock, which Ctrl-C ends.

use crate::error::{OrRaise, exception, internal};
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// How often signals are looked at.
const PATIENCE: Duration = Duration::from_millis(50);

/// Whether work should go on.
#[derive(Clone, Default)]
pub struct Interrupt {
    stop: Arc<AtomicBool>,
}

impl Interrupt {
    /// For the progress of a rollout.
    pub fn check(&self) -> ControlFlow<()> {
        match self.stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

/// The process whose threads do the work.
static PROCESS: OnceLock<u32> = OnceLock::new();

/// A forked process has none of the threads that its parent's work has started: it would wait for them for ever.
fn not_forked() -> PyResult<()> {
    let own = std::process::id();
    let first = *PROCESS.get_or_init(|| own);
    if first == own {
        return Ok(());
    }
    Err(exception(hydrograd::Error::Unsupported {
        what: format!("work in process {own}, a fork of process {first}"),
        why: "hydrograd had started its threads there, and threads don't survive a fork".into(),
        instead:
            "start processes by \"spawn\" or \"forkserver\": multiprocessing.get_context(\"spawn\")"
                .into(),
    }))
}

fn said(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}

/// Does work on a thread of its own while this one listens for signals. After Ctrl-C it is asked to stop and left
/// to itself: the exception doesn't wait for it.
pub fn long<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Interrupt) -> hydrograd::Result<T> + Send + 'static,
) -> PyResult<T> {
    not_forked()?;
    let interrupt = Interrupt::default();
    // A controller that simulates is called by a thread that the simulation waits for: it can't wait for another.
    if rayon::current_thread_index().is_some() {
        return finish(py, || work(&interrupt));
    }
    let (send, receive) = sync_channel(1);
    let theirs = interrupt.clone();
    let thread = std::thread::Builder::new()
        .name("hydrograd".into())
        .spawn(move || {
            let done = catch_unwind(AssertUnwindSafe(|| work(&theirs)));
            // Nobody listens after an interrupt.
            let _ = send.send(done);
        });
    thread?;
    // The receiver moves in and out of each wait, for it isn't shared.
    let mut receive = receive;
    loop {
        let (back, received) = py.detach(move || {
            let received = receive.recv_timeout(PATIENCE);
            (receive, received)
        });
        receive = back;
        match received {
            Ok(Ok(done)) => return done.or_raise(),
            Ok(Err(panic)) => return Err(internal(said(panic.as_ref()))),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(stop) = py.check_signals() {
                    interrupt.stop.store(true, Ordering::Relaxed);
                    return Err(stop);
                }
            }
            Err(RecvTimeoutError::Disconnected) => return Err(internal("its thread ended")),
        }
    }
}

/// Does work that takes a step's time, on this thread.
pub fn short<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> hydrograd::Result<T> + Send,
) -> PyResult<T> {
    not_forked()?;
    finish(py, work)
}

fn finish<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> hydrograd::Result<T> + Send,
) -> PyResult<T> {
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(done) => {
            py.check_signals()?;
            done.or_raise()
        }
        Err(panic) => Err(internal(said(panic.as_ref()))),
    }
}
