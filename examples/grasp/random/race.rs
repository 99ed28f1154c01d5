//! CMA-ES on a drawn grasp, with ten times the simulations that the recipe spent on it.

use super::tried::Function;
use super::{Outcome, Task};
use crate::rival;
use hydrograd::Result;
use serde::Serialize;

/// Simulations of the rival for each of the recipe.
const TIMES: f64 = 10.0;

/// What the rival came to.
#[derive(Clone, Debug, Serialize)]
pub struct Raced {
    pub caught: bool,
    /// Until it caught the object, or all that it may make.
    pub simulations: usize,
    /// Most that it may make.
    pub most: usize,
    /// What the recipe spent, gradients counted by their time.
    pub recipe: f64,
    /// The least cost that it saw.
    pub cost: f64,
}

pub fn race(drawn: &Task, outcome: &Outcome, seed: u64) -> Result<Raced> {
    let function = Function::new(drawn)?;
    let ratio = function.gradient_over_simulation()?;
    let found = &outcome.found;
    let recipe = found.simulations as f64 + ratio * found.gradients as f64;
    let most = (TIMES * recipe).ceil() as usize;
    let evaluate = |x: &[f64]| match function.run(&function.simulator, x) {
        Ok(tried) => (tried.cost, tried.caught),
        Err(_) => (rival::FAILED, false),
    };
    let (needed, cost) = rival::search(evaluate, &function.start()?, most, seed);
    Ok(Raced {
        caught: needed.is_some(),
        simulations: needed.unwrap_or(most),
        most,
        recipe,
        cost,
    })
}
