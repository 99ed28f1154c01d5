//! The water's velocity around the bodies.

use super::{Rollout, Sample, Simulator};
use crate::adjoint::lie::{Pose, Vec3, Vec6};
use crate::geometry::{Distance, Other};
use crate::{Error, Result};

/// Distance from a surface, in edges of its mesh, from which on the flow is shown. Sources lie within the bodies, one under each
/// vertex; nearer than this the flow between the places that were fitted isn't what it should be.
pub const FLOW_EDGES: f64 = 0.5;

impl Simulator {
    fn flow(&self, sample: &Sample, points: &[Vec3]) -> Result<Vec<Vec3>> {
        let (q, v) = (&sample.q, &sample.v);
        let (system, parameters) = (self.system(), self.parameters());
        let kinematics = system.tree.kinematics(q);
        for (i, point) in points.iter().enumerate() {
            if let Some(bad) = point.iter().find(|x| !x.is_finite()) {
                return Err(Error::input(
                    format!("flow: points[{i}]"),
                    bad,
                    "must be finite",
                ));
            }
            if let Some(obstacle) = self.obstacle(point, &kinematics.poses) {
                return Err(self.too_near(i, point, &obstacle));
            }
        }
        let twists = system.tree.twists(&kinematics, v);
        let at = system.moving(sample.place(parameters), &twists, v, &sample.control);
        let through: Vec<Vec6> = (0..twists.len()).map(|b| at.relative(b)).collect();
        let through = system.submerged_twists(&kinematics, &through);
        let poses: Vec<Pose> = (system.submerged().map(|(b, _)| kinematics.poses[b])).collect();
        let made = match system.coupling.velocity(&poses, &through, points)? {
            Some(own) => own,
            None => self.layered_flow(sample, points)?,
        };
        let each = made.into_iter().zip(points);
        Ok(each
            .map(|(u, x)| u + system.water_velocity(x, sample.time, parameters))
            .collect())
    }

    /// What is too near to a point.
    fn obstacle(&self, point: &Vec3, poses: &[Pose]) -> Option<Distance> {
        let mut distances = self.gaps().distances(point, poses);
        distances.find(|d| d.distance < FLOW_EDGES * d.edge)
    }

    fn too_near(&self, number: usize, point: &Vec3, obstacle: &Distance) -> Error {
        let (what, remedy) = match obstacle.from {
            Other::Body(b) => (
                format!("body {:?}", self.system().bodies[b].name),
                "it lies within the body or too near to its surface for the mesh: leave it out, or use more faces",
            ),
            Other::Wall(w) => (format!("wall {w}"), "it lies behind the wall: leave it out"),
        };
        Error::Unresolved {
            place: format!("flow: points[{number}] at {:?} m: {what}", point.as_slice()),
            quantity: "distance in m".into(),
            value: obstacle.distance,
            limit: FLOW_EDGES * obstacle.edge,
            remedy: remedy.into(),
        }
    }
}

impl Rollout {
    /// The water's velocity at points (m, world frame) at state `n`: m/s, world axes, currents included (those by depth and time as each body feels them alone). It takes a solve. It is
    /// there to be looked at: nothing of a step depends on it, and it has no transpose.
    ///
    /// # Errors
    /// A state that there isn't; points that aren't finite, within a body, behind a wall, or nearer to a surface than
    /// [`FLOW_EDGES`] of its edges; bodies without a surface, and whatever the coupling reports.
    pub fn flow(&self, n: usize, points: &[Vec3]) -> Result<Vec<Vec3>> {
        let sample = self.sample(n)?;
        self.simulator().flow(sample, points)
    }

    /// Whether [`Rollout::flow`] knows the velocity at each of these points at state `n`: one that is finite, in the water, and far
    /// enough from all surfaces.
    ///
    /// # Errors
    /// A state that there isn't.
    pub fn flow_resolved(&self, n: usize, points: &[Vec3]) -> Result<Vec<bool>> {
        let poses = &self.sample(n)?.poses;
        let clear = |x: &Vec3| {
            x.iter().all(|c| c.is_finite()) && self.simulator().obstacle(x, poses).is_none()
        };
        Ok(points.iter().map(clear).collect())
    }

    fn sample(&self, n: usize) -> Result<&Sample> {
        self.samples().get(n).ok_or_else(|| {
            let expected = format!("must be at most {}", self.steps());
            Error::input("flow: state", n, expected)
        })
    }
}
