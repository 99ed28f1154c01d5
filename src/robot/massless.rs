//! Bodies that move without mass, or without inertia about what their joints turn them about.

use super::bodies::Bodies;
use super::joints::Moves;
use super::report::Report;
use super::surface::Immersed;
use super::tree::{joint_place, link_place};
use crate::multibody::Joint;
use crate::{Error, Result};
use hydrograd_adjoint::lie::Vec3;

/// Sine of the angle under which two axes are one.
const ALIKE: f64 = 1e-3;

impl Bodies<'_> {
    /// Whether a joint moves it that it alone doesn't give any inertia to.
    fn is_massless(&self, g: usize) -> bool {
        self.joint(g).velocities() > 0 && self.inertials[g].is_none() && self.density(g).is_none()
    }

    /// Refuses what moves and has no inertia.
    pub fn check_massless(&self) -> Result<()> {
        let refused = |g: usize, what: String, remedy: &str| {
            let place = match self.groups[g].joint {
                Some(joint) => joint_place(self.file, joint),
                None => link_place(self.file, self.groups[g].top()),
            };
            Err(Error::input(place, what, remedy))
        };
        let usual = "give it a mass and an inertia (<inertial>, or `density` for the link), or make its joint fixed";
        let root = "give it a mass and an inertia (<inertial>, or `density` for the link), or fix the base to the world (`base = \"fixed\"`, --base fixed)";
        for g in 0..self.groups.len() {
            let remedy = if g == 0 { root } else { usual };
            if self.is_massless(g) {
                let what = format!("moves link {:?} without mass", self.name(g));
                let carried = |b: usize| {
                    let mut up = std::iter::successors(Some(b), |b| self.groups[*b].parent);
                    b != g && up.any(|b| b == g)
                };
                let mut above = (0..self.groups.len()).filter(|b| carried(*b));
                if !above.any(|b| !self.inertials[b].is_none() || self.density(b).is_some()) {
                    return refused(g, what, remedy);
                }
                if let Some(parent) = self.massless_alike(g) {
                    let remedy = if parent == 0 { root } else { remedy };
                    let parent = self.name(parent);
                    let chain = format!(
                        "{what}, as does the joint of link {parent:?} without mass along or about the same axis"
                    );
                    return refused(g, chain, remedy);
                }
                if let Some(joint) = self.moves_as_its_only_load(g) {
                    let chain = format!(
                        "{what}, and joint {joint:?}, which carries all that has mass on it, moves that the same way"
                    );
                    return refused(g, chain, remedy);
                }
            }
            if self.is_point(g) {
                let what = format!(
                    "turns link {:?}, whose inertia about it is zero",
                    self.name(g)
                );
                return refused(g, what, remedy);
            }
        }
        Ok(())
    }

    /// The joint of the one body with mass that all mass on a massless link is carried by, if that joint moves it the same way as the link's own does: nothing tells the two
    /// motions apart.
    fn moves_as_its_only_load(&self, g: usize) -> Option<&str> {
        let has_mass = |b: usize| !self.inertials[b].is_none() || self.density(b).is_some();
        let carried = (0..self.groups.len()).filter(|b| self.groups[*b].parent == Some(g));
        let heavy = carried.filter(|child| {
            let up = |b: &usize| self.groups[*b].parent;
            let mut all = *child..self.groups.len();
            all.any(|b| has_mass(b) && std::iter::successors(Some(b), up).any(|b| b == *child))
        });
        let heavy: Vec<usize> = heavy.collect();
        let [load] = heavy[..] else {
            return None;
        };
        let moves = self.moves[load].as_ref().filter(|_| has_mass(load))?;
        // A rotor, a leader and a motion of its own tell a joint apart.
        let apart = |m: &Moves| {
            let driven = self.options.driven.contains_key(&m.name);
            m.dynamics.armature > 0.0 || m.mimic.is_some() || driven
        };
        if apart(moves) || self.moves[g].as_ref().is_some_and(apart) {
            return None;
        }
        let placement = &self.groups[load].placement;
        let turned = |axis: [f64; 3]| placement.rotation * Vec3::from(axis);
        let along = |a: &Vec3, b: &Vec3| a.cross(b).norm() <= ALIKE * a.norm() * b.norm();
        let alike = match (self.joint(g), moves.joint) {
            (Joint::Free, joint) | (joint, Joint::Free) => joint.velocities() > 0,
            (Joint::Prismatic { axis }, Joint::Prismatic { axis: other }) => {
                along(&Vec3::from(axis), &turned(other))
            }
            // About one line: the first goes through the link's origin.
            (Joint::Revolute { axis }, Joint::Revolute { axis: other }) => {
                let axis = Vec3::from(axis);
                let shift = placement.translation.vector;
                along(&axis, &turned(other)) && along(&axis, &shift)
            }
            _ => false,
        };
        alike.then_some(&moves.name)
    }

    /// Of massless links in a row, of which it is one: another whose joint moves along or about the same axis, or any that has not one coordinate. What both carry
    /// doesn't tell their motions apart.
    fn massless_alike(&self, g: usize) -> Option<usize> {
        let axis = |joint: &Joint| match joint {
            Joint::Revolute { axis } => Some((true, Vec3::from(*axis))),
            Joint::Prismatic { axis } => Some((false, Vec3::from(*axis))),
            _ => None,
        };
        let own = axis(&self.joint(g));
        // From the frame of the link's joint to that of the one above.
        let mut turn = self.groups[g].placement.rotation;
        let mut at = self.groups[g].parent;
        while let Some(p) = at.filter(|p| self.is_massless(*p)) {
            let other = axis(&self.joint(p));
            let apart = match (own, other) {
                (Some((turns, a)), Some((others, b))) => {
                    let a = turn * a;
                    turns != others || a.cross(&b).norm() > ALIKE * a.norm() * b.norm()
                }
                _ => false,
            };
            if !apart {
                return Some(p);
            }
            turn = self.groups[p].placement.rotation * turn;
            at = self.groups[p].parent;
        }
        None
    }

    /// Whether it has mass, and no inertia about an axis that its joint turns it about, nor anything on it.
    fn is_point(&self, g: usize) -> bool {
        let own = &self.inertials[g];
        let chosen = self.density(g).is_some() || self.has_inertia_chosen(g);
        if own.mass == 0.0 || own.inertia.norm() > 0.0 || chosen {
            return false;
        }
        if self.groups.iter().any(|other| other.parent == Some(g)) {
            return false;
        }
        match self.joint(g) {
            Joint::Fixed | Joint::Prismatic { .. } => false,
            Joint::Revolute { axis } => {
                let axis = Vec3::from(axis);
                axis.cross(&own.center).norm() <= 1e-12 * axis.norm() * own.center.norm()
            }
            _ => true,
        }
    }

    /// The water sees no body that moves without mass.
    pub fn dry_if_massless(&self, g: usize, wet: Immersed, report: &mut Report) -> Immersed {
        if wet.surface.is_none() || !self.is_massless(g) {
            return wet;
        }
        report.warn(format!(
            "body {:?} is dry: it moves and has no mass; give it one to put it in the water",
            self.name(g)
        ));
        Immersed::dry("it has no mass")
    }
}
