//! A rollout as steps with transposes: controller, integrator and observations together.

use super::grown::Size;
use super::observable::{Differentiable, Observed, ObservedBars};
use super::{Observation, Sample, Simulator, finite};
use crate::adjoint::lie::Vec6;
use crate::adjoint::step::Step;
use crate::dynamics::{
    Evaluation, Input, Linearisation, LinearisedStep, Parameters, State, StateBar, StepBar,
    StepRecord, Stepper,
};
use crate::multibody::{Cotangents, Virtual};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Everything that a rollout's steps need.
pub(super) struct Trajectory<'a> {
    pub stepper: Stepper<'a>,
    pub simulator: &'a Simulator,
    pub controls: &'a DMatrix<f64>,
}

/// Seed at one time.
pub(super) struct Seed {
    pub q: DVector<f64>,
    pub v: DVector<f64>,
    /// Of the controls that acted from there on; empty at the end.
    pub control: DVector<f64>,
    /// Of other observables.
    pub observables: Vec<(&'static dyn Differentiable, DVector<f64>)>,
}

impl Seed {
    /// Its largest number.
    pub fn size(&self) -> f64 {
        let others = self.observables.iter().flat_map(|(_, x)| x.iter());
        let own = [&self.q, &self.v, &self.control];
        let all = own.into_iter().flatten().chain(others);
        all.fold(0.0, |most, x| most.max(x.abs()))
    }
}

/// What the transpose of one step yields beside the state's cotangent.
pub(super) struct Partial {
    pub control: DVector<f64>,
    pub parameters: Parameters,
    pub gains: Vec<f64>,
    /// Of the state's cotangent.
    pub size: Size,
}

impl Simulator {
    /// The steps of this simulator with open-loop controls.
    pub(super) fn trajectory<'a>(&'a self, controls: &'a DMatrix<f64>) -> Trajectory<'a> {
        Trajectory {
            stepper: self.stepper(),
            simulator: self,
            controls,
        }
    }
}

impl<'a> Trajectory<'a> {
    /// Refuses a state that isn't finite, or whose bodies don't keep apart where that has an effect.
    fn check(&self, state: &State) -> Result<()> {
        finite::state(&self.simulator.scene, state)?;
        if !self.simulator.fidelity_acting().coupled() {
            return Ok(());
        }
        let poses = self.stepper.system.tree.kinematics(&state.q).poses;
        self.simulator.clearance().keep_apart(&poses)
    }

    fn observe(&self, e: &Evaluation, state: &State) -> Result<Sample> {
        let v = self.stepper.velocity(e, state)?;
        let momenta = e.momenta(&v);
        let sample = Sample {
            time: self.stepper.time(state),
            q: state.q.clone(),
            kinetic_energy: e.kinetic_energy(&v),
            potential_energy: e.potential_energy(),
            momentum: e.total_momentum(&v, &momenta),
            largest_momentum: momenta.iter().fold(Vec6::zeros(), |m, h| m.sup(&h.abs())),
            kept_momentum: (self.simulator.kept().velocities).tr_mul(&e.frame_momentum(&v)),
            poses: e.kinematics.poses.clone(),
            report: e.report().clone(),
            control: DVector::zeros(0),
            hold: Vec::new(),
            v,
        };
        finite::sample(&self.simulator.scene, state.step, &sample)?;
        Ok(sample)
    }

