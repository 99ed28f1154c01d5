//! Bodies of unlike sizes: what is little beside what a large one does may be much of what a small one does.
//!
//! A norm in units of the root of an energy counts the largest bodies alone: beside one of 1 m those of 3 mm move water of a ten-millionth of its mass. In a second norm all count as if
//! they moved as much water as the largest, so that it is one of speeds. A large body that small ones hardly move is seen by the first, small ones beside it by the second: what must be
//! little must be so in both. Of like bodies they are one.

use super::Scattering;
use crate::adjoint::lie::Vec6;
use crate::coupling::reduced::ReducedBody;
use crate::solver::dot;
use std::sync::Arc;

/// Root of the ratio of the masses of water moved up to which bodies are alike.
const ALIKE: f64 = 10.0;

/// A size in both norms.
pub(super) type Both = [f64; 2];

/// By how much each body counts more in the second norm than in the first; none where bodies are alike.
pub(super) fn weights(bodies: &[Arc<ReducedBody>]) -> Option<Vec<f64>> {
    let ahead = Vec6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let masses: Vec<f64> = bodies.iter().map(|b| b.displaced(&ahead)).collect();
    let most = masses.iter().copied().fold(0.0, f64::max);
    let weight = |mass: &f64| match (most / mass).sqrt() {
        weight if weight.is_finite() => weight,
        _ => 1.0,
    };
    let weights: Vec<f64> = masses.iter().map(weight).collect();
    weights.iter().any(|w| *w > ALIKE).then_some(weights)
}

impl Scattering {
    /// Norms of modes, or of modes and twists after them, in units of about the root of their energy.
    pub(super) fn both(&self, x: &[f64]) -> Both {
        match &self.unlike {
            None => [norm(x); 2],
            Some(weights) => [norm(x), norm(&self.counted(x, |b| weights[b]))],
        }
    }

    /// The same of twists alone.
    pub(super) fn both_of_twists(&self, x: &[f64]) -> Both {
        match &self.unlike {
            None => [norm(x); 2],
            Some(weights) => {
                let mut counted = x.to_vec();
                count_twists(&mut counted, |b| weights[b]);
                [norm(x), norm(&counted)]
            }
        }
    }

    /// Modes, or modes and twists after them, where every body's count so many times.
    pub(super) fn counted(&self, x: &[f64], weight: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut out = x.to_vec();
        let (modes, twists) = out.split_at_mut(self.mode_count());
        for (b, range) in self.modes.iter().enumerate() {
            let own = &mut modes[range.clone()];
            own.iter_mut().for_each(|x| *x *= weight(b));
        }
        count_twists(twists, weight);
        out
    }
}

/// Twists where every body's counts so many times.
pub(super) fn count_twists(twists: &mut [f64], weight: impl Fn(usize) -> f64) {
    for (b, twist) in twists.chunks_exact_mut(6).enumerate() {
        twist.iter_mut().for_each(|x| *x *= weight(b));
    }
}

/// The norm.
pub(super) fn norm(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}
