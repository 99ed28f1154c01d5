//! The device's memory as a whole, and counts of what was done.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

#[derive(Debug, Default)]
pub(super) struct Counters {
    pub dispatches: AtomicU64,
    pub read_backs: AtomicU64,
    pub bytes_back: AtomicU64,
    pub memory: AtomicU64,
    pub peak: AtomicU64,
}

impl Counters {
    pub fn allocate(&self, bytes: u64) {
        let now = self.memory.fetch_add(bytes, Ordering::Relaxed) + bytes;
        self.peak.fetch_max(now, Ordering::Relaxed);
    }

    pub fn free(&self, bytes: u64) {
        self.memory.fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// Memory to be used again, by size: every evaluation asks for the same sizes, and fresh memory has to be
/// made and filled with zeros.
#[derive(Default)]
pub(super) struct Pool {
    free: Mutex<HashMap<u64, Vec<wgpu::Buffer>>>,
    pub counters: Arc<Counters>,
}

impl Pool {
    pub fn take(&self, bytes: u64) -> Option<wgpu::Buffer> {
        self.free.lock().ok()?.get_mut(&bytes)?.pop()
    }

    /// Takes memory back that is no longer in use.
    pub fn put(&self, bytes: u64, raw: wgpu::Buffer) {
        match self.free.lock() {
            Ok(mut free) => free.entry(bytes).or_default().push(raw),
            Err(_) => self.counters.free(bytes),
        }
    }

    /// Gives everything that isn't in use back to the device.
    pub fn drain(&self) {
        if let Ok(mut free) = self.free.lock() {
            for (bytes, buffers) in free.drain() {
                self.counters.free(bytes * buffers.len() as u64);
            }
        }
    }
}
