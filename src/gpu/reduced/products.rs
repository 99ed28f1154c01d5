//! Products with G, and what is summed with it, of any number of columns in passes.

use crate::Result;
use crate::gpu::buffer::Buffer;
use crate::gpu::coulomb::coulomb;
use crate::gpu::coulomb_jvp::coulomb_jvp;
use crate::gpu::coulomb_vjp::coulomb_vjp;
use crate::gpu::kernel::Call;
use crate::gpu::points::{Motion, PlacedPoints};
use crate::gpu::share::passes;
use crate::gpu::sum::{Base, Slice, Sum, sum};

/// Most columns of one pass of potentials.
const WIDE: usize = 12;
/// Of pulls, which are vectors.
const NARROW: usize = 6;

/// Which product.
#[derive(Clone, Copy)]
pub(super) enum Product<'a> {
    /// G x.
    Potential,
    /// δG x.
    Tangent(&'a Motion),
    /// The pulls, `[point][F, D][columns]`.
    Pull,
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
    let (context, sizes) = (&model.context, &model.sizes);
    let fine = context.fine();
    let (rows, most) = match what {
        Product::Pull => (sizes.points * model.pull(), NARROW),
        _ => (sizes.points, WIDE),
    };
    let shares = sizes.shares();
    let widest = columns.min(most);
    // Passes follow one another: they can share it.
    let parts = context.reals("shares of a product", fine, shares * rows * widest)?;
    let mut calls = Vec::new();
    for (first, width) in passes(columns, most).filter(|(_, width)| *width > 0) {
        let x = (x, stride, offset + first);
        let to = (&parts, width);
        calls.push(match what {
            Product::Potential => coulomb(context, placed, x, to, gate)?,
            Product::Tangent(motion) => coulomb_jvp(context, placed, motion, x, to)?,
            Product::Pull => coulomb_vjp(context, placed, x, to)?,
        });
        let task = Sum {
            rows,
            columns: width,
            parts: (&parts, shares, width, 0),
            scale: 1.0,
            base: Base::Nothing,
            damped: None,
            out: (out, out_stride, out_offset + first),
        };
        calls.push(sum(context, fine, &task, gate)?);
    }
    Ok(calls)
}
