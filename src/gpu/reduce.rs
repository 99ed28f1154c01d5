//! `shaders/reduce.wgsl`: sums over the tasks of each pair.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::{Call, threads};
use super::source::Arithmetic;
use crate::Result;

/// `out[pair][element]`, the sum of `parts[task][element]` over the pair's range of tasks.
pub(super) fn reduce(
    context: &Context,
    arithmetic: Arithmetic,
    parts: &Buffer,
    ranges: &Buffer,
    out: &Buffer,
    (pairs, elements): (usize, usize),
) -> Result<Call> {
    let kernel = context.kernel("reduce", "main", arithmetic, &[])?;
    let uniform = context.uniform(&[pairs as u32, elements as u32, 0, 0]);
    let buffers = [
        ("parts", parts.into()),
        ("ranges", ranges.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
    ];
    context.call(&kernel, &buffers, threads(pairs * elements))
}
