//! `shaders/blocks.wgsl`: products with the bodies' dense blocks [L, Ū].

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::{Call, threads};
use super::points::Compressed;
use super::sum::{Base, Slice};
use crate::Result;

/// Which part of a block.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// L: by modes of all bodies.
    Modes,
    /// Ū: by six components of every body's twist.
    Strengths,
}

/// `out = base + scale · block · x`, or with the block's transpose.
pub(super) struct Blocks<'a> {
    pub part: Part,
    pub columns: usize,
    pub x: Slice<'a>,
    pub out: Slice<'a>,
    pub scale: f32,
    pub base: Base<'a>,
}

/// From coefficients to points (`expand`), or from points to coefficients; skipped where no column of `gate` goes
/// on.
pub(super) fn blocks(
    context: &Context,
    model: &Compressed,
    expand: bool,
    task: &Blocks,
    gate: &Buffer,
) -> Result<Call> {
    let entry = if expand { "expand" } else { "project" };
    let kernel = context.kernel("blocks", entry, context.fine(), &[])?;
    let sizes = &model.sizes;
    let rows = match (expand, task.part) {
        (true, _) => sizes.points,
        (false, Part::Modes) => sizes.modes,
        (false, Part::Strengths) => 6 * sizes.bodies,
    };
    // A variable that isn't read still has to be bound, to something that isn't written.
    let (base, kind) = match task.base {
        Base::Nothing => ((task.x.0, 0, 0), 0),
        Base::Other(slice) => (slice, 1),
        Base::Out => ((task.x.0, 0, 0), 2),
    };
    let mut words: Vec<u32> = [
        rows,
        task.columns,
        task.x.1,
        task.x.2,
        task.out.1,
        task.out.2,
        base.1,
        base.2,
        usize::from(task.part == Part::Strengths),
        kind,
    ]
    .map(|n| n as u32)
    .to_vec();
    words.extend([task.scale.to_bits(), 0]);
    let uniform = context.uniform(&words);
    let buffers = [
        ("table", (&model.table).into()),
        ("bodies", (&model.bodies).into()),
        ("shapes", (&model.shapes).into()),
        ("owners", (&model.owners).into()),
        ("mode_owners", (&model.mode_owners).into()),
        ("x", task.x.0.into()),
        ("base", base.0.into()),
        ("out", task.out.0.into()),
        ("task", (&uniform).into()),
        ("going", gate.into()),
    ];
    context.call(&kernel, &buffers, threads(rows * task.columns))
}
