//! How columns and shapes are shared out.

use std::sync::Arc;

/// The columns of an array in passes of at most `most`, as even as can be: (first, count).
pub(super) fn passes(columns: usize, most: usize) -> impl Iterator<Item = (usize, usize)> {
    let parts = columns.div_ceil(most).max(1);
    (0..parts).map(move |p| {
        let first = p * columns / parts;
        (first, (p + 1) * columns / parts - first)
    })
}

/// Distinct shapes, and which one each body has.
pub(super) fn shapes<'a, T: 'a>(
    bodies: impl Iterator<Item = &'a Arc<T>>,
) -> (Vec<Arc<T>>, Vec<usize>) {
    let mut all: Vec<Arc<T>> = Vec::new();
    let of = bodies.map(|body| {
        let same = |b: &Arc<T>| Arc::ptr_eq(b, body);
        all.iter().position(same).unwrap_or_else(|| {
            all.push(body.clone());
            all.len() - 1
        })
    });
    let of = of.collect();
    (all, of)
}
