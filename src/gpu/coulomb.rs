//! `shaders/coulomb.wgsl`: `G x`.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::Call;
use super::points::PlacedPoints;
use super::source::Constant;
use super::sum::Slice;
use crate::Result;

/// Columns of a pass, as a shader is compiled for them: few different ones.
pub(super) fn compiled(columns: usize) -> Constant {
    Constant::Number(if columns > 2 {
        columns.next_multiple_of(2)
    } else {
        columns
    } as u32)
}

/// `G x` of some columns, as shares `[share][point][columns]` to be summed.
pub(super) fn coulomb(
    context: &Context,
    placed: &PlacedPoints,
    (x, stride, offset): Slice,
    (out, columns): (&Buffer, usize),
    gate: &Buffer,
) -> Result<Call> {
    let constants = [("COLUMNS", compiled(columns))];
    let kernel = context.kernel("coulomb", "main", context.fine(), &constants)?;
    let shares = placed.model.sizes.shares();
    let uniform = context.uniform(&[shares, columns, stride, offset].map(|n| n as u32));
    let mut buffers = placed.buffers(None);
    buffers.extend([
        ("x", x.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
        ("going", gate.into()),
    ]);
    context.call(&kernel, &buffers, placed.groups())
}
