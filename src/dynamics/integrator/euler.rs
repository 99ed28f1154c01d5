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

use super::end_contact;
use super::energy::{self, Closure};
use super::hold::Hold;
use super::plan::Halt;
use super::quasi::{self, Descended, Trial};
use super::rule::Rule;
use super::split::share;
use super::stage_adjoint::AdjointStage;
use super::stage_factor::{StageFactor, StageMatrix};
use super::stages::{ContactVelocities, Stages, StepDerivatives};
use super::start::Start;
use super::{Integrator, State, StateBar, StateTangents, StepBar, StepTangents, Stepper};
use crate::adjoint::lie::angular;
use crate::dynamics::Linearisation;
use crate::dynamics::island_matrix::IslandMatrix;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Most Newton iterations of a stage; quadratic convergence needs four or five.
const ITERATIONS: usize = 40;
/// Residual that is accepted at the last iteration, and below which none is asked to fall.
const ENOUGH: f64 = 1e-11;
/// What is left of forces that cancel, of what they are by themselves, and is rounding.
const ROUNDED: f64 = 1e-13;
/// Distance from the world's origin, m, from which on its moments hide those of bodies of a metre or less: their part of them falls with its square.
const FAR: f64 = 1e3;
/// Part of the residual that a descent which ends short of the solution may leave.
const NEARER: f64 = 0.5;
/// Shortest part of Newton's step.
const SHORTEST: f64 = 1.0 / 4096.0;

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
        let force = self.start.stage_force(e, &v, rule)?;
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

    /// The factor of its matrix at a trial; none of a singular one.
    fn factor(&self, now: &Trial) -> Result<Option<StageFactor<'a>>> {
        let made = StageMatrix::new(&self.start, self.e, &now.v, self.rule)?;
        Ok(self.factored(&made, now))
    }

    fn factored(&self, made: &StageMatrix<'_, 'a>, now: &Trial) -> Option<StageFactor<'a>> {
        let matrix = made.matrix(&now.v, &now.reached, self.rule);
        made.factored(self.start.split, &matrix, false)
    }

    /// What momenta are weighed by in turn: the inertia of the free velocities, each by itself.
    pub fn weight(&self) -> DVector<f64> {
        self.start.split.take(&self.e.mass_blocks().diagonal())
    }

    /// Whether what is left at a trial says nothing: what the water's solves leave open, where momenta are products of them, or rounding of forces that cancel. What is at
    /// rest has no momentum to measure that by.
    pub fn is_noise(&self, now: &Trial) -> bool {
        let in_water = self.e.scattered().map_or(0.0, |_| noise(self.e));
        let rounded = || {
            let effort = self.e.load_effort(&now.v, &self.start.input.control);
            now.merit <= ROUNDED * self.sized(&(self.rule.h * effort))
        };
        now.residual <= in_water || rounded()
    }

    /// The factor at the first trial of a step, if the step isn't too long.
    pub fn first_factor(&self, now: &Trial) -> std::result::Result<Option<StageFactor<'a>>, Halt> {
        let start = &self.start;
        let made = StageMatrix::new(start, self.e, &now.v, self.rule)?;
        if start.plan.may_cut()
            && let Some(times) = made.excess(start.split, &now.v, self.rule)
        {
            return Err(Halt::TooLong(times));
        }
        Ok(self.factored(&made, now))
    }
}

