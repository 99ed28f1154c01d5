//! Explicit Runge–Kutta methods in (chart of q, p̂) whose stages each lean on the one before: the midpoint rule
//! (second order) and the classical method (fourth order).
//!
//! Rotations are integrated in a rotation-vector chart around the start of the step, whose rate is
//! the inverse left Jacobian times the angular velocity, so the order isn't lost on the group.
//!
//! Momenta are summed as they are about a point that drifts with the water ([`crate::dynamics::Drift`]) from the start of the step on: π = (1 − τ D) p̂, whose rate is
//! φ = (1 − τ D) f − D p̂. A step in a current is then the step that the same bodies make in still water.

use super::readout::{self, ReadOut};
use super::split::{Split, When};
use super::stages::{Forces, Stages, StepDerivatives, Tableau};
use super::start::Start;
use super::{State, StateBar, StateTangents, StepBar, StepTangents};
use crate::Result;
use crate::dynamics::Linearisation;
use crate::dynamics::answers::Answers;
use crate::dynamics::slopes::columns;
use nalgebra::{DMatrix, DVector};

/// The explicit midpoint rule.
pub(super) const SECOND: Tableau = Tableau {
    nodes: &[0.0, 0.5],
    weights: &[0.0, 1.0],
};

/// The classical method.
pub(super) const FOURTH: Tableau = Tableau {
    nodes: &[0.0, 0.5, 0.5, 1.0],
    weights: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
};

struct RungeKuttaStage<'a> {
    /// The first stage has none: it is the step's own.
    own: Option<Linearisation<'a>>,
    split: Split,
    xi: DVector<f64>,
    p: DVector<f64>,
    /// Time since the start of the step, s.
    after: f64,
    v: DVector<f64>,
    /// Whether v is the velocity read out at the state.
    read_out: bool,
    chart_rate: DVector<f64>,
    force: DVector<f64>,
    /// φ.
    drifting: DVector<f64>,
}

impl<'a> RungeKuttaStage<'a> {
    fn at<'s>(&'s self, start: &Start<'s, 'a>) -> &'s Linearisation<'a> {
        self.own.as_ref().unwrap_or(start.e)
    }

    /// Its velocity, and what the water answered to it.
    fn known(&self, start: &Start<'_, 'a>) -> (DVector<f64>, Answers) {
        (self.v.clone(), self.at(start).answers([&self.v]))
    }
}

/// The stages. `force` gives that of stage i, from its system and velocity; of those after the first velocities and answers may be `known`.
fn stages<'a>(
    start: &Start<'_, 'a>,
    tableau: &Tableau,
    momentum: &DVector<f64>,
    known: &[(DVector<f64>, Answers)],
    force: impl Fn(usize, &Linearisation, &DVector<f64>) -> Result<DVector<f64>>,
) -> Result<Vec<RungeKuttaStage<'a>>> {
    let (s, state) = (start.stepper, start.state);
    let tree = &s.system.tree;
    let nv = tree.velocities();
    let mut out: Vec<RungeKuttaStage> = Vec::with_capacity(tableau.nodes.len());
    for (i, node) in tableau.nodes.iter().enumerate() {
        let t = s.time(state) + node * s.dt;
        let split = s.split(&start.input.hold, When::At(t));
        let drift = &s.system.drift;
        let after = node * s.dt;
        let (xi, p) = match out.last() {
            Some(last) => (
                after * &last.chart_rate,
                drift.carry(after, momentum + after * &last.drifting),
            ),
            None => (DVector::zeros(nv), momentum.clone()),
        };
        let own = if i == 0 {
            None
        } else {
            let mut q = tree.integrate(&state.q, &xi);
            s.place_motions(&mut q, t);
            Some(s.system.linearise(s.parameters, &q, t)?)
        };
        let at = own.as_ref().unwrap_or(start.e);
        // The readout's, unless a joint is newly held or released.
        let read_out = i == 0 && split.is_driven == s.split(&state.held, When::At(t)).is_driven;
        let known = i.checked_sub(1).and_then(|i| known.get(i));
        let v = match known {
            _ if read_out => start.v.clone(),
            Some((v, answers)) => {
                at.recall(answers);
                v.clone()
            }
            None => {
                if let Some(last) = out.last() {
                    at.begin_near(last.at(start), &last.v);
                }
                readout::solve(at, &split, &p)?
            }
        };
        let chart_rate = tree.chart_rate(&xi, &v);
        let force = force(i, at, &v)?;
        let drifting = drift.carry(-after, force.clone()) - drift.turn(&p);
        out.push(RungeKuttaStage {
            own,
            split,
            xi,
            p,
            after,
            v,
            read_out,
            chart_rate,
            force,
            drifting,
        });
    }
    Ok(out)
}

