//! A rollout as steps with transposes: controller, integrator and observations together.

use super::{Fidelity, Observation, Policy, Sample};
use crate::adjoint::lie::{Vec3, Vec6, point_wrench};
use crate::adjoint::step::Step;
use crate::dynamics::{
    Evaluation, Input, Linearisation, Parameters, State, StateBar, StepBar, Stepper,
};
use crate::geometry::Gap;
use crate::water::Clearance;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Everything that a rollout's steps need.
pub(super) struct Trajectory<'a> {
    pub stepper: Stepper<'a>,
    pub policy: &'a dyn Policy,
    pub clearance: &'a Clearance,
    pub fidelity: Fidelity,
    pub controls: &'a DMatrix<f64>,
}

/// Seed at one time.
pub(super) struct Seed {
    pub q: DVector<f64>,
    pub v: DVector<f64>,
    pub positions: DVector<f64>,
    pub rotations: DVector<f64>,
}

/// What one step yields.
pub(super) struct Local {
    pub control: DVector<f64>,
    pub parameters: Parameters,
    pub gains: Vec<f64>,
}

impl<'a> Trajectory<'a> {
    /// The smallest gap at a state, whose bodies must keep apart; not asked for where it has no effect.
    fn gap(&self, state: &State) -> Result<Option<Gap>> {
        let system = self.stepper.system;
        if self.fidelity == Fidelity::Isolated {
            return Ok(None);
        }
        let poses = system.tree.kinematics(&state.q).poses;
        self.clearance.keep_apart(&poses)
    }

    fn observe(&self, e: &Evaluation, state: &State, gap: Option<Gap>) -> Result<Sample> {
        let v = self.stepper.velocity(e, state)?;
        if let Some(bad) = v.iter().position(|x| !x.is_finite()) {
            return Err(Error::Unresolved {
                place: "simulation".into(),
                quantity: format!("velocity v[{bad}]"),
                value: v[bad],
                limit: f64::MAX,
                remedy: "the simulation left what floating point holds: take a smaller time step"
                    .into(),
            });
        }
        let momenta = e.momenta(&v);
        Ok(Sample {
            time: self.stepper.time(state),
            q: state.q.clone(),
            kinetic_energy: e.kinetic_energy(&v),
            potential_energy: e.potential_energy(),
            momentum: e.total_momentum(&v, &momenta),
            largest_momentum: momenta.iter().fold(Vec6::zeros(), |m, h| m.sup(&h.abs())),
            poses: e.kinematics.poses.clone(),
            report: e.report().clone(),
            gap,
            control: DVector::zeros(0),
            hold: Vec::new(),
            memo: None,
            v,
        })
    }

    /// What acts during a step, and the controller's next mode.
    fn input(&self, index: usize, state: &State, sample: &Sample) -> Result<(Input, usize)> {
        let action = self.policy.act(&observation(state, sample));
        let mode = action.mode;
        expect_length("hold", action.hold.len(), self.stepper.system.len(), "body")?;
        let mut control = self.controls.column(index).into_owned();
        if !action.control.is_empty() {
            if action.control.len() != control.len() {
                return Err(Error::input(
                    "controller: control",
                    format!("{} numbers", action.control.len()),
                    format!("must be {} numbers, one per control", control.len()),
                ));
            }
            control += DVector::from_vec(action.control);
        }
        if let Some(bad) = control.iter().position(|x| !x.is_finite()) {
            return Err(Error::input(
                format!("control {bad} at step {index}"),
                control[bad],
                "must be finite",
            ));
        }
        let hold = action.hold;
        Ok((Input { control, hold }, mode))
    }

    /// Cotangents that enter at a state: readings of q, v and poses.
    fn observe_vjp(
        &self,
        e: &Linearisation,
        state: &State,
        sample: &Sample,
        seed: &Seed,
        bar: &mut StepBar,
    ) -> Result<()> {
        let wrenches: Vec<Vec6> = (0..sample.poses.len())
            .map(|b| {
                let p = Vec3::from(seed.positions.fixed_rows::<3>(3 * b));
                let mut w = point_wrench(&sample.poses[b].translation, &p);
                let mut turn = w.fixed_rows_mut::<3>(3);
                turn += seed.rotations.fixed_rows::<3>(3 * b);
                w
            })
            .collect();
        bar.state.q += &seed.q + self.stepper.system.tree.project(&e.kinematics, wrenches);
        let v_bar = &bar.v + &seed.v;
        self.stepper.velocity_vjp(e, state, &sample.v, &v_bar, bar)
    }

