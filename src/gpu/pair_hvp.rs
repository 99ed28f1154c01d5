//! `shaders/pair_hvp.wgsl`: the tangent of [`pair_vjp`](super::pair_vjp), mirrored.

use super::buffer::Buffer;
use super::geometry::PlacedSystem;
use super::kernel::{Call, groups};
use super::source::{Arithmetic, Constant};
use crate::Result;
use std::ops::Range;

/// `out[task][columns][columns][12]` of these tasks: wrenches and their tangents; left densities
/// `[face][μ, r, β, δμ, δr]`, right ones `[source][a, λ, δa, δλ]`.
pub(super) fn pair_hvp(
    arithmetic: Arithmetic,
    placed: &PlacedSystem,
    (left, right): (&Buffer, &Buffer),
    columns: usize,
    motions: &Buffer,
    tasks: &Range<usize>,
    out: &Buffer,
) -> Result<Call> {
    let context = &placed.geometry.context;
    let constants = [("LEFT", Constant::Number(columns as u32))];
    let kernel = context.kernel("pair_hvp", "main", arithmetic, &constants)?;
    let uniform = context.uniform(&[tasks.start as u32, tasks.len() as u32, 0, 0]);
    let mut buffers = placed.buffers(arithmetic);
    buffers.extend([
        ("left", left.into()),
        ("right", right.into()),
        ("tasks", (&placed.geometry.tasks).into()),
        ("motions", motions.into()),
        ("out", out.into()),
        ("share", (&uniform).into()),
    ]);
    context.call(&kernel, &buffers, groups(tasks.len()))
}
