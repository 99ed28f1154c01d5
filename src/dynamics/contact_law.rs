//! The laws of contact of all pairs of surfaces, from what they depend on: a pair's own law is made when it is asked for.

use crate::adjoint::contact::Law;
use crate::contact::ContactPair;

/// The law of each pair; stiffness, dissipation and frictions are parameters and stand there.
#[derive(Clone, Debug)]
pub struct ContactLaws {
    /// What all have in common; its gap and its speed of spinning at which stiction ends are those of no pair.
    pub common: Law,
    /// The gap at which all touch, m, if it was given.
    pub gap: Option<f64>,
    /// Else the least at which any do, m.
    pub least: f64,
    /// And the least at which each body touches others, m; twice that at which it touches walls.
    pub each: Vec<f64>,
    /// Radius of each body, m; none without surface.
    pub radii: Vec<Option<f64>>,
}

impl ContactLaws {
    /// That of a pair.
    pub fn of(&self, pair: &ContactPair) -> Law {
        Law {
            gap: self.gap.unwrap_or_else(|| self.own_gap(pair)),
            stiction_spin: self.common.stiction_speed / self.smaller(pair),
            ..self.common
        }
    }

    /// Radius of the smaller body of a pair, m.
    pub fn smaller(&self, pair: &ContactPair) -> f64 {
        let both = [Some(pair.first), pair.second_body()];
        let radii = both.into_iter().flatten().filter_map(|b| self.radii[b]);
        radii.fold(f64::INFINITY, f64::min)
    }

    /// The gap at which body `b` touches anything is no more than this, m.
    pub fn widest(&self, b: usize) -> f64 {
        self.gap.unwrap_or_else(|| self.each[b].max(self.least))
    }

    fn own_gap(&self, pair: &ContactPair) -> f64 {
        let each = match pair.second_body() {
            Some(b) => self.each[pair.first].max(self.each[b]),
            // The image is twice as far away.
            None => 0.5 * self.each[pair.first],
        };
        each.max(self.least)
    }
}
