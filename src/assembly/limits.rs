//! Limits of a scene's joints: how stiff their stops are.

use super::contact::STIFFNESS;
use crate::adjoint::contact::Law;
use crate::dynamics::{JointLimit, Parameters, System};
use crate::scene::Scene;
use crate::{Error, Result};
use nalgebra::DVector;

/// Half the width over which a stop's force sets in, of the range.
const WIDTH: f64 = 1e-3;

/// From the scene and its start at `q`.
pub(super) fn assemble(
    scene: &Scene,
    dt: f64,
    system: &System,
    parameters: &Parameters,
    q: &DVector<f64>,
) -> Result<Vec<JointLimit>> {
    let asked = |b: usize| scene.bodies[b].limit_stiffness;
    // The water's part of the inertia may take a solve.
    let inertia = match scene.limited().any(|(b, _)| asked(b).is_none()) {
        true => system
            .evaluate(parameters, q, 0.0)?
            .mass_matrix()
            .diagonal(),
        false => DVector::zeros(system.tree.velocities()),
    };
    let mut out = Vec::new();
    for (b, range) in scene.limited() {
        let link = &system.tree.links()[b];
        let stiffness = asked(b).unwrap_or(STIFFNESS * inertia[link.v.start] / (dt * dt));
        if !(stiffness > 0.0 && stiffness.is_finite()) {
            return Err(Error::input(
                format!("body {:?}: limit_stiffness", scene.bodies[b].name),
                stiffness,
                "nothing that the joint carries has inertia to take a default from: give a stiffness, N/m or N m/rad",
            ));
        }
        out.push(JointLimit {
            q: link.q.start,
            v: link.v.start,
            range,
            rigid: asked(b).is_none(),
            law: Law {
                stiffness,
                dissipation: 0.0,
                friction: 0.0,
                torsional_friction: 0.0,
                rolling_friction: 0.0,
                // Without friction any speed will do.
                stiction_speed: 1.0,
                stiction_spin: 1.0,
                gap: 0.0,
                width: WIDTH * (range[1] - range[0]),
                horizon: dt,
            },
        });
    }
    Ok(out)
}
