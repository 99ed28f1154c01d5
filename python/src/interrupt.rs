//! Work without the interpreter's lock; long work ends with Ctrl-C, and a callback can follow it.
//!
//! Whatever may ask the pool of threads for something stands in [`long`], [`followed`], [`short`] or [`light`]: a thread of the pool may be waiting for the interpreter's lock, to ask a controller
//! written in Python, and who holds the lock and waits for the pool would wait for ever.

use crate::error::{OrRaise, exception, input, internal};
use crate::nested::{apart, ask};
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

/// How often signals are looked at, and progress is told.
const PATIENCE: Duration = Duration::from_millis(50);

/// Whether work should go on.
#[derive(Clone, Default)]
pub struct Interrupt {
    stop: Arc<AtomicBool>,
    left: Arc<AtomicBool>,
    done: Arc<AtomicUsize>,
    /// Whether a thread that work waits for does this itself, where it stands.
    here: bool,
    /// What follows work that the thread does which asked for it.
    own: Option<Arc<Own>>,
}

impl Interrupt {
    /// For the progress of a rollout.
    pub fn check(&self) -> ControlFlow<()> {
        if let Some(own) = &self.own
            && !own.tell(self.done.load(Ordering::Relaxed))
        {
            self.stop.store(true, Ordering::Relaxed);
        }
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

    /// Whether it must not wait for other work, which may be waiting for it.
    pub fn is_within(&self) -> bool {
        self.here
    }

    /// Whether Ctrl-C has left the work to itself: it has been asked to stop, and nobody waits for it.
    pub fn is_left(&self) -> bool {
        self.left.load(Ordering::Relaxed)
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

/// A callback that follows work of the thread that asked for it: nobody else is there to call it, so that thread does, between two parts of the work.
struct Own {
    thread: ThreadId,
    /// With the time of its last call. Gone during a call, in which this thread may do other parts of the work.
    progress: Mutex<Option<(Progress, Instant)>>,
}

impl Own {
    fn new(progress: Progress) -> Self {
        Self {
            thread: thread::current().id(),
            progress: Mutex::new(Some((progress, Instant::now()))),
        }
    }

    /// Tells how far it is, if it is time to; whether to go on.
    fn tell(&self, done: usize) -> bool {
        if thread::current().id() != self.thread {
            return true;
        }
        let due = |(_, last): &mut (Progress, Instant)| last.elapsed() >= PATIENCE;
        let taken = lock(&self.progress).take_if(due);
        let Some((mut progress, _)) = taken else {
            return true;
        };
        let go_on = ask(|py| progress.tell(py, done));
        *lock(&self.progress) = Some((progress, Instant::now()));
        go_on
    }

    fn ended(&self) -> Option<Progress> {
        lock(&self.progress).take().map(|(progress, _)| progress)
    }
}

/// What a mutex guards, whatever became of those who held it.
pub fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
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
        let raised = lock(&self.0).take();
        raised.map_or(made, Err)
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
        let answer = ask(|py| call.bind(py).call1((progress(py)?,))?.is_truthy());
        match answer {
            Ok(false) => ControlFlow::Continue(()),
            Ok(true) => ControlFlow::Break(()),
            Err(error) => {
                *lock(&self.raised.0) = Some(error);
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
    followed(py, &mut None, work)
}

/// The same, with a callback that is told how far it is every so often, on this thread. After an exception of the callback the work is
/// asked to stop and waited for: what it gives then comes back, and the exception stands in `progress`.
pub fn followed<T: Send + 'static>(
    py: Python<'_>,
    progress: &mut Option<Progress>,
    work: impl FnOnce(&Interrupt) -> hydrograd::Result<T> + Send + 'static,
) -> PyResult<T> {
    not_forked()?;
    // A controller that simulates is called by a thread that the simulation waits for: it can't wait for another.
    if rayon::current_thread_index().is_some() {
        return followed_here(py, progress, work);
    }
    let interrupt = Interrupt::default();
    let (send, receive) = sync_channel(1);
    let theirs = interrupt.clone();
    let thread = std::thread::Builder::new()
        .name("hydrograd".into())
        .spawn(move || {
            let threads = rayon::current_num_threads();
            let work = || apart(threads, || work(&theirs));
            let done = catch_unwind(AssertUnwindSafe(work));
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
                if let Some(progress) = progress
                    && done.is_ok()
                {
                    progress.tell(py, interrupt.done.load(Ordering::Relaxed));
                }
                return done.or_raise();
            }
            Ok(Err(panic)) => return Err(internal(said(panic.as_ref()))),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(stop) = py.check_signals() {
                    interrupt.left.store(true, Ordering::Relaxed);
                    interrupt.stop.store(true, Ordering::Relaxed);
                    return Err(stop);
                }
                if let Some(progress) = progress
                    && !progress.tell(py, interrupt.done.load(Ordering::Relaxed))
                {
                    interrupt.stop.store(true, Ordering::Relaxed);
                }
            }
            Err(RecvTimeoutError::Disconnected) => return Err(internal("its thread ended")),
        }
    }
}

/// The same on this thread, which tells the callback between two parts of the work.
fn followed_here<T: Send>(
    py: Python<'_>,
    progress: &mut Option<Progress>,
    work: impl FnOnce(&Interrupt) -> hydrograd::Result<T> + Send,
) -> PyResult<T> {
    let interrupt = Interrupt {
        here: true,
        own: progress.take().map(|progress| Arc::new(Own::new(progress))),
        ..Interrupt::default()
    };
    let made = finish(py, || work(&interrupt));
    *progress = interrupt.own.as_ref().and_then(|own| own.ended());
    if let Some(progress) = progress
        && made.is_ok()
    {
        progress.tell(py, interrupt.done.load(Ordering::Relaxed));
    }
    made
}

/// Does work that takes a step's time, on this thread: Ctrl-C waits for its end.
pub fn short<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> hydrograd::Result<T> + Send,
) -> PyResult<T> {
    not_forked()?;
    finish(py, work)
}

/// The same for work that as a rule starts no threads: a forked process may do it, and a process may be forked after it.
pub fn light<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> hydrograd::Result<T> + Send,
) -> PyResult<T> {
    finish(py, work)
}

fn finish<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> hydrograd::Result<T> + Send,
) -> PyResult<T> {
    match py.detach(|| catch_unwind(AssertUnwindSafe(|| apart(1, work)))) {
        Ok(done) => {
            py.check_signals()?;
            done.or_raise()
        }
        Err(panic) => Err(internal(said(panic.as_ref()))),
    }
}
