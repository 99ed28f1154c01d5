//! A system: the tree, its bodies' constants, and the coupling through the water.

use super::force::{ForceModel, Moving, Place, Streams};
use super::{
    Armature, BodyData, ContactModel, Drift, JointLimit, Motions, Parameters, Shapes, SiteData,
};
use crate::adjoint::lie::{Vec3, Vec6};
use crate::coupling::Coupling;
use crate::multibody::Tree;
use crate::scene::Motion;
use nalgebra::DVector;
use std::sync::Arc;

/// What moves a joint.
#[derive(Clone, Debug, PartialEq)]
pub enum Drive {
    /// Forces.
    Free,
    /// Nothing: it stays where it is.
    Locked,
    /// A given motion, one per coordinate.
    Motion(Vec<Motion>),
}

/// A mechanical system in water. Clones share the coupling.
#[derive(Clone)]
pub struct System {
    /// Joints and bodies.
    pub tree: Tree,
    /// Constants of the bodies, in the tree's order.
    pub bodies: Vec<BodyData>,
    /// Named frames on bodies.
    pub sites: Vec<SiteData>,
    /// What moves each joint.
    pub drives: Vec<Drive>,
    /// What drives add to the inertia of their joints.
    pub armature: Armature,
    /// Forces that don't come from the water's kinetic energy; clones share them.
    pub forces: Arc<[Box<dyn ForceModel>]>,
    /// Uniform steady current, m/s.
    pub current: Vec3,
    /// Currents by depth and time; clones share them.
    pub streams: Arc<Streams>,
    /// What the uniform one may carry along.
    pub drift: Drift,
    /// Number of controls.
    pub controls: usize,
    /// The coupling; its bodies are those with `submerged` set, in order.
    pub coupling: Arc<dyn Coupling>,
    /// Shapes that are parameters.
    pub shapes: Shapes,
    /// Contact; none where bodies pass through each other.
    pub contact: Option<ContactModel>,
    /// Limits of joints.
    pub limits: Vec<JointLimit>,
    /// How far toward the end of a step velocities are at which stiff forces of joints are taken, from 0 (its mean) to 1, by integrators with a middle; empty where there are none.
    pub late: DVector<f64>,
    /// Frame velocities of rigid motions of all bodies, or of all that feel one another through the water, that no joint and no wall of the water stands
    /// against. The momentum along each is theirs to keep.
    pub symmetric: Motions,
}

impl System {
    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.bodies.len()
    }

    /// Whether there is no body.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// The bodies in the water, each with its number among those that the coupling knows.
    pub fn submerged(&self) -> impl Iterator<Item = (usize, usize)> {
        let each = self.bodies.iter().enumerate();
        each.filter_map(|(b, body)| Some((b, body.submerged?)))
    }

    /// Forces that act in the course of a step.
    pub(super) fn smooth_forces(&self) -> impl Iterator<Item = &dyn ForceModel> {
        let all = self.forces.iter().map(AsRef::as_ref);
        all.filter(|f: &&dyn ForceModel| !f.solved_with_contact())
    }

    /// Those that are solved with contact.
    pub(super) fn dampers(&self) -> impl Iterator<Item = &dyn ForceModel> {
        let all = self.forces.iter().map(AsRef::as_ref);
        all.filter(|f: &&dyn ForceModel| f.solved_with_contact())
    }

    /// Bodies and joints as forces see them: spatial `twists`, velocity and controls at a place.
    pub fn moving<'m>(
        &'m self,
        place: Place<'m>,
        twists: &'m [Vec6],
        v: &'m DVector<f64>,
        control: &'m DVector<f64>,
    ) -> Moving<'m> {
        Moving {
            place,
            twists,
            v,
            current: &self.current,
            streams: &self.streams,
            control,
        }
    }

    /// Velocity of the undisturbed water at the point `x` of the world at the time `t` (s): m/s.
    pub fn water_velocity(&self, x: &Vec3, t: f64, parameters: &Parameters) -> Vec3 {
        self.current + self.streams.at(x, t, parameters).velocity
    }

    /// Whether the water moves past bodies at rest.
    pub fn has_current(&self) -> bool {
        self.current != Vec3::zeros()
    }
}
