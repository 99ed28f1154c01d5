//! The water's inertia along the found trajectory, beside that of coupled panels on the same faces.

use crate::task;
use hydrograd::simulate::Rollout;
use hydrograd::{Result, Scene, Simulator};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// One state.
#[derive(Clone, Debug, Serialize)]
pub struct Compared {
    /// s
    pub time: f64,
    /// Smallest gap, m.
    pub gap: f64,
    /// Diagonal of the fluid's mass matrix in generalised coordinates, and that by panels: kg, kg m².
    pub diagonal: [Vec<f64>; 2],
    /// max |ΔM_ij| / √(M_ii M_jj) over all velocities.
    pub error: f64,
    /// The same over those of the coin.
    pub coin: f64,
}

/// Compares `count` states, evenly spread over the rollout, the last one its end.
pub fn along(scene: &Scene, rollout: &Rollout, count: usize) -> Result<Vec<Compared>> {
    let panels = task::simulator(scene, task::FULL)?;
    let simulator = rollout.simulator();
    let tree = &simulator.system().tree;
    let coin = scene.body("coin").map_or(0, |b| b.0);
    let own = tree.links()[coin].v.clone();
    let steps = rollout.steps();
    let state = |k: usize| -> Result<Compared> {
        let n = steps * (k + 1) / count;
        let sample = &rollout.samples()[n];
        let found = added_mass(simulator, &sample.q)?;
        let right = added_mass(&panels, &sample.q)?;
        let worst = |of: std::ops::Range<usize>| {
            let off = |i: usize, j: usize| {
                (found[(i, j)] - right[(i, j)]).abs() / (right[(i, i)] * right[(j, j)]).sqrt()
            };
            let all = of.clone().flat_map(|i| of.clone().map(move |j| (i, j)));
            all.map(|(i, j)| off(i, j)).fold(0.0, f64::max)
        };
        let diagonal = |m: &DMatrix<f64>| m.diagonal().iter().copied().collect();
        Ok(Compared {
            time: sample.time,
            gap: rollout.gaps()[n]
                .as_ref()
                .map_or(f64::INFINITY, |g| g.distance),
            error: worst(0..found.nrows()),
            coin: worst(own.clone()),
            diagonal: [diagonal(&found), diagonal(&right)],
        })
    };
    (0..count).map(state).collect()
}

/// The water's part of the mass matrix, generalised coordinates.
fn added_mass(simulator: &Simulator, q: &DVector<f64>) -> Result<DMatrix<f64>> {
    let system = simulator.system();
    let mut dry = simulator.parameters().clone();
    *dry.density_mut() = 0.0;
    let submerged = system.evaluate(simulator.parameters(), q, 0.0)?;
    Ok(submerged.mass_matrix() - system.evaluate(&dry, q, 0.0)?.mass_matrix())
}
