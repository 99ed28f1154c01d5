//! Memory of the places that bodies have left, for those that they come to: what is kept of a place are many megabytes, which a system takes longer to hand out than they take to fill.

use std::sync::{Arc, Mutex, PoisonError};

/// Lists that are kept: those of one place.
const MOST: usize = 8;

/// Lists that nothing uses.
#[derive(Debug)]
pub(super) struct Spare<X>(Arc<Mutex<Vec<Vec<X>>>>);

impl<X> Default for Spare<X> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<X> Clone for Spare<X> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<X> Spare<X> {
    /// An empty list with room for so many.
    pub fn take(&self, room: usize) -> Vec<X> {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut out = last.unwrap_or_default();
        out.reserve_exact(room);
        out
    }

    /// Takes a list back.
    pub fn give(&self, mut list: Vec<X>) {
        list.clear();
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if all.len() < MOST {
            all.push(list);
        }
    }
}
