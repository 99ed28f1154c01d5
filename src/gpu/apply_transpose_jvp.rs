//! `shaders/apply_transpose_jvp.wgsl`: `δKᵀ y`, or `δPᵀ y`.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::Placed;
use super::kernel::Call;
use super::source::{Arithmetic, Constant};
use super::sum::Slice;
use crate::Result;

/// `δKᵀ y`, or `δPᵀ y` of some columns, as shares `[share][row][columns]` to be summed; `potential` for P.
pub(super) fn apply_transpose_jvp(
    context: &Context,
    arithmetic: Arithmetic,
    placed: &Placed,
    potential: bool,
    (y, stride, offset): Slice,
    (out, columns): (&Buffer, usize),
    motions: &Buffer,
) -> Result<Call> {
    let constants = [
        ("COLUMNS", Constant::Number(columns as u32)),
        ("POTENTIAL", Constant::Flag(potential)),
    ];
    let kernel = context.kernel("apply_transpose_jvp", "main", arithmetic, &constants)?;
    let sizes = &placed.geometry.sizes;
    let shares = sizes.shares(sizes.source_blocks, sizes.face_blocks);
    let uniform = context.uniform(&[shares, stride, offset, 0].map(|n| n as u32));
    let mut buffers = placed.buffers(arithmetic);
    buffers.extend([
        ("y", y.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
        ("motions", motions.into()),
    ]);
    context.call(
        &kernel,
        &buffers,
        [sizes.source_blocks as u32, shares as u32, 1],
    )
}
