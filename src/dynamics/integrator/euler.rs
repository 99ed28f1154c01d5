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
//! The stage is solved by Newton's method with exact derivatives, safeguarded; its adjoint is the implicit function theorem at
//! the converged stage, with the transpose of the same matrix.

use super::contact;
use super::energy::{self, Closure};
use super::plan::{Halt, MOST};
use super::quasi::{self, Trial};
use super::split::{Split, share};
use super::stages::{ContactVelocities, Stages, StepDerivatives};
use super::start::Start;
use super::{Integrator, State, StateBar, StateTangents, StepBar, StepTangents, Stepper};
use crate::adjoint::lie::angular;
use crate::adjoint::solve::Definite;
use crate::dynamics::island_matrix::{IslandFactor, IslandMatrix};
use crate::dynamics::slopes::columns;
use crate::dynamics::{Drift, Linearisation};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Most Newton iterations of a stage; quadratic convergence needs four or five.
const ITERATIONS: usize = 40;
/// Residual that is accepted at the last iteration, and below which none is asked to fall.
const ENOUGH: f64 = 1e-11;
/// Shortest part of Newton's step.
const SHORTEST: f64 = 1.0 / 4096.0;
/// Largest part by which the inertia may change in the time of a stage.
const CHANGE: f64 = 0.25;

/// A converged stage.
pub(super) struct ImplicitStage {
    /// Its velocity.
    pub v: DVector<f64>,
    /// f(q, v, u) there.
    pub force: DVector<f64>,
}

impl From<Trial> for ImplicitStage {
    fn from(trial: Trial) -> Self {
        let Trial { v, force, .. } = trial;
        Self { v, force }
    }
}

/// An implicit stage: `M v + p_rest = J(ξ)ᵀ X(q ⊕ ξ)ᵀ (p̂ + h f(q, v, u))` with ξ = reach v; h (1 − h D) for h where the stage has a configuration of its own,
/// before which bodies have drifted for the time h ([`crate::dynamics::Drift`]).
#[derive(Clone, Copy)]
pub(super) struct Rule {
    /// Time over which the force acts, s.
    pub h: f64,
    /// Time over which the chart reaches out, s: the step's for Euler; zero where q is the stage's own.
    pub reach: f64,
}

impl Rule {
    /// What a force adds to the momentum.
    pub fn impulse(&self, e: &Linearisation, force: &DVector<f64>) -> DVector<f64> {
        self.drifted(e, force, |drift, x| drift.carry(-self.h, x))
    }

    /// Transpose of [`Rule::impulse`].
    pub fn impulse_back(&self, e: &Linearisation, bar: &DVector<f64>) -> DVector<f64> {
        self.drifted(e, bar, |drift, x| drift.carry_back(-self.h, x))
    }

    fn drifted(
        &self,
        e: &Linearisation,
        x: &DVector<f64>,
        carry: impl Fn(&Drift, DVector<f64>) -> DVector<f64>,
    ) -> DVector<f64> {
        let x = self.h * x;
        match self.reach == 0.0 {
            true => carry(&e.system.drift, x),
            false => x,
        }
    }
}

/// Matrix of the stage, from ∂f/∂v and the momentum p̂ + h f.
fn stage_matrix(
    e: &Linearisation,
    v: &DVector<f64>,
    rates: &IslandMatrix,
    reached: &DVector<f64>,
    rule: Rule,
) -> IslandMatrix {
    let tree = &e.system.tree;
    let xi = rule.reach * v;
    let [_, by_xi, by_hat] = tree.chart_momentum_slopes(&e.q, &xi, reached);
    let impulses = rates.mapped(|rates| columns(rates, |rate| rule.impulse(e, rate)));
    let mut m = (e.mass_blocks()).minus(&impulses.mapped(|impulses| by_hat.times(impulses)));
    if rule.reach != 0.0 {
        m.subtract(by_xi.entries().map(|(i, j, x)| (i, j, rule.reach * x)));
    }
    m
}

