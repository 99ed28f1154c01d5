//! A stage solved with one factor of its matrix, which each step improves (Broyden's "good" update): as few evaluations as Newton's method takes, or two more, but one
//! Jacobian, which costs as much as several of them. It ends at the same solution, or gives up where it doesn't get there fast.
//!
//! # References
//! C. T. Kelley, "Solving Nonlinear Equations with Newton's Method", 2003, chapter 4.

use super::split::Split;
use super::stage_factor::StageFactor;
use crate::dynamics::Linearisation;
use nalgebra::DVector;

/// Most steps.
const STEPS: usize = 12;
/// Part of the residual that a step may leave.
const LEFT: f64 = 0.3;
/// Residual that is rounding.
const ROUNDING: f64 = 1e-15;
/// Residual at which a stage is solved whose evaluations are themselves solves, and leave about as much.
const SOLVED: f64 = 1e-12;

/// A velocity that a stage may have, with what is left of its equation.
pub(super) struct Trial {
    pub v: DVector<f64>,
    /// f(q, v, u) there.
    pub force: DVector<f64>,
    /// p̂ + h f.
    pub reached: DVector<f64>,
    pub defect: DVector<f64>,
    /// The defect's size.
    pub merit: f64,
    /// The same relative to what is balanced.
    pub residual: f64,
}

impl Trial {
    /// Whether rounding is all that is left, by the residual of the trial before it.
    pub fn converged(&self, previous: f64) -> bool {
        let residual = self.residual;
        residual <= ROUNDING || (residual <= 1e-13 && residual >= 0.25 * previous)
    }
}

/// Residual at which a stage at `e` is solved: rounding, of one by a factor.
pub(super) fn solved(e: &Linearisation) -> f64 {
    match e.scattered() {
        Some(_) => SOLVED,
        None => 0.0,
    }
}

/// Where a descent gets to.
pub(super) enum Descended {
    /// The solution.
    Solved(Trial),
    /// Nearer to it, but no longer fast.
    Nearer(Trial),
    /// Nowhere.
    Nowhere,
}

/// Towards the solution from `first` on, `factor` being that of the stage's matrix about there, and `weight` the inertia of each free velocity, as long as each step comes much nearer, but for trials of which `is_noise` says that
/// nothing more can be told; residuals up to `solved` end it at once.
pub(super) fn descend(
    split: &Split,
    weight: &DVector<f64>,
    factor: &StageFactor,
    first: &Trial,
    (is_noise, solved): (impl Fn(&Trial) -> bool, f64),
    at: impl Fn(DVector<f64>) -> crate::Result<Trial>,
) -> Descended {
    let Some(mut back) = factor.solve(&split.take(&first.defect), Some(&first.v)) else {
        return Descended::Nowhere;
    };
    // Steps made, each with its dual by the inertia.
    let mut made: Vec<[DVector<f64>; 2]> = Vec::new();
    let mut improved: Vec<DVector<f64>> = Vec::new();
    let mut nearest: Option<Trial> = None;
    for _ in 0..STEPS {
        let step = -&back;
        let from = nearest.as_ref().unwrap_or(first);
        let Ok(now) = at(&from.v + split.put(&step)) else {
            break;
        };
        let fast = now.residual <= LEFT * from.residual;
        if now.residual <= solved || now.converged(from.residual) || (!fast && is_noise(&now)) {
            return Descended::Solved(now);
        }
        if !fast {
            if now.residual < from.residual {
                nearest = Some(now);
            }
            break;
        }
        let next = factor.solve(&split.take(&now.defect), Some(&now.v));
        let now = nearest.insert(now);
        let Some(next) = next else {
            break;
        };
        back = next;
        let dual = step.component_mul(weight);
        for ([_, dual], u) in made.iter().zip(&improved) {
            let part = dual.dot(&back);
            back += part * u;
        }
        // (I + u sᵀ) with u = −z / sᵀ(z + s), by which the new inverse brings z = H F to z sᵀs / sᵀ(z + s).
        let (size, ahead) = (dual.dot(&step), dual.dot(&step) + dual.dot(&back));
        let sound = ahead > LEFT * size;
        if !sound {
            if is_noise(now) {
                return nearest.map_or(Descended::Nowhere, Descended::Solved);
            }
            break;
        }
        improved.push(-&back / ahead);
        back *= size / ahead;
        made.push([step, dual]);
    }
    nearest.map_or(Descended::Nowhere, Descended::Nearer)
}
