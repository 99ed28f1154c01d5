//! `shaders/pair_hvp.wgsl`: the tangent of [`pair_vjp`](super::pair_vjp), mirrored.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::Placed;
use super::kernel::Call;
use super::source::{Arithmetic, Constant};
use crate::Result;

/// `out[task][columns][columns][12]`: wrenches and their tangents; left densities
/// `[face][μ, r, β, δμ, δr]`, right ones `[source][a, λ, δa, δλ]`.
pub(super) fn pair_hvp(
    context: &Context,
    arithmetic: Arithmetic,
    placed: &Placed,
    (left, right): (&Buffer, &Buffer),
    columns: usize,
    motions: &Buffer,
    out: &Buffer,
) -> Result<Call> {
    let constants = [("LEFT", Constant::Number(columns as u32))];
    let kernel = context.kernel("pair_hvp", "main", arithmetic, &constants)?;
    let mut buffers = placed.buffers(arithmetic);
    buffers.extend([
        ("left", left.into()),
        ("right", right.into()),
        ("tasks", (&placed.geometry.tasks).into()),
        ("motions", motions.into()),
        ("out", out.into()),
    ]);
    context.call(&kernel, &buffers, placed.geometry.task_groups())
}
