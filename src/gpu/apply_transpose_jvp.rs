//! `shaders/apply_transpose_jvp.wgsl`: `δKᵀ y`, or `δPᵀ y`.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::PlacedSystem;
use super::kernel::Call;
use super::pass::{Pass, Side, pass};
use super::source::Arithmetic;
use super::sum::Slice;
use crate::Result;

/// `δKᵀ y`, or `δPᵀ y` of some columns, as shares `[share][row][columns]` to be summed; `potential` for P.
pub(super) fn apply_transpose_jvp(
    context: &Context,
    arithmetic: Arithmetic,
    placed: &PlacedSystem,
    potential: bool,
    y: Slice,
    out: (&Buffer, usize),
    motions: &Buffer,
) -> Result<Call> {
    let what = Pass {
        shader: "apply_transpose_jvp",
        side: Side::Sources,
        potential,
        name: "y",
        beside: ("motions", motions),
    };
    pass(context, arithmetic, placed, &what, y, out)
}
