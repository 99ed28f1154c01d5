//! What a step solved with its velocities, as it acted on the bodies.

use super::{StepRecord, Stepper};
use crate::Result;
use crate::adjoint::lie::{Vec3, Vec6, point_wrench, six};
use crate::dynamics::ContactForce;
use crate::dynamics::force::{Loads, Place};
use nalgebra::DVector;

/// What a step solved with its velocities; in a step of several pieces their mean.
pub struct Solved {
    /// Of dampers too stiff to act at any other velocity: wrenches on the bodies by name.
    pub dampers: Vec<(&'static str, Vec<Vec6>)>,
    /// Of contact: wrenches on the bodies.
    pub contact: Vec<Vec6>,
    /// Of the stops of joints: generalised forces.
    pub stops: DVector<f64>,
}

impl Stepper<'_> {
    /// What contact, stops and stiff dampers did during a step.
    ///
    /// # Errors
    /// A signed distance that can't be found.
    pub fn solved(&self, record: &StepRecord) -> Result<Solved> {
        let (system, stepper) = (self.system, self.of_pieces(record));
        let (n, nv) = (system.len(), system.tree.velocities());
        let share = 1.0 / record.pieces() as f64;
        let mut out = Solved {
            dampers: (system.dampers())
                .map(|force| (force.name(), vec![Vec6::zeros(); n]))
                .collect(),
            contact: vec![Vec6::zeros(); n],
            stops: DVector::zeros(nv),
        };
        for contact in self.contact_forces(record, 0.0)? {
            add(&contact, &mut out.contact);
        }
        for (state, v, _, stages) in record.parts() {
            let acting = stages.contact_velocities().map_or(v, |v| v.acting());
            if self.integrator.solves_contact() {
                for (k, limit) in system.limits.iter().enumerate() {
                    let limit = limit.sharpened(record.plan.of_limit(k));
                    let pushed = limit.forces(state.q[limit.q], acting[limit.v]);
                    out.stops[limit.v] += share * (pushed[0] + pushed[1]);
                }
            }
            let kinematics = system.tree.kinematics(&state.q);
            let place = Place {
                poses: &kinematics.poses,
                q: &state.q,
                time: stepper.time(&state),
                parameters: self.parameters,
            };
            let twists = system.tree.twists(&kinematics, acting);
            let at = system.moving(place, &twists, acting, &record.input.control);
            for (force, (_, sum)) in system.dampers().zip(&mut out.dampers) {
                let mut loads = Loads::zeros(n, nv);
                force.add(&at, &mut loads);
                for (sum, wrench) in sum.iter_mut().zip(&loads.wrenches) {
                    *sum += share * wrench;
                }
            }
        }
        Ok(out)
    }
}

/// Adds a contact's wrench to that on its bodies.
fn add(contact: &ContactForce, wrenches: &mut [Vec6]) {
    let torque = six(&Vec3::zeros(), &Vec3::from(contact.torque));
    let wrench = point_wrench(&contact.position.into(), &contact.force.into()) + torque;
    wrenches[contact.first] += wrench;
    if let Some(b) = contact.second {
        wrenches[b] -= wrench;
    }
}
