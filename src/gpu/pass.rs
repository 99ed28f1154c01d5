//! A pass over all pairs of faces and sources: what the products with K and P, and their tangents, share.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::PlacedSystem;
use super::kernel::{Bound, Call};
use super::source::{Arithmetic, Constant};
use super::sum::Slice;
use crate::Result;

/// The side whose blocks have a workgroup each; every one goes over the other's.
#[derive(Clone, Copy)]
pub(super) enum Side {
    Faces,
    Sources,
}

/// One of the four products.
pub(super) struct Pass<'a> {
    pub shader: &'static str,
    pub side: Side,
    /// For P.
    pub potential: bool,
    /// The shader's name of what it multiplies.
    pub name: &'static str,
    /// What else it reads: motions, or the gate.
    pub beside: (&'static str, &'a Buffer),
}

/// The call of a product with some columns, as shares `[share][row][columns]` to be summed.
pub(super) fn pass(
    context: &Context,
    arithmetic: Arithmetic,
    placed: &PlacedSystem,
    what: &Pass,
    (x, stride, offset): Slice,
    (out, columns): (&Buffer, usize),
) -> Result<Call> {
    let constants = [
        ("COLUMNS", Constant::Number(columns as u32)),
        ("POTENTIAL", Constant::Flag(what.potential)),
    ];
    let kernel = context.kernel(what.shader, "main", arithmetic, &constants)?;
    let sizes = &placed.geometry.sizes;
    let (own, other) = match what.side {
        Side::Faces => (sizes.face_blocks, sizes.source_blocks),
        Side::Sources => (sizes.source_blocks, sizes.face_blocks),
    };
    let shares = sizes.shares(own, other);
    let uniform = context.uniform(&[shares, stride, offset, 0].map(|n| n as u32));
    let beside: Bound = what.beside.1.into();
    let mut buffers = placed.buffers(arithmetic);
    buffers.extend([
        (what.name, x.into()),
        ("out", out.into()),
        ("task", (&uniform).into()),
        (what.beside.0, beside),
    ]);
    context.call(&kernel, &buffers, [own as u32, shares as u32, 1])
}
