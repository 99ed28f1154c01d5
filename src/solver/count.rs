//! How much was solved.

use std::sync::atomic::{AtomicU64, Ordering};

static CALLS: AtomicU64 = AtomicU64::new(0);

/// Counts one call.
pub(super) fn call() {
    CALLS.fetch_add(1, Ordering::Relaxed);
}

/// Calls of this module's solvers and products ([`cgls`](super::cgls), [`gmres`](super::gmres()),
/// [`product`](super::product()) and its kin, [`Lu`](super::Lu)) so far, in all threads of this process.
/// What is solved elsewhere, on a GPU say, doesn't show here.
pub fn calls_made() -> u64 {
    CALLS.load(Ordering::Relaxed)
}
