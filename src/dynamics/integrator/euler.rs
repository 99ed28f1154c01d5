//! Momentum Euler, implicit in p at fixed q: symplectic.
//!
//! ```text
//! p̂⁺ = p̂ + Δt f(q, v, u)      M(q) v + p_rest = J(Δt v)ᵀ X(q⁺)ᵀ p̂⁺      q⁺ = q ⊕ Δt v
//! ```
//!
//! These are the discrete Euler–Lagrange equations of Δt L(q, v): M v is the momentum conjugate to the chart
//! coordinates ξ = Δt v around q, and JᵀXᵀ (the derivative of spatial displacements at q⁺ with respect to ξ) carries p̂⁺
//! there. With Xᵀ at q instead, a free body's momenta would stay and its pose be stepped by explicit Euler.
//!
//! The stage is solved by Newton's method with exact derivatives; its adjoint is the implicit function theorem at
//! the converged stage, with the transpose of the same matrix.

use super::{Input, Memo, Split, State, StateBar, StepBar, Stepped, Stepper, When, contact};
use crate::adjoint::lie::angular;
use crate::dynamics::Linearisation;
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

/// An implicit stage: `M v + p_rest = J(ξ)ᵀ X(q ⊕ ξ)ᵀ (p̂ + h f(q, v, u))` with ξ = reach v.
#[derive(Clone, Copy)]
pub(super) struct Rule {
    /// Time over which the force acts, s.
    pub h: f64,
    /// Time over which the chart reaches out, s: the step's for Euler; zero where q is the stage's own.
    pub reach: f64,
}

/// Matrix of the stage on the free rows, from ∂f/∂v and the momentum p̂ + h f.
fn stage_matrix(
    e: &Linearisation,
    split: &Split,
    v: &DVector<f64>,
    rates: &DMatrix<f64>,
    reached: &DVector<f64>,
    rule: Rule,
) -> DMatrix<f64> {
    let tree = &e.system.tree;
    let xi = rule.reach * v;
    let mut m = e.mass_matrix.clone();
    for k in 0..v.len() {
        let column = tree.chart_momentum(&e.q, &xi, &rates.column(k).into_owned());
        let mut target = m.column_mut(k);
        target -= rule.h * column;
        if rule.reach != 0.0 {
            let mut unit = DVector::zeros(v.len());
            unit[k] = 1.0;
            let [_, along, _] = tree.chart_momentum_vjp(&e.q, &xi, reached, &unit);
            let mut target = m.row_mut(k);
            target -= rule.reach * along.transpose();
        }
    }
    split.block(&m)
}

