//! Contact at the end of a step, as a convex problem: from the velocity v* that the step would end with,
//!
//! ```text
//! M(q) (v − v*) = Δt g(q, v)          g = −∂P/∂v: contact's generalised forces
//! ```
//!
//! is the least of ½ (v − v*)ᵀ M (v − v*) + Δt P(v), which is strictly convex: Newton's method with a search along its step always gets there, however
//! stiff. M holds the water. The impulse goes to the frame momenta at q, and q is stepped with v.
//!
//! # References
//! A. Castro et al., "An Unconstrained Convex Formulation of Compliant Contact", 2022.

use super::frozen;
use super::hessian::Hessian;
use super::line::{Step, Trial, search};
use super::reaction::{Reaction, Resisting};
use super::split::share;
use super::start::Start;
use super::{StepBar, StepTangents};
use crate::dynamics::Dual;
use crate::dynamics::slopes::columns;
use crate::dynamics::tied::Places;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::cell::Cell;

/// Most Newton iterations.
const ITERATIONS: usize = 200;
/// Imbalance, relative to what is balanced, below which the search ends once it stops shrinking; at once where a step is as fine as it is asked to be.
const RESIDUAL: f64 = 1e-12;
/// What is accepted at the last iteration.
const ENOUGH: f64 = 1e-9;
/// Imbalance above which a step solved by products looks ahead ([`frozen`]), and the relative residual that it is solved to then.
const FAR: f64 = 0.05;
const AHEAD: f64 = 1e-3;
/// Coarsest relative residual of a step that is solved for by products.
const COARSE: f64 = 1e-2;
/// Of [`RESIDUAL`], what such a step leaves at the finest.
const FINE: f64 = 0.3;

/// The velocity after contact that acts for `dt` (s), from the one before it; the same bits where nothing presses.
pub(super) fn solve(
    start: &Start,
    before: &DVector<f64>,
    dt: f64,
    resisting: Resisting,
) -> Result<DVector<f64>> {
    let still = DVector::zeros(before.len());
    match start.near.contact_acts(before) {
        true => solve_pushed(start, before, &still, dt, before, resisting),
        // At no force v* is the least of the convex problem.
        false => start.near.check_damping().map(|()| before.clone()),
    }
}

/// The same with an impulse `push` beside contact, user coordinates, from a first guess.
pub(super) fn solve_pushed(
    start: &Start,
    before: &DVector<f64>,
    push: &DVector<f64>,
    dt: f64,
    guess: &DVector<f64>,
    resisting: Resisting,
) -> Result<DVector<f64>> {
    let (e, split) = (start.near, start.split);
    e.check_damping()?;
    if split.free.is_empty() {
        return Ok(before.clone());
    }
    let reaction = Reaction::new(start, before, resisting);
    let sized = split.sizes(&e.mass_blocks().diagonal());
    let summands = e.mass_blocks().mapped(DMatrix::abs);
    let least = sized(&summands.times(&before.abs())).max(sized(push));
    // Solved by products, steps are as fine as they have to be, beside what earlier ones lack.
    let by_products = e.scattered().is_some();
    let in_water = Cell::new(0.0);
    let at = |v: DVector<f64>, moved: Option<DVector<f64>>, behind: Vec<f64>| {
        let moved = moved.unwrap_or_else(|| e.mass_times(&(&v - before)));
        let [force, effort] = reaction.force_and_effort(&v);
        let imbalance = &moved - push - dt * force;
        let size = sized(&summands.times(&v.abs())).max(least);
        let size = size.max(dt * sized(&effort));
        let lacking = share(
            behind.iter().map(|x| x * x).sum::<f64>().sqrt(),
            in_water.get(),
        );
        let own = share(sized(&imbalance), size);
        let lacks = lacking > own;
        Trial {
            v,
            moved,
            behind,
            imbalance,
            lacks,
            residual: if lacks { lacking } else { own },
        }
    };
    let mut now = at(guess.clone(), None, Vec::new());
    let (mut previous, mut looked) = (f64::INFINITY, false);
    let mut places = Places::default();
    for iteration in 0..ITERATIONS {
        let stalled = now.residual >= 0.25 * previous;
        let converged =
            now.residual == 0.0 || (now.residual <= RESIDUAL && (stalled || by_products));
        if converged || (iteration + 1 == ITERATIONS && now.residual <= ENOUGH) {
            e.check()?;
            return Ok(now.v);
        }
        if !now.residual.is_finite() {
            break;
        }
        let looks = by_products && now.residual > FAR;
        let forced = match (looks, previous.is_finite() && !looked) {
            (true, _) => AHEAD,
            // What was come nearer by looking ahead says nothing of the next step.
            (false, false) => COARSE,
            // As the search comes nearer (S. C. Eisenstat, H. F. Walker, "Choosing the Forcing Terms in an Inexact Newton Method", 1996).
            (false, true) => (now.residual / previous).powi(2),
        };
        let goal = forced.max(FINE * RESIDUAL / now.residual).min(COARSE);
        looked = looks;
        previous = now.residual;
        let mut hessian = |v: &DVector<f64>| Hessian::new(e, split, &reaction, v, dt, &mut places);
        let ahead = || frozen::solve(&now, &mut hessian, (split, &reaction, dt), &at);
        let seen = looks.then(ahead).transpose()?;
        let mut step = |seen: Option<&DVector<f64>>| -> Result<Step> {
            let v = seen.unwrap_or(&now.v);
            let hessian = hessian(v)?;
            // The imbalance, with forces that are linear about what is seen ahead.
            let right = match seen {
                None => now.imbalance.clone(),
                Some(v) => {
                    let force = reaction.force(v, Dual::User);
                    &now.moved - push - dt * (force + reaction.force_jvp(v, &(&now.v - v)))
                }
            };
            let (step, left) = hessian.step(&split.take(&right), &now.behind, goal);
            let step = split.put(&step);
            let sizes = [before, &(&now.v - &step)].map(|v| hessian.size(v));
            in_water.set(sizes.into_iter().fold(in_water.get(), f64::max));
            // Where a product with M is a solve it follows from that of the step, (M − Δt ∂g/∂v) s being the imbalance.
            let moved = by_products.then(|| right + dt * reaction.force_jvp(v, &step));
            Ok(Step {
                v: step,
                moved,
                left,
            })
        };
        let mut next = step(seen.as_ref())?;
        // Up the energy, as it may be where the exchange decides what presses: as without looking.
        if seen.is_some() && now.imbalance.dot(&next.v) <= 0.0 {
            next = step(None)?;
        }
        now = search(&now, &next, &at);
    }
    Err(Error::Solver {
        what: start.stage_name(),
        iterations: ITERATIONS,
        residual: now.residual,
        tolerance: RESIDUAL,
        remedy: "contact doesn't converge: take a smaller time step, or smaller contact.stiffness, contact.friction and limit_stiffness"
            .into(),
    })
}

