//! Flux: value.

use super::constant;
use crate::kernel::lane::{Lane, V3, dot, sub};
use crate::kernel::{Sources, Triangles, Write};
use crate::lie::Vec3;

/// Solid angle Ω from `2A n`, the corner `r_0 = v_0 − s`, the lengths `l_c` and the halved squares
/// of the edges 01, 12, 20.
#[inline(always)]
pub(super) fn solid_angle<T: Lane>(double_area: V3<T>, r0: V3<T>, l: V3<T>, half_e2: V3<T>) -> T {
    let half = l[0].like(0.5);
    let [h0, h1, h2] = [half * l[0] * l[0], half * l[1] * l[1], half * l[2] * l[2]];
    // r·r' = ½(l² + l'² − e²)
    let d01 = h0 + (h1 - half_e2[0]);
    let d12 = h1 + (h2 - half_e2[1]);
    let d20 = h2 + (h0 - half_e2[2]);
    let n = dot(double_area, r0);
    let d = (l[0].mul_add(l[1], d01)).mul_add(l[2], d12.mul_add(l[0], d20 * l[1]));
    let half_angle = n.atan2(d);
    half_angle + half_angle
}

/// Ω of the triangle with these corners.
pub(super) fn solid_angle_of<T: Lane>(corners: &[Vec3; 3], s: V3<T>) -> T {
    let [a, b, c] = corners;
    let r = corners.map(|v| sub(constant(s[0], &v), s));
    let l = r.map(|r| dot(r, r).sqrt());
    let half_e2 = [b - a, c - b, a - c].map(|e| s[0].like(0.5 * e.norm_squared()));
    let double_area = constant(s[0], &(b - a).cross(&(c - a)));
    solid_angle(double_area, r[0], l, half_e2)
}

/// `weight · Ω`: flux of a unit source at `s` through the triangle, along its normal.
pub fn flux(corners: &[Vec3; 3], weight: f64, s: &Vec3) -> f64 {
    weight * solid_angle_of(corners, [s.x, s.y, s.z])
}

/// `K_ij` into `out[i · stride + column + j]`, targets × sources.
pub fn flux_fill(
    targets: &Triangles,
    sources: &Sources,
    write: Write,
    out: &mut [f64],
    stride: usize,
    column: usize,
) {
    for i in 0..targets.len() {
        let corners = targets.corners(i);
        for j in 0..sources.len() {
            let value = flux(&corners, targets.weight[i], &sources.point(j));
            let entry = &mut out[i * stride + column + j];
            *entry = if write == Write::Set {
                value
            } else {
                *entry + value
            };
        }
    }
}
