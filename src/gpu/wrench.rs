//! `shaders/wrench.wgsl`: wrenches on the bodies of the forces between charges.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::Call;
use super::points::{Motion, PlacedPoints};
use super::source::Constant;
use crate::Result;

/// Columns of charges, and their pulls.
#[derive(Clone, Copy)]
pub(super) struct Side<'a> {
    /// `[point][columns]`.
    pub alpha: &'a Buffer,
    /// `[point][F, D][columns]`, with a motion `[point][F, D, δF, δD][columns]`.
    pub pull: &'a Buffer,
    /// δα, read with a motion alone.
    pub change: &'a Buffer,
    pub columns: usize,
}

/// `out[body][left][right][6]`, with a motion `[12]`: wrenches about the scene's middle, then their tangents,
/// over 4π.
pub(super) fn wrench(
    context: &Context,
    placed: &PlacedPoints,
    (left, right): (Side, Side),
    motion: Option<&Motion>,
    out: &Buffer,
) -> Result<Call> {
    let model = &placed.model;
    let constants = [
        ("FADING", Constant::Flag(model.fading)),
        ("TANGENT", Constant::Flag(motion.is_some())),
    ];
    let kernel = context.kernel("wrench", "main", context.fine(), &constants)?;
    let sizes = &model.sizes;
    let words = [sizes.points, sizes.bodies, left.columns, right.columns];
    let uniform = context.uniform(&words.map(|n| n as u32));
    // Where the shader's two names for the sizes differ, this one is found first.
    let mut buffers = vec![
        ("sizes", (&uniform).into()),
        ("bodies", (&model.bodies).into()),
        ("centres", (&placed.centres).into()),
        ("alpha_left", left.alpha.into()),
        ("pull_left", left.pull.into()),
        ("change_left", left.change.into()),
        ("alpha_right", right.alpha.into()),
        ("pull_right", right.pull.into()),
        ("change_right", right.change.into()),
        ("out", out.into()),
    ];
    buffers.extend(placed.buffers(motion));
    // Without a motion nothing is read of it, but the variable may still be bound.
    buffers.push(("motions", (&placed.points).into()));
    let count = [sizes.bodies, left.columns, right.columns].map(|n| n as u32);
    context.call(&kernel, &buffers, count)
}