/// The frame momenta `hat` with what contact adds in a step, from the velocities before and after it.
pub(super) fn pressed(
    start: &Start,
    before: &DVector<f64>,
    after: &DVector<f64>,
    hat: DVector<f64>,
    resisting: Resisting,
) -> DVector<f64> {
    if before == after && !start.near.contact_acts(after) {
        return hat;
    }
    // Where the momenta are taken drifts on during the step.
    let (dt, drift) = (start.stepper.dt, &start.stepper.system.drift);
    let reaction = Reaction::new(start, before, resisting);
    hat + drift.carry(dt, dt * reaction.force(after, Dual::Frame))
}

/// A problem of contact that has been solved: what the derivatives of [`solve`] and [`pressed`] need.
pub(super) struct Problem<'a> {
    before: DVector<f64>,
    after: DVector<f64>,
    /// For which contact acts, s.
    time: f64,
    resisting: Resisting,
    acting: Acting<'a>,
}

enum Acting<'a> {
    /// Nothing presses.
    No,
    /// Something does, but every velocity is driven.
    Driven,
    /// The problem's Hessian at its solution, factored.
    Solved(Hessian<'a>),
}

impl<'a> Problem<'a> {
    /// With the velocities before and after contact that acts for `time` (s).
    pub fn new(
        start: &Start<'_, 'a>,
        before: &DVector<f64>,
        after: &DVector<f64>,
        time: f64,
        resisting: Resisting,
    ) -> Result<Self> {
        match start.near.contact_acts(before) {
            true => Self::pushed(start, before, after, time, resisting),
            false => Ok(Self {
                before: before.clone(),
                after: after.clone(),
                time,
                resisting,
                acting: Acting::No,
            }),
        }
    }

    /// The same beside an impulse.
    pub fn pushed(
        start: &Start<'_, 'a>,
        before: &DVector<f64>,
        after: &DVector<f64>,
        time: f64,
        resisting: Resisting,
    ) -> Result<Self> {
        let (e, split) = (start.near, start.split);
        let acting = if split.free.is_empty() {
            Acting::Driven
        } else {
            let reaction = Reaction::new(start, before, resisting);
            let mut places = Places::default();
            Acting::Solved(Hessian::new(e, split, &reaction, after, time, &mut places)?)
        };
        Ok(Self {
            before: before.clone(),
            after: after.clone(),
            time,
            resisting,
            acting,
        })
    }

