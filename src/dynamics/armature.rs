//! Inertia that drives add to their joints: a diagonal part of M, by which a joint's momentum is more than its column of the bodies' momenta.

use super::{Declarations, Declared, Owner, Parameter, Parameters};
use crate::multibody::Tree;
use crate::scene::Scene;
use nalgebra::DVector;

const ARMATURE: Declared =
    Declared::new("joint.armature", "kg or kg m²").size(|value, typical| match value > 0.0 {
        true => value,
        false => 0.1 * typical.moment,
    });

/// The velocities that have it, each with its inertia.
#[derive(Clone, Debug, Default)]
pub struct Armature(Vec<(usize, Parameter)>);

impl Armature {
    /// Of the joints of a scene; declares its parameters.
    pub fn new(scene: &Scene, tree: &Tree, parameters: &mut Declarations) -> Self {
        let bodies = scene.bodies.iter().zip(tree.links()).enumerate();
        let of = |(b, (body, link)): (usize, (&crate::scene::Body, &crate::multibody::Link))| {
            let value = body.passive?.armature;
            let own = parameters.declare(Owner::Body(b), ARMATURE, value);
            Some((link.v.start, own))
        };
        Self(bodies.filter_map(of).collect())
    }

    /// Each velocity that has it, with the inertia.
    pub(super) fn entries<'a>(
        &'a self,
        parameters: &'a Parameters,
    ) -> impl Iterator<Item = (usize, f64)> + 'a {
        self.0.iter().map(|(i, own)| (*i, parameters[*own]))
    }

    /// Adds its momentum at the velocity `v`.
    pub(super) fn add(
        &self,
        parameters: &Parameters,
        v: &DVector<f64>,
        momentum: &mut DVector<f64>,
    ) {
        for (i, own) in self.entries(parameters) {
            momentum[i] += own * v[i];
        }
    }

    /// Adds the cotangents of v and of the parameters for the momentum's `w`.
    pub(super) fn add_vjp(
        &self,
        parameters: &Parameters,
        v: &DVector<f64>,
        w: &DVector<f64>,
        v_bar: &mut DVector<f64>,
        bar: &mut Parameters,
    ) {
        for (i, own) in &self.0 {
            v_bar[*i] += parameters[*own] * w[*i];
            bar[*own] += v[*i] * w[*i];
        }
    }
}
