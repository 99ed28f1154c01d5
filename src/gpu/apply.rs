//! `shaders/apply.wgsl`: `K x`, or `P x`.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::Placed;
use super::kernel::Call;
use super::source::{Arithmetic, Constant};
use super::sum::Slice;
use crate::Result;

/// `K x`, or `P x` of some columns, as shares `[share][row][columns]` to be summed; `potential` for P.
pub(super) fn apply(
    context: &Context,
    arithmetic: Arithmetic,
    placed: &Placed,
    potential: bool,
    (x, stride, offset): Slice,
    (out, columns): (&Buffer, usize),
    gate: &Buffer,
) -> Result<Call> {
    let constants = [
        ("COLUMNS", Constant::Number(columns as u32)),
        ("POTENTIAL", Constant::Flag(potential)),
    ];
    let kernel = context.kernel("apply", "main", arithmetic, &constants)?;
    let sizes = &placed.geometry.sizes;
    let shares = sizes.shares(sizes.face_blocks, sizes.source_blocks);
    let uniform = context.uniform(&[shares, stride, offset, 0].map(|n| n as u32));
    let mut buffers = placed.buffers(arithmetic);
    buffers.extend([
        ("x", x.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
        ("going", gate.into()),
    ]);
    context.call(
        &kernel,
        &buffers,
        [sizes.face_blocks as u32, shares as u32, 1],
    )
}
