//! Implicit midpoint in (q, p̂): second order and symmetric in time.
//!
//! q_m = q ⊕ ½Δt v, M(q_m) v + p_rest = Xᵀ(q_m) (p̂ + ½Δt f(q_m, v, u)), q⁺ = q ⊕ Δt v,
//! p̂⁺ = p̂ + Δt f. In a current ½Δt f − ¼Δt² D f stands for ½Δt f: momenta in the middle are taken about a point that
//! has drifted by then ([`crate::dynamics::Drift`]). The velocity is found by [`quasi::descend`] in v and q_m(v) at once, one evaluation a step; where that doesn't get there, by Newton at
//! fixed q_m (cheap) inside a fixed point in
//! q_m (one evaluation each); the adjoint solves with the transpose of that splitting by GMRES, which gets there wherever the step does, the tangent for all
//! directions at once.
//!
//! Limits of joints are solved at q for the mean velocity and for the one at the end ([`middle_contact`]): the position is stepped implicitly, so that they are stable at
//! any stiffness, and of first order. Where surfaces press, by viscous films too, a step is momentum Euler's ([`super::euler`]). What presses on them acts in the middle of midpoint's step,
//! half of what it moves from the points at which they bear it, and a body that rolls would be turned by that; nor would the water at q_m know what contact stops.

use super::euler::{self, Equation, noise, solve_stage};
use super::middle_contact;
use super::plan::Halt;
use super::quasi::{self, Descended};
use super::rule::Rule;
use super::stage_adjoint::{AdjointStage, krylov, solve_columns};
use super::stages::{ContactVelocities, Stages, StepDerivatives};
use super::start::Start;
use super::{State, StateBar, StateTangents, StepBar, StepTangents, Stepper};
use crate::dynamics::Linearisation;
use crate::dynamics::island_matrix::IslandMatrix;
use crate::dynamics::slopes::columns;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Relative change of the velocity at which the fixed point in q_m ends.
const TOLERANCE: f64 = 1e-14;
const ITERATIONS: usize = 60;
/// How many times as large as noise what stays after them may be.
const STALLED: f64 = 10.0;
/// What is left of the adjoint's equation, of what it sums; and the coarsest that a part of the sum is solved to.
const ADJOINT: f64 = 1e-13;
const ENOUGH: f64 = 1e-6;

/// Half the force, at a configuration that is the stage's own.
fn rule(s: &Stepper) -> Rule {
    Rule {
        h: 0.5 * s.dt,
        reach: 0.0,
    }
}

/// The system in the middle of a step with the velocity `v`.
fn middle<'a>(start: &Start<'_, 'a>, v: &DVector<f64>) -> Result<Linearisation<'a>> {
    let (s, state) = (start.stepper, start.state);
    let mut q = s.system.tree.integrate(&state.q, &(0.5 * s.dt * v));
    let t = s.time(state) + 0.5 * s.dt;
    s.place_motions(&mut q, t);
    s.system.linearise_apart(s.parameters, &q, t)
}

/// Relative change between two velocities, each joint coordinate weighed by its inertia.
fn change(e: &Linearisation, a: &DVector<f64>, b: &DVector<f64>) -> f64 {
    let weight = e.mass_blocks().diagonal().map(|m| m.max(0.0).sqrt());
    let size = b.component_mul(&weight).norm();
    let step = (a - b).component_mul(&weight).norm();
    if step == 0.0 { 0.0 } else { step / size }
}

pub(super) fn step(start: &Start) -> std::result::Result<(State, Stages), Halt> {
    let (s, split) = (start.stepper, start.split);
    // Near to touch: whether they do, by a stage that may fail where nothing presses.
    if start.near.may_touch()
        && let Ok(Some(found)) = euler::touching_step_if_any(start)
    {
        return Ok(found);
    }
    let p = start.momentum();
    let mut stage = split.complete(start.v);
    if let Some(found) = at_once(start, &p, &stage)? {
        let y = &p + s.dt * found.force;
        return ends(start, found.v, y);
    }
    let mut previous = f64::INFINITY;
    for iteration in 1..=ITERATIONS {
        let m = middle(start, &stage)?;
        let next = solve_stage(start, &m, &p, rule(s), &stage)?;
        let moved = change(&m, &next.v, &stage);
        stage = next.v;
        // Down at rounding, or at the coupled solve's own tolerance, changes are noise: stop when they no longer halve.
        let at_last = iteration == ITERATIONS && moved <= STALLED * noise(&m);
        if moved <= TOLERANCE || (moved <= noise(&m) && moved > 0.5 * previous) || at_last {
            let y = &p + s.dt * next.force;
            return ends(start, stage, y);
        }
        if moved > 0.5 * previous {
            // Forces that cancel leave rounding, beside which a small velocity doesn't settle.
            let m = middle(start, &stage)?;
            let equation = Equation::new(start, &m, &p, rule(s));
            let now = equation.at(stage.clone())?;
            if equation.is_noise(&now) {
                return ends(start, now.v, &p + s.dt * now.force);
            }
        }
        previous = moved;
    }
    Err(Error::Solver {
        what: start.stage_name(),
        iterations: ITERATIONS,
        residual: previous,
        tolerance: TOLERANCE,
        remedy:
            "the midpoint's fixed point doesn't contract: take a smaller time step, or tighten \
                 the coupling's tolerance"
                .into(),
    }
    .into())
}

