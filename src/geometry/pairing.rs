//! Which bodies are looked at together.

use std::collections::BTreeSet;

/// Bodies in groups, of which those of one group are looked at together, or those of different ones: but for a few pairs. It takes as much room as there are bodies.
#[derive(Clone, Debug)]
pub struct Pairing {
    /// The group of each body.
    groups: Vec<usize>,
    /// Whether it is those of one group that are looked at.
    within: bool,
    /// Pairs that aren't, the lower number first.
    but: BTreeSet<(usize, usize)>,
    /// Of each body whether it is looked at together with walls; all are where nothing is said.
    at_walls: Vec<bool>,
}

impl Pairing {
    /// All pairs of so many bodies.
    pub fn all(bodies: usize) -> Self {
        Self::between((0..bodies).collect())
    }

    /// Bodies of different groups, from the group of each.
    pub fn between(groups: Vec<usize>) -> Self {
        Self {
            groups,
            within: false,
            but: BTreeSet::new(),
            at_walls: Vec::new(),
        }
    }

    /// Bodies of the same group, from the group of each.
    pub fn within(groups: Vec<usize>) -> Self {
        Self {
            within: true,
            ..Self::between(groups)
        }
    }

    /// Without these pairs, in either order.
    #[must_use]
    pub fn but(mut self, pairs: impl IntoIterator<Item = (usize, usize)>) -> Self {
        let sorted = pairs.into_iter().map(|(a, b)| (a.min(b), a.max(b)));
        self.but.extend(sorted);
        self
    }

    /// With walls for some bodies alone.
    #[must_use]
    pub fn at_walls(mut self, bodies: Vec<bool>) -> Self {
        self.at_walls = bodies;
        self
    }

    /// Whether a body is looked at together with walls.
    pub fn has_walls(&self, body: usize) -> bool {
        self.at_walls.get(body).copied().unwrap_or(true)
    }

    /// Whether bodies `a` and `b` are looked at together; no body is with itself, or with one that isn't there.
    pub fn has(&self, a: usize, b: usize) -> bool {
        let (Some(one), Some(other)) = (self.groups.get(a), self.groups.get(b)) else {
            return false;
        };
        a != b && (one == other) == self.within && !self.but.contains(&(a.min(b), a.max(b)))
    }
}
