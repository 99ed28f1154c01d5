//! Products with K and P, or the double and single layers of panels, of any number of columns, in passes (`shaders/apply*.wgsl`).

use super::buffer::Buffer;
use super::columns::{Base, Slice, Sum, passes};
use super::kernel::Call;
use super::placed::PlacedSurfaces;
use super::source::{Arithmetic, Constant};
use super::surfaces::Sizes;
use crate::Result;

/// Most columns of one pass over the pairs.
pub(super) const WIDE: usize = 12;

/// Which product: with K, or P. Of panels K is A, the double layer with ½ of every panel itself, and P is S, the single layer between
/// bodies; their sources are the centroids, so that both are transposed.
#[derive(Clone, Copy)]
pub(super) struct Product<'a> {
    potential: bool,
    /// Faces to sources: Kᵀ, Pᵀ.
    transpose: bool,
    /// δK, δP for these motions.
    motions: Option<&'a Buffer>,
    /// Whether bodies don't see themselves but by images.
    apart: bool,
}

impl<'a> Product<'a> {
    /// Sources to faces: K, or P.
    pub const fn forward(potential: bool) -> Self {
        Self {
            potential,
            transpose: false,
            motions: None,
            apart: false,
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

    /// Without what bodies see of themselves.
    pub const fn apart(self) -> Self {
        Self {
            apart: true,
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
    placed: &PlacedSurfaces,
    arithmetic: Arithmetic,
    what: Product,
    (x, stride, offset): Slice,
    columns: usize,
    to: &[To<'a>],
) -> Result<Vec<Call>> {
    let surfaces = &placed.surfaces;
    let context = &surfaces.context;
    let (rows, _, shares) = what.sizes(&surfaces.sizes);
    let mut calls = Vec::new();
    for (first, width) in passes(columns, WIDE) {
        let parts = context.reals("shares of a product", arithmetic, shares * rows * width)?;
        let x = (x, stride, offset + first);
        let out = (&parts, width);
        calls.push(once(placed, arithmetic, what, x, out, &surfaces.open)?);
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
            calls.push(task.call(context, arithmetic, &surfaces.open)?);
        }
    }
    Ok(calls)
}

/// One pass of a product, as shares `[share][row][columns]` to be summed; a product that is no tangent is skipped
/// where no column of `gate` goes on.
pub(super) fn once(
    placed: &PlacedSurfaces,
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
        ("SURFACE", Constant::Surface(placed.surfaces.surface)),
    ];
    let (_, own, shares) = what.sizes(&placed.surfaces.sizes);
    let name = if what.transpose { "y" } else { "x" };
    let mut buffers = vec![(name, x), ("out", out), ("going", gate)];
    buffers.extend(what.motions.map(|motions| ("motions", motions)));
    if what.apart {
        buffers.push(("relations", &placed.surfaces.apart));
    }
    placed.surfaces.context.call(
        (shader, "main", arithmetic),
        &constants,
        &[shares, stride, offset, 0],
        (placed.table(arithmetic), &buffers),
        [own as u32, shares as u32, 1],
    )
}
