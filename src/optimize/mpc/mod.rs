//! Model-predictive control: a plan that is made again and again from where the plant has got to.
//!
//! A model (a simulator) plans with [`ilqr`](super::ilqr()) over a horizon; every few time steps it does so again from the plant's state, starting from the plan before, moved
//! on, with its feedback. Between plans the controls are the plan's, with its feedback unless that is turned off. The plant may be the model, another simulator (another
//! fidelity, other parameters, another current, finer steps), or a robot that asks for controls step by step ([`Mpc::control`]).

mod run;

pub use run::{MpcProgress, MpcRun};

use super::cost::Sizes;
use super::ilqr::{self, Guess, IlqrProgress, IlqrSettings, IlqrStop, Plan, Problem, Ready};
use crate::simulate::{Simulator, State, steps_at};
use crate::{Error, Result};
use nalgebra::DVector;
use serde::Serialize;
use std::ops::ControlFlow;

/// How often to plan, and how hard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MpcSettings {
    /// Time steps of the model from one plan to the next.
    pub every: usize,
    /// Most iterations of a plan.
    pub iterations: usize,
    /// Most iterations of the first plan, which starts from nothing.
    pub first_iterations: usize,
    /// Whether the plan's feedback acts between plans.
    pub feedback: bool,
    /// All else of iLQR.
    pub ilqr: IlqrSettings,
}

impl Default for MpcSettings {
    fn default() -> Self {
        Self {
            every: 1,
            iterations: 3,
            first_iterations: 50,
            feedback: true,
            ilqr: IlqrSettings {
                tolerance: 1e-6,
                last_gains: false,
                ..IlqrSettings::default()
            },
        }
    }
}

/// One plan of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Replan {
    /// Time of the plant, s.
    pub time: f64,
    /// Iterations made.
    pub iterations: usize,
    /// Cost of the plan by the model; that of the plan before where this one failed.
    pub cost: f64,
    /// Why it ended; none where it failed.
    pub stop: Option<IlqrStop>,
    /// Time that it took, s.
    pub seconds: f64,
    /// Why it failed, what a cost or a controller of the user's own raised included; the plan before then goes on.
    pub failure: Option<String>,
}

/// Model-predictive control of a plant.
pub struct Mpc {
    model: Simulator,
    ready: Ready,
    settings: MpcSettings,
    /// The plan, with the model's time step at which it starts.
    plan: Option<(i64, Plan)>,
    /// Time step of the model at which controls were last decided, and those.
    held: Option<(i64, DVector<f64>)>,
    replans: Vec<Replan>,
    /// Controls before the first plan, as the problem has them.
    previous: Option<DVector<f64>>,
    /// Time of the first call, s.
    start: f64,
    /// Where the last run ended, and its plant's time step, s.
    ended: Option<(State, f64)>,
}

/// That the plant's states and controls are those of the model.
fn check_plant(plant: Sizes, model: Sizes) -> Result<()> {
    match plant == model {
        true => Ok(()),
        false => Err(Error::input(
            "mpc: plant",
            plant,
            format!("must have the model's {model}"),
        )),
    }
}

impl Mpc {
    /// For a model and what it is to do.
    ///
    /// # Errors
    /// A problem or settings that don't fit the model ([`ilqr`](super::ilqr())); more time steps between plans than a plan has.
    pub fn new(model: &Simulator, problem: &Problem, settings: MpcSettings) -> Result<Self> {
        let ready = Ready::new(problem, model)?;
        settings.ilqr.validate()?;
        for (name, count) in [
            ("every", settings.every),
            ("iterations", settings.iterations),
            ("first_iterations", settings.first_iterations),
        ] {
            if count == 0 {
                return Err(Error::input(
                    format!("mpc settings: {name}"),
                    0,
                    "must be at least 1",
                ));
            }
        }
        if settings.every > ready.steps() {
            return Err(Error::input(
                "mpc settings: every",
                settings.every,
                format!(
                    "must be at most {}, the time steps of a plan (knots · hold)",
                    ready.steps()
                ),
            ));
        }
        Ok(Self {
            model: model.clone(),
            previous: ready.previous.clone(),
            ready,
            settings,
            plan: None,
            held: None,
            replans: Vec::new(),
            start: 0.0,
            ended: None,
        })
    }

    /// Forgets plans, so that the next call starts anew.
    pub fn reset(&mut self) {
        (self.plan, self.held, self.ended) = (None, None, None);
        self.ready.previous = self.previous.clone();
        self.replans.clear();
    }

    /// Plans with another model from now on: one that has learnt the current, say.
    ///
    /// # Errors
    /// A model of other sizes, or another time step; a problem that doesn't fit it.
    pub fn set_model(&mut self, model: &Simulator, problem: &Problem) -> Result<()> {
        let ready = Ready::new(problem, model)?;
        let of =
            |ready: &Ready, model: &Simulator| (ready.cost.sizes, ready.steps(), model.time_step());
        let (theirs, ours) = (of(&ready, model), of(&self.ready, &self.model));
        let told = |(sizes, steps, dt): &(Sizes, usize, f64)| {
            format!("{sizes}, {steps} steps of a plan of {dt} s each")
        };
        if theirs != ours {
            return Err(Error::input(
                "mpc: model",
                told(&theirs),
                format!("must be as the one before: {}", told(&ours)),
            ));
        }
        self.previous = ready.previous.clone();
        (self.ready, self.model) = (ready, model.clone());
        Ok(())
    }