pub(super) fn step(start: &Start, tableau: &'static Tableau) -> Result<(State, Stages)> {
    let dt = start.stepper.dt;
    let momentum = start.momentum();
    let control = &start.input.control;
    let stages = stages(start, tableau, &momentum, &[], |_, e, v| {
        e.force(v, control)
    })?;
    let zero = DVector::zeros(start.v.len());
    let xi = tableau.sum(dt, zero, stages.iter().map(|s| &s.chart_rate));
    let y = tableau.sum(dt, momentum, stages.iter().map(|s| &s.drifting));
    let y = start.stepper.system.drift.carry(dt, y);
    let next = start.next_state(start.arrive(&xi), y);
    let known = match start.e.scattered() {
        Some(_) => stages[1..].iter().map(|stage| stage.known(start)).collect(),
        None => Vec::new(),
    };
    let mut all: Vec<DVector<f64>> = stages.into_iter().map(|stage| stage.force).collect();
    all.pop();
    let forces = Forces {
        tableau,
        all,
        known,
    };
    Ok((next, Stages::RungeKutta(forces)))
}

/// What the derivatives of a step need.
pub(super) struct Adjoint<'a> {
    tableau: &'static Tableau,
    stages: Vec<RungeKuttaStage<'a>>,
    /// Chart coordinates after the step.
    xi: DVector<f64>,
}

impl<'a> Adjoint<'a> {
    pub fn new(start: &Start<'_, 'a>, forces: &Forces) -> Result<Self> {
        let (dt, nv) = (start.stepper.dt, start.v.len());
        let tableau = forces.tableau;
        // That of the last stage isn't asked for here.
        let force = |i: usize, _: &Linearisation, _: &DVector<f64>| {
            Ok(forces.all.get(i).cloned().unwrap_or(DVector::zeros(nv)))
        };
        let stages = stages(start, tableau, &start.momentum(), &forces.known, force)?;
        let rates = stages.iter().map(|s| &s.chart_rate);
        Ok(Self {
            tableau,
            xi: tableau.sum(dt, DVector::zeros(nv), rates),
            stages,
        })
    }
}