/// Relative change of the velocity, or of momenta, that says nothing: rounding, or what the coupled solve leaves open.
pub(super) fn noise(e: &Linearisation) -> f64 {
    (10.0 * e.report().residual).max(1e-11)
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
    let (split, tree) = (start.split, &e.system.tree);
    let equation = Equation::new(start, e, hat, rule);
    let mut now = equation.at(split.complete(guess))?;
    let mut previous = f64::INFINITY;
    'newton: for iteration in 0..ITERATIONS {
        let residual = now.residual;
        // Stop where rounding ends the quadratic convergence.
        let at_last = iteration + 1 == ITERATIONS && residual <= ENOUGH;
        let stalled = residual > 0.5 * previous;
        if now.converged(previous) || at_last || (stalled && equation.is_noise(&now)) {
            return Ok(now.into());
        }
        if !residual.is_finite() || iteration + 1 == ITERATIONS {
            break;
        }
        previous = residual;
        let factor = match iteration {
            0 => equation.first_factor(&now)?,
            _ => equation.factor(&now)?,
        };
        // Newton's method is none where the matrix lacks how forces of what bodies exchange change.
        let lacks = e.scattered().is_some();
        if let Some(factor) = factor.as_ref().filter(|_| iteration == 0 || lacks) {
            let (weight, at) = (equation.weight(), |v| equation.at(v));
            let ends = (|now: &Trial| equation.is_noise(now), quasi::solved(e));
            match quasi::descend(split, &weight, factor, &now, ends, at) {
                Descended::Solved(found) => return Ok(found.into()),
                Descended::Nearer(found) if lacks && found.residual <= NEARER * residual => {
                    now = found;
                    continue;
                }
                _ => {}
            }
        }
        let step = factor.and_then(|factor| factor.solve(&split.take(&now.defect), Some(&now.v)));
        let Some(step) = step else {
            break;
        };
        let step = split.put(&step);
        let mut next = equation.at(&now.v - &step)?;
        let mut length = 1.0;
        while !(next.merit < now.merit || next.residual <= ENOUGH) {
            length *= 0.5;
            if length < SHORTEST {
                if equation.is_noise(&now) {
                    return Ok(now.into());
                }
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
    let poses = e.kinematics.poses.iter();
    let farthest = poses.map(|p| p.translation.norm()).fold(0.0, f64::max);
    let remedy = match farthest > FAR {
        true => format!(
            "bodies are up to {farthest:.1e} m from the world's origin, and momenta about it lose their digits: put the origin near the bodies, or take an explicit integrator"
        ),
        false => format!(
            "the time step is too long for these velocities or forces: take a smaller one (bodies turn by up to {:.2} rad in it){}{}",
            turning * rule.reach.max(2.0 * (rule.h - rule.reach)),
            match rule.reach > 0.0 && tree.links().iter().any(|link| link.parent.is_some()) {
                true =>
                    ", or the integrator `midpoint`, which bears light bodies that carry heavy ones",
                false => "",
            },
            match start.near.may_touch() {
                true => ", or where surfaces are pressed together a larger `contact.stiffness`",
                false => "",
            }
        ),
    };
    Err(Error::Solver {
        what: start.stage_name(),
        iterations: ITERATIONS,
        residual,
        tolerance: 1e-13,
        remedy,
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
    let (next, velocities) = free(start)?.ends(start)?;
    Ok((next, Stages::Contact(velocities)))
}

/// What a step comes to before contact is solved.
struct Free {
    v: DVector<f64>,
    /// Frame momenta, with what contact bears already.
    hat: DVector<f64>,
    hold: Option<Hold>,
}

fn free(start: &Start) -> std::result::Result<Free, Halt> {
    let (s, e) = (start.stepper, start.e);
    let hold = Hold::new(start)?;
    let p = momentum(start, hold.as_ref());
    let stage = solve_stage(start, e, &p, rule(s), start.v)?;
    Ok(Free {
        v: stage.v,
        hat: p + s.dt * stage.force,
        hold,
    })
}

/// The momenta from which the stage is solved.
fn momentum(start: &Start, hold: Option<&Hold>) -> DVector<f64> {
    let p = start.momentum();
    match hold {
        None => p,
        Some(hold) => p + &hold.impulse.frame,
    }
}

impl Free {
    fn presses(&self, start: &Start) -> bool {
        self.hold.is_some() || start.near.touches(&self.v)
    }

    fn ends(self, start: &Start) -> Result<(State, ContactVelocities)> {
        end_contact::apply(start, self.v, self.hat, self.hold)
    }

    fn touching(self, start: &Start) -> std::result::Result<(State, Stages), Halt> {
        let (next, velocities) = self.ends(start)?;
        Ok((next, Stages::Touching(velocities)))
    }
}

/// The step of an integrator that leaves those in which surfaces press to this one.
pub(super) fn touching_step(start: &Start) -> std::result::Result<(State, Stages), Halt> {
    free(start)?.touching(start)
}

/// The same, if surfaces press in it.
pub(super) fn touching_step_if_any(
    start: &Start,
) -> std::result::Result<Option<(State, Stages)>, Halt> {
    let free = free(start)?;
    let presses = free.presses(start);
    presses.then(|| free.touching(start)).transpose()
}

/// The same, whose energy is closed.
pub(super) fn closed_step(start: &Start) -> std::result::Result<(State, Stages), Halt> {
    let (next, stages) = step(start)?;
    match &stages {
        Stages::Contact(velocities) => Ok((energy::close(start, velocities, next)?, stages)),
        _ => Ok((next, stages)),
    }
}

/// What the derivatives of a step need.
pub(super) struct Adjoint<'s, 'a> {
    contact: end_contact::Adjoint<'s, 'a>,
    /// p̂ + Δt f.
    reached: DVector<f64>,
    stage: AdjointStage<'a>,
    hold: Option<Hold>,
    closure: Option<Closure<'a>>,
}

impl<'s, 'a> Adjoint<'s, 'a> {
    pub fn new(start: &Start<'_, 'a>, velocities: &'s ContactVelocities) -> Result<Self> {
        let (s, e) = (start.stepper, start.e);
        let control = &start.input.control;
        let force = e.force(&velocities.before, control)?;
        let held = velocities.held.as_ref();
        let hold = held.map(|held| Hold::made(start, held));
        let reached = momentum(start, hold.as_ref()) + s.dt * force;
        let contact = end_contact::Adjoint::new(start, velocities)?;
        let closure = match s.integrator {
            Integrator::EnergyEuler => {
                let next = contact.reached(start, reached.clone());
                Closure::new(start, velocities, &next)?
            }
            _ => None,
        };
        Ok(Self {
            closure,
            stage: AdjointStage::new(start, e, &velocities.before, &reached, rule(s))?,
            contact,
            reached,
            hold,
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
        let hold = self.hold.as_ref();
        let borne = hold
            .map(|hold| hold.impulse_jvp(start, along))
            .transpose()?;
        let mut held = start.momentum_jvp(along)? + s.dt * force.along(q, None, inputs);
        if let Some(borne) = &borne {
            held += &borne.frame;
        }
        let right = by_q.dense() * q + by_hat.dense() * &held - momentum.along(q, None, inputs);
        let v = self.stage.solve_jvp(e, split, &right)?;
        let hat = held + s.dt * (force.v * &v);
        let (mut next, acting) = (self.contact).apply_jvp(start, along, &v, hat, borne.as_ref())?;
        if let Some(closure) = &self.closure {
            let velocities = self.contact.velocities;
            next.y = closure.jvp(start, velocities, along, &next, [&v, &acting])?;
        }
        Ok(next)
    }

    fn vjp(&self, start: &Start<'_, 'a>, next_bar: &StateBar) -> Result<StepBar> {
        let (s, e, split) = (start.stepper, start.e, start.split);
        let before = &self.contact.velocities.before;
        let mut bar = StepBar::zeros(e);
        let mut end = match &self.closure {
            None => self.contact.apply_vjp(start, next_bar, None, &mut bar)?,
            Some(closure) => {
                let velocities = self.contact.velocities;
                let own = closure.vjp(start, velocities, next_bar, &mut bar)?;
                let [own_before, own_acting] = own.velocities;
                let acting = Some(&own_acting);
                let mut end = (self.contact).apply_vjp(start, &own.next, acting, &mut bar)?;
                end.before += own_before;
                end
            }
        };
        // v̄ of p̂⁺ through f; only the transpose of ∂f/∂v is needed here.
        end.before += s.dt * self.stage.rates_vjp(e, &end.hat)?;
        let w = self.stage.solve(e, split, &end.before)?;
        let tree = &e.system.tree;
        let [q_bar, _, hat_bar] =
            tree.chart_momentum_vjp(&e.q, &(s.dt * before), &self.reached, &w);
        bar.state.q += q_bar;
        let z_total = end.hat + hat_bar;
        bar.add(s.dt, &e.force_vjp(before, &start.input.control, &z_total)?);
        bar.add(-1.0, &e.momentum_vjp(before, &w)?);
        start.momentum_vjp(&z_total, &mut bar)?;
        if let Some(hold) = &self.hold {
            end.borne.frame += z_total;
            hold.impulse_vjp(start, &end.borne, &mut bar)?;
        }
        Ok(bar)
    }
}