    /// What acts during a step beside the open-loop controls `control`, and the controller's next mode.
    fn input(
        &self,
        mut control: DVector<f64>,
        state: &State,
        sample: &Sample,
    ) -> Result<(Input, usize)> {
        let seen = observation(&self.stepper, state, &sample.v);
        let action = self.simulator.policy().act(&seen)?;
        let mode = action.mode;
        expect_length("hold", action.hold.len(), self.stepper.system.len(), "body")?;
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
                format!("control {bad} at step {}", state.step),
                control[bad],
                "must be finite",
            ));
        }
        let hold = action.hold;
        Ok((Input { control, hold }, mode))
    }

    /// Cotangents that enter at a state with the velocity `v`: of q, v and other observables.
    fn observe_vjp(
        &self,
        e: &Linearisation,
        state: &State,
        v: &DVector<f64>,
        seed: &Seed,
        bar: &mut StepBar,
    ) -> Result<()> {
        bar.state.q += &seed.q;
        let mut v_bar = &bar.v + &seed.v;
        if !seed.observables.is_empty() {
            observables_vjp(e, v, &seed.observables, &mut v_bar, bar);
        }
        self.stepper.velocity_vjp(e, state, v, &v_bar, bar)
    }

    /// Cotangents of a state, and of all else, which must be finite; that of the velocity has been carried on.
    fn finished(
        &self,
        state: &State,
        bar: StepBar,
        gains: Vec<f64>,
    ) -> Result<(StateBar, Partial)> {
        let partial = Partial {
            control: bar.control,
            parameters: bar.parameters,
            gains,
            size: Size::new(&bar.state),
        };
        let Partial {
            control,
            parameters,
            gains,
            size: _,
        } = &partial;
        let scene = &self.simulator.scene;
        finite::bars(scene, state.step, &bar.state, control, parameters, gains)?;
        Ok((bar.state, partial))
    }

    /// The system with its derivatives at a configuration of the trajectory; an error has the time.
    pub fn at(&self, q: &DVector<f64>, time: f64) -> Result<Linearisation<'a>> {
        let made = self.stepper.linearise(q, time);
        made.map_err(|e| e.at_time(time))
    }

    /// A step whose open-loop controls `decide` gives from what is observed before it.
    pub(super) fn advance(
        &self,
        state: &State,
        decide: impl FnOnce(&Sample) -> Result<DVector<f64>>,
    ) -> Result<(State, Sample, StepRecord)> {
        let run = || {
            self.check(state)?;
            let e = self.stepper.linearise(&state.q, self.stepper.time(state))?;
            let mut sample = self.observe(&e, state)?;
            let control = decide(&sample)?;
            let (input, mode) = self.input(control, state, &sample)?;
            let step = self.stepper.step(&e, state, &sample.v, &input);
            let clearance = self.simulator.clearance();
            let (mut next, record) = step.map_err(|e| clearance.explain(e))?;
            next.mode = mode;
            sample.control = input.control;
            sample.hold = input.hold;
            Ok((next, sample, record))
        };
        run().map_err(|e: Error| self.explain(e, state))
    }

    /// An error of a step at a state, with the time, and with what it comes from.
    fn explain(&self, error: Error, state: &State) -> Error {
        let error = finite::blown_up(&self.simulator.scene, state, error);
        error.at_time(self.stepper.time(state))
    }

    /// A step with its controller, and what all its derivatives share.
    pub(super) fn linearise<'t>(
        &'t self,
        record: &'t StepRecord,
    ) -> Result<ControlledStep<'t, 'a>> {
        let step = self.stepper.linearise_step(record);
        Ok(ControlledStep {
            trajectory: self,
            step: step.map_err(|e| e.at_time(self.stepper.time(record.state())))?,
        })
    }

    /// Cotangent of a state from a seed there alone.
    pub(super) fn seed_vjp(
        &self,
        e: &Linearisation,
        state: &State,
        v: &DVector<f64>,
        seed: &Seed,
    ) -> Result<StepBar> {
        let mut bar = StepBar::zeros(e);
        self.observe_vjp(e, state, v, seed, &mut bar)
            .map_err(|e| e.at_time(self.stepper.time(state)))?;
        Ok(bar)
    }
}

/// A step of a trajectory with its controller, linearised.
pub(super) struct ControlledStep<'t, 'a> {
    pub trajectory: &'t Trajectory<'a>,
    pub step: LinearisedStep<'t, 'a>,
}

