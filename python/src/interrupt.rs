//! Long work without the interpreter's lock, which Ctrl-C ends.

use crate::error::{OrRaise, internal};
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

/// How often signals are looked at.
const PATIENCE: Duration = Duration::from_millis(50);

/// Whether work should go on.
#[derive(Clone, Default)]
pub struct Wish(Arc<AtomicBool>);

impl Wish {
    /// For the progress of a rollout.
    pub fn go_on(&self) -> ControlFlow<()> {
        if self.0.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
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
    work: impl FnOnce(&Wish) -> hydrograd::Result<T> + Send + 'static,
) -> PyResult<T> {
    let wish = Wish::default();
    let (send, receive) = sync_channel(1);
    let theirs = wish.clone();
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
        let (back, heard) = py.detach(move || {
            let heard = receive.recv_timeout(PATIENCE);
            (receive, heard)
        });
        receive = back;
        match heard {
            Ok(Ok(done)) => return done.or_raise(),
            Ok(Err(panic)) => return Err(internal(said(panic.as_ref()))),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(stop) = py.check_signals() {
                    wish.0.store(true, Ordering::Relaxed);
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
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(done) => {
            py.check_signals()?;
            done.or_raise()
        }
        Err(panic) => Err(internal(said(panic.as_ref()))),
    }
}
