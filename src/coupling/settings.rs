//! What the coupled systems share: ranges of their bodies, what may be asked of them, limits of their
//! solvers, and the measure of their symmetry.

use super::Coupling;
use crate::adjoint::lie::Pose;
use crate::solver::Outcome;
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::ops::Range;

/// Consecutive ranges of these lengths.
pub(super) fn ranges(lengths: impl Iterator<Item = usize>) -> Vec<Range<usize>> {
    let mut at = 0;
    let range = |n| {
        at += n;
        at - n..at
    };
    lengths.map(range).collect()
}

/// Where consecutive ranges end.
pub(super) fn end(ranges: &[Range<usize>]) -> usize {
    ranges.last().map_or(0, |r| r.end)
}

/// Refuses poses and columns of twists that aren't those of the coupling's bodies.
pub(crate) fn check_asked(
    coupling: &dyn Coupling,
    poses: &[Pose],
    twists: &DMatrix<f64>,
) -> Result<()> {
    let bodies = coupling.bodies();
    if poses.len() == bodies && twists.nrows() == 6 * bodies {
        return Ok(());
    }
    Err(Error::input(
        format!("{}: poses and basis", coupling.name()),
        format!("{} poses, {} rows", poses.len(), twists.nrows()),
        format!("must be one pose and six rows for each of the {bodies} bodies"),
    ))
}

/// Whether a residual meets the tolerance; that of a recurrence may stall a little above at round-off.
pub(super) fn met(residual: f64, tolerance: f64) -> bool {
    residual <= tolerance.max(1e-13) * 1.001
}

/// An outcome that met the tolerance.
pub(super) fn converged(
    outcome: Outcome,
    tolerance: f64,
    what: impl FnOnce() -> String,
    instead: &str,
) -> Result<Outcome> {
    if met(outcome.residual, tolerance) {
        return Ok(outcome);
    }
    Err(Error::Solver {
        what: what(),
        iterations: outcome.iterations,
        residual: outcome.residual,
        tolerance,
        remedy: format!(
            "raise the tolerance, refine the meshes where bodies are close, or use the {instead}"
        ),
    })
}

/// Whether an iterative solver can work with these.
pub(super) fn check_limits(tolerance: f64, max_iterations: usize) -> Result<()> {
    if !(tolerance > 0.0 && tolerance < 1.0) {
        return Err(Error::input(
            "settings: tolerance",
            tolerance,
            "must lie between 0 and 1, e.g. 1e-8",
        ));
    }
    if max_iterations == 0 {
        return Err(Error::input(
            "settings: max_iterations",
            0,
            "must be at least 1",
        ));
    }
    Ok(())
}

/// max |M_ij − M_ji| / √(M_ii M_jj) of `raw`, M over the columns of `basis`. A column that hardly
/// moves water (a round body's spin) counts as a hundredth of the water displaced; `volume` of each
/// body in m³.
pub(super) fn asymmetry(
    raw: &DMatrix<f64>,
    basis: &DMatrix<f64>,
    volume: impl Fn(usize) -> f64,
) -> f64 {
    let displaced = |i: usize| -> f64 {
        let inertia = (0..basis.nrows() / 6).map(|b| {
            let volume = volume(b);
            let twist = basis.fixed_view::<6, 1>(6 * b, i);
            let (u, w) = (twist.fixed_rows::<3>(0), twist.fixed_rows::<3>(3));
            volume * (u.norm_squared() + volume.cbrt().powi(2) * w.norm_squared())
        });
        inertia.sum()
    };
    let diagonal = |i| raw[(i, i)].abs().max(0.01 * displaced(i));
    let diagonal: Vec<f64> = (0..basis.ncols()).map(diagonal).collect();
    let mut worst = 0.0_f64;
    for i in 0..basis.ncols() {
        for j in 0..i {
            let scale = (diagonal[i] * diagonal[j]).sqrt();
            if scale > 0.0 {
                worst = worst.max((raw[(i, j)] - raw[(j, i)]).abs() / scale);
            }
        }
    }
    worst
}
