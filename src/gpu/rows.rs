//! `shaders/rows.wgsl`: what twists ask for on every face, or read out of every source.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::{Call, threads};
use super::source::Arithmetic;
use super::sum::Slice;
use crate::Result;

/// A table of rows per shape.
pub(super) struct Table<'a> {
    /// `[shape's row][width]`.
    pub values: &'a Buffer,
    pub width: usize,
    /// First of the six columns.
    pub first: usize,
    /// `[row]`: body, shape's row.
    pub map: &'a Buffer,
    pub rows: usize,
}

/// `out (+)= table · twists`, twists `[body][6][columns]`.
pub(super) fn rows(
    context: &Context,
    arithmetic: Arithmetic,
    table: &Table,
    (twists, columns): (&Buffer, usize),
    (out, stride, offset): Slice,
    accumulate: bool,
) -> Result<Call> {
    let kernel = context.kernel("rows", "main", arithmetic, &[])?;
    let words = [
        table.rows,
        columns,
        table.width,
        table.first,
        stride,
        offset,
        usize::from(accumulate),
        0,
    ];
    let uniform = context.uniform(&words.map(|n| n as u32));
    let buffers = [
        ("table", table.values.into()),
        ("map", table.map.into()),
        ("twists", twists.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
    ];
    context.call(&kernel, &buffers, threads(table.rows * columns))
}
