//! Long work without the interpreter's lock, which Ctrl-C ends and a callback can follow.

use crate::error::{OrRaise, exception, input, internal};
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

/// How often signals are looked at, and progress is told.
const PATIENCE: Duration = Duration::from_millis(50);

/// Whether work should go on.
#[derive(Clone, Default)]
pub struct Interrupt {
    stop: Arc<AtomicBool>,
    done: Arc<AtomicUsize>,
}

impl Interrupt {
    /// For the progress of a rollout.
    pub fn check(&self) -> ControlFlow<()> {
        match self.stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    /// The same, where `done` parts of the work are.
    pub fn at(&self, done: usize) -> ControlFlow<()> {
        self.done.store(done, Ordering::Relaxed);
        self.check()
    }

    /// The same, where one part more is done, by whatever thread.
    pub fn one_more(&self) -> ControlFlow<()> {
        self.done.fetch_add(1, Ordering::Relaxed);
        self.check()
    }
}

/// A callback of Python, `f(done, total)`, and the exception that it ended the work with.
pub struct Progress {
    call: Py<PyAny>,
    total: usize,
    told: Option<usize>,
    /// What it raised.
    pub raised: Option<PyErr>,
}

impl Progress {
    /// Of a callback, if there is one.
    pub fn new(
        place: &str,
        call: Option<&Bound<'_, PyAny>>,
        total: usize,
    ) -> PyResult<Option<Self>> {
        let Some(call) = call else {
            return Ok(None);
        };
        if !call.is_callable() {
            let what = call.get_type().name()?.to_string();
            let remedy = "must be a function of two numbers: progress(done, total)";
            return Err(input(place, format!("a value of type {what}"), remedy));
        }
        Ok(Some(Self {
            call: call.clone().unbind(),
            total,
            told: None,
            raised: None,
        }))
    }

    /// Tells how far it is, if that has changed; whether to go on.
    fn tell(&mut self, py: Python<'_>, done: usize) -> bool {
        if self.raised.is_none() && self.told != Some(done) {
            self.told = Some(done);
            self.raised = self.call.call1(py, (done, self.total)).err();
        }
        self.raised.is_none()
    }
}

/// A callback of Python that is told of every iteration of a search, and ends it by giving True or by raising.
pub struct Told {
    call: Option<Py<PyAny>>,
    raised: Raised,
}

/// The exception that a [`Told`] raised.
#[derive(Clone, Default)]
pub struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    /// What was made, unless there was one.
    pub fn or<T>(&self, made: PyResult<T>) -> PyResult<T> {
        let mut raised = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        raised.take().map_or(made, Err)
    }
}

impl Told {
    /// Of a callback, if there is one, and what it raises.
    pub fn new(call: Option<Bound<'_, PyAny>>) -> (Self, Raised) {
        let raised = Raised::default();
        let told = Self {
            call: call.map(Bound::unbind),
            raised: raised.clone(),
        };
        (told, raised)
    }

    /// Tells it what `progress` makes.
    pub fn tell(
        &self,
        interrupt: &Interrupt,
        progress: impl for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyAny>>,
    ) -> ControlFlow<()> {
        interrupt.check()?;
        let Some(call) = &self.call else {
            return ControlFlow::Continue(());
        };
        let answer = Python::attach(|py| call.bind(py).call1((progress(py)?,))?.is_truthy());
        match answer {
            Ok(false) => ControlFlow::Continue(()),
            Ok(true) => ControlFlow::Break(()),
            Err(error) => {
                *self.raised.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                ControlFlow::Break(())
            }
        }
    }
}

/// What was made, unless its callback raised an exception.
pub fn ended<T>(progress: Option<Progress>, made: PyResult<T>) -> PyResult<T> {
    match progress.and_then(|progress| progress.raised) {
        Some(raised) => Err(raised),
        None => made,
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
    followed(py, None, work)
}

/// The same, with a callback that is told how far it is every so often, on this thread. After an exception of the callback the work is
/// asked to stop and waited for: what it gives then comes back, and the exception stands in `progress`.
pub fn followed<T: Send + 'static>(
    py: Python<'_>,
    mut progress: Option<&mut Progress>,
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
            Ok(Ok(done)) => {
                if let Some(progress) = &mut progress
                    && done.is_ok()
                {
                    progress.tell(py, interrupt.done.load(Ordering::Relaxed));
                }
                return done.or_raise();
            }
            Ok(Err(panic)) => return Err(internal(said(panic.as_ref()))),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(stop) = py.check_signals() {
                    interrupt.stop.store(true, Ordering::Relaxed);
                    return Err(stop);
                }
                if let Some(progress) = &mut progress
                    && !progress.tell(py, interrupt.done.load(Ordering::Relaxed))
                {
                    interrupt.stop.store(true, Ordering::Relaxed);
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
