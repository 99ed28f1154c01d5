//! Work within work: Python that is called by work which waits for it, and asks for work of its own.
//!
//! The pool's threads do the work. One that calls Python (a controller, a cost) does nothing else until it has the answer, and when all of them wait so, nobody is left
//! for the work that Python asks for meanwhile. A thread of the pool does that itself, where it stands. Python may as well have another thread do it (JAX does), which the pool's
//! thread then waits for: such work gets threads of its own.

use pyo3::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// How many answers of Python work is waiting for, and how many of these threads of the pool.
static ASKED: AtomicUsize = AtomicUsize::new(0);
static OF_THE_POOL: AtomicUsize = AtomicUsize::new(0);

/// Counts one while it lives.
struct Asking(&'static AtomicUsize);

impl Asking {
    fn new(count: &'static AtomicUsize) -> Self {
        count.fetch_add(1, Ordering::SeqCst);
        Self(count)
    }
}

impl Drop for Asking {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Calls Python from work that waits for the answer.
pub fn ask<T>(call: impl FnOnce(Python<'_>) -> T) -> T {
    let _asking = Asking::new(&ASKED);
    let _pool = rayon::current_thread_index().map(|_| Asking::new(&OF_THE_POOL));
    match Python::try_attach(call) {
        Some(answer) => answer,
        // The interpreter is ending: work that Ctrl-C has left to itself ends with the process.
        None => loop {
            std::thread::park();
        },
    }
}

/// Whether threads of the pool may be waiting for this one, or it is one of them.
pub fn is_nested() -> bool {
    rayon::current_thread_index().is_some() || OF_THE_POOL.load(Ordering::SeqCst) > 0
}

/// Does work that the pool's threads may be waiting for: without them then, on so many others.
pub fn apart<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    if rayon::current_thread_index().is_some() || !is_nested() {
        return work();
    }
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(work),
        // No more threads: then it waits its turn.
        Err(_) => work(),
    }
}

/// Whether who waits for other threads here might wait for ever: for batches that Python spreads over threads, which may be taken by work that waits for this.
#[pyfunction]
pub fn _nested() -> bool {
    is_nested() || ASKED.load(Ordering::SeqCst) > 0
}
