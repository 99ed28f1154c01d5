//! Wrenches on pairs of bodies: a derivative by tasks, then summed by pair, in batches that the memory holds.

use crate::Result;
use crate::gpu::buffer::Buffer;
use crate::gpu::geometry::{PairBatch, PlacedSystem};
use crate::gpu::kernel::Call;
use crate::gpu::pair_hvp::pair_hvp;
use crate::gpu::pair_vjp::pair_vjp;
use crate::gpu::reduce::reduce;
use crate::gpu::source::Arithmetic;

/// Densities on the left, by face, and on the right, by source, of so many columns.
pub(super) struct Densities<'a> {
    pub left: &'a Buffer,
    pub right: &'a Buffer,
    pub columns: usize,
}

/// Calls, what they leave, and how many numbers that is.
pub(super) type Wrenches = (Vec<Call>, Buffer, usize);

/// `[pair][width][columns][6]` for the columns `first..first + width` on the left.
pub(super) fn pairs_vjp(
    placed: &PlacedSystem,
    arithmetic: Arithmetic,
    of: &Densities,
    (first, width): (usize, usize),
) -> Result<Wrenches> {
    summed(
        placed,
        arithmetic,
        width * of.columns * 6,
        |batch, parts| {
            pair_vjp(
                arithmetic,
                placed,
                (of.left, of.right),
                of.columns,
                (first, width),
                &batch.tasks,
                parts,
            )
        },
    )
}

/// `[pair][columns][columns][12]`: wrenches and their tangents.
pub(super) fn pairs_hvp(
    placed: &PlacedSystem,
    arithmetic: Arithmetic,
    of: &Densities,
    motions: &Buffer,
) -> Result<Wrenches> {
    summed(
        placed,
        arithmetic,
        of.columns * of.columns * 12,
        |batch, parts| {
            pair_hvp(
                arithmetic,
                placed,
                (of.left, of.right),
                of.columns,
                motions,
                &batch.tasks,
                parts,
            )
        },
    )
}

fn summed(
    placed: &PlacedSystem,
    arithmetic: Arithmetic,
    elements: usize,
    part: impl Fn(&PairBatch, &Buffer) -> Result<Call>,
) -> Result<Wrenches> {
    let geometry = &placed.geometry;
    let context = &geometry.context;
    let count = geometry.pairs.len() * elements;
    let out = context.reals("wrenches", arithmetic, count)?;
    let batches = geometry.batches(elements * arithmetic.size());
    let widest = batches.iter().map(|b| b.tasks.len()).max().unwrap_or(0);
    let parts = context.reals("tasks of a derivative", arithmetic, widest * elements)?;
    let mut calls = Vec::new();
    for batch in &batches {
        calls.push(part(batch, &parts)?);
        calls.push(reduce(
            context,
            arithmetic,
            &parts,
            &geometry.ranges,
            batch,
            elements,
            &out,
        )?);
    }
    Ok((calls, out, count))
}
