//! How far points are from surfaces and walls.

use super::{Gaps, Other};
use hydrograd_adjoint::lie::{Pose, Vec3};

/// Signed distance of a point from a surface or a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// m; negative inside a body or behind a wall.
    pub distance: f64,
    /// From what.
    pub from: Other,
    /// Mean edge length near the closest point, m; zero at a wall.
    pub edge: f64,
}

impl Gaps {
    /// Distances of a point (world frame) from every surface, one pose per mesh, and then from every wall. A pose that is missing or
    /// isn't finite is passed over.
    pub fn distances<'a>(
        &'a self,
        point: &'a Vec3,
        poses: &'a [Pose],
    ) -> impl Iterator<Item = Distance> + 'a {
        let placed = self.surfaces.iter().zip(poses).enumerate();
        let bodies = placed.filter_map(|(body, (surface, pose))| {
            let surface = surface.as_ref()?;
            let (distance, face) = surface.signed(&pose.apply_inverse(point))?;
            Some(Distance {
                distance,
                from: Other::Body(body),
                edge: surface.edge_at_face(face),
            })
        });
        let walls = self.walls.iter().enumerate();
        bodies.chain(walls.map(move |(wall, (at, normal))| Distance {
            distance: (point - at).dot(normal),
            from: Other::Wall(wall),
            edge: 0.0,
        }))
    }
}
