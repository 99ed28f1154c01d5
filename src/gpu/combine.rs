//! `shaders/combine.wgsl`: combinations of columns.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::{Call, threads};
use super::source::Arithmetic;
use crate::Result;
use nalgebra::DMatrix;

/// `[row][blocks][k] → [row][blocks][n]` by coefficients k × n.
pub(super) fn combine(
    context: &Context,
    arithmetic: Arithmetic,
    x: &Buffer,
    coefficients: &DMatrix<f64>,
    out: &Buffer,
    (rows, blocks): (usize, usize),
) -> Result<Call> {
    let kernel = context.kernel("combine", "main", arithmetic, &[])?;
    let (from, to) = coefficients.shape();
    let uniform = context.uniform(&[rows, blocks, from, to].map(|n| n as u32));
    // Row-major.
    let values: Vec<f64> = coefficients.transpose().iter().copied().collect();
    let table = context.upload("coefficients", arithmetic, &values)?;
    let buffers = [
        ("x", x.into()),
        ("coefficients", (&table).into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
    ];
    context.call(&kernel, &buffers, threads(rows * blocks * to))
}
