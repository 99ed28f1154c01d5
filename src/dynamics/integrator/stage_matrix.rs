//! Matrix of an implicit stage, and whether its step is too long for it.

use super::plan::MOST;
use super::rule::Rule;
use super::split::Split;
use crate::adjoint::solve::Definite;
use crate::dynamics::Linearisation;
use crate::dynamics::island_matrix::IslandMatrix;
use crate::dynamics::slopes::columns;
use crate::solver::{growth, scaled_by};
use nalgebra::{DMatrix, DVector};

/// Largest part by which the inertia may change in the time of a stage.
const CHANGE: f64 = 0.25;

/// Matrix of the stage, from the inertia, ∂f/∂v and the momentum p̂ + h f.
pub(super) fn stage_matrix(
    e: &Linearisation,
    inertia: &IslandMatrix,
    v: &DVector<f64>,
    rates: &IslandMatrix,
    reached: &DVector<f64>,
    rule: Rule,
) -> IslandMatrix {
    let tree = &e.system.tree;
    let xi = rule.reach * v;
    let [_, by_xi, by_hat] = tree.chart_momentum_slopes(&e.q, &xi, reached);
    let impulses = rates.mapped(|rates| columns(rates, |rate| rule.impulse(e, rate)));
    let mut m = inertia.minus(&impulses.mapped(|impulses| by_hat.times(impulses)));
    if rule.reach != 0.0 {
        m.subtract(by_xi.entries().map(|(i, j, x)| (i, j, rule.reach * x)));
    }
    m
}

/// How many times too long a step is for its implicit stage; none where it isn't.
///
/// With W = h ∂f/∂v on the free rows, the stage's matrix is M − W but for what turning adds, and κ the largest real part of the eigenvalues of
/// M⁻¹ W: the part by which the inertia M changes in the time h of what moves relative to the water, less what damps. In one coordinate it is
/// h v M′/M, and there is no solution from κ = ½ on. The largest eigenvalue of M^-½ ½(W + Wᵀ) M^-½ is no smaller: up to ¼ a factor of ¼ M − ½(W + Wᵀ) is all that it takes, n³/3 operations of each
/// island.
pub(super) fn excess(
    e: &Linearisation,
    split: &Split,
    v: &DVector<f64>,
    rates: &IslandMatrix,
    rule: Rule,
) -> Option<usize> {
    if rates.is_zero() {
        return None;
    }
    let xi = rule.reach * v;
    let (tree, drift) = (&e.system.tree, &e.system.drift);
    let [_, _, by_hat] = tree.chart_momentum_slopes(&e.q, &xi, &DVector::zeros(v.len()));
    let mut grown = rates.mapped(|rates| columns(rates, |rate| rule.impulse(e, rate)));
    let inertia = e.mass_blocks();
    if !drift.is_none() {
        let turned = |m: &DVector<f64>| rule.h * drift.turn(&e.frame_dual(m));
        grown = grown.minus(&inertia.mapped(|m| columns(m, turned)));
    }
    let grown = grown.mapped(|grown| by_hat.times(grown));
    let blocks = grown.free_blocks(&split.free);
    let blocks = blocks.zip(inertia.free_blocks(&split.free));
    let each = blocks.filter_map(|((_, grown), (_, m))| own_excess(grown, m));
    each.max()
}

/// The same of the velocities of an island.
fn own_excess(grown: DMatrix<f64>, m: DMatrix<f64>) -> Option<usize> {
    let even = 0.5 * (&grown + grown.transpose());
    if grown.is_empty() || Definite::new(CHANGE * &m - even).is_some() {
        return None;
    }
    let lower = m.cholesky()?.unpack();
    let change = match scaled_by(&lower, &grown) {
        Some(scaled) => growth(scaled),
        None => f64::INFINITY,
    };
    (change > CHANGE).then(|| (change / CHANGE).ceil().clamp(2.0, MOST as f64) as usize)
}