/// How many times too long a step is for its implicit stage; none where it isn't.
///
/// With W = h ∂f/∂v on the free rows, the stage's matrix is M − W but for what turning adds, and κ the largest eigenvalue of
/// M^-½ ½(W + Wᵀ) M^-½: the part by which the inertia M changes in the time h of what moves relative to the water, less what damps. In one coordinate it is
/// h v M′/M, and there is no solution from κ = ½ on. Up to ¼ a factor of ¼ M − ½(W + Wᵀ) is all that it takes, n³/3 operations of each island.
fn excess(
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
    let grown = 0.5 * (&grown + grown.transpose());
    if grown.is_empty() || Definite::new(CHANGE * &m - &grown).is_some() {
        return None;
    }
    let lower = m.cholesky()?.unpack();
    let half = lower.solve_lower_triangular(&grown)?;
    let scaled = lower.solve_lower_triangular(&half.transpose())?;
    let change = match scaled.iter().all(|x| x.is_finite()) {
        true => (0.5 * (&scaled + scaled.transpose()))
            .symmetric_eigenvalues()
            .max(),
        false => f64::INFINITY,
    };
    Some((change / CHANGE).ceil().clamp(2.0, MOST as f64) as usize)
}

/// The equation of a stage at `e`, from the momentum at the step's start.
pub(super) struct Equation<'s, 'a> {
    start: Start<'s, 'a>,
    e: &'s Linearisation<'a>,
    hat: &'s DVector<f64>,
    rule: Rule,
    /// Σ |M| |v| is what the sum M v is measured by, so that a total momentum of zero is no target for relative errors.
    summands: IslandMatrix,
    /// By which momenta are weighed, and the least size of what is balanced.
    scale: DVector<f64>,
    least: f64,
}

impl<'s, 'a> Equation<'s, 'a> {
    pub fn new(
        start: &Start<'s, 'a>,
        e: &'s Linearisation<'a>,
        hat: &'s DVector<f64>,
        rule: Rule,
    ) -> Self {
        let mut out = Self {
            start: *start,
            e,
            hat,
            rule,
            summands: e.mass_blocks().mapped(DMatrix::abs),
            scale: start.split.scale(&e.mass_blocks().diagonal()),
            least: 0.0,
        };
        let rest = out.sized(&e.rest_momentum);
        out.least = out.sized(&e.user_momentum(hat)).max(rest);
        out
    }

    fn sized(&self, p: &DVector<f64>) -> f64 {
        self.start.split.take(p).component_mul(&self.scale).norm()
    }

    /// What the velocity `v` leaves of it.
    pub fn at(&self, v: DVector<f64>) -> Result<Trial> {
        let (e, rule) = (self.e, self.rule);
        let force = e.force(&v, &self.start.input.control)?;
        let reached = self.hat + rule.impulse(e, &force);
        let xi = rule.reach * &v;
        let target = e.system.tree.chart_momentum(&e.q, &xi, &reached);
        let defect = e.momentum(&v) - &target;
        let size = self.sized(&self.summands.times(&v.abs()));
        let size = size.max(self.sized(&target)).max(self.least);
        let merit = self.sized(&defect);
        let residual = share(merit, size);
        Ok(Trial {
            v,
            force,
            reached,
            defect,
            merit,
            residual,
        })
    }

    /// The factor of its matrix at a trial.
    fn factor(&self, now: &Trial, rates: &IslandMatrix) -> IslandFactor {
        let Trial { v, reached, .. } = now;
        let matrix = stage_matrix(self.e, v, rates, reached, self.rule);
        matrix.factored(&self.start.split.free, false)
    }

    /// What momenta are weighed by in turn: the inertia of the free velocities, each by itself.
    pub fn weight(&self) -> DVector<f64> {
        self.start.split.take(&self.e.mass_blocks().diagonal())
    }

    /// The same at the first trial of a step, if the step isn't too long.
    pub fn first_factor(&self, now: &Trial) -> std::result::Result<IslandFactor, Halt> {
        let (e, start) = (self.e, &self.start);
        let rates = e.force_velocity_blocks(&now.v, &start.input.control)?;
        if start.plan.may_cut()
            && let Some(times) = excess(e, start.split, &now.v, &rates, self.rule)
        {
            return Err(Halt::TooLong(times));
        }
        Ok(self.factor(now, &rates))
    }
}

