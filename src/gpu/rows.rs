//! What twists ask for on faces, and what is read out of densities there (`shaders/{rows,impulse}.wgsl`).

use super::buffer::Buffer;
use super::columns::Slice;
use super::context::Context;
use super::kernel::{Call, threads};
use super::surfaces::{Rows, Surfaces};
use crate::Result;

/// `out (+)= table · twists`, six numbers of the table's rows from `first` on, twists `[body][6][columns]`: what twists ask for on
/// every face, or read out of every source.
pub(super) fn rows(
    context: &Context,
    (table, first): (&Rows, usize),
    (twists, columns): (&Buffer, usize),
    (out, stride, offset): Slice,
    accumulate: bool,
) -> Result<Call> {
    let words = [
        table.rows,
        columns,
        table.width,
        first,
        stride,
        offset,
        usize::from(accumulate),
        0,
    ];
    let buffers = [
        ("table", &table.table),
        ("map", &table.map),
        ("twists", twists),
        ("out", out),
    ];
    let shader = ("rows", "main", context.fine());
    let count = threads(table.rows * columns);
    context.call(shader, &[], &words, (&[], &buffers), count)
}

/// `out[body][6][columns] = ½ {B̄ᵀφ + F̄ᵀμ + ρᵀa}` of every body: F̄ and B̄ are the rows of the faces, ρ those of the sources.
pub(super) fn impulse(
    surfaces: &Surfaces,
    phi: Slice,
    mu: Slice,
    a: Slice,
    (out, columns): (&Buffer, usize),
) -> Result<Call> {
    let shader = ("impulse", "main", surfaces.context.fine());
    let words = [columns, phi.1, phi.2, mu.1, mu.2, a.1, a.2, 0];
    let buffers = [("phi", phi.0), ("mu", mu.0), ("a", a.0), ("out", out)];
    let count = [surfaces.sizes.bodies as u32, columns as u32, 1];
    let all = (&surfaces.table[..], &buffers[..]);
    surfaces.context.call(shader, &[], &words, all, count)
}
