//! Potential: value.

use crate::kernel::{Points, Sources};
use crate::lie::Vec3;

/// `1/|x − s|`.
pub fn potential(x: &Vec3, s: &Vec3) -> f64 {
    1.0 / (x - s).norm()
}

/// `out[j][k] += Σ_i bar[i][k]/|x_i − s_j|`; `bar` is `[target][k]`, `out` is `[source][k]`.
pub fn potential_sum(
    targets: &Points,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    for i in 0..targets.len() {
        for j in 0..sources.len() {
            let p = potential(&targets.centre[i], &sources.point(j));
            for k in 0..columns {
                out[j * columns + k] += bar[i * columns + k] * p;
            }
        }
    }
}
