//! Figure 4: the falling ball with more and less viscosity in Eq. 22. The more of it, the less far the coin is pushed, and the sooner it settles.

use crate::falling::{Coin, largest, run, scene};
use crate::plot::{Curve, Panel, draw};
use crate::{How, Made, Numbers};
use hydrograd::Fidelity;
use hydrograd::scene::Drag;
use serde_json::json;

/// ν of Eq. 22, m/s; the scene's own is the second.
const VISCOSITIES: [f64; 4] = [0.0, 0.012, 0.05, 0.2];
/// Steps of a run: in fewer the scene's own viscosity doesn't let the coin settle.
const STEPS: usize = 800;
/// Speed below which the coin has settled, m/s.
const SETTLED: f64 = 0.01;

pub fn make(how: &How) -> Made {
    let scene = scene()?;
    let faces = if how.quick { 80 } else { 1280 };
    let mut coins = Vec::new();
    for viscosity in VISCOSITIES {
        let mut scene = scene.clone();
        for body in &mut scene.bodies {
            if body.name == "coin" {
                let linear = viscosity * scene.fluid.density;
                body.drag = Some(Drag {
                    linear,
                    ..body.drag.unwrap_or_default()
                });
            }
        }
        coins.push(Coin::of(&run(&scene, Fidelity::Auto, faces, STEPS)?));
    }
    // The last time that it was faster; none where it still is at the end.
    let settles = |coin: &Coin| {
        let last = coin.speed.iter().rposition(|v| *v > SETTLED);
        last.map_or(Some(0.0), |n| coin.time.get(n + 1).copied())
    };
    let pushed: Vec<f64> = coins.iter().map(|c| largest(&c.pushed)).collect();
    let settled: Vec<Option<f64>> = coins.iter().map(settles).collect();
    let end = |c: &Coin| c.pushed[c.pushed.len() - 1];
    let falls = |x: &[f64]| x.windows(2).all(|pair| pair[1] < pair[0]);
    let ends: Vec<f64> = settled.iter().map(|t| t.unwrap_or(f64::MAX)).collect();
    let mut numbers = Numbers::new();
    numbers.insert("viscosity_m_per_s".into(), json!(VISCOSITIES));
    numbers.insert("pushed_at_most_m".into(), json!(pushed));
    numbers.insert(
        "way_at_the_end_m".into(),
        json!(coins.iter().map(end).collect::<Vec<_>>()),
    );
    numbers.insert("settled_after_s".into(), json!(settled));
    numbers.insert("push_falls_with_viscosity".into(), json!(falls(&pushed)));
    numbers.insert("settles_sooner_with_viscosity".into(), json!(falls(&ends)));
    let curves = |of: fn(&Coin) -> &Vec<f64>| -> Vec<Curve> {
        let each = VISCOSITIES.iter().zip(&coins);
        each.map(|(nu, coin)| Curve::new(format!("ν = {nu} m/s"), &coin.time, of(coin)))
            .collect()
    };
    draw(
        how.picture,
        &[
            Panel::new("way of the coin, m", curves(|c| &c.pushed)),
            Panel::new("turn of the coin, degrees", curves(|c| &c.angle)),
        ],
    )?;
    Ok(numbers)
}
