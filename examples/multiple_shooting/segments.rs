//! Segments of a long way, and the augmented Lagrangian that pulls them together.

use super::{
    FORCES, GROWTH, SPANS, State, UNITS, WEIGHT, effort, end, forces_bar, from_end, miss, rollout,
};
use hydrograd::Simulator;
use nalgebra::DVector;
use rayon::prelude::*;

/// Segments with simulators of their own: they run at the same time.
pub struct Segments {
    parts: Vec<Simulator>,
    first: State,
    target: [f64; 2],
    /// Multipliers of the defects in their units, and their common weight.
    multipliers: Vec<State>,
    weight: f64,
}

/// What came of one segment.
struct Part {
    cost: f64,
    defect: State,
    /// Cotangents of its forces, its start, and the next one's start, in their units.
    forces: Vec<f64>,
    start: State,
    next: State,
}

impl Segments {
    /// One segment per span, each with a simulator.
    pub fn new(simulator: &Simulator, target: [f64; 2]) -> hydrograd::Result<Self> {
        let parts = (0..SPANS).map(|_| super::simulator());
        let (q, v) = simulator.start();
        Ok(Self {
            parts: parts.collect::<hydrograd::Result<_>>()?,
            target,
            first: [q[0], q[1], v[0], v[1]],
            multipliers: vec![[0.0; 4]; SPANS - 1],
            weight: WEIGHT,
        })
    }

    pub fn len(&self) -> usize {
        self.multipliers.len() + 1
    }

    /// Start of segment k among the unknowns: forces, then the starts of all but the first segment.
    fn start(&self, x: &[f64], k: usize) -> State {
        let Some(k) = k.checked_sub(1) else {
            return self.first;
        };
        std::array::from_fn(|i| UNITS[i] * x[FORCES + 4 * k + i])
    }

    fn part(&self, x: &[f64], k: usize, simulator: &mut Simulator) -> hydrograd::Result<Part> {
        let from = self.start(x, k);
        simulator.set_start(
            DVector::from_vec(vec![from[0], from[1], 0.0]),
            DVector::from_vec(vec![from[2], from[3], 0.0]),
        )?;
        let forces = FORCES / self.len();
        let rollout = rollout(simulator, &x[forces * k..forces * (k + 1)])?;
        let end = end(&rollout);
        let (mut cost, mut end_bar) = (0.0, [0.0; 4]);
        let (mut defect, mut next) = ([0.0; 4], [0.0; 4]);
        if k + 1 == self.len() {
            (cost, end_bar) = miss(end, self.target);
        } else {
            let wanted = self.start(x, k + 1);
            for i in 0..4 {
                defect[i] = (end[i] - wanted[i]) / UNITS[i];
                let pull = self.multipliers[k][i] + self.weight * defect[i];
                cost += (self.multipliers[k][i] + 0.5 * self.weight * defect[i]) * defect[i];
                end_bar[i] = pull / UNITS[i];
                next[i] = -pull;
            }
        }
        let gradient = from_end(&rollout, end_bar)?;
        let initial = &gradient.initial;
        let start = [initial.q[0], initial.q[1], initial.v[0], initial.v[1]];
        Ok(Part {
            cost,
            defect,
            forces: forces_bar(&gradient),
            start: std::array::from_fn(|i| UNITS[i] * start[i]),
            next,
        })
    }

    fn run(&mut self, x: &[f64]) -> hydrograd::Result<Vec<Part>> {
        let mut parts = std::mem::take(&mut self.parts);
        let each = parts.par_iter_mut().enumerate();
        let out = each.map(|(k, s)| self.part(x, k, s)).collect();
        self.parts = parts;
        out
    }

    /// Augmented Lagrangian and gradient.
    pub fn evaluate(&mut self, x: &[f64]) -> hydrograd::Result<(f64, Vec<f64>)> {
        let (mut cost, mut gradient) = effort(&x[..FORCES]);
        gradient.resize(x.len(), 0.0);
        let mut add = |at: usize, more: &[f64]| {
            for (g, m) in gradient[at..].iter_mut().zip(more) {
                *g += m;
            }
        };
        for (k, part) in self.run(x)?.into_iter().enumerate() {
            cost += part.cost;
            add(k * part.forces.len(), &part.forces);
            if k > 0 {
                add(FORCES + 4 * (k - 1), &part.start);
            }
            if k + 1 < self.len() {
                add(FORCES + 4 * k, &part.next);
            }
        }
        Ok((cost, gradient))
    }

    /// Multipliers take over what the weight pulls; the largest defect, in its unit.
    pub fn update(&mut self, x: &[f64]) -> hydrograd::Result<f64> {
        let mut largest = 0.0_f64;
        for (multiplier, part) in self.run(x)?.iter().enumerate().take(self.len() - 1) {
            for i in 0..4 {
                self.multipliers[multiplier][i] += self.weight * part.defect[i];
                largest = largest.max(part.defect[i].abs());
            }
        }
        self.weight *= GROWTH;
        Ok(largest)
    }

    /// Every second start goes: segments twice as long.
    pub fn join(&mut self, x: &[f64]) -> Vec<f64> {
        let mut kept = x[..FORCES].to_vec();
        let starts = x[FORCES..].chunks_exact(4);
        kept.extend(starts.skip(1).step_by(2).flatten());
        let multipliers = self.multipliers.iter().skip(1).step_by(2);
        self.multipliers = multipliers.copied().collect();
        self.parts.truncate(self.len());
        kept
    }
}
