//! Momentum Euler, implicit in p at fixed q:
//! p̂⁺ = p̂ + Δt f(q, v, u), M(q) v + p_rest = Xᵀ p̂⁺, q⁺ = q ⊕ Δt v.
//!
//! The stage is solved by Newton's method with the exact ∂f/∂v; its adjoint is the implicit function theorem at
//! the converged stage, with the transpose of the same matrix.

use super::{Input, Memo, Split, State, StateBar, StepBar, Stepped, Stepper, When};
use crate::dynamics::Evaluation;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector, Dyn, LU};

/// Most Newton iterations of a stage; quadratic convergence needs four or five.
const ITERATIONS: usize = 40;

/// A converged stage.
pub(super) struct Stage {
    /// Its velocity.
    pub v: DVector<f64>,
    /// f(q, v, u) there.
    pub force: DVector<f64>,
}

/// Matrix of the stage, (M − h Xᵀ ∂f/∂v)_ff, from ∂f/∂v.
fn stage_matrix(e: &Evaluation, split: &Split, rates: &DMatrix<f64>, h: f64) -> DMatrix<f64> {
    let mut m = e.mass_matrix.clone();
    for k in 0..rates.ncols() {
        let column = e.user_momentum(&rates.column(k).into_owned());
        let mut target = m.column_mut(k);
        target -= h * column;
    }
    split.block(&m)
}

/// Solves `M v + p_rest = Xᵀ (p̂ + h f(q, v, u))` on the free rows, from the guess `v`.
pub(super) fn solve_stage(
    e: &Evaluation,
    split: &Split,
    hat: &DVector<f64>,
    control: &DVector<f64>,
    h: f64,
    guess: &DVector<f64>,
    what: &dyn Fn() -> String,
) -> Result<Stage> {
    let mut v = &split.driven + split.put(&split.take(guess));
    let scale = split
        .block(&e.mass_matrix)
        .diagonal()
        .map(|d| 1.0 / d.max(f64::MIN_POSITIVE).sqrt());
    let sized = |p: &DVector<f64>| split.take(p).component_mul(&scale).norm();
    let start = sized(&e.user_momentum(hat));
    let mut previous = f64::INFINITY;
    let mut residual = f64::INFINITY;
    for iteration in 0..ITERATIONS {
        let force = e.force(&v, control);
        let target = e.user_momentum(&(hat + h * &force));
        let momentum = e.momentum(&v);
        let defect = &momentum - &target;
        let size = sized(&momentum).max(sized(&target)).max(start);
        residual = if size > 0.0 {
            sized(&defect) / size
        } else {
            0.0
        };
        // Stop where rounding ends the quadratic convergence.
        let converged = residual == 0.0 || (residual <= 1e-13 && residual >= 0.25 * previous);
        let at_last = iteration + 1 == ITERATIONS && residual <= 1e-11;
        if converged || at_last {
            return Ok(Stage { v, force });
        }
        if !residual.is_finite() {
            break;
        }
        previous = residual;
        let matrix = stage_matrix(e, split, &e.force_velocity_jacobian(&v), h);
        let Some(step) = matrix.lu().solve(&split.take(&defect)) else {
            break;
        };
        v -= split.put(&step);
    }
    Err(Error::Solver {
        what: what(),
        iterations: ITERATIONS,
        residual,
        tolerance: 1e-13,
        remedy: "the time step is too long for these velocities or forces: take a smaller one"
            .into(),
    })
}

/// Coordinates after the step, motions placed.
pub(super) fn advance(s: &Stepper, state: &State, v: &DVector<f64>) -> DVector<f64> {
    let mut q = s.system.tree.integrate(&state.q, &(s.dt * v));
    s.place_motions(&mut q, (state.step + 1) as f64 * s.dt);
    q
}

/// Momenta after the step: driven joints carry none of their own.
pub(super) fn next_state(
    state: &State,
    split: &Split,
    q: DVector<f64>,
    mut y: DVector<f64>,
    input: &Input,
) -> State {
    split.forget_driven(&mut y);
    State {
        step: state.step + 1,
        q,
        y,
        held: input.hold.clone(),
    }
}

/// Message of a stage that failed.
pub(super) fn stage_name(s: &Stepper, state: &State) -> String {
    format!(
        "implicit stage of step {} (t = {} s, Δt = {} s)",
        state.step,
        s.time(state),
        s.dt
    )
}

