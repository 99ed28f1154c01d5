//! The task: the scene with and without water, its controllers, and controls through knots with their cost and its gradient.

use super::hold::{Hold, Tolerable, caught};
use hydrograd::optimize::{OptimizeProgress, OptimizeSettings, Optimum, minimise};
use hydrograd::scene::{Controller, SpeedStage};
use hydrograd::simulate::{Knots, OpenLoop, Rollout};
use hydrograd::{Controls, Fidelity, Result, Scene, Settings, Simulator};
use nalgebra::DMatrix;
use std::cell::{Cell, RefCell};
use std::path::Path;
use std::time::Instant;

/// Largest force on the column and on each finger, N.
pub const LIMITS: [f64; 3] = [500.0; 3];
/// Knots of the controls, a quarter of a second apart.
const KNOTS: usize = 11;
/// Steps of the approach: until shortly before the fingers touch the coin.
const APPROACH: usize = 130;

/// Descent of the approach: it needn't be exact.
const REACHING: OptimizeSettings = OptimizeSettings {
    iterations: 10,
    evaluations: 20,
    memory: 10,
    first_step: Some(0.3),
    gradient_tolerance: 1e-3,
    cost_tolerance: 1e-3,
    target: Some(0.3),
    clip: None,
};

/// How often a descent of the hold goes on where the coin isn't held for long enough.
const GOING_ON: usize = 3;
/// Descent of the hold in water that is resolved, to a cost at which the coin is held firmly.
const HOLDING: OptimizeSettings = OptimizeSettings {
    iterations: 30,
    evaluations: 15,
    memory: 10,
    first_step: Some(0.3),
    gradient_tolerance: 1e-6,
    cost_tolerance: 1e-9,
    target: Some(0.1),
    // Gradients through a collision that is about to happen otherwise are hundreds of times this, and say little.
    clip: Some(0.1),
};
/// The same in water that is only searched in: to where little is left to polish.
const SEARCHING: OptimizeSettings = OptimizeSettings {
    evaluations: 40,
    target: Some(0.2),
    ..HOLDING
};

/// The water that forces are searched in: compressed sources alone, at half the time of a step.
pub const CHEAP: Water = Water {
    fidelity: Fidelity::Reduced,
    films: false,
};
/// The water that they are polished and judged in: films in the gaps that the sources don't resolve.
pub const RESOLVED: Water = Water {
    fidelity: Fidelity::Reduced,
    films: true,
};
/// All bodies solved together.
pub const FULL: Water = Water {
    fidelity: Fidelity::Full,
    films: false,
};

/// How the water is computed.
#[derive(Clone, Copy)]
pub struct Water {
    fidelity: Fidelity,
    films: bool,
}

pub fn load() -> Result<Scene> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
    Scene::load(folder.join("grasp.toml"))
}

/// With faces small enough for the gaps between the coin and the fingers that hold it: what is compressed resolves half the longest
/// edge, which is less than the gap of contact.
pub fn refined(scene: &Scene) -> Scene {
    // Where the coin comes near a finger, in the finger's frame, m.
    const GRIP: [f64; 3] = [0.0, 1.27, 0.0];
    const EDGE: f64 = 0.036;
    let mut scene = scene.clone();
    for body in &mut scene.bodies {
        *body = match body.name.as_str() {
            "finger 1" | "finger 2" => {
                body.clone()
                    .refine(GRIP, 0.25, EDGE)
                    .refine(GRIP, 0.4, 3.0 * EDGE)
            }
            // All of it.
            "coin" => body.clone().refine([0.0; 3], 0.3, EDGE),
            _ => continue,
        };
    }
    scene
}

/// As on dry land.
pub fn dry(scene: &Scene) -> Scene {
    let mut dry = scene.clone();
    dry.fluid.density = 0.0;
    dry
}

/// The paper's two hand-tuned controllers: the naive push, and from a speed of the fingers on one of the column as well.
pub fn hand_tuned(scene: &Scene) -> [Scene; 2] {
    let stages = [
        [(0.12, [0.0, 400.0, -400.0]), (0.18, [850.0, 400.0, -400.0])],
        [(0.08, [0.0, 400.0, -400.0]), (0.2, [1000.0, 400.0, -400.0])],
    ];
    stages.map(|stages| {
        let mut scene = scene.clone();
        let stage = |(until, control): (f64, [f64; 3])| SpeedStage {
            until,
            control: control.to_vec(),
        };
        scene.controller = Some(Controller::SpeedStages {
            bodies: vec!["finger 1".into(), "finger 2".into()],
            stages: stages.map(stage).to_vec(),
        });
        scene
    })
}

