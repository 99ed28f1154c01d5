//! Frames whose motion is observed.

use super::entry::by_body;
use crate::adjoint::lie::Pose;
use crate::dynamics::System;
use crate::scene::Scene;

/// Whose frames.
#[derive(Clone, Copy, Debug)]
pub(super) enum Of {
    /// The bodies'.
    Bodies,
    /// The sites'.
    Sites,
}

impl Of {
    /// Of two texts the one that is theirs.
    pub fn named(self, bodies: &'static str, sites: &'static str) -> &'static str {
        match self {
            Self::Bodies => bodies,
            Self::Sites => sites,
        }
    }

    /// How many there are.
    pub fn count(self, system: &System) -> usize {
        match self {
            Self::Bodies => system.len(),
            Self::Sites => system.sites.len(),
        }
    }

    /// Each with its body, in the world, from the bodies' poses.
    pub fn frames<'a>(
        self,
        system: &'a System,
        poses: &'a [Pose],
    ) -> impl Iterator<Item = (usize, Pose)> + 'a {
        (0..self.count(system)).map(move |k| match self {
            Self::Bodies => (k, poses[k]),
            Self::Sites => {
                let site = &system.sites[k];
                (site.body, poses[site.body].compose(&site.pose))
            }
        })
    }

    /// Labels of some entries of each.
    pub fn labels(self, scene: &Scene, entries: &[&str]) -> Vec<String> {
        match self {
            Self::Bodies => by_body(scene, entries),
            Self::Sites => (scene.sites.iter())
                .flat_map(|s| entries.iter().map(move |e| format!("{}.{e}", s.name)))
                .collect(),
        }
    }
}
