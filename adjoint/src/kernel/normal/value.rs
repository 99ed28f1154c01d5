//! Normal velocity: value.

use crate::kernel::lane::{Lane, V3, dot};
use crate::kernel::{Points, Sources, Write};
use crate::lie::Vec3;

/// `n·r/|r|³`; `n` may carry the row weight.
#[inline(always)]
pub(super) fn velocity<T: Lane>(n: V3<T>, r: V3<T>) -> T {
    let r2 = dot(r, r);
    dot(n, r) / (r2 * r2.sqrt())
}

/// `weight n·(x − s)/|x − s|³`.
pub fn normal(x: &Vec3, n: &Vec3, weight: f64, s: &Vec3) -> f64 {
    weight * velocity((*n).into(), (x - s).into())
}

/// `K_ij` into `out[i · stride + column + j]`, targets × sources.
pub fn normal_fill(
    targets: &Points,
    sources: &Sources,
    write: Write,
    out: &mut [f64],
    stride: usize,
    column: usize,
) {
    for i in 0..targets.len() {
        let (x, n) = (&targets.centre[i], &targets.normal[i]);
        for j in 0..sources.len() {
            let value = normal(x, n, targets.weight[i], &sources.point(j));
            let entry = &mut out[i * stride + column + j];
            *entry = if write == Write::Set {
                value
            } else {
                *entry + value
            };
        }
    }
}
