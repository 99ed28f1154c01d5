//! `shaders/coulomb_hvp.wgsl`: the tangent of [`coulomb_vjp`](super::coulomb_vjp), with it.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::Call;
use super::points::{Motion, PlacedPoints};
use super::source::Constant;
use crate::Result;

/// The pulls of charges x that change by δx and their tangents, as shares
/// `[share][point][F, D, δF, δD][columns]` to be summed.
pub(super) fn coulomb_hvp(
    context: &Context,
    placed: &PlacedPoints,
    motion: &Motion,
    (x, dx): (&Buffer, &Buffer),
    (out, columns): (&Buffer, usize),
) -> Result<Call> {
    let constants = [
        ("COLUMNS", Constant::Number(columns as u32)),
        ("FADING", Constant::Flag(placed.model.fading)),
    ];
    let kernel = context.kernel("coulomb_hvp", "main", context.fine(), &constants)?;
    let shares = placed.model.sizes.shares();
    let uniform = context.uniform(&[shares as u32, 0, 0, 0]);
    let mut buffers = placed.buffers(Some(motion));
    buffers.extend([
        ("x", x.into()),
        ("dx", dx.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
    ]);
    context.call(&kernel, &buffers, placed.groups())
}
