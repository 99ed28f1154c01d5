//! Products with K and P of any number of columns, in passes.

use crate::Result;
use crate::gpu::apply::apply;
use crate::gpu::apply_jvp::apply_jvp;
use crate::gpu::apply_transpose::apply_transpose;
use crate::gpu::apply_transpose_jvp::apply_transpose_jvp;
use crate::gpu::buffer::Buffer;
use crate::gpu::geometry::PlacedSystem;
use crate::gpu::kernel::Call;
use crate::gpu::share::passes;
use crate::gpu::source::Arithmetic;
use crate::gpu::sum::{Base, Slice, Sum, sum};

/// Most columns of one pass over the pairs.
pub(super) const WIDE: usize = 12;

/// Which product.
#[derive(Clone, Copy)]
pub(super) enum Product<'a> {
    /// Sources to faces: K, or P.
    Forward { potential: bool },
    /// Faces to sources: Kᵀ, or Pᵀ.
    Transpose { potential: bool },
    /// δK, or δP, for these motions.
    ForwardTangent {
        potential: bool,
        motions: &'a Buffer,
    },
    /// δKᵀ, or δPᵀ.
    TransposeTangent {
        potential: bool,
        motions: &'a Buffer,
    },
}

/// Where some columns of a product go: `out[to..] = scale · product[from..from + count] (+ out)`.
pub(super) struct To<'a> {
    pub from: usize,
    pub count: usize,
    pub out: Slice<'a>,
    pub scale: f32,
    pub base: Option<Slice<'a>>,
    /// Whether it is added to what is there.
    pub accumulate: bool,
}

impl<'a> To<'a> {
    /// All `count` columns, as they are.
    pub fn plain(count: usize, out: Slice<'a>) -> Self {
        Self {
            from: 0,
            count,
            out,
            scale: 1.0,
            base: None,
            accumulate: false,
        }
    }
}

/// The calls of a product of `columns` columns of `x`, with the memory that they use.
pub(super) fn product<'a>(
    placed: &PlacedSystem,
    arithmetic: Arithmetic,
    what: Product,
    (x, stride, offset): Slice,
    columns: usize,
    to: &[To<'a>],
) -> Result<Vec<Call>> {
    let geometry = &placed.geometry;
    let (context, sizes) = (&geometry.context, &geometry.sizes);
    let (rows, own, other) = match what {
        Product::Forward { .. } | Product::ForwardTangent { .. } => {
            (sizes.faces, sizes.face_blocks, sizes.source_blocks)
        }
        _ => (sizes.sources, sizes.source_blocks, sizes.face_blocks),
    };
    let shares = sizes.shares(own, other);
    let mut calls = Vec::new();
    for (first, width) in passes(columns, WIDE) {
        let parts = context.reals("shares of a product", arithmetic, shares * rows * width)?;
        let x = (x, stride, offset + first);
        calls.push(once(
            placed,
            arithmetic,
            what,
            x,
            (&parts, width),
            &geometry.open,
        )?);
        for t in to {
            // The columns of this pass that go there.
            let (from, end) = (t.from.max(first), (t.from + t.count).min(first + width));
            if from >= end {
                continue;
            }
            let shifted = |(b, s, o): Slice<'a>| (b, s, o + from - t.from);
            let base = match (t.base, t.accumulate) {
                (Some(base), _) => Base::Other(shifted(base)),
                (None, true) => Base::Out,
                (None, false) => Base::Nothing,
            };
            let task = Sum {
                rows,
                columns: end - from,
                parts: (&parts, shares, width, from - first),
                scale: t.scale,
                base,
                damped: None,
                out: shifted(t.out),
            };
            calls.push(sum(context, arithmetic, &task, &geometry.open)?);
        }
    }
    Ok(calls)
}

/// One pass of a product, as shares.
pub(super) fn once(
    placed: &PlacedSystem,
    arithmetic: Arithmetic,
    what: Product,
    x: Slice,
    out: (&Buffer, usize),
    gate: &Buffer,
) -> Result<Call> {
    let context = &placed.geometry.context;
    match what {
        Product::Forward { potential } => {
            apply(context, arithmetic, placed, potential, x, out, gate)
        }
        Product::Transpose { potential } => {
            apply_transpose(context, arithmetic, placed, potential, x, out, gate)
        }
        Product::ForwardTangent { potential, motions } => {
            apply_jvp(context, arithmetic, placed, potential, x, out, motions)
        }
        Product::TransposeTangent { potential, motions } => {
            apply_transpose_jvp(context, arithmetic, placed, potential, x, out, motions)
        }
    }
}
