//! The pairs of surfaces that may come in contact.

use super::gaps::{against_wall, between};
use super::point::ContactPoint;
use super::shape::ContactShape;
use crate::Result;
use crate::adjoint::lie::Pose;
use crate::geometry::{HalfSpace, Other, Wall};

/// Two surfaces that may come in contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ContactPair {
    /// The body that normals point to.
    pub first: usize,
    /// What it may come in contact with.
    pub second: Other,
}

impl ContactPair {
    /// Number of the second body, unless it's a wall.
    pub fn second_body(&self) -> Option<usize> {
        match self.second {
            Other::Body(b) => Some(b),
            Other::Wall(_) => None,
        }
    }
}

/// Shapes of the bodies of a scene, its walls, and which of them may come in contact.
#[derive(Clone, Debug)]
pub struct Contacts {
    shapes: Vec<Option<ContactShape>>,
    walls: Vec<HalfSpace>,
    pairs: Vec<ContactPair>,
}

/// Points are kept up to this part of the smaller body's radius beyond the distance asked for: what may close in a step.
const AHEAD: f64 = 0.5;

impl Contacts {
    /// From the bodies' shapes (none for a body without surface) and the walls; pairs of which one has no surface are dropped.
    ///
    /// # Errors
    /// A wall without a normal.
    pub fn new(
        shapes: Vec<Option<ContactShape>>,
        walls: &[Wall],
        pairs: &[ContactPair],
    ) -> Result<Self> {
        let solid = |b: usize| shapes[b].is_some();
        let whole = |p: &ContactPair| solid(p.first) && p.second_body().is_none_or(solid);
        Ok(Self {
            pairs: pairs.iter().copied().filter(whole).collect(),
            walls: Wall::half_spaces(walls)?,
            shapes,
        })
    }

    /// The pairs that may come in contact.
    pub fn pairs(&self) -> &[ContactPair] {
        &self.pairs
    }

    /// Shape of body `b`, if it has one.
    pub fn shape(&self, b: usize) -> Option<&ContactShape> {
        self.shapes[b].as_ref()
    }

    /// Where the surfaces of pair `k` are near, the bodies being at `poses`; all places with a gap under `distance` (m) and some beyond,
    /// as far as bodies may come in a step.
    ///
    /// # Errors
    /// A signed distance that can't be found.
    pub fn points(&self, k: usize, poses: &[Pose], distance: f64) -> Result<Vec<ContactPoint>> {
        let pair = &self.pairs[k];
        let (a, first) = (pair.first, &self.shapes[pair.first]);
        let Some(first) = first else {
            return Ok(Vec::new());
        };
        match pair.second {
            Other::Wall(w) => {
                let reach = distance + AHEAD * first.radius();
                against_wall(first, &self.walls[w], &poses[a], reach)
            }
            Other::Body(b) => {
                let Some(second) = &self.shapes[b] else {
                    return Ok(Vec::new());
                };
                let reach = distance + AHEAD * first.radius().min(second.radius());
                between(first, second, &poses[a], &poses[b], reach)
            }
        }
    }
}