pub fn simulator(scene: &Scene, water: Water) -> Result<Simulator> {
    let settings = Settings::default();
    let settings = match scene.fluid.density == 0.0 {
        true => settings.fidelity(Fidelity::Isolated),
        false => settings.fidelity(water.fidelity).films(water.films),
    };
    Simulator::new(scene, settings)
}

/// The scene's own controller.
pub fn run(simulator: &Simulator, steps: usize) -> Result<Rollout> {
    simulator.rollout(&Controls::zeros(simulator, steps))
}

/// Open-loop controls of the scene, through knots.
pub struct Task {
    simulator: Simulator,
    knots: Knots,
    steps: usize,
    /// Where the fingers should be, and the coin between them, before they touch it.
    approach: Hold,
    hold: Hold,
    /// Steps simulated.
    simulated: Cell<usize>,
    /// Steps simulated that were differentiated as well.
    differentiated: Cell<usize>,
    /// Time of simulating and of differentiating, s.
    seconds: Cell<(f64, f64)>,
}

/// What evaluations cost so far.
#[derive(Clone, Copy)]
pub struct Spent {
    /// Whole simulations, shorter ones by their share.
    pub simulations: f64,
    /// Whole gradients.
    pub gradients: f64,
    /// Time of a simulation, s.
    pub seconds_per_simulation: f64,
    /// Time of a gradient, its simulation left out, s.
    pub seconds_per_gradient: f64,
}

impl Spent {
    /// Together with another.
    pub fn and(&self, other: &Self) -> Self {
        let mean = |a: f64, n: f64, b: f64, m: f64| (a * n + b * m) / (n + m).max(1.0);
        let (rollouts, more) = (self.simulations, other.simulations);
        let (gradients, further) = (self.gradients, other.gradients);
        let simulating = (self.seconds_per_simulation, other.seconds_per_simulation);
        let differentiating = (self.seconds_per_gradient, other.seconds_per_gradient);
        Self {
            simulations: rollouts + more,
            gradients: gradients + further,
            seconds_per_simulation: mean(simulating.0, rollouts, simulating.1, more),
            seconds_per_gradient: mean(differentiating.0, gradients, differentiating.1, further),
        }
    }
}

impl Task {
    pub fn new(scene: &Scene, water: Water) -> Result<Self> {
        let mut simulator = simulator(scene, water)?;
        simulator.set_policy(Box::new(OpenLoop));
        let steps = scene.steps;
        let gap = scene.contact.and_then(|c| c.gap).unwrap_or(0.0);
        let never = f64::INFINITY;
        Ok(Self {
            knots: Knots::new(&simulator, steps, KNOTS, &LIMITS)?,
            simulator,
            steps,
            approach: Hold {
                from: 1.2,
                along: 1.25,
                opening: 0.44,
                grip: 0.0,
                tolerable: Tolerable {
                    along: 0.05,
                    across: 0.05,
                    opening: 0.05,
                    drift: 0.05,
                    closing: never,
                    grip: never,
                },
            },
            hold: Hold {
                from: 1.9,
                along: 1.2,
                opening: 0.1 + 2.0 * gap,
                grip: 100.0,
                tolerable: Tolerable {
                    along: 0.2,
                    across: 0.1,
                    opening: 0.1,
                    drift: 0.1,
                    closing: 0.1,
                    grip: 100.0,
                },
            },
            simulated: Cell::new(0),
            differentiated: Cell::new(0),
            seconds: Cell::new((0.0, 0.0)),
        })
    }

    /// The knots through what another controller did.
    pub fn through(&self, rollout: &Rollout) -> Result<Vec<f64>> {
        let mut controls = DMatrix::zeros(LIMITS.len(), self.steps);
        for (n, sample) in rollout.samples().iter().take(self.steps).enumerate() {
            controls.set_column(n, &sample.control);
        }
        self.knots
            .through(&Controls::from_matrix(&self.simulator, controls)?)
    }

    pub fn controls(&self, x: &[f64]) -> Result<Controls> {
        self.knots.controls(&self.simulator, x)
    }

    /// A rollout of the first steps, counted.
    fn simulate(&self, x: &[f64], steps: usize) -> Result<Rollout> {
        let start = Instant::now();
        let all = self.controls(x)?;
        let first = all.matrix().columns(0, steps).into_owned();
        let rollout = self
            .simulator
            .rollout(&Controls::from_matrix(&self.simulator, first)?);
        self.simulated.set(self.simulated.get() + steps);
        let (simulating, differentiating) = self.seconds.get();
        self.seconds
            .set((simulating + start.elapsed().as_secs_f64(), differentiating));
        rollout
    }

