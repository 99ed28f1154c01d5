//! Figure 3: the coin beside the falling ball, with the water coupled and without.

use crate::falling::{Coin, largest, run, scene};
use crate::plot::{Curve, Panel, draw};
use crate::{How, Made, Numbers};
use hydrograd::Fidelity;
use serde_json::json;
use std::time::Instant;

/// Gap of the sphere below which it counts as having arrived, m.
const ARRIVED: f64 = 0.05;

pub fn make(how: &How) -> Made {
    let scene = scene()?;
    let (faces, steps) = if how.quick {
        (80, 160)
    } else {
        (1280, scene.steps)
    };
    let mut numbers = Numbers::new();
    let mut coins = Vec::new();
    for (name, fidelity) in [
        ("full", Fidelity::Full),
        ("reduced", Fidelity::Reduced),
        ("isolated", Fidelity::Isolated),
    ] {
        let start = Instant::now();
        let coin = Coin::of(&run(&scene, fidelity, faces, steps)?);
        let seconds = start.elapsed().as_secs_f64();
        let arrives = coin.sphere.iter().position(|gap| *gap < ARRIVED);
        numbers.insert(
            name.into(),
            json!({
                "turned_when_the_sphere_arrives_deg": arrives.map(|n| coin.angle[n]),
                "sphere_arrives_s": arrives.map(|n| coin.time[n]),
                "turned_at_most_deg": largest(&coin.angle),
                "pushed_at_most_m": largest(&coin.pushed),
                "seconds_a_step_with_preparation": seconds / steps as f64,
            }),
        );
        coins.push((name, coin));
    }
    let curves = |of: fn(&Coin) -> &Vec<f64>| -> Vec<Curve> {
        let each = coins.iter();
        each.map(|(name, coin)| Curve::new(*name, &coin.time, of(coin)))
            .collect()
    };
    draw(
        how.picture,
        &[
            Panel::new("turn of the coin, degrees", curves(|c| &c.angle)),
            Panel::new("way of the coin, m", curves(|c| &c.pushed)),
            Panel::new("sphere over the floor, m", curves(|c| &c.sphere)),
            Panel::new("height of the coin, m", curves(|c| &c.height)),
        ],
    )?;
    Ok(numbers)
}
