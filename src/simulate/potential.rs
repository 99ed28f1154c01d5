//! The potential of the flow around the bodies.

use super::surface_flow::Asked;
use super::{Rollout, flow::few};
use crate::Result;
use crate::adjoint::lie::Vec3;

impl Rollout {
    /// The potential φ of the flow that the bodies make at points (m, world frame) at state `n`: m²/s, velocity −∇φ, zero far away. A current isn't in it: with one that is uniform, C, that of all the
    /// water is φ − C·x. By the layers on the surfaces of all bodies, whatever the fidelity, and continued up to smooth ones as [`Rollout::flow`] is. It takes solves of its own.
    ///
    /// # Errors
    /// As [`Rollout::flow`] of the points; gaps that films carry, and bodies without a surface or of more faces than panels are solved for, with every fidelity.
    pub fn potential(&self, n: usize, points: &[Vec3]) -> Result<Vec<f64>> {
        let sample = self.sample("potential", n)?;
        let what = "potential: points";
        few(what, points.len())?;
        if points.is_empty() {
            return Ok(Vec::new());
        }
        let simulator = self.simulator();
        let made = || {
            let flows = simulator.open_surface_flow(sample, None)?;
            let places = simulator.places(what, points, &sample.poses, &flows)?;
            let found = simulator.layered(&flows, &places.asked, Asked::Potential)?;
            let each = places.join(&flows, &found).into_iter();
            Ok(each.map(|water| water.potential).collect())
        };
        made().map_err(|e: crate::Error| e.at_time(sample.time))
    }
}
