//! Products with K and P of any number of columns, in passes (`shaders/apply*.wgsl`).

use crate::Result;
use crate::gpu::buffer::Buffer;
use crate::gpu::columns::{Base, Slice, Sum, passes};
use crate::gpu::geometry::{PlacedSystem, Sizes};
use crate::gpu::kernel::Call;
use crate::gpu::source::{Arithmetic, Constant};

/// Most columns of one pass over the pairs.
pub(super) const WIDE: usize = 12;

/// Which product: with K, or P.
#[derive(Clone, Copy)]
pub(super) struct Product<'a> {
    potential: bool,
    /// Faces to sources: Kᵀ, Pᵀ.
    transpose: bool,
    /// δK, δP for these motions.
    motions: Option<&'a Buffer>,
}

impl<'a> Product<'a> {
    /// Sources to faces: K, or P.
    pub const fn forward(potential: bool) -> Self {
        Self {
            potential,
            transpose: false,
            motions: None,
        }
    }

    /// Faces to sources: Kᵀ, or Pᵀ.
    pub const fn back(potential: bool) -> Self {
        Self {
            transpose: true,
            ..Self::forward(potential)
        }
    }

    /// Its tangent for these motions.
    pub fn tangent(self, motions: &'a Buffer) -> Self {
        Self {
            motions: Some(motions),
            ..self
        }
    }

    /// Rows of the result, workgroups that make them, and shares that each cuts its work into.
    pub fn sizes(&self, sizes: &Sizes) -> (usize, usize, usize) {
        let (rows, own, other) = if self.transpose {
            (sizes.sources, sizes.source_blocks, sizes.face_blocks)
        } else {
            (sizes.faces, sizes.face_blocks, sizes.source_blocks)
        };
        (rows, own, sizes.shares(own, other))
    }
}

/// Where some columns of a product go: `out[to..] = scale · product[from..from + count] + base`.
pub(super) struct To<'a> {
    pub from: usize,
    pub count: usize,
    pub out: Slice<'a>,
    pub scale: f32,
    pub base: Base<'a>,
}

impl<'a> To<'a> {
    /// All `count` columns, as they are.
    pub fn plain(count: usize, out: Slice<'a>) -> Self {
        Self {
            from: 0,
            count,
            out,
            scale: 1.0,
            base: Base::Nothing,
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
    let context = &geometry.context;
    let (rows, _, shares) = what.sizes(&geometry.sizes);
    let mut calls = Vec::new();
    for (first, width) in passes(columns, WIDE) {
        let parts = context.reals("shares of a product", arithmetic, shares * rows * width)?;
        let x = (x, stride, offset + first);
        let out = (&parts, width);
        calls.push(once(placed, arithmetic, what, x, out, &geometry.open)?);
        for t in to {
            // The columns of this pass that go there.
            let (from, end) = (t.from.max(first), (t.from + t.count).min(first + width));
            if from >= end {
                continue;
            }
            let shifted = |(b, s, o): Slice<'a>| (b, s, o + from - t.from);
            let task = Sum {
                taken: (width, from - first),
                scale: t.scale,
                base: match t.base {
                    Base::Other(base) => Base::Other(shifted(base)),
                    base => base,
                },
                ..Sum::new((rows, end - from), (&parts, shares), shifted(t.out))
            };
            calls.push(task.call(context, arithmetic, &geometry.open)?);
        }
    }
    Ok(calls)
}

/// One pass of a product, as shares `[share][row][columns]` to be summed; a product that is no tangent is skipped
/// where no column of `gate` goes on.
pub(super) fn once(
    placed: &PlacedSystem,
    arithmetic: Arithmetic,
    what: Product,
    (x, stride, offset): Slice,
    (out, columns): (&Buffer, usize),
    gate: &Buffer,
) -> Result<Call> {
    let shader = match (what.transpose, what.motions) {
        (false, None) => "apply",
        (true, None) => "apply_transpose",
        (false, Some(_)) => "apply_jvp",
        (true, Some(_)) => "apply_transpose_jvp",
    };
    let constants = [
        ("COLUMNS", Constant::Number(columns as u32)),
        ("POTENTIAL", Constant::Flag(what.potential)),
    ];
    let (_, own, shares) = what.sizes(&placed.geometry.sizes);
    let name = if what.transpose { "y" } else { "x" };
    let mut buffers = vec![(name, x), ("out", out), ("going", gate)];
    buffers.extend(what.motions.map(|motions| ("motions", motions)));
    placed.geometry.context.call(
        (shader, "main", arithmetic),
        &constants,
        &[shares, stride, offset, 0],
        (placed.table(arithmetic), &buffers),
        [own as u32, shares as u32, 1],
    )
}
