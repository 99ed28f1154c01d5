//! `shaders/reduce.wgsl`: sums over the tasks of each pair.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::PairBatch;
use super::kernel::{Call, threads};
use super::source::Arithmetic;
use crate::Result;

/// `out[pair][element]` for the batch's pairs, the sum of `parts[task][element]` over the pair's range of tasks.
pub(super) fn reduce(
    context: &Context,
    arithmetic: Arithmetic,
    parts: &Buffer,
    ranges: &Buffer,
    batch: &PairBatch,
    elements: usize,
    out: &Buffer,
) -> Result<Call> {
    let kernel = context.kernel("reduce", "main", arithmetic, &[])?;
    let pairs = batch.pairs.len();
    let words = [pairs, elements, batch.pairs.start, batch.tasks.start];
    let uniform = context.uniform(&words.map(|n| n as u32));
    let buffers = [
        ("parts", parts.into()),
        ("ranges", ranges.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
    ];
    context.call(&kernel, &buffers, threads(pairs * elements))
}
