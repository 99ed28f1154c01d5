//! What is made when it is first asked for, by work on several threads.

use std::sync::OnceLock;

/// What a cell holds, made first where it is empty. Not while others wait for it: a thread that makes it may be given other work meanwhile, which asks for the same. Whoever else made it
/// made the same.
pub(crate) fn once<T>(cell: &OnceLock<T>, make: impl FnOnce() -> T) -> &T {
    if let Some(made) = cell.get() {
        return made;
    }
    let made = make();
    cell.get_or_init(|| made)
}
