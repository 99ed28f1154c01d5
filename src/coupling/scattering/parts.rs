//! Work in parts that are the same whatever the number of threads, so that sums of theirs are.

use rayon::prelude::*;

/// Parts in which pairs are summed: the same whatever the number of threads, so that sums are.
pub(super) const PARTS: usize = 8;
/// Pairs or bodies that aren't worth another thread.
pub(super) const FEW: usize = 256;

/// Parts of a list, by their numbers, each on a thread where they are worth it.
pub(super) fn in_parts<I: Sync, P: Send>(
    items: &[I],
    part: impl Fn(usize, &[I]) -> P + Sync + Send,
) -> Vec<P> {
    let size = items.len().div_ceil(PARTS).max(1);
    let part = |(number, items): (usize, &[I])| part(number, items);
    match items.len() < FEW {
        true => items.chunks(size).enumerate().map(part).collect(),
        false => items.par_chunks(size).enumerate().map(part).collect(),
    }
}

/// What each of some bodies gives, on all threads where that is worth it.
pub(super) fn of_each<X: Send>(bodies: usize, one: impl Fn(usize) -> X + Sync + Send) -> Vec<X> {
    match bodies < FEW {
        true => (0..bodies).map(one).collect(),
        false => (0..bodies).into_par_iter().map(one).collect(),
    }
}
