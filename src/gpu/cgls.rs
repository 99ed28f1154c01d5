//! `shaders/cgls.wgsl`: conjugate gradients in single precision, what isn't a product.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::{Call, threads};
use super::source::{Arithmetic, Constant};
use crate::Result;

/// The vectors of an iteration, sources × columns, and each column's numbers.
pub(super) struct Iterates {
    pub p: Buffer,
    pub q: Buffer,
    pub direction: Buffer,
    pub x: Buffer,
    pub s: Buffer,
    /// `[column][4]`: γ, α, β, γ to end at.
    pub scalars: Buffer,
    /// `[column][4]`: iterations, whether the inner solve reached its end, whether refinement stalled, cycles.
    pub counts: Buffer,
    /// Columns that go on.
    pub active: Buffer,
}

impl Iterates {
    pub fn new(context: &Context, rows: usize, columns: usize) -> Result<Self> {
        let vector = |label| context.reals(label, Arithmetic::Single, rows * columns);
        Ok(Self {
            p: vector("p")?,
            q: vector("q")?,
            direction: vector("direction")?,
            x: vector("x")?,
            s: vector("s")?,
            scalars: context.zeros("scalars", Arithmetic::Single, 4 * columns)?,
            counts: context.upload_words("counts", &vec![0; 4 * columns])?,
            active: context.upload_words("going", &vec![0; columns])?,
        })
    }
}

/// The second half of an iteration, once `q = R⁻ᵀ N R⁻¹ p` is there.
pub(super) fn cgls(
    context: &Context,
    iterates: &Iterates,
    rows: usize,
    columns: usize,
) -> Result<[Call; 4]> {
    let constants = [("COLUMNS", Constant::Number(columns as u32))];
    let uniform = context.uniform(&[rows as u32, 0, 0, 0]);
    let buffers = [
        ("p", (&iterates.p).into()),
        ("q", (&iterates.q).into()),
        ("direction", (&iterates.direction).into()),
        ("x", (&iterates.x).into()),
        ("s", (&iterates.s).into()),
        ("scalars", (&iterates.scalars).into()),
        ("counts", (&iterates.counts).into()),
        ("going", (&iterates.active).into()),
        ("task", (&uniform).into()),
    ];
    let of = |entry: &str| context.kernel("cgls", entry, Arithmetic::Single, &constants);
    let each = [columns as u32, 1, 1];
    let all = threads(rows * columns);
    Ok([
        context.call(&of("curvature")?, &buffers, each)?,
        context.call(&of("advance")?, &buffers, all)?,
        context.call(&of("measure")?, &buffers, each)?,
        context.call(&of("turn")?, &buffers, all)?,
    ])
}
