//! How much was computed.

use std::sync::atomic::{AtomicU64, Ordering};

static PAIRS: AtomicU64 = AtomicU64::new(0);

/// Adds the pairs of one sum or block.
pub(super) fn add(pairs: usize) {
    PAIRS.fetch_add(pairs as u64, Ordering::Relaxed);
}

/// Pairs of a source and a term of a surface (a face, an edge or a point) that the sums and fills of this
/// module have gone over so far, in all threads of this process; a kernel asked for a single pair isn't
/// counted. What happens to them elsewhere, on a GPU say, doesn't show here.
pub fn pairs_computed() -> u64 {
    PAIRS.load(Ordering::Relaxed)
}
