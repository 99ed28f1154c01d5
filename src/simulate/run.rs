//! Running a simulator: rollouts and single steps.

use super::controls::MOST_STEPS;
use super::deciding::Deciding;
use super::{Controls, Record, Rollout, Sample, Simulator};
use crate::adjoint::step;
use crate::dynamics::State;
use crate::memory;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

/// What is kept of a step, bytes, and of each body in it: 3.4 kB a step with four bodies of six velocities.
const STEP_BYTES: f64 = 1500.0;
const BODY_BYTES: f64 = 450.0;

/// A rollout that ended before its time ([`Simulator::rollout_as_far`]).
pub struct Halted {
    /// The step that failed, counted as [`State::step`] is.
    pub step: usize,
    /// The time at its start, s.
    pub time: f64,
    /// Why.
    pub error: Error,
    /// What ran; none where not even the first state can be observed.
    pub rollout: Option<Rollout>,
}

impl Simulator {
    /// Runs the scene's own controller with additional open-loop controls.
    ///
    /// # Errors
    /// The first step that fails, with its time.
    pub fn rollout(&self, controls: &Controls) -> Result<Rollout> {
        self.rollout_with(controls, |_| {})
    }

    /// As [`Simulator::rollout`]; `progress` is called with the number of steps made.
    ///
    /// # Errors
    /// The first step that fails, with its time.
    pub fn rollout_with(
        &self,
        controls: &Controls,
        mut progress: impl FnMut(usize) + Send,
    ) -> Result<Rollout> {
        let count = |done| {
            progress(done);
            ControlFlow::Continue(())
        };
        let initial = self.initial().map_err(|e| e.at_time(0.0))?;
        let v = self.assembled.v.clone();
        self.run(initial, Some(v), controls, count)
    }

    /// As [`Simulator::rollout`], from any state: that of [`Simulator::state`], or one of another rollout's
    /// [`Rollout::states`], which it goes on from to the bit. `progress` is called with the number of steps made, and may end the run.
    ///
    /// # Errors
    /// A state of other sizes, the first step that fails, with its time, and [`Error::Stopped`] if `progress` breaks.
    pub fn rollout_from(
        &self,
        state: &State,
        controls: &Controls,
        progress: impl FnMut(usize) -> ControlFlow<()> + Send,
    ) -> Result<Rollout> {
        self.check_sizes(state)?;
        self.run(state.clone(), None, controls, progress)
    }

    /// As [`Simulator::rollout_from`], but what ran before a step failed isn't lost.
    ///
    /// # Errors
    /// As there: the error with its step, and the rollout up to there.
    pub fn rollout_as_far(
        &self,
        state: &State,
        controls: &Controls,
        progress: impl FnMut(usize) -> ControlFlow<()> + Send,
    ) -> std::result::Result<Rollout, Box<Halted>> {
        // On a thread of the pool from first step to last: entering the pool costs as much as a small step's work.
        rayon::scope(|_| self.rollout_here(state, controls, progress))
    }

    /// The same on this thread.
    pub(super) fn rollout_here(
        &self,
        state: &State,
        controls: &Controls,
        progress: impl FnMut(usize) -> ControlFlow<()> + Send,
    ) -> std::result::Result<Rollout, Box<Halted>> {
        let at = |error| Halted {
            step: state.step,
            time: state.step as f64 * self.time_step(),
            error,
            rollout: None,
        };
        self.check_sizes(state).map_err(|e| Box::new(at(e)))?;
        let steps = self.check_controls(controls).map_err(|e| Box::new(at(e)))?;
        let matrix = controls.matrix().clone();
        let trajectory = self.trajectory(&matrix);
        let ended = ended(progress, steps);
        let (tape, failed) = step::forward_as_far(&trajectory, state.clone(), steps, ended);
        let rollout = tape
            .observations()
            .first()
            .map(|s| s.v.clone())
            .map(|v| Rollout {
                simulator: self.clone(),
                initial_velocity: v,
                controls: matrix.columns(0, tape.records().len()).into_owned(),
                tape,
                gaps: Default::default(),
                report: Default::default(),
            });
        match (failed, rollout) {
            (None, Some(rollout)) => Ok(rollout),
            (Some((made, error)), rollout) => Err(Box::new(Halted {
                step: state.step + made,
                time: (state.step + made) as f64 * self.time_step(),
                rollout,
                error,
            })),
            (None, None) => Err(Box::new(at(Error::Stopped {
                what: "the rollout, before its first state".into(),
            }))),
        }
    }

