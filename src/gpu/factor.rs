//! The bodies' own factors or inverses as a right preconditioner (`shaders/factor.wgsl`).

use super::buffer::Buffer;
use super::columns::Sum;
use super::kernel::{Call, threads};
use super::placed::PlacedSurfaces;
use super::source::{Arithmetic, Constant};
use crate::Result;

/// Rows of the bodies' sparse factors over what [`factor`] left there: L x, or Lᵀ x (`shaders/sparse.wgsl`).
pub(super) fn sparse(
    placed: &PlacedSurfaces,
    transpose: bool,
    (x, out): (&Buffer, &Buffer),
    columns: usize,
    gate: &Buffer,
) -> Result<Call> {
    let surfaces = &placed.surfaces;
    let (context, sources) = (&surfaces.context, surfaces.sizes.sources);
    let single = Arithmetic::Single;
    context.call(
        ("sparse", "main", single),
        &constants(columns, transpose),
        &[sources, 0, 0, 0],
        (
            placed.table(single),
            &[("x", x), ("out", out), ("going", gate)],
        ),
        threads(sources),
    )
}

fn constants(columns: usize, transpose: bool) -> [(&'static str, Constant); 2] {
    [
        ("COLUMNS", Constant::Number(columns as u32)),
        ("TRANSPOSE", Constant::Flag(transpose)),
    ]
}

/// `out = R⁻¹ x`, or `R⁻ᵀ x`, columns beside each other, in single precision; `parts` is memory for its shares.
pub(super) fn factor(
    placed: &PlacedSurfaces,
    transpose: bool,
    (x, parts, out): (&Buffer, &Buffer, &Buffer),
    columns: usize,
    gate: &Buffer,
) -> Result<[Call; 2]> {
    let surfaces = &placed.surfaces;
    let (context, sizes) = (&surfaces.context, &surfaces.sizes);
    let (single, shares) = (Arithmetic::Single, surfaces.factor_shares());
    let sum = Sum::new((sizes.sources, columns), (parts, shares), (out, columns, 0));
    Ok([
        context.call(
            ("factor", "main", single),
            &constants(columns, transpose),
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
