//! Cotangents that grow out of all proportion on their way back.
//!
//! A step that damps or pushes more than its integrator resolves multiplies cotangents by a large number each time, while the run itself, whose velocities may be
//! zero there, shows nothing. Cotangents of coordinates and of momenta have units of their own, and each kind is looked at by itself. What an objective adds at a state is
//! no growth: steps where it may be a part of what is there ([`SEEN`]) don't count.

use super::Simulator;
use crate::dynamics::StateBar;
use crate::error::readable;

/// Growth from which it is told: nothing that was known of the start to double precision is left of by then.
const LARGE: f64 = 1e12;

/// Part of the cotangents of coordinates, and of those of momenta, from which on what the objective adds there is seen: of momenta, whose units differ by those of
/// an inertia and a time, far less.
const SEEN: [f64; 2] = [1e-3, 1e-9];

/// The sizes of a state's cotangent, and what is largest in it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Size {
    /// Largest entries with respect to coordinates and to momenta.
    pub of: [f64; 2],
    /// Where the latter is.
    at: usize,
}

impl Size {
    pub fn new(bar: &StateBar) -> Self {
        let at = (0..bar.y.len()).max_by(|a, b| bar.y[*a].abs().total_cmp(&bar.y[*b].abs()));
        let largest = |x: &nalgebra::DVector<f64>| if x.is_empty() { 0.0 } else { x.amax() };
        Self {
            of: [largest(&bar.q), largest(&bar.y)],
            at: at.unwrap_or(0),
        }
    }
}

/// How the cotangents of a sweep have grown, state by state from the last to the first.
#[derive(Clone, Debug, Default)]
pub(super) struct Grown {
    /// The sizes at the state before.
    last: [f64; 2],
    /// Growth of each kind, and since which state.
    since: [(f64, usize); 2],
    /// The most that there was: the factor, since which state, the sizes, and the state.
    most: Option<(f64, usize, Size, usize)>,
}

impl Grown {
    /// Takes note of the cotangent of state `n`, to which the objective has added numbers of up to `seed`.
    pub fn add(&mut self, n: usize, size: Size, seed: f64) {
        let sizes = self.last.into_iter().zip(size.of).zip(SEEN);
        for (since, ((last, now), seen)) in self.since.iter_mut().zip(sizes) {
            let (factor, from) = *since;
            let grown = factor * now / last;
            let counts = last > 0.0 && seed <= seen * now && grown > 1.0;
            *since = if counts { (grown, from) } else { (1.0, n) };
            if counts && grown > self.most.map_or(LARGE, |(factor, ..)| factor) {
                self.most = Some((grown, from, size, n));
            }
        }
        self.last = size.of;
    }

    /// What the user should know of it, of a run whose first state is number `first`.
    pub fn warning(&self, simulator: &Simulator, first: usize) -> Option<String> {
        let (factor, from, size, n) = self.most?;
        let (from, n) = (first + from, first + n);
        let time = |n: usize| readable(n as f64 * simulator.time_step());
        let labels = simulator.scene.velocity_labels();
        let label = labels.get(size.at).map_or("", String::as_str);
        Some(format!(
            "the gradient grows by {factor:.1e} on its way back from step {} (t = {} s) to step {n} (t = {} s), where it is {:.1e} with respect to the momentum of {label}: \
             nothing of it can be trusted; where drag, damping or a stiff force causes it take a smaller time step or the integrator midpoint, where the motion is \
             chaotic a shorter horizon (`hydrograd gradcheck` tells the growth)",
            from,
            time(from),
            time(n),
            size.of[1],
        ))
    }
}
