//! The rival that has no gradient: CMA-ES on the same cost of the same knots from the same start.

use crate::task::{CHEAP, Task};
use cmaes::{CMAESOptions, DVector};
use hydrograd::{Result, Scene};
use serde::Serialize;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// How far a rival searches around the start at first, in units of x.
const SPREAD: f64 = 0.3;
/// A simulation that fails costs what nothing else does.
pub const FAILED: f64 = 1e9;

/// Outcome of all seeds.
#[derive(Clone, Debug, Serialize)]
pub struct Rival {
    /// Simulations that each seed needed to reach the cost; none where it hit the cap.
    pub simulations: Vec<Option<usize>>,
    /// The least cost that each seed found.
    pub costs: Vec<f64>,
    /// Most simulations of a seed.
    pub cap: usize,
    /// Median over the seeds; the cap where the median seed hit it.
    pub median: usize,
    /// Whether the median is a lower bound.
    pub at_least: bool,
}

/// Runs the rival from `start` until it costs no more than `target`, or `cap` simulations are made, for seeds 1 to `seeds`,
/// as many at a time as there are cores.
pub fn run(scene: &Scene, start: &[f64], target: f64, cap: usize, seeds: usize) -> Result<Rival> {
    let next = AtomicUsize::new(0);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let worker = || -> Result<Vec<(usize, Option<usize>, f64)>> {
        let task = Task::new(scene, CHEAP)?;
        let mut found = Vec::new();
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds {
                return Ok(found);
            }
            let (needed, cost) = one(&task, start, target, cap, seed as u64 + 1);
            eprintln!(
                "rival, seed {}: cost {cost:.3} after {} simulations",
                seed + 1,
                needed.unwrap_or(cap)
            );
            found.push((seed, needed, cost));
        }
    };
    let results = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..cores.min(seeds)).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().map(|w| w.join()).collect::<Vec<_>>()
    });
    let mut all = Vec::new();
    for result in results {
        match result {
            Ok(found) => all.extend(found?),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
    all.sort_by_key(|(seed, ..)| *seed);
    let mut sorted: Vec<usize> = all.iter().map(|(_, n, _)| n.unwrap_or(cap)).collect();
    sorted.sort_unstable();
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(cap);
    Ok(Rival {
        simulations: all.iter().map(|(_, n, _)| *n).collect(),
        costs: all.iter().map(|(.., cost)| *cost).collect(),
        cap,
        median,
        at_least: median == cap,
    })
}

/// Simulations that one seed needed, if it got there, and the least cost that it saw.
fn one(task: &Task, start: &[f64], target: f64, cap: usize, seed: u64) -> (Option<usize>, f64) {
    let evaluate = |x: &[f64]| {
        let cost = task.cost(x).unwrap_or(FAILED);
        (cost, cost <= target)
    };
    search(evaluate, start, cap, seed)
}

/// CMA-ES on a function that gives its cost, and whether that is enough: evaluations until it is, if it is within `cap` of them, and the
/// least cost that was seen.
pub fn search(
    mut evaluate: impl FnMut(&[f64]) -> (f64, bool),
    start: &[f64],
    cap: usize,
    seed: u64,
) -> (Option<usize>, f64) {
    let mut count = 0;
    let mut best = f64::INFINITY;
    let mut reached = None;
    let done = AtomicBool::new(false);
    let cost = |x: &DVector<f64>| {
        // The rest of the generation.
        if reached.is_some() || count == cap {
            return FAILED;
        }
        count += 1;
        let (cost, enough) = evaluate(x.as_slice());
        best = best.min(cost);
        if enough {
            reached = Some(count);
            done.store(true, Ordering::Relaxed);
        }
        cost
    };
    let search = CMAESOptions::new(start.to_vec(), SPREAD)
        .seed(seed)
        .build(cost);
    if let Ok(mut search) = search {
        while search.function_evals() < cap && !done.load(Ordering::Relaxed) {
            if search.next().is_some() {
                break;
            }
        }
    }
    (reached, best)
}
