//! Beyond the paper: the swimmer's gait, for less work of its motors at no less distance swum. Amplitudes of the joints, frequency and length of the wave, stiffness and damping are found with
//! the gradients of distance and work through the whole run; beside it an evolution strategy at the same cost.

use crate::course::{Course, NAMES, Swum};
use crate::plot::{Curve, Panel, draw};
use crate::sqp::{self, Point, Vector};
use crate::swim::path;
use crate::work::{self, HINGE, MOTORS};
use crate::{How, Made, Numbers, rival};
use hydrograd::simulate::Sample;
use hydrograd::{Result, Rollout};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::error::Error;
use std::time::Instant;

/// Distance that the gradients aim at, of the scene's own gait's: a little more, so as not to end with less.
const AIM: f64 = 1.002;
/// What a distance that falls short costs, for a part of it, where a part of the work costs 1.
const SHORT: f64 = 20.0;
/// Runs with gradients, at most, and how many simulations one counts for: it takes the time of two, or of five with coarse meshes.
const MOST: [usize; 2] = [15, 8];
const COUNTS: [usize; 2] = [2, 5];
/// Spread of the evolution strategy at first, and what a run costs there that fails.
const SPREAD: f64 = 0.3;
const FAILED: f64 = 1e3;

/// The best so far, and how it went with the simulations that it took.
struct Best {
    own_distance: f64,
    own_work: f64,
    x: Vector,
    cost: f64,
    economy: f64,
    made: usize,
    history: [Vec<f64>; 2],
}

impl Best {
    fn new(own: &Swum) -> Self {
        Self {
            x: Vector::zeros(NAMES.len()),
            cost: 0.0,
            economy: own.distance / own.work,
            made: 0,
            history: [vec![0.0], vec![own.distance / own.work]],
            own_distance: own.distance,
            own_work: own.work,
        }
    }

    /// −ln of distance by work, of the own gait's, and what the distance falls short of its.
    fn cost(&self, swum: &Swum) -> f64 {
        if swum.distance <= 0.0 || swum.work <= 0.0 {
            return FAILED;
        }
        let further = (swum.distance / self.own_distance).ln();
        (swum.work / self.own_work).ln() - further + SHORT * (-further).max(0.0)
    }

    /// Notes a run that counts for some simulations, and what it costs.
    fn note(&mut self, x: &Vector, swum: Option<&Swum>, counts: usize) -> f64 {
        self.history[0].push((self.made + counts) as f64);
        self.history[1].push(self.economy);
        self.made += counts;
        let cost = swum.map_or(FAILED, |swum| self.cost(swum));
        if let Some(swum) = swum
            && cost < self.cost
        {
            (self.x, self.cost, self.economy) = (x.clone(), cost, swum.distance / swum.work);
        }
        self.history[0].push(self.made as f64);
        self.history[1].push(self.economy);
        cost
    }
}

/// By gradients.
fn descend(course: &Course, own: &Swum, most: usize, counts: usize) -> Best {
    let mut best = Best::new(own);
    sqp::search(best.x.clone(), &course.bounds(), most, |x| {
        let swum = course.swim(x).ok();
        if best.note(x, swum.as_ref(), counts) >= FAILED {
            return None;
        }
        let swum = swum?;
        let [distance, work] = course.slopes(x, &swum).ok()?;
        let (by_distance, by_work) = (distance / swum.distance, work / swum.work);
        Some(Point {
            cost: (swum.work / swum.distance).ln(),
            cost_slope: by_work - &by_distance,
            condition: (swum.distance / (AIM * own.distance)).ln(),
            condition_slope: by_distance,
        })
    });
    best
}

/// By an evolution strategy.
fn evolve(course: &Course, own: &Swum, most: usize) -> Best {
    let best = RefCell::new(Best::new(own));
    let bounds = course.bounds();
    rival::search(&[0.0; NAMES.len()], SPREAD, most, |x| {
        let x = Vector::from_column_slice(x);
        let inside = bounds.nearest(&x);
        let swum = course.swim(&inside).ok();
        let cost = best.borrow_mut().note(&inside, swum.as_ref(), 1);
        cost + (x - inside).norm_squared()
    });
    best.into_inner()
}

