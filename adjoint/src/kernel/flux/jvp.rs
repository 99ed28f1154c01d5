//! Flux: tangent.

use super::vjp::EdgeGradients;
use crate::kernel::sum::forward;
use crate::kernel::target::NONE;
use crate::kernel::{Sources, Triangles};
use crate::lie::Vec3;

/// `out[i][k] += Σ_j (∇K_ij · d_j) a[j][k]`; `a` is `[source][k]`, `out` is `[target][k]`.
pub fn flux_jvp(
    targets: &Triangles,
    sources: &Sources,
    d: &[Vec3],
    a: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    assert_eq!(out.len(), targets.len() * columns, "out: [target][k]");
    // On the edges first; every face then collects its own.
    let mut edges = vec![0.0; targets.sides.len() * columns];
    forward(EdgeGradients(targets), sources, d, a, columns, &mut edges);
    if columns == 0 {
        return;
    }
    for (side, edge) in targets.sides.iter().zip(edges.chunks_exact(columns)) {
        let left = side.left as usize;
        for (out, e) in out[left * columns..].iter_mut().zip(edge) {
            *out += targets.weights()[left] * e;
        }
        if side.right != NONE {
            let right = side.right as usize;
            for (out, e) in out[right * columns..].iter_mut().zip(edge) {
                *out -= targets.weights()[right] * e;
            }
        }
    }
}
