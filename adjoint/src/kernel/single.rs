//! Potential of a triangle with a constant density, `w_i ∫ 1/|x − s| dA`: the single layer, seen by a point at `s`.
//!
//! With `r_c = v_c − s` the corners seen from the point, `l_c = |r_c|`, `n` the unit normal, and over the edges `a → b` of length
//! `e`, `m_ab` their outward normals in the plane of the triangle,
//!
//! ```text
//! I = Σ m_ab·r_a L_ab − n·r_0 Ω,   L_ab = ln (l_a + l_b + e)/(l_a + l_b − e) = 2 artanh e/(l_a + l_b)
//! ∇_s I = n Ω − Σ m_ab L_ab
//! ∇∇I d = n (∇Ω·d) − Σ m_ab (∇L_ab·d),   ∇L_ab = 2 e/((l_a + l_b)² − e²) (r_a/l_a + r_b/l_b)
//! ```
//!
//! The derivatives of the logarithms and of the solid angle Ω ([`flux`](mod@super::flux)) cancel in the gradient.
//!
//! Far from a triangle the sums take two terms of its multipole series, blended smoothly (`kernel::panel`).
//!
//! A point in the plane of a triangle and within it has the mean of the values on both sides; on an edge nothing is finite but
//! the value.
//!
//! # References
//! D. R. Wilton et al., "Potential integrals for uniform and linear source distributions on polygonal and polyhedral
//! domains", IEEE Trans. Antennas Propag. 32 (1984) 276–281, Eq. 5.

use super::flux::{edge_gradient, solid_angle};
use super::lane::{Lane, V3, dot, scale, scale_add};
use super::layer::{Gradients, Tangents, Values};
use super::panel::{Layer, Multipoles, Panel, constant};
use super::sum::{forward, transposed};
use super::{Sources, Triangles};
use crate::lie::Vec3;

/// The single layer.
#[derive(Clone, Copy)]
pub(super) struct Single;

impl Panel {
    #[inline(always)]
    pub fn angle<T: Lane>(&self, r0: V3<T>, l: V3<T>) -> T {
        let (area, half) = (&self.double_area, &self.half_squares);
        solid_angle(constant(l[0], area), r0, l, constant(l[0], half))
    }

    /// L of edge `c`, from the distances of its ends.
    #[inline(always)]
    pub fn logarithm<T: Lane>(&self, c: usize, l: V3<T>) -> T {
        let t = l[0].like(self.lengths[c]) / (l[c] + l[(c + 1) % 3]);
        let half = t.artanh();
        half + half
    }
}

impl Layer for Single {
    #[inline(always)]
    fn near<T: Lane>(panel: &Panel, s: V3<T>) -> T {
        let (r, l) = panel.seen(s);
        let mut value = -(dot(constant(l[0], &panel.normal), r[0]) * panel.angle(r[0], l));
        for (c, r) in r.into_iter().enumerate() {
            let distance = dot(constant(l[0], &panel.outward[c]), r);
            value = distance.mul_add(panel.logarithm(c, l), value);
        }
        value
    }

    #[inline(always)]
    fn near_gradient<T: Lane>(panel: &Panel, s: V3<T>) -> V3<T> {
        let (r, l) = panel.seen(s);
        let mut out = scale(panel.angle(r[0], l), constant(l[0], &panel.normal));
        for c in 0..3 {
            let outward = constant(l[0], &panel.outward[c]);
            out = scale_add(-panel.logarithm(c, l), outward, out);
        }
        out
    }

    #[inline(always)]
    fn near_hessian_product<T: Lane>(panel: &Panel, s: V3<T>, d: V3<T>) -> V3<T> {
        let (r, l) = panel.seen(s);
        let slopes = [
            dot(r[0], d) / l[0],
            dot(r[1], d) / l[1],
            dot(r[2], d) / l[2],
        ];
        let mut turned = l[0].like(0.0);
        let mut out = [turned; 3];
        for c in 0..3 {
            let next = (c + 1) % 3;
            let squared = l[0].like(2.0 * panel.half_squares[c]);
            let along = constant(l[0], &panel.along[c]);
            turned = turned + dot(edge_gradient(r[c], along, squared, l[c], l[next]), d);
            let sum = l[c] + l[next];
            let rate = l[0].like(2.0 * panel.lengths[c]) / sum.mul_add(sum, -squared);
            let rate = rate * (slopes[c] + slopes[next]);
            out = scale_add(-rate, constant(l[0], &panel.outward[c]), out);
        }
        scale_add(turned, constant(l[0], &panel.normal), out)
    }

    #[inline(always)]
    fn far<T: Lane>(panel: &Panel, far: &Multipoles<T>) -> T {
        panel.charge(far) * far.value()
    }

    #[inline(always)]
    fn far_gradient<T: Lane>(panel: &Panel, far: &Multipoles<T>) -> V3<T> {
        scale(panel.charge(far), far.gradient())
    }

    #[inline(always)]
    fn far_hessian_product<T: Lane>(panel: &Panel, far: &Multipoles<T>, d: V3<T>) -> V3<T> {
        scale(panel.charge(far), far.hessian_product(d))
    }
}

/// `weight · ∫ 1/|x − s| dA` over the triangle, m for weight 1: the near form.
pub fn single(corners: &[Vec3; 3], weight: f64, s: &Vec3) -> f64 {
    Single::near(&Panel::new(*corners, weight), [s.x, s.y, s.z])
}

/// Gradient of [`single`](single()) in `s`.
pub fn single_gradient(corners: &[Vec3; 3], weight: f64, s: &Vec3) -> Vec3 {
    Single::near_gradient(&Panel::new(*corners, weight), [s.x, s.y, s.z]).into()
}

/// Hessian of [`single`](single()) in `s`, times `d`.
pub fn single_hessian_product(corners: &[Vec3; 3], weight: f64, s: &Vec3, d: &Vec3) -> Vec3 {
    let panel = Panel::new(*corners, weight);
    Single::near_hessian_product(&panel, [s.x, s.y, s.z], [d.x, d.y, d.z]).into()
}

/// `out[j][k] += Σ_i bar[i][k] K_ij`; `bar` is `[target][k]`, `out` is `[source][k]`.
pub fn single_sum(
    targets: &Triangles,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    transposed(Values(targets, Single), sources, None, bar, columns, out);
}

/// `out[i][k] += Σ_j (∇K_ij · d_j) a[j][k]`; `a` is `[source][k]`, `out` is `[target][k]`.
pub fn single_jvp(
    targets: &Triangles,
    sources: &Sources,
    d: &[Vec3],
    a: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    forward(Gradients(targets, Single), sources, d, a, columns, out);
}

/// `out[j][k] += Σ_i bar[i][k] ∇K_ij`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn single_vjp(
    targets: &Triangles,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    transposed(Gradients(targets, Single), sources, None, bar, columns, out);
}

/// `out[j][k] += Σ_i bar[i][k] ∇∇K_ij d_j`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn single_hvp(
    targets: &Triangles,
    sources: &Sources,
    d: &[Vec3],
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    transposed(
        Tangents(targets, Single),
        sources,
        Some(d),
        bar,
        columns,
        out,
    );
}
