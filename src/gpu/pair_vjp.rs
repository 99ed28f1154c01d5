//! `shaders/pair_vjp.wgsl`: derivatives of energies, as wrenches on pairs of bodies.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::Placed;
use super::kernel::Call;
use super::source::{Arithmetic, Constant};
use crate::Result;

/// `out[task][width][columns][6]` for the columns `first..first + width` on the left: left densities
/// `[face][μ, r, β]`, right ones `[source][a, λ]`.
pub(super) fn pair_vjp(
    context: &Context,
    arithmetic: Arithmetic,
    placed: &Placed,
    (left, right): (&Buffer, &Buffer),
    columns: usize,
    (first, width): (usize, usize),
    out: &Buffer,
) -> Result<Call> {
    let constants = [("LEFT", Constant::Number(width as u32))];
    let kernel = context.kernel("pair_vjp", "main", arithmetic, &constants)?;
    let uniform = context.uniform(&[columns as u32, first as u32, 0, 0]);
    let mut buffers = placed.buffers(arithmetic);
    buffers.extend([
        ("left", left.into()),
        ("right", right.into()),
        ("tasks", (&placed.geometry.tasks).into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
    ]);
    context.call(&kernel, &buffers, placed.geometry.task_groups())
}
