//! `shaders/sum.wgsl`: shares added up, with what else a row needs.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::{Call, threads};
use super::source::Arithmetic;
use crate::Result;

/// Columns of an array: (array, stride, first column).
pub(super) type Slice<'a> = (&'a Buffer, usize, usize);

/// `out = scale · (Σ parts + diagonal · vector) + base`.
pub(super) struct Sum<'a> {
    pub rows: usize,
    pub columns: usize,
    /// Shares, their width, and the first column taken of them.
    pub parts: (&'a Buffer, usize, usize, usize),
    pub scale: f32,
    pub base: Base<'a>,
    /// Diagonal, and what it multiplies.
    pub damped: Option<(&'a Buffer, Slice<'a>)>,
    pub out: Slice<'a>,
}

/// What the sum is added to.
pub(super) enum Base<'a> {
    Nothing,
    /// Columns of another array.
    Other(Slice<'a>),
    /// What is there.
    Out,
}

/// The call of a sum; skipped where no column of `gate` goes on.
pub(super) fn sum(
    context: &Context,
    arithmetic: Arithmetic,
    task: &Sum,
    gate: &Buffer,
) -> Result<Call> {
    let kernel = context.kernel("sum", "main", arithmetic, &[])?;
    let (parts, shares, width, first) = task.parts;
    let (out, out_stride, out_offset) = task.out;
    // A variable that isn't read still has to be bound, to something that isn't written.
    let (base, base_stride, base_offset, base_kind) = match task.base {
        Base::Nothing => (parts, 0, 0, 0),
        Base::Other((b, s, o)) => (b, s, o, 1),
        Base::Out => (parts, 0, 0, 2),
    };
    let (diagonal, (vector, vector_stride, vector_offset)) =
        task.damped.unwrap_or((parts, (parts, 0, 0)));
    let mut words: Vec<u32> = [
        task.rows,
        shares,
        width,
        task.columns,
        out_stride,
        out_offset,
        base_stride,
        base_offset,
        vector_stride,
        vector_offset,
        base_kind,
        usize::from(task.damped.is_some()),
    ]
    .map(|n| n as u32)
    .to_vec();
    words.extend([task.scale.to_bits(), 0, first as u32, 0]);
    let uniform = context.uniform(&words);
    let buffers = [
        ("parts", parts.into()),
        ("out", out.into()),
        ("base", base.into()),
        ("diagonal", diagonal.into()),
        ("vector", vector.into()),
        ("task", (&uniform).into()),
        ("going", gate.into()),
    ];
    context.call(&kernel, &buffers, threads(task.rows * task.columns))
}
