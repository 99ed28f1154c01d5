//! Grasps that nobody tuned: controls with which a gripper catches an object and holds it, by one recipe with one set of settings.
//!
//! 1. *Pushes*: what a person would try is simulated, evenly spread ([`pushes`]). They find the basin; a gradient through a collision doesn't.
//! 2. *Descent* from the best of them, several where none caught: first of the approach alone, until shortly before the fingers touch the object, then of the
//!    whole run, over contact softened and hardened again ([`continuation`]) if that is asked for.
//! 3. *Search*: where gradients stall and nothing is caught, CMA-ES around the best point with what simulations are left.
//!
//! What was caught is never given up for a lower cost. Costs are in radii of the object, so that the same settings fit a coin and a barrel.

mod cost;
mod pushes;
mod search;
mod task;
mod tried;

pub use task::{Finger, GraspTask};
pub use tried::GraspStage;

use super::continuation;
use super::{OptimizeSettings, minimise};
use crate::simulate::{Controls, Knots, Objective, OpenLoop, Rollout, Simulator};
use crate::{Error, Result};
pub use cost::GraspCost;
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use task::Grip;
use tried::Tried;

/// How hard to look for a grasp.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspSettings {
    /// Knots of each control ([`Knots`]).
    pub knots: usize,
    /// Pushes that are tried.
    pub pushes: usize,
    /// The best of them from which is descended, as long as nothing is caught.
    pub starts: usize,
    /// Values with gradients of each part of a descent.
    pub evaluations: usize,
    /// Softness of contact over which the whole run is descended, in turn.
    pub softness: Vec<f64>,
    /// A cost at which a caught grasp is good enough.
    pub target: f64,
    /// Simulations of the search, if nothing was caught before it.
    pub search: usize,
    /// Seed of the search.
    pub seed: u64,
}

impl Default for GraspSettings {
    fn default() -> Self {
        Self {
            knots: 11,
            pushes: 48,
            starts: 3,
            evaluations: 12,
            // Softer contact first didn't end lower at the same price (docs/grasp.md).
            softness: vec![1.0],
            target: 0.1,
            search: 200,
            seed: 1,
        }
    }
}

/// What it came to: the best grasp that was seen.
#[derive(Clone, Debug, Serialize)]
pub struct Grasp {
    /// The controls; not part of a report.
    #[serde(skip)]
    pub controls: Controls,
    /// Whether they hold the object for as long as was asked.
    pub caught: bool,
    /// Since when it is held at the end, s.
    pub held_since: Option<f64>,
    /// Cost of the hold.
    pub cost: f64,
    /// What found it.
    pub stage: GraspStage,
    /// Pushes that caught the object.
    pub pushes_caught: usize,
    /// Simulations, those with a gradient included.
    pub simulations: usize,
    /// Gradients.
    pub gradients: usize,
    /// Simulations that failed.
    pub failures: usize,
}

/// Is told what is tried and whether something was caught so far, and may end it.
type Progress<'a> = dyn Fn(GraspStage, bool) -> ControlFlow<()> + Sync + 'a;

/// The task with what was spent on it.
struct Attempt<'a> {
    simulator: Simulator,
    grip: Arc<Grip>,
    knots: Knots,
    progress: &'a Progress<'a>,
    /// Whether anything was caught.
    caught: AtomicBool,
    /// Whether it was ended before it was done.
    stopped: AtomicBool,
    simulations: AtomicUsize,
    gradients: AtomicUsize,
    failures: AtomicUsize,
}

/// The approach is judged from and to these parts of the time until the fingers touch the object.
const APPROACH: [f64; 2] = [0.75, 0.95];
/// Cost of an approach that is good enough.
const REACHED: f64 = 0.05;

impl<'a> Attempt<'a> {
    fn new(
        simulator: &Simulator,
        task: &GraspTask,
        settings: &GraspSettings,
        progress: &'a Progress<'a>,
    ) -> Result<Self> {
        let grip = Arc::new(Grip::new(simulator, task)?);
        let mut simulator = simulator.clone();
        simulator.set_policy(Box::new(OpenLoop));
        let knots = Knots::new(&simulator, simulator.steps(), settings.knots, &grip.limits)?;
        Ok(Self {
            simulator,
            grip,
            knots,
            progress,
            caught: AtomicBool::new(false),
            stopped: AtomicBool::new(false),
            simulations: AtomicUsize::new(0),
            gradients: AtomicUsize::new(0),
            failures: AtomicUsize::new(0),
        })
    }

    fn hold(&self) -> GraspCost {
        GraspCost {
            grip: self.grip.clone(),
            span: self.grip.end(),
            held: true,
        }
    }

