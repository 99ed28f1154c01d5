//! Drag summed over a body's surface: the linear law of Eq. 22 and a quadratic one.
//!
//! With ν = (u, ω) the body's twist through the water in its own frame, the surface point x moves
//! with u + ω × x, of which the part w = Π(u + ω × x) drags: along the surface (Eq. 22), across
//! it, or all of it.

use crate::kernel::{Lane, Lanes, V3, WIDTH, cross, dispatch, dot, scale, scale_add};
use crate::lie::{Mat3, Mat6, Vec3, Vec6, skew};
use pulp::{Simd, WithSimd};

/// Speed below which a piece of surface counts as no faster, m/s: squares of smaller ones leave floating point.
const SLOWEST: f64 = 1e-150;
/// Places of the second moments.
const SECOND: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];

/// Which part of the surface velocity drags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Part {
    /// Along the surface, Π = 1 − nnᵀ (Eq. 22).
    #[default]
    Tangential,
    /// Across the surface, Π = nnᵀ.
    Normal,
    /// Π = 1.
    Total,
}

/// One flat piece of surface in the body's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element {
    /// Centre, m.
    pub center: Vec3,
    /// Unit outward normal.
    pub normal: Vec3,
    /// Area, m².
    pub area: f64,
}

impl Part {
    fn projector(self, n: &Vec3) -> Mat3 {
        match self {
            Part::Tangential => Mat3::identity() - n * n.transpose(),
            Part::Normal => n * n.transpose(),
            Part::Total => Mat3::identity(),
        }
    }

    /// a and b of Π = a 1 + b n nᵀ.
    fn projector_parts(self) -> [f64; 2] {
        match self {
            Part::Tangential => [1.0, -1.0],
            Part::Normal => [0.0, 1.0],
            Part::Total => [1.0, 0.0],
        }
    }
}

/// Resistance at unit coefficient, Σ ΔA Gᵀ Π G with `G = [1, −[x]×]`: constant in the body's frame,
/// symmetric positive semi-definite; the wrench is `−coefficient · resistance · ν` (m², m³, m⁴).
pub fn resistance(surface: &[Element], part: Part) -> Mat6 {
    let mut out = Mat6::zeros();
    for e in surface {
        let p = part.projector(&e.normal) * e.area;
        let x = skew(&e.center);
        let px = p * x;
        let corner = -(x * px);
        for i in 0..3 {
            for j in 0..3 {
                out[(i, j)] += p[(i, j)];
                out[(i, j + 3)] -= px[(i, j)];
                out[(j + 3, i)] -= px[(i, j)];
                out[(i + 3, j + 3)] += corner[(i, j)];
            }
        }
    }
    out
}

/// A surface made ready for [`quadratic_drag`] and its derivatives, which are sums over all of its pieces.
///
/// The numbers lie in separate arrays, padded with pieces without area to a multiple of the widest vector.
#[derive(Clone, Debug)]
pub struct Surface {
    part: Part,
    center: [Vec<f64>; 3],
    normal: [Vec<f64>; 3],
    area: Vec<f64>,
}

impl Surface {
    /// Of these pieces, this part of whose velocity drags.
    pub fn new(elements: &[Element], part: Part) -> Self {
        let padded = elements.len().next_multiple_of(WIDTH);
        let numbers = |of: &dyn Fn(&Element) -> f64| {
            let mut out: Vec<f64> = elements.iter().map(of).collect();
            out.resize(padded, 0.0);
            out
        };
        Self {
            part,
            center: [0, 1, 2].map(|k| numbers(&|e| e.center[k])),
            normal: [0, 1, 2].map(|k| numbers(&|e| e.normal[k])),
            area: numbers(&|e| e.area),
        }
    }
}

/// Quadratic drag at unit coefficient: wrench `−½ Σ ΔA |w| w` about the body's origin, body frame
/// (to be multiplied by ρ and the dimensionless coefficient).
pub fn quadratic_drag(surface: &Surface, nu: &Vec6) -> Vec6 {
    let mut out = Vec6::zeros();
    dispatch(Wrench {
        surface,
        nu,
        out: &mut out,
    });
    out
}

/// Derivative matrix of [`quadratic_drag`] with respect to ν: symmetric, negative
/// semi-definite, and zero (not 0/0) for an element at rest. The drag being of second degree, the wrench itself is half of its product with ν.
pub fn quadratic_drag_derivative(surface: &Surface, nu: &Vec6) -> Mat6 {
    let mut out = Mat6::zeros();
    dispatch(Derivative {
        surface,
        nu,
        out: &mut out,
    });
    out
}

/// Tangent of [`quadratic_drag`].
pub fn quadratic_drag_jvp(surface: &Surface, nu: &Vec6, dnu: &Vec6) -> Vec6 {
    quadratic_drag_derivative(surface, nu) * dnu
}

