//! `shaders/apply_jvp.wgsl`: `δK x`, or `δP x`.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::PlacedSystem;
use super::kernel::Call;
use super::pass::{Pass, Side, pass};
use super::source::Arithmetic;
use super::sum::Slice;
use crate::Result;

/// `δK x`, or `δP x` of some columns, as shares `[share][row][columns]` to be summed; `potential` for P.
pub(super) fn apply_jvp(
    context: &Context,
    arithmetic: Arithmetic,
    placed: &PlacedSystem,
    potential: bool,
    x: Slice,
    out: (&Buffer, usize),
    motions: &Buffer,
) -> Result<Call> {
    let what = Pass {
        shader: "apply_jvp",
        side: Side::Faces,
        potential,
        name: "x",
        beside: ("motions", motions),
    };
    pass(context, arithmetic, placed, &what, x, out)
}
