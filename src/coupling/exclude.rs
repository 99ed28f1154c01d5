//! Pairs of bodies between which the water isn't modelled: links of a mechanism that touch or
//! overlap at their joint.
//!
//! Neither body of an excluded pair meets the other's flow; both meet that of all other bodies, and
//! what walls and other bodies throw back of it: with G the matrix that takes the strengths of all
//! sources (images included) to what the bodies see of each other, G_ab = G_ba = 0 without the images,
//! and all else stays. So M_f stays symmetric, the block of a and b alone is zero, and the rule is
//! the same whether a wall is a plane or a large body.

use crate::{Error, Result};
use std::collections::BTreeSet;

/// A symmetric set of pairs of bodies in the water, by their numbers in the coupling.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exclusions {
    /// The smaller number first.
    pairs: BTreeSet<(usize, usize)>,
}

impl Exclusions {
    /// No pair: all bodies feel each other.
    pub fn none() -> Self {
        Self::default()
    }

    /// These pairs, each in either order.
    pub fn new(pairs: impl IntoIterator<Item = (usize, usize)>) -> Self {
        let ordered = pairs.into_iter().map(|(a, b)| (a.min(b), a.max(b)));
        Self {
            pairs: ordered.collect(),
        }
    }

    /// Whether these two, in either order, don't feel each other.
    pub fn contains(&self, a: usize, b: usize) -> bool {
        self.pairs.contains(&(a.min(b), a.max(b)))
    }

    /// The pairs, the smaller number first, in ascending order.
    pub fn iter(&self) -> impl Iterator<Item = (usize, usize)> {
        self.pairs.iter().copied()
    }

    /// Refuses pairs that can't be among so many bodies.
    ///
    /// # Errors
    /// [`Error::Input`] if a pair names a body that doesn't exist, or one body twice.
    pub fn check(&self, bodies: usize) -> Result<()> {
        match self.iter().find(|(a, b)| a == b || *b >= bodies) {
            None => Ok(()),
            Some(pair) => Err(Error::input(
                "coupling: excluded pair",
                format!("{pair:?}"),
                format!("must be two different bodies, counted from 0, of {bodies}"),
            )),
        }
    }
}