/// The end of a step from its mean velocity and the frame momenta before contact.
fn ends(
    start: &Start,
    mean: DVector<f64>,
    hat: DVector<f64>,
) -> std::result::Result<(State, Stages), Halt> {
    if start.near.touches(&mean) {
        return euler::touching_step(start);
    }
    Ok(middle_contact::apply(start, mean, hat)?)
}

/// The stage from the guess `v`, if it gets there in v and q_m(v) at once.
fn at_once(
    start: &Start,
    p: &DVector<f64>,
    v: &DVector<f64>,
) -> std::result::Result<Option<quasi::Trial>, Halt> {
    let (split, rule) = (start.split, rule(start.stepper));
    let m = middle(start, v)?;
    let equation = Equation::new(start, &m, p, rule);
    let first = equation.at(v.clone())?;
    if first.converged(f64::INFINITY) {
        return Ok(Some(first));
    }
    let Some(factor) = equation.first_factor(&first)? else {
        return Ok(None);
    };
    let at = |v: DVector<f64>| {
        let m = middle(start, &v)?;
        Equation::new(start, &m, p, rule).at(v)
    };
    let is_noise = |now: &quasi::Trial| now.residual <= noise(&m) || equation.is_noise(now);
    let (weight, ends) = (equation.weight(), (is_noise, quasi::solved(&m)));
    Ok(
        match quasi::descend(split, &weight, &factor, &first, ends, at) {
            Descended::Solved(found) => Some(found),
            _ => None,
        },
    )
}

/// What the derivatives of a step need.
pub(super) struct Adjoint<'s, 'a> {
    contact: middle_contact::Adjoint<'s, 'a>,
    /// The system in the middle of the step.
    middle: Linearisation<'a>,
    /// p̂ + ½Δt f.
    reached: DVector<f64>,
    stage: AdjointStage<'a>,
}

impl<'s, 'a> Adjoint<'s, 'a> {
    pub fn new(start: &Start<'_, 'a>, velocities: &'s ContactVelocities) -> Result<Self> {
        let (s, before) = (start.stepper, &velocities.before);
        let middle = middle(start, before)?;
        let force = start.stage_force(&middle, before, rule(s))?;
        let reached = start.momentum() + rule(s).impulse(&middle, &force);
        Ok(Self {
            contact: middle_contact::Adjoint::new(start, velocities)?,
            stage: AdjointStage::new(start, &middle, before, &reached, rule(s))?,
            middle,
            reached,
        })
    }
}

impl<'a> StepDerivatives<'a> for Adjoint<'_, 'a> {
    fn jvp(&self, start: &Start<'_, 'a>, along: &StepTangents) -> Result<StateTangents> {
        let (s, split, m) = (start.stepper, start.split, &self.middle);
        let (q, inputs, nv) = (along.q, along.inputs, start.v.len());
        let before = &self.contact.velocities.before;
        let h = 0.5 * s.dt;
        let (force, by_start) =
            start.stage_force_slopes(m, before, rule(s), inputs.has_parameters())?;
        let by_start = by_start * along.v;
        let momentum = m.momentum_slopes(before, &split.free, inputs.has_parameters())?;
        // q_m by q and by v.
        let advance = |q: &DMatrix<f64>, v: &DMatrix<f64>| {
            let mut out = s.system.tree.integrate_jvp(&(h * before), q, &(h * v));
            split.forget_moved_rows(&mut out);
            out
        };
        let (one, none) = (DMatrix::identity(nv, nv), DMatrix::zeros(nv, nv));
        let by_v = advance(&none, &one);
        let impulse = |f: &DMatrix<f64>| columns(f, |f| rule(s).impulse(m, f));
        let middle = advance(q, &DMatrix::zeros(nv, q.ncols()));
        let frame = m.frame_matrix();
        // Derivative of Xᵀ(p̂ + h f) − M v − p_rest over q_m, which moves with v as well.
        let bent =
            frame.tr_mul(&impulse(&force.q)) + m.frame_momentum_slope(&self.reached) - &momentum.q;
        let matrix = IslandMatrix::whole(self.stage.matrix(m)? - bent * &by_v);
        let p = start.momentum_jvp(along)?;
        let held = &p + impulse(&(force.along(&middle, None, inputs) + &by_start));
        let right = frame.tr_mul(&held) + m.frame_momentum_slope(&self.reached) * &middle
            - momentum.along(&middle, None, inputs);
        let v = solve_columns(&matrix, split, &right)?;
        let middle = middle + by_v * &v;
        let hat = p + s.dt * (force.along(&middle, Some(&v), inputs) + by_start);
        self.contact.apply_jvp(start, along, &v, hat)
    }

