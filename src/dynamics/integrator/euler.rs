//! Momentum Euler, implicit in p at fixed q:
//! p̂⁺ = p̂ + Δt f(q, v, u), M(q) v + p_rest = Xᵀ p̂⁺, q⁺ = q ⊕ Δt v.
//!
//! The stage is solved by Newton's method with the exact ∂f/∂v; its adjoint is the implicit function theorem at
//! the converged stage, with the transpose of the same matrix.

use super::{Input, Split, State, StateBar, StepBar, Stepped, Stepper, When};
use crate::dynamics::Evaluation;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Most Newton iterations of a stage; quadratic convergence needs four or five.
const ITERATIONS: usize = 40;

/// Matrix of the stage, (M − h Xᵀ ∂f/∂v)_ff.
pub(super) fn stage_matrix(
    e: &Evaluation,
    split: &Split,
    v: &DVector<f64>,
    h: f64,
) -> DMatrix<f64> {
    let rates = e.force_velocity_jacobian(v);
    let mut m = e.mass_matrix.clone();
    for k in 0..v.len() {
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
) -> Result<DVector<f64>> {
    let mut v = &split.driven + split.put(&split.take(guess));
    if split.free.is_empty() {
        return Ok(v);
    }
    let mut previous = f64::INFINITY;
    let mut residual = f64::INFINITY;
    let scale = split
        .block(&e.mass_matrix)
        .diagonal()
        .map(|d| 1.0 / d.max(f64::MIN_POSITIVE).sqrt());
    for iteration in 0..ITERATIONS {
        let reached = hat + h * e.force(&v, control);
        let target = e.user_momentum(&reached);
        let defect = split
            .take(&(e.momentum(&v) - &target))
            .component_mul(&scale);
        let size = split
            .take(&e.momentum(&v))
            .component_mul(&scale)
            .norm()
            .max(split.take(&target).component_mul(&scale).norm())
            .max(
                split
                    .take(&e.user_momentum(hat))
                    .component_mul(&scale)
                    .norm(),
            );
        residual = if size > 0.0 {
            defect.norm() / size
        } else {
            0.0
        };
        // Stop where rounding ends the quadratic convergence.
        if residual == 0.0 || (residual <= 1e-13 && residual >= 0.25 * previous) {
            return Ok(v);
        }
        if !residual.is_finite() {
            break;
        }
        previous = residual;
        let rows = split.take(&(e.momentum(&v) - &target));
        let Some(step) = stage_matrix(e, split, &v, h).lu().solve(&rows) else {
            break;
        };
        v -= split.put(&step);
        if iteration + 1 == ITERATIONS && residual <= 1e-11 {
            return Ok(v);
        }
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
    let y = &p + s.dt * e.force(&stage, &input.control);
    let q = advance(s, state, &stage);
    Ok(Stepped {
        state: next_state(state, &split, q, y, input),
        memo: Some(stage),
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
    next_bar: &StateBar,
) -> Result<StepBar> {
    let split = s.split(&input.hold, When::Over(s.time(state), s.dt));
    let p = s.released_momentum(e, state, v, &split);
    let stage = solve_stage(e, &split, &p, &input.control, s.dt, v, &|| {
        stage_name(s, state)
    })?;
    let mut bar = StepBar::zeros(e);
    let (q_bar, mut v_bar) = advance_vjp(s, &split, &stage, &next_bar.q);
    bar.state.q += q_bar;
    let mut z = next_bar.y.clone();
    split.forget_driven(&mut z);
    // v̄ of p̂⁺ through f; only the transpose of ∂f/∂v is needed here.
    v_bar += s.dt * e.force_velocity_jacobian(&stage).tr_mul(&z);
    let w = adjoint_stage(e, &split, &stage, s.dt, &v_bar)?;
    let z_total = &z + e.frame_velocity(&w);
    let reached = &p + s.dt * e.force(&stage, &input.control);
    bar.add(s.dt, &e.force_vjp(&stage, &input.control, &z_total)?);
    bar.add(-1.0, &e.momentum_vjp(&stage, &w)?);
    bar.state.q += e.frame_velocity_vjp(&w, &reached);
    s.released_momentum_vjp(e, state, v, &split, &z_total, &mut bar)?;
    Ok(bar)
}

/// w with (M − h Xᵀ ∂f/∂v)ᵀ_ff w_f = v̄_f, zero on driven entries.
pub(super) fn adjoint_stage(
    e: &Evaluation,
    split: &Split,
    stage: &DVector<f64>,
    h: f64,
    v_bar: &DVector<f64>,
) -> Result<DVector<f64>> {
    if split.free.is_empty() {
        return Ok(DVector::zeros(stage.len()));
    }
    let matrix = stage_matrix(e, split, stage, h).transpose();
    let solution = matrix
        .lu()
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
