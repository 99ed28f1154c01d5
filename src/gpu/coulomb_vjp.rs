//! `shaders/coulomb_vjp.wgsl`: what charges pull with.

use super::buffer::Buffer;
use super::context::Context;
use super::coulomb::compiled;
use super::kernel::Call;
use super::points::PlacedPoints;
use super::source::Constant;
use super::sum::Slice;
use crate::Result;

/// The pulls of some columns of charges, as shares `[share][point][F, D][columns]` to be summed.
pub(super) fn coulomb_vjp(
    context: &Context,
    placed: &PlacedPoints,
    (x, stride, offset): Slice,
    (out, columns): (&Buffer, usize),
) -> Result<Call> {
    let constants = [
        ("COLUMNS", compiled(columns)),
        ("FADING", Constant::Flag(placed.model.fading)),
    ];
    let kernel = context.kernel("coulomb_vjp", "main", context.fine(), &constants)?;
    let shares = placed.model.sizes.shares();
    let uniform = context.uniform(&[shares, columns, stride, offset].map(|n| n as u32));
    let mut buffers = placed.buffers(None);
    buffers.extend([
        ("x", x.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
    ]);
    context.call(&kernel, &buffers, placed.groups())
}
