//! Figure 1: a gripper that closes on a coin as it would on dry land pushes it away under water; forces that move the gripper along with it, found by gradients, catch it.
//!
//! The task, its costs and what *caught* means are those of the example `grasp` (docs/grasp.md).

#[allow(dead_code)]
#[path = "../grasp/hold.rs"]
mod hold;
#[allow(dead_code)]
#[path = "../grasp/task.rs"]
mod task;

use crate::plot::{Curve, Panel, draw};
use crate::{How, Made, Numbers};
use hold::{COIN_Y, COLUMN, FINGERS};
use hydrograd::geometry::{Gaps, Other};
use hydrograd::simulate::{Rollout, Sample};
use serde_json::{Value, json};
use std::error::Error;
use std::time::Instant;
use task::Task;

const COIN: usize = 3;

pub fn make(how: &How) -> Made {
    let plain = task::load()?;
    let steps = plain.steps;
    let dry = task::simulator(&task::dry(&plain), task::CHEAP)?;
    let dry = task::run(&dry, steps)?;
    let (scene, water) = match how.quick {
        true => (plain.clone(), task::CHEAP),
        false => (task::refined(&plain), task::RESOLVED),
    };
    let submerged = task::simulator(&scene, water)?;
    let naive = task::run(&submerged, steps)?;

    let start = Instant::now();
    let search = Task::new(&plain, task::CHEAP)?;
    let through = search.through(&naive)?;
    let before = search.cost(&through)?;
    let mut found = search.find(&through, |_, _| ())?;
    let cut_by = before / found.cost;
    let (mut iterations, mut spent) = (found.iterations, search.spent());
    let optimised = match how.quick {
        true => search.rollout(&found.x)?,
        false => {
            let judged = Task::new(&scene, task::RESOLVED)?;
            found = judged.polish(&found.x, |_| ())?;
            iterations += found.iterations;
            spent = spent.and(&judged.spent());
            judged.rollout(&found.x)?
        }
    };
    let seconds = start.elapsed().as_secs_f64();

    let runs = [
        ("naive_dry", "naive, no water", &dry),
        ("naive", "naive", &naive),
        ("optimised", "found by gradients", &optimised),
    ];
    let gaps = submerged.gaps();
    let mut numbers = Numbers::new();
    for (name, _, rollout) in runs {
        numbers.insert(name.into(), report(rollout, gaps)?);
    }
    numbers.insert("cost_cut_by".into(), json!(cut_by));
    numbers.insert("iterations".into(), json!(iterations));
    numbers.insert("rollouts_with_gradients".into(), json!(spent.gradients));
    numbers.insert("seconds".into(), json!(seconds));
    picture(how, &runs, gaps)?;
    Ok(numbers)
}

fn report(rollout: &Rollout, gaps: &Gaps) -> Result<Value, Box<dyn Error>> {
    let samples = rollout.samples();
    let (first, last) = (&samples[0], &samples[samples.len() - 1]);
    let clearance = samples.iter().map(|s| clearance(s, gaps));
    Ok(json!({
        "caught": hold::caught(rollout)?,
        "held_since_s": hold::held_since(rollout)?,
        "coin_pushed_m": last.q[COIN_Y] - first.q[COIN_Y],
        "gripper_moved_m": last.q[COLUMN] - first.q[COLUMN],
        "coin_along_the_fingers_m": along(last),
        "opening_m": opening(last),
        "smallest_gap_m": clearance.fold(f64::INFINITY, f64::min),
    }))
}

/// Of the coin's middle from the column; the fingers end at 1.6 m.
fn along(s: &Sample) -> f64 {
    s.q[COIN_Y] - s.q[COLUMN]
}

/// Between the fingers' joints.
fn opening(s: &Sample) -> f64 {
    s.q[FINGERS[1]] - s.q[FINGERS[0]]
}

/// Smallest gap between the coin and anything else, m.
fn clearance(s: &Sample, gaps: &Gaps) -> f64 {
    let of_coin = gaps.all(&s.poses).into_iter();
    let of_coin = of_coin.filter(|g| g.first == COIN || g.second == Other::Body(COIN));
    of_coin.map(|g| g.distance).fold(f64::INFINITY, f64::min)
}

fn picture(how: &How, runs: &[(&str, &str, &Rollout)], gaps: &Gaps) -> Result<(), Box<dyn Error>> {
    let panel = |title, of: &dyn Fn(&Sample) -> f64| {
        let curve = |(_, label, rollout): &(&str, &str, &Rollout)| {
            let samples = rollout.samples().iter();
            let (time, values): (Vec<f64>, Vec<f64>) = samples.map(|s| (s.time, of(s))).unzip();
            Curve::new(*label, &time, &values)
        };
        Panel::new(title, runs.iter().map(curve).collect())
    };
    draw(
        how.picture,
        &[
            panel("coin, m from where it was", &|s| {
                s.q[COIN_Y] - runs[0].2.samples()[0].q[COIN_Y]
            }),
            panel("gripper, m from where it was", &|s| s.q[COLUMN]),
            panel("coin along the fingers, m (tips at 1.6)", &along),
            panel("smallest gap of the coin, m", &|s| clearance(s, gaps)),
        ],
    )
}