/// Solves a stage of a step at `e` on the free rows, from the momentum at the step's start and a guess of its velocity: by [`quasi`], and where that doesn't get there by
/// Newton's method, whose steps are halved until the defect falls.
pub(super) fn solve_stage<'a>(
    start: &Start<'_, 'a>,
    e: &Linearisation<'a>,
    hat: &DVector<f64>,
    rule: Rule,
    guess: &DVector<f64>,
) -> std::result::Result<ImplicitStage, Halt> {
    let (split, control) = (start.split, &start.input.control);
    let tree = &e.system.tree;
    let equation = Equation::new(start, e, hat, rule);
    let mut now = equation.at(split.complete(guess))?;
    let mut previous = f64::INFINITY;
    'newton: for iteration in 0..ITERATIONS {
        let residual = now.residual;
        // Stop where rounding ends the quadratic convergence.
        let at_last = iteration + 1 == ITERATIONS && residual <= ENOUGH;
        if now.converged(previous) || at_last {
            return Ok(now.into());
        }
        if !residual.is_finite() || iteration + 1 == ITERATIONS {
            break;
        }
        previous = residual;
        let factor = if iteration == 0 {
            let factor = equation.first_factor(&now)?;
            let at = |v| equation.at(v);
            if let Some(found) = quasi::descend(split, &equation.weight(), &factor, &now, 0.0, at) {
                return Ok(found.into());
            }
            factor
        } else {
            equation.factor(&now, &e.force_velocity_blocks(&now.v, control)?)
        };
        let Some(step) = factor.solve(&split.take(&now.defect)) else {
            break;
        };
        let step = split.put(&step);
        let mut next = equation.at(&now.v - &step)?;
        let mut length = 1.0;
        while !(next.merit < now.merit || next.residual <= ENOUGH) {
            length *= 0.5;
            if length < SHORTEST {
                break 'newton;
            }
            next = equation.at(&now.v - length * &step)?;
        }
        now = next;
    }
    let residual = now.residual;
    let twists = tree.twists(&e.kinematics, guess);
    let turning = (twists.iter())
        .map(|t| angular(t).norm())
        .fold(0.0, f64::max);
    Err(Error::Solver {
        what: start.stage_name(),
        iterations: ITERATIONS,
        residual,
        tolerance: 1e-13,
        remedy: format!(
            "the time step is too long for these velocities or forces: take a smaller one (bodies turn by up to {:.2} rad \
             in it)",
            turning * rule.reach.max(2.0 * (rule.h - rule.reach))
        ),
    }
    .into())
}

fn rule(s: &Stepper) -> Rule {
    Rule {
        h: s.dt,
        reach: s.dt,
    }
}

pub(super) fn step(start: &Start) -> std::result::Result<(State, Stages), Halt> {
    let (s, e) = (start.stepper, start.e);
    let p = start.momentum();
    let stage = solve_stage(start, e, &p, rule(s), start.v)?;
    let y = &p + s.dt * &stage.force;
    Ok(contact::apply(start, stage.v, y)?)
}

/// The same, whose energy is closed.
pub(super) fn closed_step(start: &Start) -> std::result::Result<(State, Stages), Halt> {
    let (next, stages) = step(start)?;
    match &stages {
        Stages::Contact(velocities) => Ok((energy::close(start, velocities, next)?, stages)),
        Stages::RungeKutta(_) => Ok((next, stages)),
    }
}

/// What the derivatives of a step need.
pub(super) struct Adjoint<'s, 'a> {
    contact: contact::Adjoint<'s>,
    /// p̂ + Δt f.
    reached: DVector<f64>,
    stage: AdjointStage,
    closure: Option<Closure<'a>>,
}

impl<'s, 'a> Adjoint<'s, 'a> {
    pub fn new(start: &Start<'_, 'a>, velocities: &'s ContactVelocities) -> Result<Self> {
        let (s, e) = (start.stepper, start.e);
        let force = e.force(&velocities.before, &start.input.control)?;
        let reached = start.momentum() + s.dt * force;
        let closure = match s.integrator {
            Integrator::EnergyEuler => {
                let next = contact::reached(start, velocities, reached.clone());
                Closure::new(start, velocities, &next)?
            }
            _ => None,
        };
        Ok(Self {
            closure,
            stage: AdjointStage::new(start, e, &velocities.before, &reached, rule(s))?,
            contact: contact::Adjoint::new(start, velocities)?,
            reached,
        })
    }
}

impl<'a> StepDerivatives<'a> for Adjoint<'_, 'a> {
    fn jvp(&self, start: &Start<'_, 'a>, along: &StepTangents) -> Result<StateTangents> {
        let (s, e, split) = (start.stepper, start.e, start.split);
        let (q, inputs) = (along.q, along.inputs);
        let before = &self.contact.velocities.before;
        let force = e.force_slopes(
            before,
            &start.input.control,
            &split.free,
            inputs.has_parameters(),
        )?;
        let momentum = e.momentum_slopes(before, &split.free, inputs.has_parameters())?;
        let tree = &e.system.tree;
        let [by_q, _, by_hat] = tree.chart_momentum_slopes(&e.q, &(s.dt * before), &self.reached);
        // p̂ + Δt f at a given velocity; the stage's matrix holds what the velocity does.
        let held = start.momentum_jvp(along)? + s.dt * force.along(q, None, inputs);
        let right = by_q.dense() * q + by_hat.dense() * &held - momentum.along(q, None, inputs);
        let v = self.stage.solve_jvp(split, &right)?;
        let hat = held + s.dt * (force.v * &v);
        let (mut next, after) = self.contact.apply_jvp(start, along, &v, hat)?;
        if let Some(closure) = &self.closure {
            let velocities = self.contact.velocities;
            next.y = closure.jvp(start, velocities, along, &next, [&v, &after])?;
        }
        Ok(next)
    }

