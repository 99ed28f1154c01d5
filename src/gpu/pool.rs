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

/// Bytes that may lie idle whatever is in use; more than these only up to what is.
pub(super) const IDLE: u64 = 256 << 20;

/// Memory to be used again, by size: every evaluation asks for the same sizes, and fresh memory has to be
/// made and filled with zeros.
#[derive(Default)]
pub(super) struct Pool {
    free: Mutex<Free>,
    counts: Mutex<Counts>,
}

/// What isn't in use.
#[derive(Default)]
struct Free {
    by_size: HashMap<u64, Vec<wgpu::Buffer>>,
    bytes: u64,
}

impl Pool {
    fn free(&self) -> MutexGuard<'_, Free> {
        self.free.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn take(&self, bytes: u64) -> Option<wgpu::Buffer> {
        let mut free = self.free();
        let found = free.by_size.get_mut(&bytes)?.pop()?;
        free.bytes -= bytes;
        Some(found)
    }

    /// Takes memory back that is no longer in use. Where more lies idle than is used, it is of sizes that nobody asks for again, and all goes back to the device.
    pub fn put(&self, bytes: u64, raw: wgpu::Buffer) {
        let mut free = self.free();
        free.by_size.entry(bytes).or_default().push(raw);
        free.bytes += bytes;
        let used = self.count(|_| ()).memory.saturating_sub(free.bytes);
        if free.bytes > IDLE.max(used) {
            self.give_back(&mut free);
        }
    }

    /// Gives everything that isn't in use back to the device.
    pub fn drain(&self) {
        self.give_back(&mut self.free());
    }

    fn give_back(&self, free: &mut Free) {
        free.by_size.clear();
        let bytes = std::mem::take(&mut free.bytes);
        self.count(|c| c.memory -= bytes);
    }

    /// Counts something, and tells what there is then.
    pub fn count(&self, change: impl FnOnce(&mut Counts)) -> Counts {
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut counts);
        counts.peak_memory = counts.peak_memory.max(counts.memory);
        *counts
    }
}