    /// As [`Simulator::rollout_from`], with open-loop controls that are decided as it goes: `decide` gives those of a step, by its number from 0, from what is observed
    /// before it. They become the rollout's [`Rollout::controls`], so that its derivatives are those of a rollout with these controls, given beforehand.
    ///
    /// # Errors
    /// A state of other sizes, more steps than a rollout takes, the first step that fails, with its time, and whatever `decide` reports.
    pub fn rollout_deciding(
        &self,
        state: &State,
        steps: usize,
        decide: impl FnMut(usize, &Sample) -> Result<DVector<f64>> + Send,
    ) -> Result<Rollout> {
        self.check_sizes(state)?;
        self.check_steps(steps)?;
        let none = DMatrix::zeros(self.system().controls, 0);
        let trajectory = self.trajectory(&none);
        let (tape, made) = rayon::scope(|_| {
            let deciding = Deciding::new(trajectory, decide);
            let tape = step::forward(&deciding, state.clone(), steps, |_| Ok(()))?;
            Ok::<_, Error>((tape, deciding.made()))
        })?;
        Ok(Rollout {
            simulator: self.clone(),
            initial_velocity: tape.observations()[0].v.clone(),
            tape,
            gaps: Default::default(),
            report: Default::default(),
            controls: made,
        })
    }

    /// One step from a state with the controls `control`, to which the scene's own controller adds: the next state, and the record
    /// that has the step's derivatives. The steps of a rollout, to the bit.
    ///
    /// # Errors
    /// As [`Simulator::rollout_from`], and controls of another number or not finite.
    pub fn step(&self, state: &State, control: &DVector<f64>) -> Result<(State, Record)> {
        let controls = DMatrix::from_column_slice(control.len(), 1, control.as_slice());
        let controls = Controls::from_matrix(self, controls)?;
        let rollout = self.rollout_from(state, &controls, |_| ControlFlow::Continue(()))?;
        Ok((rollout.states()[1].clone(), Record::new(rollout)))
    }

    /// What a rollout keeps of a step, bytes.
    pub(super) fn step_bytes(&self) -> f64 {
        let system = self.system();
        STEP_BYTES
            + BODY_BYTES * system.len() as f64
            + memory::numbers(8.0 * system.tree.velocities() as f64)
            + memory::numbers(
                (self.stepper().integrator.answers() * system.answer_numbers()) as f64,
            )
    }

    fn check_sizes(&self, state: &State) -> Result<()> {
        let tree = &self.system().tree;
        let sizes = [state.q.len(), state.y.len()];
        let right = [tree.coordinates(), tree.velocities()];
        if sizes != right {
            return Err(Error::input(
                "state: numbers of coordinates and velocities",
                format!("{sizes:?}"),
                format!("must be {right:?}, as the scene's"),
            ));
        }
        Ok(())
    }

    /// Refuses controls of other sizes, and too many steps; the number of steps.
    fn check_controls(&self, controls: &Controls) -> Result<usize> {
        let matrix = controls.matrix();
        if matrix.nrows() != self.system().controls {
            return Err(Error::input(
                "controls",
                format!("{} rows", matrix.nrows()),
                format!("must have {} rows, one per control", self.system().controls),
            ));
        }
        self.check_steps(matrix.ncols())
    }

    /// Refuses too many steps; gives their number.
    pub(crate) fn check_steps(&self, steps: usize) -> Result<usize> {
        if steps > MOST_STEPS {
            return Err(Error::input(
                "steps",
                format!("more than {MOST_STEPS}"),
                format!("must be at most {MOST_STEPS}: every state is kept; run in parts"),
            ));
        }
        memory::fits(
            &format!("a rollout of {steps} steps"),
            self.step_bytes() * steps as f64,
            "run in parts, each from the state in which the last one ended, or take the gradient in parts (gradient_in_parts)",
        )?;
        Ok(steps)
    }

    fn run(
        &self,
        initial: State,
        initial_velocity: Option<DVector<f64>>,
        controls: &Controls,
        progress: impl FnMut(usize) -> ControlFlow<()> + Send,
    ) -> Result<Rollout> {
        let steps = self.check_controls(controls)?;
        let matrix = controls.matrix().clone();
        let ended = ended(progress, steps);
        let trajectory = self.trajectory(&matrix);
        // On a thread of the pool from first step to last: entering the pool costs as much as a small step's work.
        let tape = rayon::scope(|_| step::forward(&trajectory, initial, steps, ended))?;
        Ok(Rollout {
            simulator: self.clone(),
            initial_velocity: initial_velocity.unwrap_or_else(|| tape.observations()[0].v.clone()),
            tape,
            gaps: Default::default(),
            report: Default::default(),
            controls: matrix,
        })
    }
}

/// Calls `progress` after each step, and ends the run where it breaks.
fn ended(
    mut progress: impl FnMut(usize) -> ControlFlow<()> + Send,
    steps: usize,
) -> impl FnMut(usize) -> Result<()> + Send {
    move |done| match progress(done) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Error::Stopped {
            what: format!("the rollout, after {done} of {steps} steps"),
        }),
    }
}
