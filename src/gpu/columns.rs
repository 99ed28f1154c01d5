//! Columns of numbers: sums, combinations and dot products of them (`shaders/{sum,combine,products}.wgsl`).

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::{Call, threads};
use super::source::Arithmetic;
use crate::Result;
use nalgebra::DMatrix;

/// Columns of an array: (array, stride, first column).
pub(super) type Slice<'a> = (&'a Buffer, usize, usize);

/// The columns of an array in passes of at most `most`, as even as can be: (first, count).
pub(super) fn passes(columns: usize, most: usize) -> impl Iterator<Item = (usize, usize)> {
    let parts = columns.div_ceil(most).max(1);
    (0..parts).map(move |p| {
        let first = p * columns / parts;
        (first, (p + 1) * columns / parts - first)
    })
}

/// `out = scale · (Σ parts + diagonal · vector) + base`.
#[derive(Clone, Copy)]
pub(super) struct Sum<'a> {
    pub rows: usize,
    pub columns: usize,
    /// Shares, and how many there are.
    pub parts: (&'a Buffer, usize),
    /// Columns of the shares, and the first that is taken.
    pub taken: (usize, usize),
    pub scale: f32,
    pub base: Base<'a>,
    /// Diagonal, and what it multiplies.
    pub damped: Option<(&'a Buffer, Slice<'a>)>,
    pub out: Slice<'a>,
}

/// What is added to.
#[derive(Clone, Copy)]
pub(super) enum Base<'a> {
    Nothing,
    /// Columns of another array.
    Other(Slice<'a>),
    /// What is there.
    Out,
}

impl<'a> Base<'a> {
    /// What is bound, and the shaders' number of the kind: a variable that isn't read still has to be bound, to
    /// something that isn't written.
    pub fn bound(self, unread: &'a Buffer) -> (Slice<'a>, usize) {
        match self {
            Self::Nothing => ((unread, 0, 0), 0),
            Self::Other(slice) => (slice, 1),
            Self::Out => ((unread, 0, 0), 2),
        }
    }
}

impl<'a> Sum<'a> {
    /// The shares alone, all their columns.
    pub fn new(
        (rows, columns): (usize, usize),
        parts: (&'a Buffer, usize),
        out: Slice<'a>,
    ) -> Self {
        Self {
            rows,
            columns,
            parts,
            taken: (columns, 0),
            scale: 1.0,
            base: Base::Nothing,
            damped: None,
            out,
        }
    }

    /// The call; skipped where no column of `gate` goes on.
    pub fn call(&self, context: &Context, arithmetic: Arithmetic, gate: &Buffer) -> Result<Call> {
        let (parts, shares) = self.parts;
        let (base, base_kind) = self.base.bound(parts);
        let (diagonal, vector) = self.damped.unwrap_or((parts, (parts, 0, 0)));
        let words = [
            self.rows,
            shares,
            self.taken.0,
            self.columns,
            self.out.1,
            self.out.2,
            base.1,
            base.2,
            vector.1,
            vector.2,
            base_kind,
            usize::from(self.damped.is_some()),
            self.scale.to_bits() as usize,
            0,
            self.taken.1,
            0,
        ];
        let buffers = [
            ("parts", parts),
            ("out", self.out.0),
            ("base", base.0),
            ("diagonal", diagonal),
            ("vector", vector.0),
            ("going", gate),
        ];
        let count = threads(self.rows * self.columns);
        context.call(
            ("sum", "main", arithmetic),
            &[],
            &words,
            (&[], &buffers),
            count,
        )
    }
}

/// `[row][blocks][k] → [row][blocks][n]` by coefficients k × n.
pub(super) fn combine(
    context: &Context,
    x: &Buffer,
    coefficients: &DMatrix<f64>,
    out: &Buffer,
    (rows, blocks): (usize, usize),
) -> Result<Call> {
    let shader = ("combine", "main", context.fine());
    let (from, to) = coefficients.shape();
    let words = [rows, blocks, from, to];
    // Row-major.
    let values = coefficients.transpose();
    let table = context.upload("coefficients", context.fine(), values.as_slice())?;
    let buffers = [("x", x), ("coefficients", &table), ("out", out)];
    let count = threads(rows * blocks * to);
    context.call(shader, &[], &words, (&[], &buffers), count)
}

/// `out[x][y] = Σ_j g_jx a_jy`, columns × columns.
pub(super) fn products(
    context: &Context,
    rows: usize,
    (g, a): (Slice, Slice),
    (out, columns): (&Buffer, usize),
) -> Result<Call> {
    let shader = ("products", "main", context.fine());
    let words = [rows, g.1, g.2, a.1, a.2, 0, 0, 0];
    let buffers = [("g", g.0), ("a", a.0), ("out", out)];
    let count = [columns as u32, columns as u32, 1];
    context.call(shader, &[], &words, (&[], &buffers), count)
}
