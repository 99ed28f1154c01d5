//! Wrenches on pairs of bodies: a derivative by tasks (`shaders/{pair,panel}_*.wgsl`), then summed by pair
//! (`shaders/reduce.wgsl`), in batches that the memory holds; and what they are of the energy.

use super::buffer::Buffer;
use super::columns::passes;
use super::kernel::{Call, groups, threads};
use super::placed::PlacedSurfaces;
use super::source::{Arithmetic, Constant, Surface};
use super::units::spatial;
use crate::Result;
use crate::adjoint::lie::{Vec6, cross_force};
use crate::coupling::PairTensor;

/// Columns on the left of one pass of a derivative.
const LEFT: usize = 4;

/// Densities of so many columns, and the columns that are taken on the left.
#[derive(Clone, Copy)]
pub(super) struct Densities<'a> {
    /// By face: `[μ, r, β]`, with motions `[μ, r, β, δμ, δr]`; of panels `[φ, q]` and `[φ, q, δφ]`.
    pub left: &'a Buffer,
    /// By source: `[a, λ]`, with motions `[a, λ, δa, δλ]`; of centroids `[μ]` and `[μ, δμ]`.
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
    placed: &PlacedSurfaces,
    arithmetic: Arithmetic,
    of: &Densities,
) -> Result<(Vec<Call>, Buffer, usize)> {
    let surfaces = &placed.surfaces;
    let (context, table) = (&surfaces.context, placed.table(arithmetic));
    let (first, width) = of.taken;
    let shader = match (surfaces.surface, of.motions) {
        (Surface::Faces, None) => "pair_vjp",
        (Surface::Faces, Some(_)) => "pair_hvp",
        (Surface::Panels, None) => "panel_vjp",
        (Surface::Panels, Some(_)) => "panel_hvp",
    };
    let numbers = of.motions.map_or(6, |_| 12);
    let elements = width * of.columns * numbers;
    let count = surfaces.pairs.len() * elements;
    let out = context.reals("wrenches", arithmetic, count)?;
    let batches = surfaces.batches(elements * arithmetic.size());
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

/// ∇_g E of all pairs of columns, from `[left, right]` densities; `scale` is what each column is in units of.
///
/// # Errors
/// A device that fails.
pub(super) fn tensor(
    placed: &PlacedSurfaces,
    [left, right]: [&Buffer; 2],
    scale: &[f64],
) -> Result<PairTensor> {
    let k = scale.len();
    let surfaces = &placed.surfaces;
    let (context, fine) = (&surfaces.context, surfaces.context.fine());
    let mut out = PairTensor::zeros(surfaces.sizes.bodies, k);
    if k == 0 || surfaces.pairs.is_empty() {
        return Ok(out);
    }
    // W(x, y) of every pair, x in passes.
    let shares: Vec<(usize, usize)> = passes(k, LEFT).collect();
    let mut outs = Vec::new();
    for share in &shares {
        let of = Densities {
            left,
            right,
            columns: k,
            taken: *share,
            motions: None,
        };
        let (calls, out, count) = wrenches(placed, fine, &of)?;
        context.submit(&calls)?;
        outs.push((out, count));
    }
    let wanted: Vec<(&Buffer, usize)> = outs.iter().map(|(out, n)| (out, *n)).collect();
    let values = context.read(fine, &wanted)?;
    let place: Vec<(usize, usize, usize)> = (shares.iter().enumerate())
        .flat_map(|(p, (_, width))| (0..*width).map(move |x| (p, x, *width)))
        .collect();
    for (number, pair) in surfaces.pairs.iter().enumerate() {
        let raw = |x: usize, y: usize| {
            let (share, x_there, width) = place[x];
            let at = ((number * width + x_there) * k + y) * 6;
            let wrench = &values[share][at..at + 6];
            spatial(surfaces.length, &placed.middle, wrench, scale[x] * scale[y])
        };
        let image = &surfaces.images[pair.image];
        for x in 0..k {
            for y in 0..=x {
                let world = 0.5 * (raw(x, y) + raw(y, x));
                out.add(pair.source, (x, y), &image.twist_vjp(&world));
                out.add(pair.target, (x, y), &-world);
            }
        }
    }
    Ok(out)
}

/// ∇_g E of the first column with the last and its rate along z, from what [`wrenches`] leaves with motions.
pub(super) fn tangent(
    placed: &PlacedSurfaces,
    z: &[Vec6],
    wrenches: &[f64],
    scale: &[f64],
) -> [Vec<Vec6>; 2] {
    let (surfaces, n) = (&placed.surfaces, scale.len());
    let unit = scale[0] * scale[n - 1];
    let mut gradient = vec![Vec6::zeros(); surfaces.sizes.bodies];
    let mut rate = gradient.clone();
    for (number, pair) in surfaces.pairs.iter().enumerate() {
        let at = |x: usize, y: usize, part: usize| {
            let from = ((number * n + x) * n + y) * 12 + 6 * part;
            let wrench = &wrenches[from..from + 6];
            spatial(surfaces.length, &placed.middle, wrench, unit)
        };
        // The symmetrised form.
        let of = |part| 0.5 * (at(0, n - 1, part) + at(n - 1, 0, part));
        let world = of(0);
        // The pair's wrench turns with the faces that it was taken against.
        let turned = of(1) + cross_force(&z[pair.target], &world);
        let image = &surfaces.images[pair.image];
        gradient[pair.source] += image.twist_vjp(&world);
        gradient[pair.target] -= world;
        rate[pair.source] += image.twist_vjp(&turned);
        rate[pair.target] -= turned;
    }
    [gradient, rate]
}
