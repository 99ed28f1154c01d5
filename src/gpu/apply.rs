//! `shaders/apply.wgsl`: `K x`, or `P x`.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::PlacedSystem;
use super::kernel::Call;
use super::pass::{Pass, Side, pass};
use super::source::Arithmetic;
use super::sum::Slice;
use crate::Result;

/// `K x`, or `P x` of some columns, as shares `[share][row][columns]` to be summed; `potential` for P.
pub(super) fn apply(
    context: &Context,
    arithmetic: Arithmetic,
    placed: &PlacedSystem,
    potential: bool,
    x: Slice,
    out: (&Buffer, usize),
    gate: &Buffer,
) -> Result<Call> {
    let what = Pass {
        shader: "apply",
        side: Side::Faces,
        potential,
        name: "x",
        beside: ("going", gate),
    };
    pass(context, arithmetic, placed, &what, x, out)
}