    /// Transpose of a step and its controller at a state where `e` was evaluated; the cotangent of the velocity isn't carried on yet.
    fn step_bar(
        &self,
        e: &Linearisation<'a>,
        state: &State,
        sample: &Sample,
        next_bar: &StateBar,
    ) -> Result<(StepBar, Vec<f64>)> {
        let input = Input {
            control: sample.control.clone(),
            hold: sample.hold.clone(),
        };
        let mut bar = self
            .stepper
            .step_vjp(e, state, &sample.v, &input, &sample.memo, next_bar)?;
        let action = (self.policy).act_vjp(&observation(state, sample), &bar.control);
        let velocities = self.stepper.system.tree.velocities();
        expect_length("cotangent of q", action.q.len(), velocities, "velocity")?;
        expect_length("cotangent of v", action.v.len(), velocities, "velocity")?;
        let gains = self.policy.gains().len();
        expect_length("cotangent of the gains", action.gains.len(), gains, "gain")?;
        if !action.q.is_empty() {
            bar.state.q += DVector::from_vec(action.q);
        }
        if !action.v.is_empty() {
            bar.v += DVector::from_vec(action.v);
        }
        Ok((bar, action.gains))
    }

    /// Cotangent of a state from that of the next one alone.
    pub(super) fn state_before(
        &self,
        e: &Linearisation<'a>,
        state: &State,
        sample: &Sample,
        next_bar: &StateBar,
    ) -> Result<StateBar> {
        let run = || {
            let (mut bar, _) = self.step_bar(e, state, sample, next_bar)?;
            let v_bar = bar.v.clone();
            self.stepper
                .velocity_vjp(e, state, &sample.v, &v_bar, &mut bar)?;
            Ok(bar.state)
        };
        run().map_err(|e: Error| e.at_time(sample.time))
    }

    fn reverse_step(
        &self,
        state: &State,
        sample: &Sample,
        next_bar: &StateBar,
        seed: &Seed,
    ) -> Result<(StateBar, Local)> {
        let e = self.stepper.linearise(&state.q)?;
        let (mut bar, gains) = self.step_bar(&e, state, sample, next_bar)?;
        self.observe_vjp(&e, state, sample, seed, &mut bar)?;
        Ok((
            bar.state,
            Local {
                control: bar.control,
                parameters: bar.parameters,
                gains,
            },
        ))
    }

    fn reverse_last(
        &self,
        state: &State,
        sample: &Sample,
        seed: &Seed,
    ) -> Result<(StateBar, Local)> {
        let e = self.stepper.linearise(&state.q)?;
        let mut bar = StepBar::zeros(&e);
        self.observe_vjp(&e, state, sample, seed, &mut bar)?;
        Ok((
            bar.state,
            Local {
                control: DVector::zeros(0),
                parameters: bar.parameters,
                gains: Vec::new(),
            },
        ))
    }
}

/// What the controller sees at a state.
fn observation<'a>(state: &State, sample: &'a Sample) -> Observation<'a> {
    Observation {
        step: state.step,
        time: sample.time,
        q: &sample.q,
        v: &sample.v,
        mode: state.mode,
    }
}

/// A controller's list is empty or has one entry per item.
fn expect_length(what: &str, given: usize, expected: usize, item: &str) -> Result<()> {
    if given == 0 || given == expected {
        return Ok(());
    }
    Err(Error::input(
        format!("controller: {what}"),
        format!("{given} entries"),
        format!("must be empty or have {expected}, one per {item}"),
    ))
}

impl Step for Trajectory<'_> {
    type State = State;
    type Kept = Sample;
    type Bar = StateBar;
    type Seed = Seed;
    type Local = Local;
    type Error = Error;

    fn step(&self, index: usize, state: &State) -> Result<(State, Sample)> {
        let run = || {
            let gap = self.gap(state)?;
            let e = self.stepper.linearise(&state.q)?;
            let mut sample = self.observe(&e, state, gap)?;
            let (input, mode) = self.input(index, state, &sample)?;
            let mut next = self.stepper.step(&e, state, &sample.v, &input)?;
            next.state.mode = mode;
            sample.control = input.control;
            sample.hold = input.hold;
            sample.memo = next.memo;
            Ok((next.state, sample))
        };
        run().map_err(|e: Error| e.at_time(self.stepper.time(state)))
    }

    fn last(&self, _index: usize, state: &State) -> Result<Sample> {
        let run = || {
            let gap = self.gap(state)?;
            let e = self.stepper.evaluate(&state.q)?;
            self.observe(&e, state, gap)
        };
        run().map_err(|e: Error| e.at_time(self.stepper.time(state)))
    }

    fn step_vjp(
        &self,
        _index: usize,
        state: &State,
        sample: &Sample,
        next_bar: &StateBar,
        seed: &Seed,
    ) -> Result<(StateBar, Local)> {
        self.reverse_step(state, sample, next_bar, seed)
            .map_err(|e| e.at_time(sample.time))
    }

    fn last_vjp(
        &self,
        _index: usize,
        state: &State,
        sample: &Sample,
        seed: &Seed,
    ) -> Result<(StateBar, Local)> {
        self.reverse_last(state, sample, seed)
            .map_err(|e| e.at_time(sample.time))
    }
}
