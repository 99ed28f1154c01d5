//! Figure 8: a swimmer passes a small fish, which nothing drives: the water pushes it aside, and nothing touches it. Beside it the same with the bodies uncoupled, and the swimmer
//! alone with and without its trailing edge.

use crate::plot::{Curve, Panel, draw};
use crate::swim::{path, run, scene, smallest_gap, with_small_fish, without_edge};
use crate::{How, Made, Numbers};
use hydrograd::{Fidelity, Rollout};
use serde_json::json;
use std::time::Instant;

fn way(rollout: &Rollout) -> f64 {
    let (x, _) = path(rollout, "head");
    x[x.len() - 1] - x[0]
}

pub fn make(how: &How) -> Made {
    let alone = scene()?;
    let mut numbers = Numbers::new();
    for (name, scene) in [
        ("alone", alone.clone()),
        ("alone_without_edge", without_edge(alone.clone())),
    ] {
        let start = Instant::now();
        let rollout = run(&scene, Fidelity::Auto, how.quick)?;
        let seconds = start.elapsed().as_secs_f64() / rollout.steps() as f64;
        let numbers_of = json!({
            "way_m": way(&rollout),
            "seconds_a_step_with_preparation": seconds,
        });
        numbers.insert(name.into(), numbers_of);
    }
    let both = with_small_fish(alone);
    let (mut paths, mut pushes) = (Vec::new(), Vec::new());
    for (name, fidelity) in [
        ("coupled", Fidelity::Auto),
        ("uncoupled", Fidelity::Isolated),
    ] {
        let start = Instant::now();
        let rollout = run(&both, fidelity, how.quick)?;
        let seconds = start.elapsed().as_secs_f64() / rollout.steps() as f64;
        let (x, y) = path(&rollout, "small fish");
        let away = |(x1, y1): (&f64, &f64)| (x1 - x[0]).hypot(y1 - y[0]);
        let pushed: Vec<f64> = x.iter().zip(&y).map(away).collect();
        numbers.insert(
            name.into(),
            json!({
                "small_fish_pushed_m": pushed[pushed.len() - 1],
                "small_fish_pushed_aside_m": y[y.len() - 1] - y[0],
                "way_m": way(&rollout),
                "smallest_gap_m": smallest_gap(&rollout, "small fish"),
                "seconds_a_step_with_preparation": seconds,
            }),
        );
        let (head_x, head_y) = path(&rollout, "head");
        paths.push(Curve::new(format!("head, {name}"), &head_x, &head_y));
        paths.push(Curve::new(format!("small fish, {name}"), &x, &y));
        let time: Vec<f64> = rollout.samples().iter().map(|s| s.time).collect();
        pushes.push(Curve::new(name, &time, &pushed));
    }
    draw(
        how.picture,
        &[
            Panel::along("paths in the plane: y, m", "x, m", paths),
            Panel::new("way of the small fish, m", pushes),
        ],
    )?;
    Ok(numbers)
}