pub(super) fn step(
    s: &Stepper,
    e: &Evaluation,
    state: &State,
    v: &DVector<f64>,
    input: &Input,
) -> Result<Stepped> {
    let split = s.split(&input.hold, When::Over(s.time(state), s.dt));
    let p = s.released_momentum(e, state, v, &split);
    let stage = solve_stage(e, &split, &p, &input.control, s.dt, v, &|| {
        stage_name(s, state)
    })?;
    let y = &p + s.dt * &stage.force;
    let q = advance(s, state, &stage.v);
    Ok(Stepped {
        state: next_state(state, &split, q, y, input),
        memo: Some(stage.v),
    })
}

/// Transpose of `q⁺ = q ⊕ Δt v` with motions placed: (q̄, v̄).
pub(super) fn advance_vjp(
    s: &Stepper,
    split: &Split,
    v: &DVector<f64>,
    q_bar: &DVector<f64>,
) -> (DVector<f64>, DVector<f64>) {
    let mut q_bar = q_bar.clone();
    split.forget_moved(&mut q_bar);
    let (q, xi) = s.system.tree.integrate_vjp(&(s.dt * v), &q_bar);
    (q, s.dt * xi)
}

pub(super) fn step_vjp(
    s: &Stepper,
    e: &Evaluation,
    state: &State,
    v: &DVector<f64>,
    input: &Input,
    memo: &Memo,
    next_bar: &StateBar,
) -> Result<StepBar> {
    let split = s.split(&input.hold, When::Over(s.time(state), s.dt));
    let p = s.released_momentum(e, state, v, &split);
    let stage = match memo {
        Some(v) => Stage {
            v: v.clone(),
            force: e.force(v, &input.control),
        },
        None => solve_stage(e, &split, &p, &input.control, s.dt, v, &|| {
            stage_name(s, state)
        })?,
    };
    let adjoint = AdjointStage::new(e, &split, &stage.v, s.dt);
    let mut bar = StepBar::zeros(e);
    let (q_bar, mut v_bar) = advance_vjp(s, &split, &stage.v, &next_bar.q);
    bar.state.q += q_bar;
    let mut z = next_bar.y.clone();
    split.forget_driven(&mut z);
    // v̄ of p̂⁺ through f; only the transpose of ∂f/∂v is needed here.
    v_bar += s.dt * adjoint.rates.tr_mul(&z);
    let w = adjoint.solve(&split, &v_bar)?;
    let z_total = &z + e.frame_velocity(&w);
    let reached = &p + s.dt * &stage.force;
    bar.add(s.dt, &e.force_vjp(&stage.v, &input.control, &z_total)?);
    bar.add(-1.0, &e.momentum_vjp(&stage.v, &w)?);
    bar.state.q += e.frame_velocity_vjp(&w, &reached);
    s.released_momentum_vjp(e, state, v, &split, &z_total, &mut bar)?;
    Ok(bar)
}

/// What the transpose of a stage needs.
pub(super) struct AdjointStage {
    /// ∂f/∂v.
    pub rates: DMatrix<f64>,
    /// Factor of the transposed stage matrix.
    factor: LU<f64, Dyn, Dyn>,
}

impl AdjointStage {
    pub fn new(e: &Evaluation, split: &Split, v: &DVector<f64>, h: f64) -> Self {
        let rates = e.force_velocity_jacobian(v);
        let factor = stage_matrix(e, split, &rates, h).transpose().lu();
        Self { rates, factor }
    }

    /// w with (M − h Xᵀ ∂f/∂v)ᵀ_ff w_f = v̄_f, zero on driven entries.
    pub fn solve(&self, split: &Split, v_bar: &DVector<f64>) -> Result<DVector<f64>> {
        if split.free.is_empty() {
            return Ok(DVector::zeros(v_bar.len()));
        }
        let solution = self
            .factor
            .solve(&split.take(v_bar))
            .ok_or_else(|| Error::Solver {
                what: "adjoint of an implicit stage".into(),
                iterations: 0,
                residual: f64::INFINITY,
                tolerance: 0.0,
                remedy: "the stage matrix is singular: take a smaller time step".into(),
            })?;
        Ok(split.put(&solution))
    }
}
