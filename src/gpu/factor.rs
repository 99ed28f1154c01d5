//! `shaders/factor.wgsl`: the right preconditioner.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::PlacedSystem;
use super::kernel::Call;
use super::source::{Arithmetic, Constant};
use crate::Result;

/// `R⁻¹ x`, or `R⁻ᵀ x`, columns beside each other, in single precision, as shares
/// `[share][source][columns]` to be summed.
pub(super) fn factor(
    context: &Context,
    placed: &PlacedSystem,
    transpose: bool,
    (x, out, columns): (&Buffer, &Buffer, usize),
    gate: &Buffer,
) -> Result<Call> {
    let constants = [
        ("COLUMNS", Constant::Number(columns as u32)),
        ("TRANSPOSE", Constant::Flag(transpose)),
    ];
    let kernel = context.kernel("factor", "main", Arithmetic::Single, &constants)?;
    let geometry = &placed.geometry;
    let (sizes, shares) = (&geometry.sizes, geometry.factor_shares());
    let words = [sizes.face_blocks, sizes.sources, shares, 0];
    let uniform = context.uniform(&words.map(|n| n as u32));
    let buffers = [
        ("blocks", (&geometry.blocks).into()),
        ("factors", (&geometry.factors).into()),
        ("places", (&geometry.layout).into()),
        ("scaling", (&placed.scaling).into()),
        ("x", x.into()),
        ("out", out.into()),
        ("counts", (&uniform).into()),
        ("going", gate.into()),
    ];
    context.call(
        &kernel,
        &buffers,
        [sizes.source_blocks as u32, shares as u32, 1],
    )
}
