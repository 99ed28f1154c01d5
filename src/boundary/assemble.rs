//! Rows of one body: flux, twist, potential.

use super::settings::{Method, RowScaling};
use super::surface::{Faces, solid_angle};
use crate::adjoint::lie::{Vec3, Vec6};
use rayon::prelude::*;

/// Weight of each face's row. A row is `weight · flux` (vertex sources) or
/// `weight · normal velocity` (face sources).
pub(crate) fn row_weights(faces: &Faces, method: Method, rows: RowScaling) -> Vec<f64> {
    faces
        .areas
        .iter()
        .map(|a| match (rows, method) {
            (RowScaling::Unscaled, _) => 1.0,
            (RowScaling::Scaled, Method::MfsVertex) => 1.0 / a.sqrt(),
            (RowScaling::Scaled, Method::MfsFace) => a.sqrt(),
        })
        .collect()
}

/// F̄: what each row should be per unit twist, faces × 6.
pub(crate) fn twist_rows(faces: &Faces, method: Method, weights: &[f64]) -> Vec<Vec6> {
    (0..faces.len())
        .map(|i| match method {
            Method::MfsVertex => faces.twist_flux(i) * weights[i],
            Method::MfsFace => faces.twist_flux(i) * (weights[i] / faces.areas[i]),
        })
        .collect()
}

/// K: the rows that unit sources make, row-major faces × sources.
pub(crate) fn flux_matrix(
    faces: &Faces,
    sources: &[Vec3],
    method: Method,
    weights: &[f64],
) -> Vec<f64> {
    let mut k = vec![0.0; faces.len() * sources.len()];
    k.par_chunks_mut(sources.len())
        .enumerate()
        .for_each(|(i, row)| {
            let (w, centre, normal) = (weights[i], &faces.centres[i], &faces.normals[i]);
            for (entry, s) in row.iter_mut().zip(sources) {
                *entry = w * match method {
                    Method::MfsVertex => solid_angle(s, &faces.corners[i]),
                    Method::MfsFace => {
                        let d = centre - s;
                        normal.dot(&d) / d.norm().powi(3)
                    }
                };
            }
        });
    k
}