    /// Goes on, unless it is to end.
    fn watch(&self, stage: GraspStage) -> ControlFlow<()> {
        let on = match self.stopped.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => (self.progress)(stage, self.caught.load(Ordering::Relaxed)),
        };
        self.stopped.fetch_or(on.is_break(), Ordering::Relaxed);
        on
    }

    /// # Errors
    /// It was ended.
    fn check(&self) -> Result<()> {
        match self.stopped.load(Ordering::Relaxed) {
            true => Err(Error::Stopped {
                what: format!(
                    "the grasp, after {} simulations",
                    self.simulations.load(Ordering::Relaxed)
                ),
            }),
            false => Ok(()),
        }
    }

    fn run(
        &self,
        simulator: &Simulator,
        x: &[f64],
        steps: usize,
        stage: GraspStage,
    ) -> Result<Rollout> {
        self.check()?;
        self.simulations.fetch_add(1, Ordering::Relaxed);
        let all = self.knots.controls(simulator, x)?;
        let first = all.matrix().columns(0, steps).into_owned();
        let controls = Controls::from_matrix(simulator, first)?;
        let start = simulator.initial()?;
        let made = simulator.rollout_from(&start, &controls, |_| self.watch(stage));
        if made.is_err() {
            self.failures.fetch_add(1, Ordering::Relaxed);
        }
        made
    }

    /// Tries a point; none if its simulation fails.
    fn try_out(&self, x: &[f64], stage: GraspStage) -> Option<Tried> {
        let steps = self.simulator.steps();
        let rollout = self.run(&self.simulator, x, steps, stage).ok()?;
        self.judge(x, &rollout, stage).ok()
    }

    fn judge(&self, x: &[f64], rollout: &Rollout, stage: GraspStage) -> Result<Tried> {
        let held_since = self.grip.held_since(rollout)?;
        let caught = self.grip.caught(rollout, held_since);
        self.caught.fetch_or(caught, Ordering::Relaxed);
        Ok(Tried {
            x: x.to_vec(),
            cost: rollout.value(&self.hold())?,
            held_since,
            caught,
            stage,
        })
    }

    /// Cost and gradient of a run of so many steps.
    fn descend(
        &self,
        simulator: &Simulator,
        x: &[f64],
        goal: &GraspCost,
        steps: usize,
    ) -> Result<(f64, Vec<f64>, Rollout)> {
        let rollout = self.run(simulator, x, steps, GraspStage::Descent)?;
        self.gradients.fetch_add(1, Ordering::Relaxed);
        goal.check(&rollout)?;
        let seed = goal.try_cotangents(&rollout)?;
        let gradient = rollout.vjp_with(&seed, |_| self.watch(GraspStage::Descent))?;
        let mut controls = DMatrix::zeros(self.grip.limits.len(), simulator.steps());
        controls.columns_mut(0, steps).copy_from(&gradient.controls);
        let gradient = self.knots.controls_vjp(x, &controls)?;
        Ok((rollout.value(goal)?, gradient, rollout))
    }

    /// From a point to where the object lies well between the fingers shortly before they touch it.
    fn approach(&self, x: &[f64], settings: &OptimizeSettings) -> Result<Vec<f64>> {
        let (whole, stage) = (self.simulator.steps(), GraspStage::Descent);
        let rollout = self.run(&self.simulator, x, whole, stage)?;
        let touch = self.grip.first_touch(&rollout)?;
        let touch = touch.unwrap_or(0.6 * self.grip.duration);
        let steps = (APPROACH[1] * touch / self.simulator.time_step()) as usize;
        // Nor where no state lies in so short a time.
        if steps < 2 || steps as f64 * self.simulator.time_step() < APPROACH[0] * touch {
            return Ok(x.to_vec());
        }
        let goal = GraspCost {
            grip: self.grip.clone(),
            span: APPROACH.map(|part| part * touch),
            held: false,
        };
        let settings = OptimizeSettings {
            target: Some(REACHED),
            ..*settings
        };
        let evaluate = |x: &[f64]| {
            let (cost, gradient, _) = self.descend(&self.simulator, x, &goal, steps)?;
            Ok((cost, gradient))
        };
        Ok(minimise(evaluate, x, &settings, |_| {})?.x)
    }

    /// From a point to a grasp, over softer contact; the best point that was seen with contact as it is.
    fn descent(&self, start: &Tried, approach: bool, settings: &GraspSettings) -> Result<Tried> {
        let each = OptimizeSettings {
            iterations: settings.evaluations,
            evaluations: settings.evaluations,
            first_step: Some(0.3),
            cost_tolerance: 1e-4,
            // Gradients through a collision that is about to happen otherwise are hundreds of times longer than this, and say little.
            clip: Some(1.0),
            ..OptimizeSettings::default()
        };
        let x = match approach {
            true => self.approach(&start.x, &each)?,
            false => start.x.clone(),
        };
        let goal = self.hold();
        let mut best = start.clone();
        let evaluate = |softness: f64, x: &[f64]| {
            let mut simulator = self.simulator.clone();
            if softness != 1.0 {
                simulator.soften_contact(softness)?;
            }
            let steps = simulator.steps();
            let (cost, gradient, rollout) = self.descend(&simulator, x, &goal, steps)?;
            if softness == 1.0 {
                let tried = self.judge(x, &rollout, GraspStage::Descent)?;
                if tried.better(&best) {
                    best = tried;
                }
            }
            Ok((cost, gradient))
        };
        let stages: &[f64] = match approach {
            true => &settings.softness,
            false => &[1.0],
        };
        continuation(evaluate, stages, &x, &each, |_, _| {})?;
        Ok(best)
    }
}

