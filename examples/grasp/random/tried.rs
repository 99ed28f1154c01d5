//! A drawn grasp as a function of its knots, for what rivals the recipe: the same cost, knots, bounds and start.

use super::Task;
use hydrograd::optimize::{GraspCost, GraspSettings, GraspTask};
use hydrograd::simulate::{Fidelity, Knots, OpenLoop, Rollout};
use hydrograd::{Result, Settings, Simulator};
use std::time::Instant;

pub struct Function {
    pub simulator: Simulator,
    task: GraspTask,
    knots: Knots,
    cost: GraspCost,
}

/// A simulated point.
pub struct Tried {
    pub cost: f64,
    pub caught: bool,
    rollout: Rollout,
}

/// In water that is resolved down to contact, or in cheap water: compressed sources alone.
pub fn simulator(drawn: &Task, resolved: bool) -> Result<Simulator> {
    let settings = Settings::default().fidelity(Fidelity::Reduced);
    Simulator::new(&drawn.scene, settings.films(resolved))
}

impl Function {
    pub fn new(drawn: &Task) -> Result<Self> {
        let mut simulator = simulator(drawn, false)?;
        simulator.set_policy(Box::new(OpenLoop));
        let task = drawn.task.clone();
        let knots = GraspSettings::default().knots;
        Ok(Self {
            knots: Knots::new(&simulator, simulator.steps(), knots, &task.limits)?,
            cost: task.hold_cost(&simulator)?,
            simulator,
            task,
        })
    }

    /// The push in the middle of those that the recipe tries.
    pub fn start(&self) -> Result<Vec<f64>> {
        let push = self.task.middle_push(&self.simulator)?;
        self.knots.through(&push)
    }

    /// With the given simulator: this one's, or a softer one.
    pub fn run(&self, simulator: &Simulator, x: &[f64]) -> Result<Tried> {
        let rollout = simulator.rollout(&self.knots.controls(simulator, x)?)?;
        let since = self.task.held_since(&rollout)?;
        let end = rollout.samples()[rollout.steps()].time;
        Ok(Tried {
            cost: rollout.value(&self.cost)?,
            caught: since.is_some_and(|t| end - t >= self.task.hold - 1e-9),
            rollout,
        })
    }

    /// Of what was simulated.
    pub fn gradient(&self, x: &[f64], tried: &Tried) -> Result<Vec<f64>> {
        let gradient = tried.rollout.gradient(&self.cost)?;
        self.knots.controls_vjp(x, &gradient.controls)
    }

    /// Time of a gradient, without its simulation, over that of a simulation, at the start.
    pub fn gradient_over_simulation(&self) -> Result<f64> {
        let x = self.start()?;
        let begin = Instant::now();
        let tried = self.run(&self.simulator, &x)?;
        let simulated = begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        self.gradient(&x, &tried)?;
        Ok(begin.elapsed().as_secs_f64() / simulated)
    }
}
