//! Figure 9: the beating tail of a large fish makes the swimmer drift sideways. Beside it the same with the bodies uncoupled, and the swimmer alone.

use crate::swim::{draw_drifts, path, run, scene, smallest_gap, with_large_tail};
use crate::{How, Made, Numbers};
use hydrograd::Fidelity;
use serde_json::json;

pub fn make(how: &How) -> Made {
    let alone = scene()?;
    let beside = with_large_tail(alone.clone());
    let mut numbers = Numbers::new();
    let mut runs = Vec::new();
    for (name, scene, fidelity) in [
        ("coupled", &beside, Fidelity::Auto),
        ("uncoupled", &beside, Fidelity::Isolated),
        ("alone", &alone, Fidelity::Auto),
    ] {
        let rollout = run(scene, fidelity, how.quick)?;
        let (x, y) = path(&rollout, "head");
        let end = y.len() - 1;
        numbers.insert(
            name.into(),
            json!({
                "lateral_drift_m": y[end] - y[0],
                "way_m": x[end] - x[0],
                "turned_deg": rollout.samples()[end].q[2].to_degrees(),
                "smallest_gap_m": (name != "alone").then(|| smallest_gap(&rollout, "large tail")),
            }),
        );
        runs.push((name, rollout));
    }
    let runs: Vec<_> = runs.iter().map(|(name, run)| (*name, run)).collect();
    draw_drifts(how.picture, &runs)?;
    Ok(numbers)
}
