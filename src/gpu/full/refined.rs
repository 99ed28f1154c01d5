//! Conjugate gradients in single precision (`shaders/cgls.wgsl`), right preconditioned (`shaders/factor.wgsl`), inside
//! an iterative refinement (`shaders/refine.wgsl`): what isn't a product.

use crate::Result;
use crate::gpu::buffer::Buffer;
use crate::gpu::columns::{Slice, Sum};
use crate::gpu::context::Context;
use crate::gpu::geometry::PlacedSystem;
use crate::gpu::kernel::{Call, threads};
use crate::gpu::source::{Arithmetic, Constant};

/// What an inner solve gains: near what single precision can.
const INNER: f32 = 1e-4;

/// The vectors of a solve, sources × columns, and each column's numbers; in single precision but for the residual.
pub(super) struct Iterates {
    rows: usize,
    columns: usize,
    pub p: Buffer,
    pub q: Buffer,
    pub direction: Buffer,
    x: Buffer,
    pub s: Buffer,
    /// `[column][4]`: γ, α, β, γ to end at.
    scalars: Buffer,
    /// `[column][4]`: iterations, whether the inner solve reached its end, whether refinement stalled, cycles.
    pub counts: Buffer,
    /// Columns that go on.
    pub active: Buffer,
    /// Residual, fine.
    pub rho: Buffer,
    /// Its direction.
    pub shrunk: Buffer,
    norms: Buffer,
    /// Relative residual of each column.
    pub relative: Buffer,
    /// Columns that haven't reached the tolerance.
    pub unfinished: Buffer,
}

impl Iterates {
    pub fn new(context: &Context, rows: usize, columns: usize) -> Result<Self> {
        let (fine, single) = (context.fine(), Arithmetic::Single);
        let vector = |label| context.reals(label, single, rows * columns);
        Ok(Self {
            rows,
            columns,
            p: vector("p")?,
            q: vector("q")?,
            direction: vector("direction")?,
            x: vector("x")?,
            s: vector("s")?,
            scalars: context.zeros("scalars", single, 4 * columns)?,
            counts: context.upload_words("counts", &vec![0; 4 * columns])?,
            active: context.upload_words("going", &vec![0; columns])?,
            rho: context.reals("residual", fine, rows * columns)?,
            shrunk: vector("shrunk")?,
            norms: context.zeros("norms", fine, 2 * columns)?,
            relative: context.zeros("relative", single, columns)?,
            unfinished: context.upload_words("unfinished", &vec![1; columns])?,
        })
    }

    /// A call of an entry with some columns of the solution, for each column or for every number.
    fn call(
        &self,
        context: &Context,
        shader: (&'static str, &'static str, Arithmetic),
        task: &[usize],
        solution: &Buffer,
        each: bool,
    ) -> Result<Call> {
        let buffers = [
            ("p", &self.p),
            ("q", &self.q),
            ("direction", &self.direction),
            ("x", &self.x),
            ("s", &self.s),
            ("scalars", &self.scalars),
            ("counts", &self.counts),
            ("going", &self.active),
            ("rho", &self.rho),
            ("shrunk", &self.shrunk),
            ("norms", &self.norms),
            ("relative", &self.relative),
            ("unfinished", &self.unfinished),
            ("solution", solution),
        ];
        let constants = [("COLUMNS", Constant::Number(self.columns as u32))];
        let count = match each {
            true => [self.columns as u32, 1, 1],
            false => threads(self.rows * self.columns),
        };
        context.call(shader, &constants, task, (&[], &buffers), count)
    }

    /// The second half of an iteration, once `q = R⁻ᵀ N R⁻¹ p` is there.
    pub fn cgls(&self, context: &Context) -> Result<[Call; 4]> {
        let of = |entry, each| {
            let shader = ("cgls", entry, Arithmetic::Single);
            self.call(context, shader, &[self.rows, 0, 0, 0], &self.x, each)
        };
        Ok([
            of("curvature", true)?,
            of("advance", false)?,
            of("measure", true)?,
            of("turn", false)?,
        ])
    }

    /// The calls of a cycle of refinement, the first or another: two, between which and the next two `R⁻ᵀ` is applied,
    /// and one after the inner solve.
    pub fn refine(
        &self,
        context: &Context,
        first: bool,
        tolerance: f64,
        (solution, stride, offset): Slice,
    ) -> Result<[Call; 5]> {
        let end = (tolerance as f32).to_bits() as usize;
        let inner = INNER.to_bits() as usize;
        let first = usize::from(first);
        let words = [self.rows, first, stride, offset, end, inner, 0, 0];
        let of = |entry, each| {
            let shader = ("refine", entry, context.fine());
            self.call(context, shader, &words, solution, each)
        };
        Ok([
            of("norm", true)?,
            of("shrink", false)?,
            of("begin", true)?,
            of("start", false)?,
            of("correct", false)?,
        ])
    }
}

/// `out = R⁻¹ x`, or `R⁻ᵀ x`, columns beside each other, in single precision; `parts` is memory for its shares.
pub(super) fn factor(
    placed: &PlacedSystem,
    transpose: bool,
    (x, parts, out): (&Buffer, &Buffer, &Buffer),
    columns: usize,
    gate: &Buffer,
) -> Result<[Call; 2]> {
    let geometry = &placed.geometry;
    let (context, sizes) = (&geometry.context, &geometry.sizes);
    let (single, shares) = (Arithmetic::Single, geometry.factor_shares());
    let constants = [
        ("COLUMNS", Constant::Number(columns as u32)),
        ("TRANSPOSE", Constant::Flag(transpose)),
    ];
    let sum = Sum::new((sizes.sources, columns), (parts, shares), (out, columns, 0));
    Ok([
        context.call(
            ("factor", "main", single),
            &constants,
            &[sizes.face_blocks, sizes.sources, shares, 0],
            (
                placed.table(single),
                &[("x", x), ("out", parts), ("going", gate)],
            ),
            [sizes.source_blocks as u32, shares as u32, 1],
        )?,
        sum.call(context, single, gate)?,
    ])
}
