//! What a step solved with its velocities, as it acted on the bodies.

use super::{StepRecord, Stepper};
use crate::Result;
use crate::adjoint::lie::{Vec3, Vec6, point_wrench, six};
use crate::dynamics::ContactForce;
use crate::dynamics::contact_force::contact_forces;
use crate::dynamics::force::Loads;
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
        for (state, v, stages) in record.parts() {
            let e = stepper.evaluate(&state.q, stepper.time(&state))?;
            let path = stepper.split_of_step(&state, &record.input).complete(v);
            let near = stepper.near(&e, &path, &record.plan)?;
            let near = near.as_ref().unwrap_or(&e);
            let acting = stages.contact_velocities().map_or(v, |v| &v.after);
            let twists = system.tree.twists(&e.kinematics, acting);
            for force in contact_forces(&near.contact_points, &twists, 0.0) {
                add(&force, share, &mut out.contact);
            }
            if self.integrator.solves_contact() {
                for limit in &near.limits {
                    let pushed = limit.forces(state.q[limit.q], acting[limit.v]);
                    out.stops[limit.v] += share * (pushed[0] + pushed[1]);
                }
            }
            let at = e.moving(&twists, acting, &record.input.control);
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
fn add(contact: &ContactForce, share: f64, wrenches: &mut [Vec6]) {
    let torque = six(&Vec3::zeros(), &Vec3::from(contact.torque));
    let wrench = share * (point_wrench(&contact.position.into(), &contact.force.into()) + torque);
    wrenches[contact.first] += wrench;
    if let Some(b) = contact.second {
        wrenches[b] -= wrench;
    }
}
