//! Products with G, and what is summed with it, of any number of columns in passes (`shaders/coulomb*.wgsl`); products
//! with the bodies' dense blocks [L, Ū] (`shaders/blocks.wgsl`).

use crate::Result;
use crate::gpu::buffer::Buffer;
use crate::gpu::columns::{Base, Slice, Sum, passes};
use crate::gpu::kernel::{Call, Table, threads};
use crate::gpu::points::{Compressed, PlacedPoints};
use crate::gpu::source::Constant;

/// Most columns of one pass of potentials.
const WIDE: usize = 12;
/// Of pulls, which are vectors.
const NARROW: usize = 6;

/// Which product.
#[derive(Clone, Copy)]
pub(super) enum Product<'a> {
    /// G x.
    Potential,
    /// δG x of displaced points.
    Tangent(&'a Table),
    /// The pulls, `[point][F, D][columns]`.
    Pull,
    /// The pulls and their tangents, `[point][F, D, δF, δD][columns]`, of displaced points and charges that change by δx;
    /// at most two columns, all there are.
    PullTangent(&'a Table, &'a Buffer),
}

/// Columns of a pass, as a shader is compiled for them: few different ones.
fn compiled(columns: usize) -> Constant {
    Constant::Number(match columns {
        0..=2 => columns,
        _ => columns.next_multiple_of(2),
    } as u32)
}

/// `out = product · x`; a product with G is skipped where no column of `gate` goes on.
pub(super) fn product(
    placed: &PlacedPoints,
    what: Product,
    (x, stride, offset): Slice,
    columns: usize,
    (out, out_stride, out_offset): Slice,
    gate: &Buffer,
) -> Result<Vec<Call>> {
    let model = &placed.model;
    let (context, fine) = (&model.context, model.context.fine());
    let (points, pull) = (model.sizes.points, model.pull());
    let (shader, table, rows, most) = match what {
        Product::Potential => ("coulomb", &placed.table, points, WIDE),
        Product::Tangent(table) => ("coulomb_jvp", table, points, WIDE),
        Product::Pull => ("coulomb_vjp", &placed.table, points * pull, NARROW),
        Product::PullTangent(table, _) => ("coulomb_hvp", table, points * 2 * pull, NARROW),
    };
    let shares = model.sizes.shares();
    let widest = columns.min(most);
    // Passes follow one another: they can share it.
    let parts = context.reals("shares of a product", fine, shares * rows * widest)?;
    let mut buffers = vec![("x", x), ("out", &parts), ("going", gate)];
    if let Product::PullTangent(_, dx) = what {
        buffers.push(("dx", dx));
    }
    let mut calls = Vec::new();
    for (first, width) in passes(columns, most).filter(|(_, width)| *width > 0) {
        let constants = [
            ("COLUMNS", compiled(width)),
            ("FADING", Constant::Flag(model.fading)),
        ];
        calls.push(context.call(
            (shader, "main", fine),
            &constants,
            &[shares, width, stride, offset + first],
            (table, &buffers),
            [model.sizes.groups() as u32, shares as u32, 1],
        )?);
        let out = (out, out_stride, out_offset + first);
        let task = Sum::new((rows, width), (&parts, shares), out);
        calls.push(task.call(context, fine, gate)?);
    }
    Ok(calls)
}

/// Which part of a block.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// L: by modes of all bodies.
    Modes,
    /// Ū: by six components of every body's twist.
    Strengths,
}

/// `out = base + scale · block · x`, or with the block's transpose.
pub(super) struct Blocks<'a> {
    pub entry: &'static str,
    pub part: Part,
    pub columns: usize,
    pub x: Slice<'a>,
    pub out: Slice<'a>,
    pub scale: f32,
    pub base: Base<'a>,
}

impl<'a> Blocks<'a> {
    /// From coefficients to points: `out = L x` or `Ū x`.
    pub fn expand(part: Part, columns: usize, x: Slice<'a>, out: Slice<'a>) -> Self {
        Self {
            entry: "expand",
            part,
            columns,
            x,
            out,
            scale: 1.0,
            base: Base::Nothing,
        }
    }

    /// From points to coefficients: `out = Lᵀ x` or `Ūᵀ x`.
    pub fn project(part: Part, columns: usize, x: Slice<'a>, out: Slice<'a>) -> Self {
        Self {
            entry: "project",
            ..Self::expand(part, columns, x, out)
        }
    }

    /// The call; skipped where no column of `gate` goes on.
    pub fn call(&self, model: &Compressed, gate: &Buffer) -> Result<Call> {
        let sizes = &model.sizes;
        let rows = match (self.entry, self.part) {
            ("expand", _) => sizes.points,
            (_, Part::Modes) => sizes.modes,
            (_, Part::Strengths) => 6 * sizes.bodies,
        };
        let (x, out) = (self.x, self.out);
        let (base, kind) = self.base.bound(x.0);
        let words = [
            rows,
            self.columns,
            x.1,
            x.2,
            out.1,
            out.2,
            base.1,
            base.2,
            usize::from(self.part == Part::Strengths),
            kind,
            self.scale.to_bits() as usize,
            0,
        ];
        let buffers = [
            ("x", x.0),
            ("base", base.0),
            ("out", out.0),
            ("going", gate),
        ];
        let shader = ("blocks", self.entry, model.context.fine());
        let count = threads(rows * self.columns);
        let all = (&model.table[..], &buffers[..]);
        model.context.call(shader, &[], &words, all, count)
    }
}
