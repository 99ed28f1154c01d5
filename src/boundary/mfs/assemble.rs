//! Rows of one body: flux, twist, potential.

use super::settings::{Method, RowScaling};
use crate::adjoint::kernel::{self, Points, Sources, Triangles, Write};
use crate::adjoint::lie::{Vec3, Vec6};
use crate::geometry::Faces;
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
    method: Method,
    triangles: &Triangles,
    points: &Points,
    sources: &[Vec3],
) -> Vec<f64> {
    let n = sources.len();
    let mut k = vec![0.0; triangles.len() * n];
    let sources = Sources::new(sources);
    match method {
        Method::MfsVertex => kernel::flux_fill(triangles, &sources, Write::Set, &mut k, n, 0),
        Method::MfsFace => kernel::normal_fill(points, &sources, Write::Set, &mut k, n, 0),
    }
    k
}

/// Columns that [`column_norms`] makes at once.
const CHUNK: usize = 64;

/// Norms of K's columns, without K.
pub(crate) fn column_norms(
    method: Method,
    triangles: &Triangles,
    points: &Points,
    sources: &[Vec3],
) -> Vec<f64> {
    let norms = |chunk: &[Vec3]| {
        let n = chunk.len();
        let k = flux_matrix(method, triangles, points, chunk);
        let mut squares = vec![0.0; n];
        for row in k.chunks_exact(n) {
            squares.iter_mut().zip(row).for_each(|(s, x)| *s += x * x);
        }
        squares.into_iter().map(f64::sqrt).collect::<Vec<_>>()
    };
    sources.par_chunks(CHUNK).flat_map_iter(norms).collect()
}
