//! Drag quadratic in the velocity through the water: −½ ρ c Σ ΔA |w| w, summed over the body's surface.

use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Velocity, drag_part};
use crate::adjoint::drag::{Element, Part, quadratic_drag, quadratic_drag_jvp, quadratic_drag_vjp};
use crate::adjoint::lie::cross_force;
use crate::dynamics::parameters::{Declarations, Declared, Owner, Parameter, Range};

/// c, per area of the surface.
const COEFFICIENT: Declared = Declared::new("drag.quadratic", "1");
/// The same of a body whose surface isn't kept.
const NONE: Declared = COEFFICIENT.range(Range::Zero(
    "must be 0 for a body whose scene gives no drag; give it `drag` there, zero if need be",
));

struct QuadraticDrag(Vec<Dragged>);

struct Dragged {
    body: usize,
    coefficient: Parameter,
    /// In the body's frame.
    surface: Vec<Element>,
    part: Part,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let mut bodies = Vec::new();
    for (body, surface) in parts.surfaces.iter().enumerate() {
        let owner = Owner::Body(body);
        match parts.scene.bodies[body].drag {
            Some(given) if !surface.is_empty() => bodies.push(Dragged {
                body,
                coefficient: parameters.declare(owner, COEFFICIENT, given.quadratic),
                surface: surface.clone(),
                part: drag_part(given.quadratic_part),
            }),
            _ => {
                parameters.declare(owner, NONE, 0.0);
            }
        }
    }
    (!bodies.is_empty()).then(|| Box::new(QuadraticDrag(bodies)) as Box<dyn ForceModel>)
}

impl ForceModel for QuadraticDrag {
    fn name(&self) -> &'static str {
        "quadratic drag"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        let parameters = at.place.parameters;
        for d in &self.0 {
            let scale = parameters.density() * parameters[d.coefficient];
            if scale != 0.0 {
                let pose = &at.place.poses[d.body];
                let nu = pose.twist_to_body(&at.relative(d.body));
                let wrench = scale * quadratic_drag(&d.surface, d.part, &nu);
                out.wrenches[d.body] += pose.wrench_to_world(&wrench);
            }
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        let parameters = at.place.parameters;
        for d in &self.0 {
            let scale = parameters.density() * parameters[d.coefficient];
            if scale != 0.0 {
                let pose = &at.place.poses[d.body];
                let nu = pose.twist_to_body(&at.relative(d.body));
                let dnu = pose.twist_to_body(&change.twists[d.body]);
                let wrench = scale * quadratic_drag_jvp(&d.surface, d.part, &nu, &dnu);
                out.wrenches[d.body] += pose.wrench_to_world(&wrench);
            }
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        let (density, parameters) = (at.place.parameters.density(), at.place.parameters);
        for d in &self.0 {
            let b = d.body;
            let pose = &at.place.poses[b];
            let (relative, virt) = (at.relative(b), &z.twists[b]);
            let (nu, zeta) = (pose.twist_to_body(&relative), pose.twist_to_body(virt));
            let unit = quadratic_drag(&d.surface, d.part, &nu);
            let power = zeta.dot(&unit);
            bar.parameters[d.coefficient] += density * power;
            *bar.parameters.density_mut() += parameters[d.coefficient] * power;
            let scale = density * parameters[d.coefficient];
            if scale != 0.0 {
                let wrench = pose.wrench_to_world(&(scale * unit));
                let nu_bar = scale * quadratic_drag_vjp(&d.surface, d.part, &nu, &zeta);
                let nu_bar = pose.wrench_to_world(&nu_bar);
                bar.twist[b] += nu_bar;
                bar.pose[b] -= cross_force(&relative, &nu_bar) + cross_force(virt, &wrench);
            }
        }
    }
}