/// Cotangent of ν of [`quadratic_drag`].
pub fn quadratic_drag_vjp(surface: &Surface, nu: &Vec6, bar: &Vec6) -> Vec6 {
    quadratic_drag_derivative(surface, nu).tr_mul(bar)
}

/// So many pieces of a surface as a vector holds.
struct Pieces<S: Simd> {
    center: V3<Lanes<S>>,
    normal: V3<Lanes<S>>,
    /// ½ ΔA.
    half: Lanes<S>,
    /// w and |w|.
    w: V3<Lanes<S>>,
    speed: Lanes<S>,
}

/// A surface and a twist as vectors hold them.
struct Moved<'a, S: Simd> {
    simd: S,
    arrays: [&'a [S::f64s]; 7],
    velocity: V3<Lanes<S>>,
    spin: V3<Lanes<S>>,
    /// Π = a 1 + b n nᵀ.
    projector: [Lanes<S>; 2],
}

impl<'a, S: Simd> Moved<'a, S> {
    #[inline(always)]
    fn new(simd: S, surface: &'a Surface, nu: &Vec6) -> Self {
        let splat = |x: f64| Lanes::splat(simd, x);
        let [x, y, z] = &surface.center;
        let [nx, ny, nz] = &surface.normal;
        let arrays = [x, y, z, nx, ny, nz, &surface.area];
        let [a, b] = surface.part.projector_parts();
        Self {
            simd,
            arrays: arrays.map(|numbers| S::as_simd_f64s(numbers).0),
            velocity: [splat(nu[0]), splat(nu[1]), splat(nu[2])],
            spin: [splat(nu[3]), splat(nu[4]), splat(nu[5])],
            projector: [splat(a), splat(b)],
        }
    }

    #[inline(always)]
    fn len(&self) -> usize {
        self.arrays[0].len()
    }

    #[inline(always)]
    fn load(&self, array: usize, i: usize) -> Lanes<S> {
        Lanes::new(self.simd, self.arrays[array][i])
    }

    #[inline(always)]
    fn pieces(&self, i: usize) -> Pieces<S> {
        let center = [self.load(0, i), self.load(1, i), self.load(2, i)];
        let normal = [self.load(3, i), self.load(4, i), self.load(5, i)];
        let (u, turned) = (self.velocity, cross(self.spin, center));
        let v = [u[0] + turned[0], u[1] + turned[1], u[2] + turned[2]];
        let [a, b] = self.projector;
        let w = scale_add(b * dot(normal, v), normal, scale(a, v));
        let area = self.load(6, i);
        Pieces {
            center,
            normal,
            half: area.like(0.5) * area,
            w,
            speed: dot(w, w).sqrt(),
        }
    }
}

struct Wrench<'a> {
    surface: &'a Surface,
    nu: &'a Vec6,
    out: &'a mut Vec6,
}

impl WithSimd for Wrench<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let moved = Moved::new(simd, self.surface, self.nu);
        let mut sums = [Lanes::splat(simd, 0.0); 6];
        for i in 0..moved.len() {
            let p = moved.pieces(i);
            let size = p.half * p.speed;
            let arm = cross(p.center, p.w);
            for k in 0..3 {
                sums[k] = size.neg_mul_add(p.w[k], sums[k]);
                sums[k + 3] = size.neg_mul_add(arm[k], sums[k + 3]);
            }
        }
        for (k, sum) in sums.into_iter().enumerate() {
            self.out[k] = simd.reduce_sum_f64s(sum.v);
        }
    }
}

struct Derivative<'a> {
    surface: &'a Surface,
    nu: &'a Vec6,
    out: &'a mut Mat6,
}

