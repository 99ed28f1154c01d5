//! What a run takes up: its surfaces, the box around them, and walls as far as they are drawn.

use crate::Result;
use crate::adjoint::lie::{Pose, Vec3};
use crate::geometry::{HalfSpace, TriMesh, Wall, bounds};
use crate::simulate::Rollout;

/// Half a wall's edge, in diagonals of the box around all bodies at all times.
const REACH: f64 = 1.0;

/// Surfaces of a run's bodies, and the box that they stay in.
pub(super) struct Room {
    /// Of each body, in its own frame; none without a shape.
    pub meshes: Vec<Option<TriMesh>>,
    low: Vec3,
    high: Vec3,
}

impl Room {
    /// Of the bodies at these states.
    pub fn of(rollout: &Rollout, states: &[usize]) -> Result<Self> {
        let meshes = rollout.simulator().meshes()?;
        let corners: Vec<Vec<Vec3>> = meshes.iter().map(corners).collect();
        // Origins may lie far from the shapes that move about them.
        let shapes = meshes.iter().any(Option::is_some);
        let mut points = Vec::new();
        for &n in states {
            let each = corners.iter().zip(&rollout.samples()[n].poses);
            for ((corners, pose), mesh) in each.zip(&meshes) {
                if mesh.is_some() || !shapes {
                    points.extend(corners.iter().map(|x| pose.apply(x)));
                }
            }
        }
        let [low, high] = bounds(points.iter());
        Ok(Self { meshes, low, high })
    }

    /// The walls as squares around the scene, corners counter-clockwise as the water sees them; m, world axes.
    pub fn walls(&self, rollout: &Rollout) -> Result<Vec<[Vec3; 4]>> {
        let middle = 0.5 * (self.low + self.high);
        let size = (self.high - self.low).norm();
        let reach = REACH * if size > 0.0 { size } else { 1.0 };
        let walls = Wall::half_spaces(&rollout.simulator().scene().walls)?;
        let square = |wall: &HalfSpace| {
            let near = middle - wall.normal * wall.height(&middle);
            let axis = wall.normal.iamin();
            let across = wall.normal.cross(&Vec3::ith(axis, 1.0)).normalize() * reach;
            let along = wall.normal.cross(&across);
            [
                near - across - along,
                near + across - along,
                near + across + along,
                near - across + along,
            ]
        };
        Ok(walls.iter().map(square).collect())
    }
}

/// Of the box around a mesh; the origin where there is none.
fn corners(mesh: &Option<TriMesh>) -> Vec<Vec3> {
    let Some(mesh) = mesh else {
        return vec![Vec3::zeros()];
    };
    let ends = mesh.bounds();
    let corner = |k: usize| Vec3::from_fn(|i, _| ends[k >> i & 1][i]);
    (0..8).map(corner).collect()
}

/// A surface at a pose: its vertices, m, world axes.
pub(super) fn placed(mesh: &TriMesh, pose: &Pose) -> Vec<Vec3> {
    mesh.vertices().iter().map(|x| pose.apply(x)).collect()
}
