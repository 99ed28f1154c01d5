//! Memory of the places that bodies have left, for those that they come to: what is kept of a place are many megabytes, which a system takes longer to hand out than they take to fill.

use super::parts::PARTS;
use std::sync::{Arc, Mutex, PoisonError};

/// Lists that are kept: those of two places, which a step is at.
const MOST: usize = 2 * PARTS;
/// Part more than is asked for that a new list has room for, as neighbours come and go; and times as much as is asked for that one isn't used for any more.
const FURTHER: usize = 8;
const LARGE: usize = 2;

/// Lists that nothing uses, as long as their model is there.
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
        // One that is too small would be copied as it grows, though nothing is in it.
        let fits = |list: &Vec<X>| (room..=LARGE * room).contains(&list.capacity());
        match last.filter(fits) {
            Some(list) => list,
            None => Vec::with_capacity(room + room / FURTHER),
        }
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
