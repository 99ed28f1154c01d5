//! `shaders/diagonal.wgsl`: the Jacobi preconditioner.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::PlacedSystem;
use super::kernel::Call;
use super::source::Arithmetic;
use crate::Result;

/// `scaling_j = 1/√(Σ_i K_ij² + D_j²)` in single precision.
pub(super) fn diagonal(context: &Context, placed: &PlacedSystem, scaling: &Buffer) -> Result<Call> {
    let arithmetic = Arithmetic::Single;
    let kernel = context.kernel("diagonal", "main", arithmetic, &[])?;
    let mut buffers = placed.buffers(arithmetic);
    buffers.extend([
        ("damping", (&placed.geometry.damping_single).into()),
        ("scaling", scaling.into()),
    ]);
    context.call(
        &kernel,
        &buffers,
        [placed.geometry.sizes.source_blocks as u32, 1, 1],
    )
}
