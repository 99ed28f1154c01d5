//! Rigid motions of bodies that water and joints can't tell from rest.
//!
//! Where all joints to the world that a group of bodies hangs on allow one and the same rigid motion, and no wall of the water stands in its way, it changes
//! no kinetic energy, and the momentum along it stays where nothing else acts.

use super::Drive;
use crate::adjoint::lie::{Mat6, Vec3, Vec6, six};
use crate::multibody::{Link, Tree};
use nalgebra::DMatrix;

/// Part of the largest singular value below which one counts as zero.
const ZERO: f64 = 1e-10;

/// Spatial twists that all of these joints to the world allow and that move along walls with these unit normals: orthonormal columns, 6 × k.
pub fn common_twists(roots: &[&Link], walls: &[Vec3]) -> DMatrix<f64> {
    let mut refused = Mat6::zeros();
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
    for n in walls {
        // It slides along the wall and turns about its normal.
        let through = six(n, &Vec3::zeros());
        refused += through * through.transpose();
        for axis in [Vec3::x(), Vec3::y(), Vec3::z()] {
            let tilt = six(&Vec3::zeros(), &(axis - n * n.dot(&axis)));
            refused += tilt * tilt.transpose();
        }
    }
    let decomposed = refused.symmetric_eigen();
    let top = decomposed.eigenvalues.max().max(1.0);
    let kept: Vec<Vec6> = (0..6)
        .filter(|&k| decomposed.eigenvalues[k].abs() <= ZERO * top)
        .map(|k| decomposed.eigenvectors.column(k).into_owned())
        .collect();
    DMatrix::from_fn(6, kept.len(), |i, j| kept[j][i])
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

/// Frame velocities of the motions that are free for each group of bodies, columns of nv × k; of the groups, lists of joints to the world, those with one that
/// is driven have none. `walls` are those of the first group's water; the others feel none.
pub fn free_motions(
    tree: &Tree,
    drives: &[Drive],
    groups: &[Vec<usize>],
    walls: &[Vec3],
) -> DMatrix<f64> {
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for (k, group) in groups.iter().enumerate() {
        if group.is_empty() || group.iter().any(|b| drives[*b] != Drive::Free) {
            continue;
        }
        let roots: Vec<&Link> = group.iter().map(|b| &tree.links()[*b]).collect();
        let twists = common_twists(&roots, if k == 0 { walls } else { &[] });
        for twist in twists.column_iter() {
            let mut column = vec![0.0; tree.velocities()];
            for root in &roots {
                // Frame velocities of the twist: least squares, which is exact here.
                let basis = allowed(root);
                let solved = basis.svd(true, true).solve(&twist.into_owned(), ZERO);
                if let Ok(hat) = solved {
                    for (i, x) in root.v.clone().zip(hat.iter()) {
                        column[i] = *x;
                    }
                }
            }
            columns.push(column);
        }
    }
    DMatrix::from_fn(tree.velocities(), columns.len(), |i, j| columns[j][i])
}
