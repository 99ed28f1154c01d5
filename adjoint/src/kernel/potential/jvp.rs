//! Potential: tangent.

use super::vjp::Gradients;
use crate::kernel::sum::forward;
use crate::kernel::{Points, Sources};
use crate::lie::Vec3;

/// `out[i][k] += Σ_j (∇P_ij · d_j) a[j][k]`; `a` is `[source][k]`, `out` is `[target][k]`.
pub fn potential_jvp(
    targets: &Points,
    sources: &Sources,
    d: &[Vec3],
    a: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    forward(Gradients(targets), sources, d, a, columns, out);
}
