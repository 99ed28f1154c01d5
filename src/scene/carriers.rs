//! Which body carries which, by number: what the names of parents come to, looked up once for all bodies.

use super::Scene;
use std::collections::HashMap;

/// The bodies that carry others. The tree must have been checked.
pub(crate) struct Carriers<'s> {
    scene: &'s Scene,
    parents: Vec<Option<usize>>,
}

impl Scene {
    /// Who carries whom.
    pub(crate) fn carriers(&self) -> Carriers<'_> {
        let each = self.bodies.iter().enumerate();
        let numbers: HashMap<&str, usize> = each.map(|(b, body)| (body.name.as_str(), b)).collect();
        let parent = |name: &String| numbers.get(name.as_str()).copied();
        let parents = self.bodies.iter();
        let parents = parents.map(|body| body.parent.as_ref().and_then(parent));
        Carriers {
            scene: self,
            parents: parents.collect(),
        }
    }
}

impl Carriers<'_> {
    /// The body that carries body `b`; none of one that hangs on the world.
    pub fn parent(&self, b: usize) -> Option<usize> {
        self.parents[b]
    }

    /// Whether body `b` can't move at all: fixed or locked joints all the way to the world.
    pub fn is_static(&self, b: usize) -> bool {
        std::iter::successors(Some(b), |b| self.parents[*b]).all(|b| {
            let body = &self.scene.bodies[b];
            body.joint.velocities() == 0 || body.locked
        })
    }

    /// A body that moves against one that moves itself.
    pub fn articulated(&self) -> Option<usize> {
        let moves = |b: &usize| {
            let body = &self.scene.bodies[*b];
            body.joint.velocities() > 0 && !body.locked
        };
        let carrying = |b: usize| std::iter::successors(self.parents[b], |b| self.parents[*b]);
        (0..self.parents.len()).find(|b| moves(b) && carrying(*b).any(|b| moves(&b)))
    }

    /// The nearest body with a shape among those that carry body `b`: what `overlaps_parent` speaks of.
    pub fn submerged_parent(&self, b: usize) -> Option<usize> {
        let mut carrying = std::iter::successors(self.parents[b], |b| self.parents[*b]);
        carrying.find(|b| self.scene.bodies[*b].shape.is_some())
    }

    /// Whether one of two bodies is the other's submerged parent.
    pub fn are_neighbours(&self, a: usize, b: usize) -> bool {
        self.submerged_parent(a) == Some(b) || self.submerged_parent(b) == Some(a)
    }

    /// Pairs of bodies declared to overlap, the carrying one first.
    pub fn overlapping(&self) -> Vec<(usize, usize)> {
        let bodies = &self.scene.bodies;
        let declared = (0..bodies.len()).filter(|&b| bodies[b].overlaps_parent);
        declared
            .filter_map(|b| Some((self.submerged_parent(b)?, b)))
            .collect()
    }
}