    /// The model.
    pub fn model(&self) -> &Simulator {
        &self.model
    }

    /// The plan in use; none before the first call.
    pub fn plan(&self) -> Option<&Plan> {
        self.plan.as_ref().map(|(_, plan)| plan)
    }

    /// All plans so far.
    pub fn replans(&self) -> &[Replan] {
        &self.replans
    }

    /// The controls at a time (s) from where the plant is, coordinates and velocity; plans again when that is due. Times must not go back; the first one starts the clock. Within a
    /// time step of the model, and where the controls of a knot are held without feedback, they stay.
    ///
    /// # Errors
    /// A time that isn't finite or lies before the last one, a state that the model can't be in, a first plan that fails, and a plan that has failed so often that the last one has run out.
    pub fn control(
        &mut self,
        time: f64,
        q: &DVector<f64>,
        v: &DVector<f64>,
    ) -> Result<DVector<f64>> {
        self.control_with(time, q, v, &mut |_| ControlFlow::Continue(()))
    }

    /// The same; `progress` is called after every iteration, and may end a plan before its iterations are used up.
    ///
    /// # Errors
    /// As [`Mpc::control`].
    pub fn control_with(
        &mut self,
        time: f64,
        q: &DVector<f64>,
        v: &DVector<f64>,
        progress: &mut dyn FnMut(&IlqrProgress) -> ControlFlow<()>,
    ) -> Result<DVector<f64>> {
        // Once there is a plan its feedback would answer to any numbers.
        self.model.check_numbers("mpc:", q, v)?;
        if self.plan.is_none() {
            self.start = time;
        }
        let dt = self.model.time_step();
        let now = steps_at(time - self.start, dt);
        let last = self.held.as_ref().map_or(0, |(step, _)| *step);
        let before = self.time_of(last);
        if !(now.is_finite() && now >= last as f64) {
            let expected =
                format!("must be finite, and not before {before} s; `reset` to start anew");
            return Err(Error::input("mpc: time", time, expected));
        }
        let now = now as i64;
        if let Some((step, control)) = &self.held
            && *step == now
        {
            return Ok(control.clone());
        }
        let due = self
            .plan
            .as_ref()
            .is_none_or(|(at, _)| now - at >= self.settings.every as i64);
        if due {
            self.plan_again(time, now, q, v, progress)?;
        }
        let Some((at, plan)) = &self.plan else {
            return Err(Error::Stopped {
                what: "the first plan".into(),
            });
        };
        let step = (now - at) as isize;
        // The plan's knots are its own: those of a problem given since may be held longer.
        let control = match self.settings.feedback {
            true => plan.tracking().control(step, q, v)?,
            false => plan.tracking().planned(step as usize),
        };
        self.held = Some((now, control.clone()));
        Ok(control)
    }

    /// Time of a time step of the model, counted from the first call, s.
    fn time_of(&self, step: i64) -> f64 {
        self.start + step as f64 * self.model.time_step()
    }

    fn plan_again(
        &mut self,
        time: f64,
        now: i64,
        q: &DVector<f64>,
        v: &DVector<f64>,
        progress: &mut dyn FnMut(&IlqrProgress) -> ControlFlow<()>,
    ) -> Result<()> {
        let clock = std::time::Instant::now();
        let before = self.plan.as_ref().map(|(at, plan)| (at, plan.tracking()));
        let guess = match &before {
            None => Guess::Zero,
            Some((at, plan)) => Guess::Plan {
                plan,
                shift: (now - *at) as usize,
            },
        };
        let iterations = match &self.plan {
            None => self.settings.first_iterations,
            Some(_) => self.settings.iterations,
        };
        let settings = IlqrSettings {
            iterations,
            ..self.settings.ilqr
        };
        if let Some((_, held)) = &self.held {
            self.ready.previous = Some(held.clone());
        }
        // The model's clock is the plant's to half a step, so that what changes with time does so for both.
        let step = (time / self.model.time_step()).round().max(0.0) as usize;
        let made = (self.model.state_of_plant(step, q, v)).and_then(|state| {
            ilqr::solve(&self.model, &state, &self.ready, guess, &settings, progress)
        });
        let mut told = Replan {
            time,
            iterations: 0,
            cost: self.plan().map_or(f64::NAN, Plan::cost),
            stop: None,
            seconds: 0.0,
            failure: None,
        };
        match made {
            Ok(plan) => {
                told.iterations = plan.iterations;
                told.cost = plan.cost();
                told.stop = Some(plan.stop);
                self.plan = Some((now, plan));
            }
            Err(error) => {
                let steps = self.ready.steps() as i64;
                if self.plan.as_ref().is_none_or(|(at, _)| now - at >= steps) {
                    return Err(error);
                }
                told.failure = Some(error.to_string());
            }
        }
        told.seconds = clock.elapsed().as_secs_f64();
        self.replans.push(told);
        Ok(())
    }
}
