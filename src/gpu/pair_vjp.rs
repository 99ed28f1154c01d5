//! `shaders/pair_vjp.wgsl`: derivatives of energies, as wrenches on pairs of bodies.

use super::buffer::Buffer;
use super::geometry::PlacedSystem;
use super::kernel::{Call, groups};
use super::source::{Arithmetic, Constant};
use crate::Result;
use std::ops::Range;

/// `out[task][width][columns][6]` of these tasks for the columns `first..first + width` on the left: left densities
/// `[face][μ, r, β]`, right ones `[source][a, λ]`.
pub(super) fn pair_vjp(
    arithmetic: Arithmetic,
    placed: &PlacedSystem,
    (left, right): (&Buffer, &Buffer),
    columns: usize,
    (first, width): (usize, usize),
    tasks: &Range<usize>,
    out: &Buffer,
) -> Result<Call> {
    let context = &placed.geometry.context;
    let constants = [("LEFT", Constant::Number(width as u32))];
    let kernel = context.kernel("pair_vjp", "main", arithmetic, &constants)?;
    let uniform = context.uniform(&[columns, first, tasks.start, tasks.len()].map(|n| n as u32));
    let mut buffers = placed.buffers(arithmetic);
    buffers.extend([
        ("left", left.into()),
        ("right", right.into()),
        ("tasks", (&placed.geometry.tasks).into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
    ]);
    context.call(&kernel, &buffers, groups(tasks.len()))
}
