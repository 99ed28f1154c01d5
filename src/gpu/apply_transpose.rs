//! `shaders/apply_transpose.wgsl`: `Kᵀ y`, or `Pᵀ y`.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::PlacedSystem;
use super::kernel::Call;
use super::pass::{Pass, Side, pass};
use super::source::Arithmetic;
use super::sum::Slice;
use crate::Result;

/// `Kᵀ y`, or `Pᵀ y` of some columns, as shares `[share][row][columns]` to be summed; `potential` for P.
pub(super) fn apply_transpose(
    context: &Context,
    arithmetic: Arithmetic,
    placed: &PlacedSystem,
    potential: bool,
    y: Slice,
    out: (&Buffer, usize),
    gate: &Buffer,
) -> Result<Call> {
    let what = Pass {
        shader: "apply_transpose",
        side: Side::Sources,
        potential,
        name: "y",
        beside: ("going", gate),
    };
    pass(context, arithmetic, placed, &what, y, out)
}
