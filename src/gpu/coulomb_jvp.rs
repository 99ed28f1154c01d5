//! `shaders/coulomb_jvp.wgsl`: `δG x`.

use super::buffer::Buffer;
use super::context::Context;
use super::coulomb::compiled;
use super::kernel::Call;
use super::points::{Motion, PlacedPoints};
use super::source::Constant;
use super::sum::Slice;
use crate::Result;

/// `δG x` of some columns, as shares `[share][point][columns]` to be summed.
pub(super) fn coulomb_jvp(
    context: &Context,
    placed: &PlacedPoints,
    motion: &Motion,
    (x, stride, offset): Slice,
    (out, columns): (&Buffer, usize),
) -> Result<Call> {
    let constants = [
        ("COLUMNS", compiled(columns)),
        ("FADING", Constant::Flag(placed.model.fading)),
    ];
    let kernel = context.kernel("coulomb_jvp", "main", context.fine(), &constants)?;
    let shares = placed.model.sizes.shares();
    let uniform = context.uniform(&[shares, columns, stride, offset].map(|n| n as u32));
    let mut buffers = placed.buffers(Some(motion));
    buffers.extend([
        ("x", x.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
    ]);
    context.call(&kernel, &buffers, placed.groups())
}