/// Time of a run with both gradients by that of a run.
fn cost_of_gradients(course: &Course) -> Result<f64> {
    let x = Vector::zeros(NAMES.len());
    let start = Instant::now();
    let swum = course.swim(&x)?;
    let run = start.elapsed().as_secs_f64();
    course.slopes(&x, &swum)?;
    Ok(start.elapsed().as_secs_f64() / run)
}

fn numbers_of(
    course: &Course,
    x: &Vector,
    swum: &Swum,
) -> std::result::Result<Value, Box<dyn Error>> {
    let samples = swum.rollout.samples().iter();
    let widest = |k: usize| {
        let angles = samples.clone().map(|s| s.q[HINGE + k].abs());
        angles.fold(0.0, f64::max)
    };
    let gaps = swum.rollout.gaps().iter().flatten();
    let values = course.values(x);
    let named = NAMES.iter().zip(&values);
    let gait: Numbers = named.map(|(name, v)| ((*name).into(), json!(v))).collect();
    Ok(json!({
        "distance_m": swum.distance,
        "work_j": swum.work,
        "net_work_j": work::net(&swum.rollout)[swum.rollout.steps()],
        "distance_by_work_m_j": swum.distance / swum.work,
        "distance_by_work_later_m_j": course.economy_later(x)?,
        "gait": gait,
        "joints_at_most_rad": ([0, 1, 2].map(widest)),
        "smallest_gap_m": gaps.map(|g| g.distance).fold(f64::INFINITY, f64::min),
    }))
}

pub fn make(how: &How) -> Made {
    let course = Course::new(how.quick)?;
    let start = Vector::zeros(NAMES.len());
    let own = course.swim(&start)?;
    let kind = usize::from(how.quick);
    let found = descend(&course, &own, MOST[kind], COUNTS[kind]);
    let rival = evolve(&course, &own, found.made);
    let (by_gradients, by_rival) = (course.swim(&found.x)?, course.swim(&rival.x)?);
    let runs = [
        ("own", &start, &own),
        ("gradients", &found.x, &by_gradients),
        ("CMA-ES", &rival.x, &by_rival),
    ];
    let mut numbers = Numbers::new();
    for (name, x, swum) in runs {
        let name = name.to_lowercase().replace('-', "");
        numbers.insert(name, numbers_of(&course, x, swum)?);
    }
    let economy = |swum: &Swum| swum.distance / swum.work / (own.distance / own.work);
    let mut insert = |name: &str, value| numbers.insert(name.into(), value);
    insert("better_by", json!(economy(&by_gradients)));
    insert("better_by_cmaes", json!(economy(&by_rival)));
    insert("distance_kept", json!(by_gradients.distance / own.distance));
    insert("runs_with_gradients", json!(found.made / COUNTS[kind]));
    insert("simulations_of_cmaes", json!(rival.made));
    let gradients = cost_of_gradients(&course)?;
    insert("run_with_gradients_by_run", json!(gradients));
    picture(
        how,
        &runs.map(|(name, _, swum)| (name, swum)),
        &[&found, &rival],
    )?;
    Ok(numbers)
}

fn picture(
    how: &How,
    runs: &[(&str, &Swum); 3],
    searches: &[&Best; 2],
) -> std::result::Result<(), Box<dyn Error>> {
    let curves = |of: &dyn Fn(&Rollout) -> Vec<f64>| {
        let curve = |(name, swum): &(&str, &Swum)| {
            let time: Vec<f64> = swum.rollout.samples().iter().map(|s| s.time).collect();
            Curve::new(*name, &time, &of(&swum.rollout))
        };
        runs.iter().map(curve).collect::<Vec<_>>()
    };
    let tail = |s: &Sample| s.q[HINGE + MOTORS - 1];
    let tail = |r: &Rollout| r.samples().iter().map(tail).collect();
    let end = searches.iter().map(|s| s.made).max().unwrap_or(1) as f64;
    let level = [searches[0].history[1][0]; 2];
    let mut histories = vec![Curve::new(runs[0].0, &[0.0, end], &level)];
    for ((name, _), search) in runs[1..].iter().zip(searches) {
        histories.push(Curve::new(*name, &search.history[0], &search.history[1]));
    }
    let last = "distance by work, best so far, m/J";
    let panels = [
        Panel::new("distance of the head, m", curves(&|r| path(r, "head").0)),
        Panel::new("work of the motors, J", curves(&work::motors)),
        Panel::new("tail's joint, rad", curves(&tail)),
        Panel::along(last, "simulations", histories),
    ];
    draw(how.picture, &panels)
}
