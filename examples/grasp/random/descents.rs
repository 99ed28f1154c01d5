//! Ways to descend on the same drawn grasps, from the same start, with as many simulations and gradients each.

use super::tried::Function;
use super::{Gripper, Task};
use hydrograd::adjoint::sample::Samples;
use hydrograd::optimize::{OptimizeSettings, Smoothing, continuation, smoothed};
use hydrograd::{Error, Result};
use rayon::prelude::*;
use serde::Serialize;
use std::cell::RefCell;

/// Simulations with gradients that each may spend.
const BUDGET: usize = 48;
/// Softness of contact, in turn.
const SOFTENED: [f64; 2] = [4.0, 1.0];
/// The neighbourhood over which is averaged: 6 samples a point.
const SMOOTHING: Smoothing = Smoothing {
    spread: 0.05,
    directions: 3,
    seed: 1,
};
/// Descents as the recipe has them.
const DESCENT: OptimizeSettings = OptimizeSettings {
    iterations: BUDGET,
    evaluations: BUDGET,
    memory: 10,
    first_step: Some(0.3),
    gradient_tolerance: 1e-6,
    cost_tolerance: 1e-4,
    target: None,
    clip: Some(1.0),
};

/// Where a way ended, with contact as it is.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Ended {
    /// The least cost that it saw.
    pub cost: f64,
    /// Whether it caught the object anywhere.
    pub caught: bool,
    /// Simulations with gradients.
    pub spent: usize,
}

/// One drawn grasp.
#[derive(Clone, Debug, Serialize)]
pub struct Compared {
    /// Cost at the start.
    pub start: f64,
    pub plain: Ended,
    pub softened: Ended,
    pub smoothed: Ended,
}

/// Sees what a descent tries.
struct Watched<'a> {
    function: &'a Function,
    seen: RefCell<Ended>,
}

impl<'a> Watched<'a> {
    fn new(function: &'a Function) -> Self {
        let seen = Ended {
            cost: f64::INFINITY,
            caught: false,
            spent: 0,
        };
        Self {
            function,
            seen: RefCell::new(seen),
        }
    }

    fn at(&self, softness: f64, x: &[f64]) -> Result<(f64, Vec<f64>)> {
        let mut simulator = self.function.simulator.clone();
        if softness != 1.0 {
            simulator.soften_contact(softness)?;
        }
        self.seen.borrow_mut().spent += 1;
        let tried = self.function.run(&simulator, x)?;
        if softness == 1.0 {
            self.note(tried.cost, tried.caught);
        }
        Ok((tried.cost, self.function.gradient(x, &tried)?))
    }

    fn note(&self, cost: f64, caught: bool) {
        let mut seen = self.seen.borrow_mut();
        seen.cost = seen.cost.min(cost);
        seen.caught |= caught;
    }

    /// Descends a family over its stages, all of them with the budget; one that breaks off has come as far as it has.
    fn descend(
        self,
        function: impl Fn(&Self, f64, &[f64]) -> Result<(f64, Vec<f64>)>,
        stages: &[f64],
        evaluations: usize,
        start: &[f64],
    ) -> Ended {
        let each = OptimizeSettings {
            evaluations: evaluations / stages.len(),
            ..DESCENT
        };
        let evaluate = |softness: f64, x: &[f64]| function(&self, softness, x);
        let _ = continuation(evaluate, stages, start, &each, |_, _| {});
        self.seen.into_inner()
    }
}

fn compared(drawn: &Task) -> Result<Compared> {
    let function = Function::new(drawn)?;
    let start = function.start()?;
    let watched = || Watched::new(&function);
    let samples = 2 * SMOOTHING.directions;
    let averaged = |watched: &Watched, _: f64, x: &[f64]| {
        let at = |x: &[f64]| {
            let tried = function.run(&function.simulator, x)?;
            Ok((tried.cost, function.gradient(x, &tried)?))
        };
        let found = smoothed(at, x, &SMOOTHING)?;
        watched.seen.borrow_mut().spent += samples;
        // The mean isn't what is asked for: the point itself is.
        let tried = function.run(&function.simulator, x)?;
        watched.note(tried.cost, tried.caught);
        Ok::<_, Error>((found.cost, found.mixed()))
    };
    Ok(Compared {
        start: function.run(&function.simulator, &start)?.cost,
        plain: watched().descend(Watched::at, &[1.0], BUDGET, &start),
        softened: watched().descend(Watched::at, &SOFTENED, BUDGET, &start),
        smoothed: watched().descend(averaged, &[1.0], BUDGET / samples, &start),
    })
}

/// So many grasps, drawn by a seed.
pub fn compare(gripper: Gripper, count: usize, seed: u64) -> Result<Vec<Compared>> {
    let scene = gripper.scene()?;
    let mut random = Samples::new(seed);
    let drawn: Result<Vec<Task>> = (0..count)
        .map(|_| gripper.draw(&scene, &mut random))
        .collect();
    let of = |(i, task): (usize, &Task)| {
        let found = compared(task)?;
        let show = |e: &Ended| {
            let caught = if e.caught { ", caught" } else { "" };
            format!("{:.3}{caught} ({})", e.cost, e.spent)
        };
        eprintln!(
            "grasp {}: cost {:.3}; plain {}; softened {}; smoothed {}",
            i + 1,
            found.start,
            show(&found.plain),
            show(&found.softened),
            show(&found.smoothed)
        );
        Ok(found)
    };
    drawn?.par_iter().enumerate().map(of).collect()
}

/// The table.
pub fn print(all: &[Compared]) {
    println!("| descent | caught | median cost | lower than plain in |");
    println!("|---|---|---|---|");
    let ended = |c: &Compared| [c.plain, c.softened, c.smoothed];
    for (k, name) in ["plain", "softened", "smoothed"].into_iter().enumerate() {
        let of = |c: &Compared| ended(c)[k];
        let mut costs: Vec<f64> = all.iter().map(|c| of(c).cost).collect();
        costs.sort_by(f64::total_cmp);
        println!(
            "| {name} | {} of {} | {:.3} | {} |",
            all.iter().filter(|c| of(c).caught).count(),
            all.len(),
            costs.get(costs.len() / 2).unwrap_or(&f64::NAN),
            all.iter().filter(|c| of(c).cost < c.plain.cost).count(),
        );
    }
}
