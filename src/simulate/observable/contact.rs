//! Forces of contact.

use super::entry::{Observable, Reading, by_body};
use crate::Result;
use crate::adjoint::lie::Vec3;
use crate::dynamics::System;
use crate::scene::Scene;

/// Sums over each body's contact points; zero at the start, which no step led to.
pub(super) struct Forces;

impl Observable for Forces {
    fn name(&self) -> &'static str {
        "contact_forces"
    }

    fn unit(&self) -> &'static str {
        "N, on each body from bodies and walls that it touches, of the step that ended there, world axes"
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![system.len(), 3]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        let names = ["contact_force_x", "contact_force_y", "contact_force_z"];
        by_body(scene, &names)
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        let mut out = vec![0.0; 3 * at.system.len()];
        let mut add = |body: usize, force: Vec3| {
            for (out, x) in out[3 * body..][..3].iter_mut().zip(force.iter()) {
                *out += x;
            }
        };
        for c in (at.contacts)()? {
            let force = Vec3::from(c.force);
            add(c.first, force);
            if let Some(second) = c.second {
                add(second, -force);
            }
        }
        Ok(out)
    }
}