    fn vjp(&self, start: &Start<'_, 'a>, next_bar: &StateBar) -> Result<StepBar> {
        let (s, e, split) = (start.stepper, start.e, start.split);
        let before = &self.contact.velocities.before;
        let mut bar = StepBar::zeros(e);
        let (mut v_bar, z) = match &self.closure {
            None => self.contact.apply_vjp(start, next_bar, None, &mut bar)?,
            Some(closure) => {
                let velocities = self.contact.velocities;
                let own = closure.vjp(start, velocities, next_bar, &mut bar)?;
                let [own_before, own_after] = own.velocities;
                let after = Some(&own_after);
                let (v_bar, z) = self.contact.apply_vjp(start, &own.next, after, &mut bar)?;
                (v_bar + own_before, z)
            }
        };
        // v̄ of p̂⁺ through f; only the transpose of ∂f/∂v is needed here.
        v_bar += s.dt * self.stage.rates.tr_times(&z);
        let w = self.stage.solve(split, &v_bar)?;
        let tree = &e.system.tree;
        let [q_bar, _, hat_bar] =
            tree.chart_momentum_vjp(&e.q, &(s.dt * before), &self.reached, &w);
        bar.state.q += q_bar;
        let z_total = z + hat_bar;
        bar.add(s.dt, &e.force_vjp(before, &start.input.control, &z_total)?);
        bar.add(-1.0, &e.momentum_vjp(before, &w)?);
        start.momentum_vjp(&z_total, &mut bar)?;
        Ok(bar)
    }
}

/// What the derivatives of a stage need.
pub(super) struct AdjointStage {
    /// ∂f/∂v.
    pub rates: IslandMatrix,
    /// The stage matrix.
    pub matrix: IslandMatrix,
    /// Factor of the transposed stage matrix.
    factor: IslandFactor,
}

impl AdjointStage {
    /// Of a step's stage at `e`, with velocity v and momentum p̂ + h f.
    pub fn new(
        start: &Start,
        e: &Linearisation,
        v: &DVector<f64>,
        reached: &DVector<f64>,
        rule: Rule,
    ) -> Result<Self> {
        let rates = e.force_velocity_blocks(v, &start.input.control)?;
        let matrix = stage_matrix(e, v, &rates, reached, rule);
        let factor = matrix.factored(&start.split.free, true);
        Ok(Self {
            rates,
            matrix,
            factor,
        })
    }

    /// dv, zero on driven entries, with stage matrix · dv_f = right_f: the factor is of all columns.
    fn solve_jvp(&self, split: &Split, right: &DMatrix<f64>) -> Result<DMatrix<f64>> {
        solve_columns(&self.matrix, split, right)
    }

    /// w_f with (stage matrix)ᵀ w_f = v̄_f, zero on driven entries.
    pub fn solve(&self, split: &Split, v_bar: &DVector<f64>) -> Result<DVector<f64>> {
        if split.free.is_empty() {
            return Ok(DVector::zeros(v_bar.len()));
        }
        let solution = self.factor.solve(&split.take(v_bar));
        Ok(split.put(&solution.ok_or_else(|| singular("adjoint"))?))
    }
}

/// Columns dv, zero on driven rows, with `matrix` · dv_f = right_f.
pub(super) fn solve_columns(
    matrix: &IslandMatrix,
    split: &Split,
    right: &DMatrix<f64>,
) -> Result<DMatrix<f64>> {
    if split.free.is_empty() {
        return Ok(DMatrix::zeros(right.nrows(), right.ncols()));
    }
    let factor = matrix.factored(&split.free, false);
    let solution = factor.solve_columns(&split.take_rows(right));
    Ok(split.put_rows(&solution.ok_or_else(|| singular("tangent"))?))
}

fn singular(what: &str) -> Error {
    Error::Solver {
        what: format!("{what} of an implicit stage"),
        iterations: 0,
        residual: f64::INFINITY,
        tolerance: 0.0,
        remedy: "the stage matrix is singular: take a smaller time step".into(),
    }
}
