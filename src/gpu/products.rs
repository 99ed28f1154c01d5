//! `shaders/products.wgsl`: dot products of columns.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::Call;
use super::source::Arithmetic;
use crate::Result;

/// Sizes of a call; (stride, first column) of the arrays.
pub(super) struct Task {
    pub rows: usize,
    pub g: (usize, usize),
    pub a: (usize, usize),
    pub columns: usize,
}

/// `out[x][y] = Σ_j g_jx a_jy`, columns × columns.
pub(super) fn products(
    context: &Context,
    arithmetic: Arithmetic,
    g: &Buffer,
    a: &Buffer,
    out: &Buffer,
    task: &Task,
) -> Result<Call> {
    let kernel = context.kernel("products", "main", arithmetic, &[])?;
    let words = [task.rows, task.g.0, task.g.1, task.a.0, task.a.1, 0, 0, 0].map(|n| n as u32);
    let uniform = context.uniform(&words);
    let buffers = [
        ("g", g.into()),
        ("a", a.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
    ];
    let k = task.columns as u32;
    context.call(&kernel, &buffers, [k, k, 1])
}