    /// A rollout with its cost and the gradient over x, counted.
    fn descend(&self, x: &[f64], goal: &Hold, steps: usize) -> Result<(Rollout, f64, Vec<f64>)> {
        let rollout = self.simulate(x, steps)?;
        let start = Instant::now();
        let gradient = rollout.gradient(goal)?;
        let mut controls = DMatrix::zeros(LIMITS.len(), self.steps);
        controls.columns_mut(0, steps).copy_from(&gradient.controls);
        let gradient = self.knots.controls_vjp(x, &controls)?;
        self.differentiated.set(self.differentiated.get() + steps);
        let (simulating, differentiating) = self.seconds.get();
        self.seconds
            .set((simulating, differentiating + start.elapsed().as_secs_f64()));
        let cost = rollout.value(goal)?;
        Ok((rollout, cost, gradient))
    }

    /// Cost of being away from a good place before the fingers touch the coin, and its gradient.
    pub fn approach(&self, x: &[f64]) -> Result<(f64, Vec<f64>)> {
        let (_, cost, gradient) = self.descend(x, &self.approach, APPROACH)?;
        Ok((cost, gradient))
    }

    /// Cost of not holding the coin at the end, and its gradient.
    pub fn hold(&self, x: &[f64]) -> Result<(f64, Vec<f64>)> {
        let (_, cost, gradient) = self.descend(x, &self.hold, self.steps)?;
        Ok((cost, gradient))
    }

    /// Forces that hold the coin, from `x`: by a descent to a good approach, and by one of the whole trajectory from there. Iterations are those
    /// of both; `say` is called with every one.
    pub fn find(&self, x: &[f64], say: impl Fn(&str, &OptimizeProgress)) -> Result<Optimum> {
        let reached = minimise(|x| self.approach(x), x, &REACHING, |p| say("approach", p))?;
        let held = self.descend_to(&SEARCHING, &reached.x, |p| say("hold", p))?;
        Ok(Optimum {
            iterations: reached.iterations + held.iterations,
            ..held
        })
    }

    /// A descent from forces that nearly hold the coin to such that hold it firmly.
    pub fn polish(&self, x: &[f64], say: impl Fn(&OptimizeProgress)) -> Result<Optimum> {
        self.descend_to(&HOLDING, x, say)
    }

    /// A descent of the whole trajectory. A cost tells how well it is held on the whole, not for how long:
    /// what holds it for long enough is never given up for less cost, and as long as nothing does the descent goes on, to half the cost.
    fn descend_to(
        &self,
        settings: &OptimizeSettings,
        x: &[f64],
        say: impl Fn(&OptimizeProgress),
    ) -> Result<Optimum> {
        let mut settings = *settings;
        let best = RefCell::new(None);
        let cost = |x: &[f64]| self.hold_or_keep(x, &best);
        let mut found = minimise(cost, x, &settings, &say)?;
        for _ in 0..GOING_ON {
            if best.borrow().is_some() {
                break;
            }
            settings.target = settings.target.map(|target| target / 2.0);
            let further = minimise(cost, &found.x, &settings, &say)?;
            found = Optimum {
                iterations: found.iterations + further.iterations,
                ..further
            };
        }
        if let Some((cost, x)) = best.into_inner() {
            found = Optimum { cost, x, ..found };
        }
        Ok(found)
    }

    /// [`Task::hold`], and the least cost of what caught the coin so far, with where.
    fn hold_or_keep(
        &self,
        x: &[f64],
        best: &RefCell<Option<(f64, Vec<f64>)>>,
    ) -> Result<(f64, Vec<f64>)> {
        let (rollout, cost, gradient) = self.descend(x, &self.hold, self.steps)?;
        let mut best = best.borrow_mut();
        if best.as_ref().is_none_or(|(least, _)| cost < *least) && caught(&rollout)? {
            *best = Some((cost, x.to_vec()));
        }
        Ok((cost, gradient))
    }

    /// The same cost alone.
    pub fn cost(&self, x: &[f64]) -> Result<f64> {
        self.simulate(x, self.steps)?.value(&self.hold)
    }

    pub fn rollout(&self, x: &[f64]) -> Result<Rollout> {
        self.simulator.rollout(&self.controls(x)?)
    }

    pub fn spent(&self) -> Spent {
        let whole = |steps: usize| steps as f64 / self.steps as f64;
        let (simulations, gradients) = (
            whole(self.simulated.get()),
            whole(self.differentiated.get()),
        );
        let (simulating, differentiating) = self.seconds.get();
        Spent {
            simulations,
            gradients,
            seconds_per_simulation: simulating / simulations.max(1.0),
            seconds_per_gradient: differentiating / gradients.max(1.0),
        }
    }
}
