//! Drag linear in the velocity through the water (Eq. 22): −c R ν in the body's frame, summed over its surface.

use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Velocity, drag_part};
use crate::adjoint::drag;
use crate::adjoint::lie::{Mat6, cross_force};
use crate::dynamics::parameters::{Declarations, Declared, Owner, Parameter};

/// Of νρ of Eq. 22; at zero a change is measured by the water's momentum through a thousandth of the surface.
const COEFFICIENT: Declared = Declared::new("drag.linear", "kg/(m² s)")
    .size(|value, typical| value.max(1e-3 * typical.density * typical.speed));

struct LinearDrag(Vec<Dragged>);

struct Dragged {
    body: usize,
    coefficient: Parameter,
    /// At unit coefficient, body frame.
    resistance: Mat6,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let mut bodies = Vec::new();
    for (body, surface) in parts.surfaces.iter().enumerate() {
        let given = parts.scene.bodies[body].drag.unwrap_or_default();
        let value = if surface.is_empty() {
            0.0
        } else {
            given.linear
        };
        let coefficient = parameters.declare(Owner::Body(body), COEFFICIENT, value);
        // Also at zero coefficient: the derivative with respect to it isn't zero.
        if !surface.is_empty() {
            bodies.push(Dragged {
                body,
                coefficient,
                resistance: drag::resistance(surface, drag_part(given.part)),
            });
        }
    }
    (!bodies.is_empty()).then(|| Box::new(LinearDrag(bodies)) as Box<dyn ForceModel>)
}

impl ForceModel for LinearDrag {
    fn name(&self) -> &'static str {
        "linear drag"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        for d in &self.0 {
            let scale = at.place.parameters[d.coefficient];
            if scale != 0.0 {
                let pose = &at.place.poses[d.body];
                let nu = pose.twist_to_body(&at.relative(d.body));
                out.wrenches[d.body] += pose.wrench_to_world(&(-scale * (d.resistance * nu)));
            }
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        for d in &self.0 {
            let scale = at.place.parameters[d.coefficient];
            if scale != 0.0 {
                let pose = &at.place.poses[d.body];
                let dnu = pose.twist_to_body(&change.twists[d.body]);
                out.wrenches[d.body] += pose.wrench_to_world(&(-scale * (d.resistance * dnu)));
            }
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        for d in &self.0 {
            let b = d.body;
            let pose = &at.place.poses[b];
            let scale = at.place.parameters[d.coefficient];
            let (relative, virt) = (at.relative(b), &z.twists[b]);
            let (nu, zeta) = (pose.twist_to_body(&relative), pose.twist_to_body(virt));
            let resisted = d.resistance * nu;
            bar.parameters[d.coefficient] -= zeta.dot(&resisted);
            if scale != 0.0 {
                // −c ζᵀ R ν; the rotation of the frame acts on both twists.
                let wrench = pose.wrench_to_world(&(-scale * resisted));
                let nu_bar = pose.wrench_to_world(&(-scale * (d.resistance * zeta)));
                bar.twist[b] += nu_bar;
                bar.pose[b] -= cross_force(&relative, &nu_bar) + cross_force(virt, &wrench);
            }
        }
    }
}
