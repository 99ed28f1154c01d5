//! Wrenches on pairs of bodies: a derivative by tasks (`shaders/pair_*.wgsl`), then summed by pair
//! (`shaders/reduce.wgsl`), in batches that the memory holds.

use crate::Result;
use crate::gpu::buffer::Buffer;
use crate::gpu::geometry::PlacedSystem;
use crate::gpu::kernel::{Call, groups, threads};
use crate::gpu::source::{Arithmetic, Constant};

/// Densities of so many columns, and the columns that are taken on the left.
pub(super) struct Densities<'a> {
    /// By face: `[μ, r, β]`, with motions `[μ, r, β, δμ, δr]`.
    pub left: &'a Buffer,
    /// By source: `[a, λ]`, with motions `[a, λ, δa, δλ]`.
    pub right: &'a Buffer,
    pub columns: usize,
    /// First, and how many: all with motions.
    pub taken: (usize, usize),
    /// Of whose displacement the tangents are wanted too.
    pub motions: Option<&'a Buffer>,
}

/// Calls, what they leave, and how many numbers that is: `[pair][taken][columns][6]`, with motions `[12]`: wrenches,
/// then their tangents.
pub(super) fn wrenches(
    placed: &PlacedSystem,
    arithmetic: Arithmetic,
    of: &Densities,
) -> Result<(Vec<Call>, Buffer, usize)> {
    let geometry = &placed.geometry;
    let (context, table) = (&geometry.context, placed.table(arithmetic));
    let (first, width) = of.taken;
    let (shader, numbers) = match of.motions {
        None => ("pair_vjp", 6),
        Some(_) => ("pair_hvp", 12),
    };
    let elements = width * of.columns * numbers;
    let count = geometry.pairs.len() * elements;
    let out = context.reals("wrenches", arithmetic, count)?;
    let batches = geometry.batches(elements * arithmetic.size());
    let widest = batches.iter().map(|b| b.tasks.len()).max().unwrap_or(0);
    let parts = context.reals("tasks of a derivative", arithmetic, widest * elements)?;
    let mut buffers = vec![("left", of.left), ("right", of.right), ("out", &parts)];
    buffers.extend(of.motions.map(|motions| ("motions", motions)));
    let mut calls = Vec::new();
    for batch in &batches {
        let (pairs, tasks) = (batch.pairs.len(), batch.tasks.len());
        calls.push(context.call(
            (shader, "main", arithmetic),
            &[("LEFT", Constant::Number(width as u32))],
            &[of.columns, first, batch.tasks.start, tasks],
            (table, &buffers),
            groups(tasks),
        )?);
        calls.push(context.call(
            ("reduce", "main", arithmetic),
            &[],
            &[pairs, elements, batch.pairs.start, batch.tasks.start],
            (table, &[("parts", &parts), ("out", &out)]),
            threads(pairs * elements),
        )?);
    }
    Ok((calls, out, count))
}
