//! What acts on every body by itself, before it is projected on the joints: spatial wrenches, moments about the world's origin.

use super::force::{ForceModel, Loads};
use super::{ForceCotangents, Linearisation};
use crate::Result;
use crate::adjoint::lie::{Vec6, cross_force};
use crate::multibody::{Cotangents, Virtual};
use nalgebra::DVector;

impl Linearisation<'_> {
    /// What the inertia of the water does to each body at the velocity `v` and the acceleration `acceleration`; weights, buoyancy and drag aren't part of it.
    ///
    /// # Errors
    /// A solve of the coupling that misses its tolerance.
    pub fn water_wrenches(
        &self,
        v: &DVector<f64>,
        acceleration: &DVector<f64>,
    ) -> Result<Vec<Vec6>> {
        let tree = &self.system.tree;
        // The power of the water's forces is linear in the virtual twists: their cotangents are the wrenches, whatever they are.
        let none = DVector::zeros(v.len());
        let fields = tree.fields(&self.kinematics, &self.q, v, Virtual::User(&none));
        let mut bar = Cotangents::zeros(self.system.len());
        let mut unused = ForceCotangents::zeros(self);
        self.fluid_inertial_vjp(v, &none, &fields, &mut bar, &mut unused)?;
        let rho = self.parameters.density();
        let gained = self.fluid_momenta(&self.virtual_direction(acceleration));
        let each = bar.virtual_twist.into_iter().zip(gained);
        Ok(each.map(|(at_rest, h)| at_rest - rho * h).collect())
    }

    /// The rate of each body's own momentum there.
    pub fn rigid_rates(&self, v: &DVector<f64>, acceleration: &DVector<f64>) -> Vec<Vec6> {
        let tree = &self.system.tree;
        let none = DVector::zeros(v.len());
        let fields = tree.fields(&self.kinematics, &self.q, v, Virtual::User(&none));
        let gained = tree.twists(&self.kinematics, acceleration);
        let each = fields.twist.iter().zip(&fields.bias).zip(gained);
        each.enumerate()
            .map(|(b, ((twist, bias), gained))| {
                cross_force(twist, &self.rigid_momentum(b, twist))
                    + self.rigid_momentum(b, &(gained + bias))
            })
            .collect()
    }

    /// What each force does that acts in the course of a step, by its name.
    pub fn force_wrenches(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
    ) -> Vec<(&'static str, Vec<Vec6>)> {
        let twists = self.system.tree.twists(&self.kinematics, v);
        let at = self.moving(&twists, v, control);
        let of = |force: &dyn ForceModel| {
            let mut out = Loads::zeros(twists.len(), v.len());
            force.add(&at, &mut out);
            (force.name(), out.wrenches)
        };
        self.system.smooth_forces().map(of).collect()
    }
}
