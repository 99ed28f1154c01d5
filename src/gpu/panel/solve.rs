//! `A φ = b` and `Aᵀ μ = g` on the device: GMRES in single precision (`shaders/gmres.wgsl`), preconditioned by each body's own inverse
//! (block Jacobi: no body waits for another), refined.

use super::geometry::PlacedPanels;
use crate::Result;
use crate::gpu::columns::{Base, Slice, Sum, passes};
use crate::gpu::factor::factor;
use crate::gpu::kernel::Call;
use crate::gpu::products::{Product, WIDE, once};
use crate::gpu::refined::{Inner, Iterates, Limits, Solves};
use crate::gpu::source::Arithmetic;

/// Iterations of a cycle before the host first looks.
const FEW: usize = 12;
/// The most of a cycle: vectors that it keeps.
const MOST: usize = 24;

/// Columns of right-hand sides, and where their solutions go.
#[derive(Clone, Copy)]
pub(super) struct System<'a> {
    /// With Aᵀ.
    pub transpose: bool,
    pub given: Slice<'a>,
    pub solution: Slice<'a>,
}

/// So many columns of each system.
///
/// # Errors
/// A device that fails, or has too little memory.
pub(super) fn solves<'a>(
    placed: &'a PlacedPanels,
    what: &str,
    systems: [System; 2],
    columns: usize,
) -> Result<Solves<'a>> {
    let model = &placed.geometry.model;
    let mut inner = Vec::new();
    for system in systems {
        for (first, width) in passes(columns, WIDE).filter(|(_, width)| *width > 0) {
            let from = |s: (_, usize, usize)| (s.0, s.1, s.2 + first);
            let part = System {
                given: from(system.given),
                solution: from(system.solution),
                ..system
            };
            inner.push((gmres(placed, part, width)?, part.solution));
        }
    }
    let limits = Limits {
        tolerance: model.settings.tolerance,
        most: model.settings.max_iterations,
        few: FEW,
        what: format!("{what} ({} panels)", model.rows()),
        remedy: "raise the tolerance, refine the meshes where bodies are close, or use the backend cpu",
    };
    Solves::new(&placed.geometry.surfaces.context, limits, inner)
}

/// The inner solve of some columns: `A M⁻¹ v = v + O M⁻¹ v`, O what different bodies and images make.
fn gmres(placed: &PlacedPanels, system: System, columns: usize) -> Result<Inner> {
    let placed = &placed.surfaces;
    let surfaces = &placed.surfaces;
    let (context, sizes) = (&surfaces.context, &surfaces.sizes);
    let (fine, single) = (context.fine(), Arithmetic::Single);
    // From panels to centroids, or back: there are as many.
    let what = match system.transpose {
        false => Product::back(false),
        true => Product::forward(false),
    };
    let (n, _, shares) = what.sizes(sizes);
    let vectors = |label, count| context.reals(label, single, count * n * columns);
    let (v, q, direction) = (vectors("v", 1)?, vectors("q", 1)?, vectors("direction", 1)?);
    let basis = vectors("basis", MOST)?;
    let numbers = |label, count| context.zeros(label, single, count * columns);
    let own = [
        ("basis", &basis),
        ("q", &q),
        ("dots", &numbers("dots", MOST + 1)?),
        ("triangle", &numbers("triangle", MOST * MOST)?),
        ("rotations", &numbers("rotations", 2 * MOST)?),
        ("right", &numbers("right", MOST + 1)?),
        ("spans", &context.upload_words("spans", &vec![0; columns])?),
    ];
    let iterates = Iterates::new(context, (n, columns), v.clone(), None)?;
    let (unfinished, active) = (&iterates.unfinished, &iterates.active);
    let whole = |b| (b, columns, 0);

    // ρ = b, and later ρ = b − A x.
    let image = context.reals("shares of A x", fine, shares * n * columns)?;
    let residual = |shares: usize| {
        let task = Sum {
            scale: -1.0,
            base: Base::Other(system.given),
            ..Sum::new((n, columns), (&image, shares), whole(&iterates.rho))
        };
        task.call(context, fine, unfinished)
    };
    let first = vec![residual(0)?];
    let applied = (&image, columns);
    let again = vec![
        once(placed, fine, what, system.solution, applied, unfinished)?,
        residual(shares)?,
    ];

    let room = surfaces.factor_shares() * n * columns;
    let parts = context.reals("shares of M⁻¹ v", single, room)?;
    let others = context.reals("shares of O v", single, shares * n * columns)?;
    let own_inverse =
        |x, out, gate| factor(placed, system.transpose, (x, &parts, out), columns, gate);
    let sum = Sum {
        base: Base::Other(whole(&v)),
        ..Sum::new((n, columns), (&others, shares), whole(&q))
    };
    let entry = |entry, step: usize, groups| {
        let words = [n, step, MOST, 0];
        iterates.call(context, ("gmres", entry, single), &words, &own, groups)
    };
    let step = |step: usize| -> Result<Vec<Call>> {
        let mut out = Vec::new();
        if step == 0 {
            out.push(entry("begin", 0, None)?);
        }
        out.extend(own_inverse(&v, &direction, active)?);
        let (from, to) = (whole(&direction), (&others, columns));
        out.push(once(placed, single, what.apart(), from, to, active)?);
        out.push(sum.call(context, single, active)?);
        let pairs = Some([columns as u32, step as u32 + 1, 1]);
        out.push(entry("project", step, pairs)?);
        out.push(entry("subtract", step, None)?);
        out.push(entry("measure", step, iterates.each())?);
        out.push(entry("extend", step, None)?);
        Ok(out)
    };
    let steps = (0..MOST).map(step).collect::<Result<_>>()?;
    let mut last = vec![entry("solve", 0, Some([1, 1, 1]))?];
    let gathered = [&own[..], &[("x", &direction)]].concat();
    let shader = ("gmres", "gather", single);
    last.push(iterates.call(context, shader, &[n, 0, MOST, 0], &gathered, None)?);
    last.extend(own_inverse(&direction, &iterates.x, unfinished)?);
    Ok(Inner {
        lead: Vec::new(),
        iterates,
        first,
        again,
        steps,
        last,
    })
}