/// Solves a stage on the free rows, from the guess `v`.
pub(super) fn solve_stage(
    e: &Linearisation,
    split: &Split,
    hat: &DVector<f64>,
    control: &DVector<f64>,
    rule: Rule,
    guess: &DVector<f64>,
    what: &dyn Fn() -> String,
) -> Result<Stage> {
    let tree = &e.system.tree;
    let mut v = &split.driven + split.put(&split.take(guess));
    let scale = split
        .block(&e.mass_matrix)
        .diagonal()
        .map(|d| 1.0 / d.max(f64::MIN_POSITIVE).sqrt());
    let sized = |p: &DVector<f64>| split.take(p).component_mul(&scale).norm();
    // Against the sum of what M v adds up, so that a total momentum of zero is no target for relative errors.
    let summands = e.mass_matrix.abs();
    let start = sized(&e.user_momentum(hat)).max(sized(&e.rest_momentum));
    let mut previous = f64::INFINITY;
    let mut residual = f64::INFINITY;
    for iteration in 0..ITERATIONS {
        let force = e.force(&v, control)?;
        let reached = hat + rule.h * &force;
        let target = tree.chart_momentum(&e.q, &(rule.reach * &v), &reached);
        let defect = e.momentum(&v) - &target;
        let size = sized(&(&summands * v.abs())).max(sized(&target)).max(start);
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
        let rates = e.force_velocity_jacobian(&v, control)?;
        let matrix = stage_matrix(e, split, &v, &rates, &reached, rule);
        let Some(step) = matrix.lu().solve(&split.take(&defect)) else {
            break;
        };
        v -= split.put(&step);
    }
    let twists = tree.twists(&e.kinematics, guess);
    let turning = (twists.iter())
        .map(|t| angular(t).norm())
        .fold(0.0, f64::max);
    Err(Error::Solver {
        what: what(),
        iterations: ITERATIONS,
        residual,
        tolerance: 1e-13,
        remedy: format!(
            "the time step is too long for these velocities or forces: take a smaller one (bodies turn by up to {:.2} rad \
             in it)",
            turning * rule.reach.max(2.0 * (rule.h - rule.reach))
        ),
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
        mode: state.mode,
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

fn rule(s: &Stepper) -> Rule {
    Rule {
        h: s.dt,
        reach: s.dt,
    }
}

pub(super) fn step(
    s: &Stepper,
    e: &Linearisation,
    state: &State,
    v: &DVector<f64>,
    input: &Input,
) -> Result<Stepped> {
    let split = s.split(&input.hold, When::Over(s.time(state), s.dt));
    let p = s.released_momentum(e, state, v, &split);
    let stage = solve_stage(e, &split, &p, &input.control, rule(s), v, &|| {
        stage_name(s, state)
    })?;
    let y = &p + s.dt * &stage.force;
    let (v, y) = contact::press(e, &split, &stage.v, y, s.dt, &|| stage_name(s, state))?;
    let q = advance(s, state, &v);
    Ok(Stepped {
        state: next_state(state, &split, q, y, input),
        memo: Some(contact::kept(&stage.v, &v)),
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
    e: &Linearisation,
    state: &State,
    v: &DVector<f64>,
    input: &Input,
    memo: &Memo,
    next_bar: &StateBar,
) -> Result<StepBar> {
    let split = s.split(&input.hold, When::Over(s.time(state), s.dt));
    let p = s.released_momentum(e, state, v, &split);
    let (stage, after) = match memo {
        Some(both) => {
            let (before, after) = contact::parted(both, v.len());
            let force = e.force(&before, &input.control)?;
            (Stage { v: before, force }, after)
        }
        None => {
            let what = || stage_name(s, state);
            let stage = solve_stage(e, &split, &p, &input.control, rule(s), v, &what)?;
            let after = contact::solve(e, &split, &stage.v, s.dt, &what)?;
            (stage, after)
        }
    };
    let reached = &p + s.dt * &stage.force;
    let adjoint = AdjointStage::new(e, &split, &stage.v, &input.control, &reached, rule(s))?;
    let mut bar = StepBar::zeros(e);
    let (q_bar, after_bar) = advance_vjp(s, &split, &after, &next_bar.q);
    bar.state.q += q_bar;
    let mut z = next_bar.y.clone();
    split.forget_driven(&mut z);
    let both = [&stage.v, &after];
    let mut v_bar = contact::press_vjp(e, &split, both, [&after_bar, &z], s.dt, &mut bar)?;
    // v̄ of p̂⁺ through f; only the transpose of ∂f/∂v is needed here.
    v_bar += s.dt * adjoint.rates.tr_mul(&z);
    let w = adjoint.solve(&split, &v_bar)?;
    let tree = &e.system.tree;
    let [q_bar, _, hat_bar] = tree.chart_momentum_vjp(&e.q, &(s.dt * &stage.v), &reached, &w);
    bar.state.q += q_bar;
    let z_total = z + hat_bar;
    bar.add(s.dt, &e.force_vjp(&stage.v, &input.control, &z_total)?);
    bar.add(-1.0, &e.momentum_vjp(&stage.v, &w)?);
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
    /// At velocity v, controls and momentum p̂ + h f.
    ///
    /// # Errors
    /// A coupling that fails.
    pub fn new(
        e: &Linearisation,
        split: &Split,
        v: &DVector<f64>,
        control: &DVector<f64>,
        reached: &DVector<f64>,
        rule: Rule,
    ) -> Result<Self> {
        let rates = e.force_velocity_jacobian(v, control)?;
        let matrix = stage_matrix(e, split, v, &rates, reached, rule);
        let factor = matrix.transpose().lu();
        Ok(Self { rates, factor })
    }

    /// w_f with (stage matrix)ᵀ w_f = v̄_f, zero on driven entries.
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