impl<'a> StepDerivatives<'a> for Adjoint<'a> {
    fn jvp(&self, start: &Start<'_, 'a>, along: &StepTangents) -> Result<StateTangents> {
        let (tree, dt) = (&start.stepper.system.tree, start.stepper.dt);
        let (inputs, control) = (along.inputs, &start.input.control);
        let drift = &start.stepper.system.drift;
        let mut momentum = start.momentum_jvp(along)?;
        start.split.forget_driven_rows(&mut momentum);
        let mut xi = DMatrix::zeros(momentum.nrows(), momentum.ncols());
        let mut y = momentum.clone();
        let mut last: Option<[DMatrix<f64>; 2]> = None;
        for (i, stage) in self.stages.iter().enumerate() {
            let e = stage.at(start);
            let h = stage.after;
            let (stage_xi, p) = match &last {
                Some([rate, drifting]) => (
                    h * rate,
                    columns(&(&momentum + h * drifting), |p| drift.carry(h, p.clone())),
                ),
                None => (xi.clone(), momentum.clone()),
            };
            let mut q = tree.integrate_jvp(&stage.xi, along.q, &stage_xi);
            stage.split.forget_moved_rows(&mut q);
            let at = StateTangents { q, y: p };
            let v = match stage.read_out {
                true => along.v.clone(),
                false => {
                    let momentum =
                        e.momentum_slopes(&stage.v, &stage.split.free, inputs.has_parameters())?;
                    readout::solve_jvp(e, &stage.split, &stage.p, &momentum, &at, inputs)?
                }
            };
            let rate = tree.chart_rate_jvp(&stage.xi, &stage.v, &stage_xi, &v);
            let force = e.force_slopes(
                &stage.v,
                control,
                &stage.split.free,
                inputs.has_parameters(),
            )?;
            let force = force.along(&at.q, Some(&v), inputs);
            let drifting =
                columns(&force, |f| drift.carry(-h, f.clone())) - columns(&at.y, |p| drift.turn(p));
            let weight = self.tableau.weights[i] * dt;
            xi += weight * &rate;
            y += weight * &drifting;
            last = Some([rate, drifting]);
        }
        Ok(StateTangents {
            q: start.arrive_jvp(&self.xi, along.q, &xi),
            y: start.next_momenta(columns(&y, |y| drift.carry(dt, y.clone()))),
        })
    }

    fn vjp(&self, start: &Start<'_, 'a>, next_bar: &StateBar) -> Result<StepBar> {
        let (tree, dt) = (&start.stepper.system.tree, start.stepper.dt);
        let mut bar = StepBar::zeros(start.e);
        let (q_direct, xi_bar) = start.arrive_vjp(&self.xi, &next_bar.q);
        bar.state.q += q_direct;
        let drift = &start.stepper.system.drift;
        let y_bar = drift.carry_back(dt, start.next_momentum_bar(next_bar));
        let mut start_bar = y_bar.clone();
        let spread = |bar: &DVector<f64>| -> Vec<DVector<f64>> {
            (self.tableau.weights.iter())
                .map(|w| *w * dt * bar)
                .collect()
        };
        let (mut rate_bar, mut force_bar) = (spread(&xi_bar), spread(&y_bar));
        for (i, stage) in self.stages.iter().enumerate().rev() {
            let e = stage.at(start);
            let mut own = StepBar::zeros(e);
            let (mut stage_xi_bar, v_bar) = tree.chart_rate_vjp(&stage.xi, &stage.v, &rate_bar[i]);
            let (z, control) = (
                drift.carry_back(-stage.after, force_bar[i].clone()),
                &start.input.control,
            );
            // Where products couple many bodies the velocity read out at the state is carried on with the force at it.
            if stage.read_out && e.scattered().is_none() {
                let force = e.force_vjp(&stage.v, control, &z)?;
                own.add(1.0, &force);
                bar.v += v_bar + &force.v;
            } else {
                let at = ReadOut {
                    split: &stage.split,
                    hat: &stage.p,
                    v: &stage.v,
                };
                readout::force_vjp(e, &at, control, [&z, &v_bar], &mut own)?;
            }
            stage.split.forget_moved(&mut own.state.q);
            let (q_bar, xi_bar) = tree.integrate_vjp(&stage.xi, &own.state.q);
            bar.state.q += q_bar;
            stage_xi_bar += xi_bar;
            bar.control += own.control;
            bar.parameters.add(&own.parameters);
            let p_bar = &own.state.y - drift.turn_back(&force_bar[i]);
            let p_bar = drift.carry_back(stage.after, p_bar);
            start_bar += &p_bar;
            if i > 0 {
                rate_bar[i - 1] += stage.after * stage_xi_bar;
                force_bar[i - 1] += stage.after * &p_bar;
            }
        }
        start.split.forget_driven(&mut start_bar);
        start.momentum_vjp(&start_bar, &mut bar)?;
        Ok(bar)
    }
}
