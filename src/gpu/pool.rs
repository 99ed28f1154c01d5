//! The device's memory as a whole, and counts of what was done.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What was done on a device since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Calls of shaders, those included that had nothing to do.
    pub dispatches: u64,
    /// Times that the host waited for numbers.
    pub read_backs: u64,
    /// Bytes that came back.
    pub bytes_back: u64,
    /// Bytes of arrays in the device's memory now, those kept to be used again included.
    pub memory: u64,
    /// The most there were at once.
    pub peak_memory: u64,
}

/// Memory to be used again, by size: every evaluation asks for the same sizes, and fresh memory has to be
/// made and filled with zeros.
#[derive(Default)]
pub(super) struct Pool {
    free: Mutex<HashMap<u64, Vec<wgpu::Buffer>>>,
    counts: Mutex<Counts>,
}

impl Pool {
    fn free(&self) -> MutexGuard<'_, HashMap<u64, Vec<wgpu::Buffer>>> {
        self.free.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn take(&self, bytes: u64) -> Option<wgpu::Buffer> {
        self.free().get_mut(&bytes)?.pop()
    }

    /// Takes memory back that is no longer in use.
    pub fn put(&self, bytes: u64, raw: wgpu::Buffer) {
        self.free().entry(bytes).or_default().push(raw);
    }

    /// Gives everything that isn't in use back to the device.
    pub fn drain(&self) {
        for (bytes, buffers) in self.free().drain() {
            self.count(|c| c.memory -= bytes * buffers.len() as u64);
        }
    }

    /// Counts something, and tells what there is then.
    pub fn count(&self, change: impl FnOnce(&mut Counts)) -> Counts {
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut counts);
        counts.peak_memory = counts.peak_memory.max(counts.memory);
        *counts
    }
}