/// Finds controls with which the gripper of a scene catches an object and holds it to the end of the run. The scene's own controller isn't used.
/// The result doesn't depend on the number of threads; `progress` is called at each step of each simulation and gradient with what is tried and whether anything
/// was caught so far, and may end it.
///
/// # Errors
/// A task that doesn't fit the scene, settings out of range, a scene in which no push could be simulated, and [`Error::Stopped`] if `progress` breaks.
pub fn grasp(
    simulator: &Simulator,
    task: &GraspTask,
    settings: &GraspSettings,
    progress: impl Fn(GraspStage, bool) -> ControlFlow<()> + Sync,
) -> Result<Grasp> {
    settings.validate()?;
    let attempt = Attempt::new(simulator, task, settings, &progress)?;
    let push = |i: usize| {
        attempt.check()?;
        let controls = pushes::push(&attempt.simulator, &attempt.grip, i)?;
        let x = attempt.knots.through(&controls)?;
        Ok(attempt.try_out(&x, GraspStage::Push))
    };
    let pushes: Vec<Result<Option<Tried>>> =
        (0..settings.pushes).into_par_iter().map(push).collect();
    let pushes: Result<Vec<Option<Tried>>> = pushes.into_iter().collect();
    let mut tried: Vec<Tried> = pushes?.into_iter().flatten().collect();
    attempt.check()?;
    let caught = tried.iter().filter(|t| t.caught).count();
    tried.sort_by(|a, b| b.caught.cmp(&a.caught).then(a.cost.total_cmp(&b.cost)));
    let Some(mut best) = tried.first().cloned() else {
        return Err(Error::Unsupported {
            what: "a grasp".into(),
            why: format!("none of {} pushes could be simulated", settings.pushes),
            instead: "run the scene by itself, which says why".into(),
        });
    };
    let starts = if best.caught { 1 } else { settings.starts };
    let good = |best: &Tried| best.caught && best.cost <= settings.target;
    for start in tried.iter().take(starts) {
        if good(&best) {
            break;
        }
        // What is caught is polished; else the approach comes first.
        if let Ok(found) = attempt.descent(start, !start.caught, settings)
            && found.better(&best)
        {
            best = found;
        }
        attempt.check()?;
        if best.caught {
            break;
        }
    }
    if !best.caught && best.stage == GraspStage::Descent {
        // On from where the best descent was stopped.
        if let Ok(found) = attempt.descent(&best.clone(), false, settings)
            && found.better(&best)
        {
            best = found;
        }
        attempt.check()?;
    }
    if !best.caught && settings.search > 0 {
        let evaluate = |x: &[f64]| attempt.try_out(x, GraspStage::Search);
        if let Some(found) = search::search(evaluate, &best.x, settings.search, settings.seed)?
            && found.better(&best)
        {
            best = found;
        }
        attempt.check()?;
    }
    Ok(Grasp {
        controls: attempt.knots.controls(simulator, &best.x)?,
        caught: best.caught,
        held_since: best.held_since,
        cost: best.cost,
        stage: best.stage,
        pushes_caught: caught,
        simulations: attempt.simulations.into_inner(),
        gradients: attempt.gradients.into_inner(),
        failures: attempt.failures.into_inner(),
    })
}

impl GraspSettings {
    fn validate(&self) -> Result<()> {
        for (name, count) in [
            ("pushes", self.pushes),
            ("starts", self.starts),
            ("evaluations", self.evaluations),
        ] {
            if count == 0 {
                let place = format!("grasp settings: {name}");
                return Err(Error::input(place, 0, "must be at least 1"));
            }
        }
        if self.softness.last() != Some(&1.0) {
            return Err(Error::input(
                "grasp settings: softness",
                format!("{:?}", self.softness),
                "must end in 1, contact as it is",
            ));
        }
        if self.target.is_nan() {
            let expected = "must be a number";
            return Err(Error::input(
                "grasp settings: target",
                self.target,
                expected,
            ));
        }
        Ok(())
    }
}
