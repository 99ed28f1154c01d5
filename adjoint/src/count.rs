//! Counters of what this process computed, for tests that ask whether another device did the work. They count with the
//! feature `count` alone.

#[cfg(feature = "count")]
use std::sync::atomic::{AtomicU64, Ordering};

/// A number that only grows, over all threads.
#[derive(Debug, Default)]
pub struct Counter {
    #[cfg(feature = "count")]
    total: AtomicU64,
}

/// Pairs of a source and a term of a surface (a face, an edge or a point) that sums and fills of
/// [`kernel`](crate::kernel) went over; a kernel that is called for a single pair isn't counted.
pub static PAIRS: Counter = Counter::new();

impl Counter {
    /// At zero.
    pub const fn new() -> Self {
        Self {
            #[cfg(feature = "count")]
            total: AtomicU64::new(0),
        }
    }

    /// Counts `amount` more.
    #[inline]
    pub fn add(&self, amount: usize) {
        #[cfg(feature = "count")]
        self.total.fetch_add(amount as u64, Ordering::Relaxed);
        #[cfg(not(feature = "count"))]
        let _ = amount;
    }

    /// What was counted so far.
    #[cfg(feature = "count")]
    pub fn total(&self) -> u64 {
        self.total.load(Ordering::Relaxed)
    }
}