    /// Tangents of [`solve`], from those of the velocity before contact.
    pub fn solve_jvp(
        &self,
        start: &Start<'_, 'a>,
        along: &StepTangents,
        before: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>> {
        let none = DMatrix::zeros(before.nrows(), before.ncols());
        self.solve_pushed_jvp(start, along, before, &none)
    }

    /// The same of [`solve_pushed`], with those of the impulse.
    pub fn solve_pushed_jvp(
        &self,
        start: &Start<'_, 'a>,
        along: &StepTangents,
        before: &DMatrix<f64>,
        push: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>> {
        let Acting::Solved(hessian) = &self.acting else {
            return Ok(before.clone());
        };
        let (e, split) = (start.e, start.split);
        let change = &self.after - &self.before;
        let reaction = self.reaction(start);
        let pressed = reaction.slopes(&self.after, Dual::User, &split.free);
        let inertia = e.mass_slopes(&change, &split.free, along.inputs.has_parameters())?;
        let moved = columns(before, |v| e.mass_times(v));
        let right = moved + push + self.time * pressed.along(along, before, None)
            - inertia.along(along.q, None, along.inputs);
        let mut after = before.clone();
        let free = hessian.solve_columns(&split.take_rows(&right));
        e.check()?;
        for (k, &i) in split.free.iter().enumerate() {
            after.row_mut(i).copy_from(&free.row(k));
        }
        Ok(after)
    }

    /// Transpose of [`solve`]: from the cotangent of the velocity after contact to that of the one before; the rest is added to
    /// `bar`.
    pub fn solve_vjp(
        &self,
        start: &Start<'_, 'a>,
        after_bar: &DVector<f64>,
        bar: &mut StepBar,
    ) -> Result<DVector<f64>> {
        Ok(self.solve_pushed_vjp(start, after_bar, bar)?.0)
    }

    /// The same of [`solve_pushed`], with that of the impulse.
    pub fn solve_pushed_vjp(
        &self,
        start: &Start<'_, 'a>,
        after_bar: &DVector<f64>,
        bar: &mut StepBar,
    ) -> Result<(DVector<f64>, DVector<f64>)> {
        let Acting::Solved(hessian) = &self.acting else {
            return Ok((after_bar.clone(), DVector::zeros(after_bar.len())));
        };
        let (e, split) = (start.e, start.split);
        let w = split.put(&hessian.solve(&split.take(after_bar)));
        let reacted = (self.reaction(start)).force_vjp(&self.after, &w, Dual::User);
        bar.add(self.time, &reacted.force);
        bar.v += self.time * reacted.start;
        bar.add(-1.0, &e.mass_vjp(&(&self.after - &self.before), &w)?);
        // Driven velocities are what they are.
        let mut before_bar = after_bar.clone();
        let moved = e.mass_times(&w) + self.time * reacted.before;
        for &i in &split.free {
            before_bar[i] = moved[i];
        }
        Ok((before_bar, w))
    }

    fn reaction<'r>(&'r self, start: &Start<'r, 'a>) -> Reaction<'r, 'a> {
        Reaction::new(start, &self.before, self.resisting)
    }

    /// Tangents of [`pressed`], from those of the velocities before and after contact and of the momenta before it.
    pub fn pressed_jvp(
        &self,
        start: &Start<'_, 'a>,
        along: &StepTangents,
        [before, after]: [&DMatrix<f64>; 2],
        hat: DMatrix<f64>,
    ) -> DMatrix<f64> {
        if matches!(self.acting, Acting::No) {
            return hat;
        }
        let reaction = self.reaction(start);
        let slopes = reaction.slopes(&self.after, Dual::Frame, &start.split.free);
        let pressed = slopes.along(along, before, Some(after));
        let (dt, drift) = (start.stepper.dt, &start.stepper.system.drift);
        hat + columns(&pressed, |g| drift.carry(dt, dt * g))
    }

    /// Transpose of [`pressed`]: the cotangents of the velocities before and after contact; the rest is added to `bar`.
    pub fn pressed_vjp(
        &self,
        start: &Start<'_, 'a>,
        hat_bar: &DVector<f64>,
        bar: &mut StepBar,
    ) -> [DVector<f64>; 2] {
        if matches!(self.acting, Acting::No) {
            return [(); 2].map(|()| DVector::zeros(hat_bar.len()));
        }
        let (dt, drift) = (start.stepper.dt, &start.stepper.system.drift);
        let impulse_bar = drift.carry_back(dt, hat_bar.clone());
        let pressed = (self.reaction(start)).force_vjp(&self.after, &impulse_bar, Dual::Frame);
        bar.add(dt, &pressed.force);
        bar.v += dt * pressed.start;
        [dt * pressed.before, dt * pressed.force.v]
    }
}
