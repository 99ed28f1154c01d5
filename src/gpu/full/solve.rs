//! `(KᵀK + D²) X = G` on the device (Eq. 20 and 21): conjugate gradients in single precision (`shaders/cgls.wgsl`), right
//! preconditioned, refined.

use super::geometry::PlacedSystem;
use crate::coupling::full::Preconditioner;
use crate::gpu::buffer::Buffer;
use crate::gpu::columns::{Base, Slice, Sum, passes};
use crate::gpu::factor::{factor, sparse};
use crate::gpu::kernel::Call;
use crate::gpu::products::{Product, WIDE, once};
use crate::gpu::refined::{Inner, Iterates, Limits, Solves};
use crate::gpu::source::Arithmetic;
use crate::{Error, Result};

/// Iterations of a cycle before the host first looks.
const FEW: usize = 12;
const MANY: usize = 64;

const FORWARD: Product = Product::forward(false);
const BACK: Product = Product::back(false);

/// `columns` columns of G into those of X, both by source.
///
/// # Errors
/// A device that fails, or has too little memory.
pub(super) fn solves<'a>(
    placed: &'a PlacedSystem,
    what: &'static str,
    g: Slice,
    x: Slice,
    columns: usize,
) -> Result<Solves<'a>> {
    let model = &placed.geometry.model;
    let context = &placed.surfaces.surfaces.context;
    let inner = passes(columns, WIDE).filter(|(_, width)| *width > 0);
    let inner = inner.map(|(first, width)| {
        let (g, x) = ((g.0, g.1, g.2 + first), (x.0, x.1, x.2 + first));
        Ok((cgls(placed, g, x, width)?, x))
    });
    let settings = &model.settings;
    let factored = settings.preconditioner == Preconditioner::Factors;
    let limits = Limits {
        tolerance: settings.tolerance,
        most: settings.max_iterations,
        few: match factored && !placed.geometry.diagonal && !placed.geometry.has_sparse {
            true => FEW,
            false => MANY,
        },
        what: format!(
            "{what} ({} rows, {} unknowns)",
            model.rows(),
            model.columns()
        ),
        remedy: "raise the tolerance, refine the meshes where bodies are close, use the factors as \
                 preconditioner, or the backend cpu",
    };
    Solves::new(context, limits, inner.collect::<Result<_>>()?)
}

/// The inner solve of some columns.
fn cgls(placed: &PlacedSystem, g: Slice, x: Slice, columns: usize) -> Result<Inner> {
    let (geometry, placed) = (&placed.geometry, &placed.surfaces);
    let surfaces = &placed.surfaces;
    let (context, sizes) = (&surfaces.context, &surfaces.sizes);
    let (fine, single) = (context.fine(), Arithmetic::Single);
    let n = sizes.sources;
    let vector = |label| context.reals(label, single, n * columns);
    let (p, q, along) = (vector("p")?, vector("q")?, vector("direction")?);
    let iterates = Iterates::new(context, (n, columns), p, Some(vector("s")?))?;
    let (faces, _, forward) = FORWARD.sizes(sizes);
    let (_, _, back) = BACK.sizes(sizes);
    let whole = |b| (b, columns, 0);
    let memory = |arithmetic| -> Result<[Buffer; 3]> {
        Ok([
            context.reals("shares of K x", arithmetic, forward * faces * columns)?,
            context.reals("K x", arithmetic, faces * columns)?,
            context.reals("shares of Kᵀ y", arithmetic, back * n * columns)?,
        ])
    };
    // The shares of Kᵀ K x.
    let normal = |arithmetic, memory: &[Buffer; 3], x: Slice, gate: &Buffer| {
        let [rows, y, gathered] = memory;
        let y = (y, columns, 0);
        let gather = Sum::new((faces, columns), (rows, forward), y);
        Ok::<_, Error>([
            once(placed, arithmetic, FORWARD, x, (rows, columns), gate)?,
            gather.call(context, arithmetic, gate)?,
            once(placed, arithmetic, BACK, y, (gathered, columns), gate)?,
        ])
    };
    let (memory, memory1) = (memory(fine)?, memory(single)?);
    let product = context.reals("N p", single, n * columns)?;

    // ρ = G, and later ρ = G − Kᵀ(K X) − D² X.
    let gate = &iterates.unfinished;
    let residual = |shares: usize| {
        let task = Sum {
            scale: -1.0,
            base: Base::Other(g),
            damped: (shares > 0).then_some((&geometry.damping, x)),
            ..Sum::new((n, columns), (&memory[2], shares), whole(&iterates.rho))
        };
        task.call(context, fine, gate)
    };
    let first = vec![residual(0)?];
    let mut again = Vec::from(normal(fine, &memory, x, gate)?);
    again.push(residual(back)?);
    let shares = surfaces.factor_shares();
    let parts = context.reals("shares of R⁻¹ x", single, shares * n * columns)?;
    let preconditioned = |transpose, x, out, gate| {
        let mut calls = Vec::from(factor(placed, transpose, (x, &parts, out), columns, gate)?);
        if geometry.has_sparse {
            calls.push(sparse(placed, transpose, (x, out), columns, gate)?);
        }
        Ok::<_, Error>(calls)
    };
    let lead = preconditioned(true, &iterates.shrunk, &iterates.s, gate)?;
    let active = &iterates.active;
    let direction = whole(&along);
    let damped = Sum {
        damped: Some((&geometry.damping_single, direction)),
        ..Sum::new((n, columns), (&memory1[2], back), whole(&product))
    };
    let mut iteration: Vec<Call> = preconditioned(false, &iterates.p, &along, active)?;
    iteration.extend(normal(single, &memory1, direction, active)?);
    iteration.push(damped.call(context, single, active)?);
    iteration.extend(preconditioned(true, &product, &q, active)?);
    let own = [("q", &q), ("direction", &along)];
    for (entry, groups) in [
        ("curvature", iterates.each()),
        ("advance", None),
        ("measure", iterates.each()),
        ("turn", None),
    ] {
        let shader = ("cgls", entry, single);
        iteration.push(iterates.call(context, shader, &[n, 0, 0, 0], &own, groups)?);
    }
    Ok(Inner {
        lead,
        steps: vec![iteration],
        last: Vec::new(),
        first,
        again,
        iterates,
    })
}
