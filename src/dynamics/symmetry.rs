//! Rigid motions of bodies that water, joints and forces can't tell from rest.
//!
//! Where all joints to the world that a group of bodies hangs on allow one and the same rigid motion, and no wall of the water stands in its way, it changes
//! no kinetic energy, and the momentum along it stays where nothing outside acts.

use super::force::Outside;
use super::{Drive, Motions};
use crate::adjoint::lie::{Mat6, Vec3, Vec6, six};
use crate::multibody::{Link, Tree};
use nalgebra::DMatrix;

/// Part of the largest singular value below which one counts as zero.
const ZERO: f64 = 1e-10;

/// Bodies that feel one another.
pub struct Group {
    /// The first body of each tree of joints.
    pub roots: Vec<usize>,
    /// Twists that something stands against ([`refuse`]).
    pub refused: Mat6,
}

/// Rigid motions that are free.
#[derive(Clone, Debug)]
pub struct FreeMotions {
    /// Frame velocities.
    pub velocities: Motions,
    /// The spatial twist of each.
    pub twists: Vec<Vec6>,
}

/// Twists that something outside stands against, as a matrix whose null space is what it leaves free.
pub fn refuse(outside: Outside) -> Mat6 {
    match outside {
        Outside::Nothing => Mat6::zeros(),
        // They slide across it and turn about it.
        Outside::Along(n) => {
            let n = n.normalize();
            let along = six(&n, &Vec3::zeros());
            along * along.transpose() + refuse_tilt(&n)
        }
        Outside::All => Mat6::identity(),
    }
}

/// Turning, but about an axis.
pub fn refuse_tilt(axis: &Vec3) -> Mat6 {
    let n = axis.normalize();
    let tilts = [Vec3::x(), Vec3::y(), Vec3::z()].map(|x| {
        let tilt = six(&Vec3::zeros(), &(x - n * n.dot(&x)));
        tilt * tilt.transpose()
    });
    tilts.into_iter().sum()
}

/// Spatial twists that all of these joints to the world allow and that nothing refuses: orthonormal.
fn common_twists(roots: &[&Link], refused: &Mat6) -> Vec<Vec6> {
    let mut refused = *refused;
    for root in roots {
        let basis = allowed(root);
        let kept = match basis.ncols() {
            0 => Mat6::zeros(),
            _ => {
                let left = basis.clone().svd(true, false);
                let u = left.u.unwrap_or_else(|| DMatrix::zeros(6, 0));
                let top = left.singular_values.max();
                let mut kept = Mat6::zeros();
                for (k, s) in left.singular_values.iter().enumerate() {
                    if *s > ZERO * top {
                        let c: Vec6 = u.column(k).fixed_rows::<6>(0).into_owned();
                        kept += c * c.transpose();
                    }
                }
                kept
            }
        };
        refused += Mat6::identity() - kept;
    }
    let decomposed = refused.symmetric_eigen();
    let top = decomposed.eigenvalues.max().max(1.0);
    (0..6)
        .filter(|&k| decomposed.eigenvalues[k].abs() <= ZERO * top)
        .map(|k| decomposed.eigenvectors.column(k).into_owned())
        .collect()
}

/// Spatial twists of a joint to the world, by its frame velocities.
fn allowed(root: &Link) -> DMatrix<f64> {
    let basis = root.joint.basis();
    let columns: Vec<Vec6> = basis
        .iter()
        .map(|b| root.placement.twist_to_world(b))
        .collect();
    DMatrix::from_fn(6, columns.len(), |i, j| columns[j][i])
}

/// The motions that are free for each group of bodies; a group with a driven joint to the world has none.
pub fn free_motions(tree: &Tree, drives: &[Drive], groups: &[Group]) -> FreeMotions {
    let (mut each, mut twists): (Vec<Vec<(usize, f64)>>, Vec<Vec6>) = Default::default();
    for Group { roots, refused } in groups {
        let free = |b: &usize| drives[*b] == Drive::Free && tree.is_single(*b);
        if roots.is_empty() || !roots.iter().all(free) {
            continue;
        }
        let roots: Vec<&Link> = roots.iter().map(|b| &tree.links()[*b]).collect();
        for twist in common_twists(&roots, refused) {
            let mut motion = Vec::new();
            for root in &roots {
                // Frame velocities of the twist: least squares, which is exact here.
                let basis = allowed(root);
                let right = DMatrix::from_column_slice(6, 1, twist.as_slice());
                if let Ok(hat) = basis.svd(true, true).solve(&right, ZERO) {
                    motion.extend(root.v.clone().zip(hat.iter().copied()));
                }
            }
            each.push(motion);
            twists.push(twist);
        }
    }
    FreeMotions {
        velocities: Motions::new(tree.velocities(), each),
        twists,
    }
}