    fn vjp(&self, start: &Start<'_, 'a>, next_bar: &StateBar) -> Result<StepBar> {
        let (s, split, m) = (start.stepper, start.split, &self.middle);
        let mut bar = StepBar::zeros(start.e);
        let (v_bar_next, z) = self.contact.apply_vjp(start, next_bar, &mut bar)?;
        let v_bar_force = s.dt * self.stage.rates_vjp(m, &z)?;
        let fixed = v_bar_next + v_bar_force;
        // Jᵀ w = fixed + (∂q_m/∂v)ᵀ q̄_m(w, z), of free velocities; q̄_m is linear in w and z.
        let mut w = self.stage.solve(m, split, &fixed)?;
        let mut back = self.through_middle(start, &w, &z)?;
        let missing = split.take(&back.v);
        let size = (split.take(&fixed) + &missing).norm();
        // NaN goes on to the error.
        let done = missing.norm() <= ADJOINT * size;
        if !done {
            w += self.fed_back(start, &missing, size)?;
            back = self.through_middle(start, &w, &z)?;
        }
        bar.state.q += back.q;
        bar.v += back.inner.v;
        bar.control += back.inner.control;
        bar.parameters.add(&back.inner.parameters);
        start.momentum_vjp(&(&z + m.frame_velocity(&w)), &mut bar)?;
        Ok(bar)
    }
}

/// What comes back through the middle of a step.
struct Through {
    /// Cotangents of the middle and of what acts there.
    inner: StepBar,
    /// Those of the middle, carried on to q and to v.
    q: DVector<f64>,
    v: DVector<f64>,
}

impl<'a> Adjoint<'_, 'a> {
    /// The cotangents that come back through q_m from `w` of the stage's equation and `z` of the momenta after the step.
    fn through_middle(
        &self,
        start: &Start<'_, 'a>,
        w: &DVector<f64>,
        z: &DVector<f64>,
    ) -> Result<Through> {
        let (s, split, m) = (start.stepper, start.split, &self.middle);
        let (before, control) = (&self.contact.velocities.before, &start.input.control);
        let h = 0.5 * s.dt;
        let z_total = s.dt * z + rule(s).impulse_back(m, &m.frame_velocity(w));
        // Gradient over q_m of −wᵀ{M v + p_rest − Xᵀ(p̂ + h f)} + zᵀ Δt f, and the rest of the cotangents.
        let mut inner = StepBar::zeros(m);
        inner.add(1.0, &m.force_vjp(before, control, &z_total)?);
        if let Some(late) = start.late(m, before, rule(s)) {
            let bars = m.late_force_vjp(&late, control, &z_total);
            inner.add(1.0, &bars.force);
            inner.v += bars.start;
        }
        inner.add(-1.0, &m.momentum_vjp(before, w)?);
        inner.state.q += m.frame_velocity_vjp(w, &self.reached);
        split.forget_moved(&mut inner.state.q);
        let (q, xi) = (s.system.tree).integrate_vjp(&(h * before), &inner.state.q);
        let v = h * xi;
        Ok(Through { inner, q, v })
    }

    /// w, zero on driven entries, with Jᵀ w − (∂q_m/∂v)ᵀ q̄_m(w) = `missing` of free velocities, which is a part of a sum of norm `size`.
    fn fed_back(
        &self,
        start: &Start<'_, 'a>,
        missing: &DVector<f64>,
        size: f64,
    ) -> Result<DVector<f64>> {
        let (split, m) = (start.split, &self.middle);
        let none = DVector::zeros(start.v.len());
        // Cotangents in units of about the root of their inertia.
        let scale = split.scale(&m.mass_blocks().diagonal());
        let apply = |x: &DVector<f64>| {
            let x = split.put(&x.component_div(&scale));
            let w = self.stage.solve(m, split, &x)?;
            let left = x - self.through_middle(start, &w, &none)?.v;
            Ok([split.take(&w), split.take(&left).component_mul(&scale)])
        };
        // The stage's own solves tell no more where they are products.
        let least = m.scattered().map_or(ADJOINT, |_| noise(m));
        let tolerance = least.max(ADJOINT * size / missing.norm()).min(ENOUGH);
        let found = krylov(apply, &missing.component_mul(&scale), tolerance)?;
        if found.residual <= tolerance.max(10.0 * noise(m)) {
            return Ok(split.put(&DVector::from_vec(found.x.data)));
        }
        Err(Error::Solver {
            what: format!("adjoint of the {}", start.stage_name()),
            iterations: found.iterations,
            residual: found.residual,
            tolerance,
            remedy: "take a smaller time step".into(),
        })
    }
}
