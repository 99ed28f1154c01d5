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
//! A point in the plane of a triangle and within it has the mean of the values on both sides; on an edge nothing is finite but
//! the value.
//!
//! # References
//! D. R. Wilton et al., "Potential integrals for uniform and linear source distributions on polygonal and polyhedral
//! domains", IEEE Trans. Antennas Propag. 32 (1984) 276–281, Eq. 5.

use super::flux::edge_gradient;
use super::flux::solid_angle;
use super::lane::{Lane, Lanes, V3, dot, scale, scale_add, sub};
use super::sum::{Scratch, TILE, Terms, forward, length, transposed};
use super::target::Panel;
use super::{Sources, Triangles};
use crate::lie::Vec3;
use pulp::Simd;

impl Panel {
    /// The corners from `s` with their distances.
    #[inline(always)]
    fn seen<T: Lane>(&self, s: V3<T>) -> ([V3<T>; 3], V3<T>) {
        let [a, b, c] = &self.corners;
        let r = [
            sub(constant(s[0], a), s),
            sub(constant(s[0], b), s),
            sub(constant(s[0], c), s),
        ];
        (r, [length(r[0]), length(r[1]), length(r[2])])
    }

    #[inline(always)]
    fn angle<T: Lane>(&self, r0: V3<T>, l: V3<T>) -> T {
        let (area, half) = (&self.double_area, &self.half_squares);
        solid_angle(constant(l[0], area), r0, l, constant(l[0], half))
    }

    /// L of edge `c`, from the distances of its ends.
    #[inline(always)]
    fn logarithm<T: Lane>(&self, c: usize, l: V3<T>) -> T {
        let t = l[0].like(self.lengths[c]) / (l[c] + l[(c + 1) % 3]);
        let half = t.artanh();
        half + half
    }

    /// `w I`.
    #[inline(always)]
    pub fn value_of<T: Lane>(&self, s: V3<T>) -> T {
        let (r, l) = self.seen(s);
        let mut value = -(dot(constant(l[0], &self.normal), r[0]) * self.angle(r[0], l));
        for (c, r) in r.into_iter().enumerate() {
            let distance = dot(constant(l[0], &self.outward[c]), r);
            value = distance.mul_add(self.logarithm(c, l), value);
        }
        value
    }

    /// `w ∇_s I`.
    #[inline(always)]
    fn gradient_of<T: Lane>(&self, s: V3<T>) -> V3<T> {
        let (r, l) = self.seen(s);
        let mut out = scale(self.angle(r[0], l), constant(l[0], &self.normal));
        for c in 0..3 {
            let outward = constant(l[0], &self.outward[c]);
            out = scale_add(-self.logarithm(c, l), outward, out);
        }
        out
    }

    /// `w ∇∇I d`.
    #[inline(always)]
    fn hessian_product_of<T: Lane>(&self, s: V3<T>, d: V3<T>) -> V3<T> {
        let (r, l) = self.seen(s);
        let slopes = [
            dot(r[0], d) / l[0],
            dot(r[1], d) / l[1],
            dot(r[2], d) / l[2],
        ];
        let mut turned = l[0].like(0.0);
        let mut out = [turned; 3];
        for c in 0..3 {
            let next = (c + 1) % 3;
            let squared = l[0].like(2.0 * self.half_squares[c]);
            let along = constant(l[0], &self.along[c]);
            turned = turned + dot(edge_gradient(r[c], along, squared, l[c], l[next]), d);
            let sum = l[c] + l[next];
            let rate = l[0].like(2.0 * self.lengths[c]) / sum.mul_add(sum, -squared);
            let rate = rate * (slopes[c] + slopes[next]);
            out = scale_add(-rate, constant(l[0], &self.outward[c]), out);
        }
        scale_add(turned, constant(l[0], &self.normal), out)
    }
}

/// A constant vector as lanes.
#[inline(always)]
fn constant<T: Lane>(x: T, v: &Vec3) -> V3<T> {
    [x.like(v.x), x.like(v.y), x.like(v.z)]
}

/// `weight · ∫ 1/|x − s| dA` over the triangle, m for weight 1.
pub fn single(corners: &[Vec3; 3], weight: f64, s: &Vec3) -> f64 {
    Panel::new(*corners, weight).value_of([s.x, s.y, s.z])
}

/// Gradient of [`single`](single()) in `s`.
pub fn single_gradient(corners: &[Vec3; 3], weight: f64, s: &Vec3) -> Vec3 {
    Vec3::from(Panel::new(*corners, weight).gradient_of([s.x, s.y, s.z]))
}

/// Hessian of [`single`](single()) in `s`, times `d`.
pub fn single_hessian_product(corners: &[Vec3; 3], weight: f64, s: &Vec3, d: &Vec3) -> Vec3 {
    let panel = Panel::new(*corners, weight);
    Vec3::from(panel.hessian_product_of([s.x, s.y, s.z], [d.x, d.y, d.z]))
}

/// `out[j][k] += Σ_i bar[i][k] K_ij`; `bar` is `[target][k]`, `out` is `[source][k]`.
pub fn single_sum(
    targets: &Triangles,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    transposed(Values(targets), sources, None, bar, columns, out);
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
    forward(Gradients(targets), sources, d, a, columns, out);
}

/// `out[j][k] += Σ_i bar[i][k] ∇K_ij`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn single_vjp(
    targets: &Triangles,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    transposed(Gradients(targets), sources, None, bar, columns, out);
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
    transposed(Tangents(targets), sources, Some(d), bar, columns, out);
}

/// Values of a surface's panels.
#[derive(Clone, Copy)]
struct Values<'a>(&'a Triangles);

/// Gradients of a surface's panels.
#[derive(Clone, Copy)]
struct Gradients<'a>(&'a Triangles);

/// Tangents of a surface's gradients.
#[derive(Clone, Copy)]
struct Tangents<'a>(&'a Triangles);

macro_rules! terms {
    ($type:ident, $components:literal, |$panel:ident, $s:ident, $d:ident| $value:expr) => {
        impl Terms<$components> for $type<'_> {
            fn len(self) -> usize {
                self.0.len()
            }

            #[inline(always)]
            fn evaluate<S: Simd>(
                self,
                _: S,
                tile: usize,
                $s: V3<Lanes<S>>,
                $d: V3<Lanes<S>>,
                _: &mut Scratch<S>,
                out: &mut [[S::f64s; $components]; TILE],
            ) {
                for (out, $panel) in out.iter_mut().zip(&self.0.panels[tile * TILE..]) {
                    let value: [Lanes<S>; $components] = $value;
                    for (out, value) in out.iter_mut().zip(&value) {
                        *out = value.v;
                    }
                }
            }
        }
    };
}

terms!(Values, 1, |panel, s, _d| [panel.value_of(s)]);
terms!(Gradients, 3, |panel, s, _d| panel.gradient_of(s));
terms!(Tangents, 3, |panel, s, d| panel.hessian_product_of(s, d));