impl<'a> ControlledStep<'_, 'a> {
    /// Transpose of the step, its controller, and what is observed at its state.
    pub fn vjp(&self, next_bar: &StateBar, seed: &Seed) -> Result<(StateBar, Partial)> {
        let record = self.step.record();
        let run = || {
            let (mut bar, gains) = self.transpose(next_bar, &seed.control)?;
            let e = self.step.linearisation();
            self.trajectory
                .observe_vjp(e, record.state(), record.velocity(), seed, &mut bar)?;
            self.trajectory.finished(record.state(), bar, gains)
        };
        run().map_err(|e: Error| e.at_time(self.trajectory.stepper.time(record.state())))
    }

    /// Transpose of the step and its controller, with a cotangent of the controls that acted; what there is of the velocity's cotangent isn't carried on yet.
    fn transpose(
        &self,
        next_bar: &StateBar,
        applied: &DVector<f64>,
    ) -> Result<(StepBar, Vec<f64>)> {
        let (t, record) = (self.trajectory, self.step.record());
        let mut bar = self.step.vjp(next_bar)?;
        bar.control += applied;
        let state = record.state();
        let seen = observation(&t.stepper, state, record.velocity());
        let policy = t.simulator.policy();
        let action = policy.act_vjp(&seen, &bar.control)?;
        let velocities = t.stepper.system.tree.velocities();
        expect_length("cotangent of q", action.q.len(), velocities, "velocity")?;
        expect_length("cotangent of v", action.v.len(), velocities, "velocity")?;
        let gains = policy.gains().len();
        expect_length("cotangent of the gains", action.gains.len(), gains, "gain")?;
        if !action.q.is_empty() {
            bar.state.q += DVector::from_vec(action.q);
        }
        if !action.v.is_empty() {
            bar.v += DVector::from_vec(action.v);
        }
        Ok((bar, action.gains))
    }
}

/// Transposes of observables at a state with the velocity `v`, added to its cotangent and to those of q and the parameters.
fn observables_vjp(
    e: &Linearisation,
    v: &DVector<f64>,
    seeds: &[(&'static dyn Differentiable, DVector<f64>)],
    v_bar: &mut DVector<f64>,
    bar: &mut StepBar,
) {
    let (system, kinematics) = (e.system, &e.kinematics);
    let tree = &system.tree;
    let mut on = Cotangents::zeros(system.len());
    let mut out = ObservedBars {
        pose: &mut on.pose,
        twist: &mut on.twist,
        q: &mut bar.state.q,
        v: v_bar,
        parameters: &mut bar.parameters,
    };
    let at = Observed {
        system,
        parameters: e.parameters,
        kinematics,
        v,
        twists: &tree.twists(kinematics, v),
    };
    for (observable, seed) in seeds {
        observable.vjp(&at, seed.as_slice(), &mut out);
    }
    if on.twist.iter().all(|t| *t == Vec6::zeros()) {
        bar.state.q += tree.project(&kinematics.columns, on.pose);
        return;
    }
    let zero = DVector::zeros(v.len());
    let fields = tree.fields(kinematics, &e.q, v, Virtual::User(&zero));
    let (q, more) = tree.reverse(kinematics, v, Virtual::User(&zero), &fields, on);
    bar.state.q += q;
    *v_bar += more;
}

/// What the controller sees at a state.
pub(super) fn observation<'a>(
    stepper: &Stepper,
    state: &'a State,
    v: &'a DVector<f64>,
) -> Observation<'a> {
    Observation {
        step: state.step,
        time: stepper.time(state),
        time_step: stepper.dt,
        q: &state.q,
        v,
        mode: state.mode,
    }
}

/// A controller's list is empty or has one entry per item.
pub(super) fn expect_length(what: &str, given: usize, expected: usize, item: &str) -> Result<()> {
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
    type Observation = Sample;
    type Record = StepRecord;
    type Cotangent = StateBar;
    type Seed = Seed;
    type Partial = Partial;
    type Error = Error;

    fn step(&self, index: usize, state: &State) -> Result<(State, Sample, StepRecord)> {
        self.advance(state, |_| Ok(self.controls.column(index).into_owned()))
    }

    fn last(&self, _index: usize, state: &State) -> Result<Sample> {
        let run = || {
            self.check(state)?;
            let e = self.stepper.evaluate(&state.q, self.stepper.time(state))?;
            self.observe(&e, state)
        };
        run().map_err(|e: Error| self.explain(e, state))
    }

    fn step_vjp(
        &self,
        _index: usize,
        record: &StepRecord,
        next_bar: &StateBar,
        seed: &Seed,
    ) -> Result<(StateBar, Partial)> {
        self.linearise(record)?.vjp(next_bar, seed)
    }

    fn last_vjp(
        &self,
        _index: usize,
        state: &State,
        sample: &Sample,
        seed: &Seed,
    ) -> Result<(StateBar, Partial)> {
        let e = self.at(&state.q, sample.time)?;
        let bar = self.seed_vjp(&e, state, &sample.v, seed)?;
        let parted = self.finished(state, bar, Vec::new());
        parted.map_err(|e| e.at_time(sample.time))
    }
}
