//! Beyond figure 9: the swimmer beside the beating tail, steered back to its line. The bias of its wave is found by Newton's iteration with the gradient of its drift through the whole run; beside it
//! an evolution strategy with as many simulations.

use crate::rival;
use crate::swim::{draw_drifts, scene, simulator, steps, with_large_tail};
use crate::{How, Made, Numbers};
use hydrograd::{Controls, Fidelity, Result, Rollout, Simulator};
use serde_json::json;

/// Number of the bias among the gains.
const BIAS: usize = 5;
/// Longest step of the iteration, rad.
const STEP: f64 = 0.1;
/// Most runs with a gradient, and part of the drift that is small enough.
const MOST: usize = 10;
const SMALL: f64 = 1e-3;
/// What a run costs that fails, m.
const FAILED: f64 = 1e3;

struct Course {
    simulator: Simulator,
    steps: usize,
    head: usize,
}

impl Course {
    fn run(&self, bias: f64) -> Result<Rollout> {
        let mut gains = self.simulator.policy().gains();
        gains[BIAS] = bias;
        let mut simulator = self.simulator.clone();
        simulator.set_policy(self.simulator.policy().with_gains(&gains)?);
        simulator.rollout(&Controls::zeros(&simulator, self.steps))
    }

    /// Lateral drift of the head, m.
    fn drift(&self, rollout: &Rollout) -> f64 {
        let y = |n: usize| rollout.samples()[n].poses[self.head].translation.y;
        y(self.steps) - y(0)
    }

    /// The drift's derivative by the bias, m/rad.
    fn slope(&self, rollout: &Rollout) -> Result<f64> {
        let mut bars = rollout.zero_cotangents();
        bars.positions[(3 * self.head + 1, self.steps)] = 1.0;
        Ok(rollout.vjp(&bars)?.gains[BIAS])
    }
}

pub fn make(how: &How) -> Made {
    let simulator = simulator(&with_large_tail(scene()?), Fidelity::Auto, how.quick)?;
    let course = Course {
        steps: steps(how.quick),
        head: simulator.scene().body("head").map_or(0, |id| id.0),
        simulator,
    };
    let before = course.run(0.0)?;
    let first = course.drift(&before);
    let (mut bias, mut runs) = (0.0, vec![before]);
    loop {
        let now = &runs[runs.len() - 1];
        let drift = course.drift(now);
        if drift.abs() <= SMALL * first.abs() || runs.len() == MOST {
            break;
        }
        let step = -drift / course.slope(now)?;
        bias += step.clamp(-STEP, STEP);
        runs.push(course.run(bias)?);
    }
    let (before, now) = (&runs[0], &runs[runs.len() - 1]);
    // It searches two numbers at least: the second has no effect.
    let (rival, simulations) = rival::search(&[0.0; 2], 1.0, 2 * runs.len(), |x| {
        let drift = course.run(STEP * x[0]).map(|run| course.drift(&run).abs());
        drift.unwrap_or(FAILED)
    });
    let by_rival = course.run(STEP * rival[0])?;
    let mut numbers = Numbers::new();
    numbers.insert("drift_m".into(), json!(first));
    numbers.insert("drift_steered_m".into(), json!(course.drift(now)));
    numbers.insert("cut_by".into(), json!((first / course.drift(now)).abs()));
    numbers.insert("bias_rad".into(), json!(bias));
    numbers.insert("runs_with_gradient".into(), json!(runs.len()));
    numbers.insert("drift_cmaes_m".into(), json!(course.drift(&by_rival)));
    numbers.insert(
        "cut_by_cmaes".into(),
        json!((first / course.drift(&by_rival)).abs()),
    );
    numbers.insert("simulations_of_cmaes".into(), json!(simulations));
    let drawn = [("no bias", before), ("steered", now), ("CMA-ES", &by_rival)];
    draw_drifts(how.picture, &drawn)?;
    Ok(numbers)
}
