//! `shaders/impulse.wgsl`: body-frame impulses.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::Geometry;
use super::kernel::Call;
use super::sum::Slice;
use crate::Result;

/// `out[body][6][columns] = ½ {B̄ᵀφ + F̄ᵀμ + ρᵀa}` of every body; φ `[face][columns]`.
pub(super) fn impulse(
    context: &Context,
    geometry: &Geometry,
    phi: &Buffer,
    mu: Slice,
    a: Slice,
    (out, columns): (&Buffer, usize),
) -> Result<Call> {
    let kernel = context.kernel("impulse", "main", context.fine(), &[])?;
    let words = [columns, columns, mu.1, mu.2, a.1, a.2, 0, 0];
    let uniform = context.uniform(&words.map(|n| n as u32));
    let buffers = [
        ("face_table", (&geometry.face_table).into()),
        ("source_table", (&geometry.source_table).into()),
        ("bodies", (&geometry.bodies).into()),
        ("shapes", (&geometry.shapes).into()),
        ("phi", phi.into()),
        ("mu", mu.0.into()),
        ("a", a.0.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
    ];
    let bodies = geometry.model.bodies.len() as u32;
    context.call(&kernel, &buffers, [bodies, columns as u32, 1])
}