impl WithSimd for Derivative<'_> {
    type Output = ();

    /// d(|w|w) = (|w| Π + w wᵀ/|w|) dw, as Π is a projector and w lies in its range. With G = [1, −[x]×], g = Gᵀ w and h = Gᵀ n a piece
    /// adds −½ ΔA { |w| (a GᵀG + b h hᵀ) + g gᵀ/|w| }, and GᵀG is made of the moments 1, x and x xᵀ.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let moved = Moved::new(simd, self.surface, self.nu);
        let zero = Lanes::splat(simd, 0.0);
        let least = Lanes::splat(simd, SLOWEST);
        let (mut moments, mut products) = ([zero; 10], [zero; 21]);
        for i in 0..moved.len() {
            let p = moved.pieces(i);
            let [a, b] = moved.projector;
            let size = p.half * p.speed;
            let slow = Lanes::new(simd, simd.max_f64s(p.speed.v, least.v));
            let over = p.half / slow;
            let plain = a * size;
            let x = p.center;
            moments[0] = moments[0] + plain;
            for k in 0..3 {
                moments[1 + k] = plain.mul_add(x[k], moments[1 + k]);
            }
            for (n, (j, k)) in SECOND.into_iter().enumerate() {
                moments[4 + n] = (plain * x[j]).mul_add(x[k], moments[4 + n]);
            }
            let (arm, lever) = (cross(x, p.w), cross(x, p.normal));
            let g = [p.w[0], p.w[1], p.w[2], arm[0], arm[1], arm[2]];
            let n = p.normal;
            let h = [n[0], n[1], n[2], lever[0], lever[1], lever[2]];
            let across = b * size;
            let mut at = 0;
            for j in 0..6 {
                let (gj, hj) = (over * g[j], across * h[j]);
                for k in 0..=j {
                    products[at] = gj.mul_add(g[k], hj.mul_add(h[k], products[at]));
                    at += 1;
                }
            }
        }
        let m = moments.map(|sum| simd.reduce_sum_f64s(sum.v));
        let out = self.out;
        let first = skew(&Vec3::new(m[1], m[2], m[3]));
        let mut second = Mat3::zeros();
        for (n, (j, k)) in SECOND.into_iter().enumerate() {
            second[(j, k)] = m[4 + n];
            second[(k, j)] = m[4 + n];
        }
        let turning = Mat3::identity() * second.trace() - second;
        for j in 0..3 {
            out[(j, j)] -= m[0];
            for k in 0..3 {
                out[(j, k + 3)] += first[(j, k)];
                out[(j + 3, k)] -= first[(j, k)];
                out[(j + 3, k + 3)] -= turning[(j, k)];
            }
        }
        let mut at = 0;
        for j in 0..6 {
            for k in 0..=j {
                let sum = simd.reduce_sum_f64s(products[at].v);
                out[(j, k)] -= sum;
                if k < j {
                    out[(k, j)] -= sum;
                }
                at += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lie::{angular, linear, point_wrench};

    fn surface() -> Vec<Element> {
        let mut out = Vec::new();
        for k in 0..12 {
            let a = k as f64;
            let n = Vec3::new(a.sin(), (1.3 * a).cos(), 0.4 - 0.1 * a).normalize();
            out.push(Element {
                center: n * 0.7 + Vec3::new(0.1, -0.2, 0.05 * a),
                normal: n,
                area: 0.3 + 0.02 * a,
            });
        }
        out
    }

    #[test]
    fn resistance_dissipates_and_matches_the_sum() {
        let nu = Vec6::new(0.3, -0.8, 0.5, 1.2, 0.4, -0.6);
        for part in [Part::Tangential, Part::Normal, Part::Total] {
            let power = nu.dot(&(resistance(&surface(), part) * nu));
            let direct: f64 = surface()
                .iter()
                .map(|e| {
                    let w =
                        part.projector(&e.normal) * (linear(&nu) + angular(&nu).cross(&e.center));
                    e.area * w.norm_squared()
                })
                .sum();
            assert!((power - direct).abs() < 1e-13 * direct);
        }
    }

    /// The sum as it is written, piece by piece.
    fn plain(surface: &[Element], part: Part, nu: &Vec6) -> Vec6 {
        let mut out = Vec6::zeros();
        for e in surface {
            let v = linear(nu) + angular(nu).cross(&e.center);
            let w = part.projector(&e.normal) * v;
            out += point_wrench(&e.center, &(-0.5 * e.area * w.norm() * w));
        }
        out
    }

    #[test]
    fn quadratic_drag_is_its_sum_and_half_of_its_derivative_times_the_twist() {
        let nu = Vec6::new(0.3, -0.8, 0.5, 1.2, 0.4, -0.6);
        for part in [Part::Tangential, Part::Normal, Part::Total] {
            let packed = Surface::new(&surface(), part);
            let (found, right) = (quadratic_drag(&packed, &nu), plain(&surface(), part, &nu));
            assert!((found - right).norm() < 1e-14 * right.norm());
            let half = 0.5 * quadratic_drag_derivative(&packed, &nu) * nu;
            assert!((half - right).norm() < 1e-14 * right.norm());
        }
    }

    #[test]
    fn quadratic_derivative_matches_differences_and_is_zero_at_rest() {
        let nu = Vec6::new(0.3, -0.8, 0.5, 1.2, 0.4, -0.6);
        for part in [Part::Tangential, Part::Normal, Part::Total] {
            let packed = Surface::new(&surface(), part);
            let d = quadratic_drag_derivative(&packed, &nu);
            for k in 0..6 {
                let h = 1e-6 * Vec6::ith(k, 1.0);
                let fd = (quadratic_drag(&packed, &(nu + h)) - quadratic_drag(&packed, &(nu - h)))
                    / 2e-6;
                assert!((fd - d.column(k)).norm() < 1e-8 * d.norm());
            }
            assert_eq!(
                quadratic_drag_derivative(&packed, &Vec6::zeros()),
                Mat6::zeros()
            );
        }
    }
}
