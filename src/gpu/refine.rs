//! `shaders/refine.wgsl`: iterative refinement around [`cgls`](super::cgls).

use super::buffer::Buffer;
use super::cgls::Iterates;
use super::context::Context;
use super::kernel::{Call, threads};
use super::source::{Arithmetic, Constant};
use super::sum::Slice;
use crate::Result;

/// What refinement keeps beside the iterates.
pub(super) struct Refined {
    /// Residual, sources × columns, fine.
    pub rho: Buffer,
    /// Its direction, in single precision.
    pub shrunk: Buffer,
    norms: Buffer,
    /// Relative residual of each column.
    pub relative: Buffer,
    /// Columns that haven't reached the tolerance.
    pub unfinished: Buffer,
}

/// The calls of one cycle: before the inner solve in two parts, between which `R⁻ᵀ` is applied, and after it.
pub(super) struct Cycle {
    pub norm: Call,
    pub shrink: Call,
    pub begin: Call,
    pub start: Call,
    pub correct: Call,
}

impl Refined {
    pub fn new(context: &Context, rows: usize, columns: usize) -> Result<Self> {
        let (fine, single) = (context.fine(), Arithmetic::Single);
        Ok(Self {
            rho: context.reals("residual", fine, rows * columns)?,
            shrunk: context.reals("shrunk", single, rows * columns)?,
            norms: context.zeros("norms", fine, 2 * columns)?,
            relative: context.zeros("relative", single, columns)?,
            unfinished: context.upload_words("unfinished", &vec![1; columns])?,
        })
    }
}

/// The calls of a cycle, the first or another; inner solves end at `inner` of what they start with.
pub(super) fn refine(
    context: &Context,
    (refined, iterates): (&Refined, &Iterates),
    (rows, columns): (usize, usize),
    first: bool,
    (tolerance, inner): (f64, f64),
    (solution, stride, offset): Slice,
) -> Result<Cycle> {
    let constants = [("COLUMNS", Constant::Number(columns as u32))];
    let mut words = [rows, usize::from(first), stride, offset]
        .map(|n| n as u32)
        .to_vec();
    words.extend([(tolerance as f32).to_bits(), (inner as f32).to_bits(), 0, 0]);
    let uniform = context.uniform(&words);
    let buffers = [
        ("rho", (&refined.rho).into()),
        ("norms", (&refined.norms).into()),
        ("shrunk", (&refined.shrunk).into()),
        ("s", (&iterates.s).into()),
        ("p", (&iterates.p).into()),
        ("x", (&iterates.x).into()),
        ("scalars", (&iterates.scalars).into()),
        ("counts", (&iterates.counts).into()),
        ("relative", (&refined.relative).into()),
        ("unfinished", (&refined.unfinished).into()),
        ("going", (&iterates.active).into()),
        ("solution", solution.into()),
        ("task", (&uniform).into()),
    ];
    let of = |entry: &str, count| {
        let kernel = context.kernel("refine", entry, context.fine(), &constants)?;
        context.call(&kernel, &buffers, count)
    };
    let each = [columns as u32, 1, 1];
    let all = threads(rows * columns);
    Ok(Cycle {
        norm: of("norm", each)?,
        shrink: of("shrink", all)?,
        begin: of("begin", each)?,
        start: of("start", all)?,
        correct: of("correct", all)?,
    })
}
