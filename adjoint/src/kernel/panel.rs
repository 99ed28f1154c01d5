//! Layers of flat triangles with constant density, near and far.
//!
//! With `r = s − g` seen from the centroid g and `C` the triangle's second moments about it (mean of `x xᵀ`), a layer is its
//! closed form near the triangle and two terms of its multipole series far from it,
//!
//! ```text
//! ∫ 1/|x − s| dA ≈ A f,   f = 1/r + ½ C:∇∇(1/r),       ∫ n·(x − s)/|x − s|³ dA ≈ A n·∇f
//! K = F + w(τ) (N − F),   τ = (|r|² − a²)/(b² − a²),   w = 1 − τ³ (10 − 15 τ + 6 τ²) within 0 … 1
//! ```
//!
//! N the near form, F the far one, which errs by the octupole, (ρ/r)³ times a few percent; a and b are [`NEAR`] and [`FAR`] times ρ, about the distance of the
//! farthest corner from the centroid ([`radius_squared`]), but smooth in the corners. The blend has two continuous derivatives, and the
//! gradient and Hessian here are those of K, not blends of theirs.

use super::lane::{Lane, V3, dot, scale, scale_add, sub};
use super::sum::length;
use crate::lie::Vec3;

/// Distances from the centroid, in ρ: below the closed form alone,
pub(super) const NEAR: f64 = 5.0;
/// and above the multipoles alone.
pub(super) const FAR: f64 = 7.0;

/// Power of the norm that stands for a maximum.
const POWER: i32 = 8;

/// ρ² of a triangle with its corners seen from its centroid, m²: the 8-norm of the squares of their distances, at least the largest one, and at most 1.15 times it, where all
/// are equal.
pub fn radius_squared(arms: &[Vec3; 3]) -> f64 {
    let squares = arms.map(|a| a.norm_squared());
    let largest = squares.into_iter().fold(0.0, f64::max);
    let sum: f64 = squares.iter().map(|s| (s / largest).powi(POWER)).sum();
    // The eighth root.
    largest * sum.sqrt().sqrt().sqrt()
}

/// Its derivatives with respect to the corners, relative to it: 1/m.
pub(super) fn radius_slopes(arms: &[Vec3; 3]) -> [Vec3; 3] {
    let radius = radius_squared(arms);
    let each = arms.map(|a| 2.0 * (a.norm_squared() / radius).powi(POWER - 1) / radius * a);
    // The centroid moves with all corners.
    let middle = (each[0] + each[1] + each[2]) / 3.0;
    each.map(|e| e - middle)
}

/// What the layers of a triangle need of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Panel {
    pub corners: [Vec3; 3],
    /// Twice the area times the unit normal, m².
    pub double_area: Vec3,
    /// Halved squares of the edges 01, 12, 20, m².
    pub half_squares: Vec3,
    /// Edges 01, 12, 20, m.
    pub along: [Vec3; 3],
    /// Their lengths, m.
    pub lengths: Vec3,
    /// Row weight.
    pub weight: f64,
    /// Unit normal times the weight.
    pub normal: Vec3,
    /// m_ab of the edges times the weight.
    pub outward: [Vec3; 3],
    /// Centroid, m.
    pub centre: Vec3,
    /// m².
    pub area: f64,
    /// Vectors p and q with C = p pᵀ + q qᵀ, m.
    spread: [Vec3; 2],
    /// Trace of C, m².
    trace: f64,
    /// a² and b², m².
    pub reach: [f64; 2],
}

impl Panel {
    /// From corners, counter-clockwise seen from outside, and row weight.
    pub fn new(corners: [Vec3; 3], weight: f64) -> Self {
        let [a, b, c] = corners;
        let along = [b - a, c - b, a - c];
        let double_area = along[0].cross(&(c - a));
        let normal = double_area.normalize();
        let centre = (a + b + c) / 3.0;
        // Σ (v − g)(v − g)ᵀ/12 over the corners, by sum and difference of two edges.
        let spread = [(b - a + (c - a)) / 72_f64.sqrt(), (b - c) / 24_f64.sqrt()];
        let radius = radius_squared(&corners.map(|v| v - centre));
        Self {
            corners,
            double_area,
            half_squares: Vec3::from(along.map(|e| 0.5 * e.norm_squared())),
            along,
            lengths: Vec3::from(along.map(|e| e.norm())),
            weight,
            normal: weight * normal,
            outward: along.map(|e| weight * e.cross(&normal).normalize()),
            centre,
            area: 0.5 * double_area.norm(),
            spread,
            trace: spread[0].norm_squared() + spread[1].norm_squared(),
            reach: [NEAR * NEAR * radius, FAR * FAR * radius],
        }
    }

    /// The corners from `s` with their distances.
    #[inline(always)]
    pub fn seen<T: Lane>(&self, s: V3<T>) -> ([V3<T>; 3], V3<T>) {
        // One by one: closures aren't compiled for the vectors' instructions.
        let [a, b, c] = &self.corners;
        let r = [
            sub(constant(s[0], a), s),
            sub(constant(s[0], b), s),
            sub(constant(s[0], c), s),
        ];
        (r, [length(r[0]), length(r[1]), length(r[2])])
    }

    /// Charge of the single layer.
    #[inline(always)]
    pub fn charge<T: Lane>(&self, far: &Multipoles<T>) -> T {
        far.u.like(self.weight * self.area)
    }

    /// Dipole moment of the double layer.
    #[inline(always)]
    pub fn moment<T: Lane>(&self, far: &Multipoles<T>) -> V3<T> {
        constant(far.u, &(self.area * self.normal))
    }

    /// The moment's part along r, times r.
    #[inline(always)]
    pub fn height<T: Lane>(&self, far: &Multipoles<T>) -> T {
        dot(self.moment(far), far.r)
    }

    #[inline(always)]
    pub fn multipoles<T: Lane>(&self, r: V3<T>, squared: T) -> Multipoles<T> {
        let [p, q] = &self.spread;
        let (p, q) = (constant(squared, p), constant(squared, q));
        let (along_p, along_q) = (dot(p, r), dot(q, r));
        let u = squared.like(1.0) / squared;
        Multipoles {
            r,
            u,
            i: u.sqrt(),
            spread: [p, q],
            along: [along_p, along_q],
            c: along_p.mul_add(along_p, along_q * along_q),
            trace: squared.like(self.trace),
        }
    }
}

/// A constant vector as lanes.
#[inline(always)]
pub(super) fn constant<T: Lane>(x: T, v: &Vec3) -> V3<T> {
    [x.like(v.x), x.like(v.y), x.like(v.z)]
}

/// f and its derivatives: two terms of the potential of a unit charge spread over a triangle.
#[derive(Clone, Copy)]
pub(super) struct Multipoles<T> {
    pub r: V3<T>,
    /// 1/r².
    pub u: T,
    /// 1/r.
    i: T,
    spread: [V3<T>; 2],
    /// p·r and q·r.
    along: [T; 2],
    /// r·C r.
    c: T,
    trace: T,
}

impl<T: Lane> Multipoles<T> {
    /// `a + b T u + e c u²`.
    #[inline(always)]
    fn series(&self, a: f64, b: f64, e: f64) -> T {
        let inner = (self.c * self.u).mul_add(self.u.like(e), self.trace * self.u.like(b));
        inner.mul_add(self.u, self.u.like(a))
    }

    /// C x.
    #[inline(always)]
    fn spread_of(&self, [along_p, along_q]: [T; 2]) -> V3<T> {
        scale_add(along_p, self.spread[0], scale(along_q, self.spread[1]))
    }

    /// f.
    #[inline(always)]
    pub fn value(&self) -> T {
        self.i * self.series(1.0, -0.5, 1.5)
    }

    /// ∂f/∂C x: C moves as the second moments do.
    #[inline(always)]
    pub fn value_spread(&self, x: V3<T>) -> V3<T> {
        let like = |x| self.u.like(x);
        let along = like(1.5) * self.u * dot(self.r, x);
        let out = scale_add(along, self.r, scale(like(-0.5), x));
        scale(self.i * self.u, out)
    }

    /// ∂α/∂C x.
    #[inline(always)]
    pub fn alpha_spread(&self, x: V3<T>) -> V3<T> {
        let like = |x| self.u.like(x);
        let along = like(-7.5) * self.u * dot(self.r, x);
        let out = scale_add(along, self.r, scale(like(1.5), x));
        scale(self.fifth(), out)
    }

    /// α of ∇f = α r + 3 i⁵ C r.
    #[inline(always)]
    pub fn alpha(&self) -> T {
        self.i * self.u * self.series(-1.0, 1.5, -7.5)
    }

    /// β of ∇α = β r − 15 i⁷ C r.
    #[inline(always)]
    fn beta(&self) -> T {
        self.i * self.u * self.u * self.series(3.0, -7.5, 52.5)
    }

    /// i⁵.
    #[inline(always)]
    fn fifth(&self) -> T {
        self.i * self.u * self.u
    }

    /// ∇f.
    #[inline(always)]
    pub fn gradient(&self) -> V3<T> {
        let spread = scale(self.u.like(3.0) * self.fifth(), self.spread_of(self.along));
        scale_add(self.alpha(), self.r, spread)
    }

    /// ∇α.
    #[inline(always)]
    pub fn alpha_gradient(&self) -> V3<T> {
        let seventh = self.fifth() * self.u;
        let spread = scale(self.u.like(-15.0) * seventh, self.spread_of(self.along));
        scale_add(self.beta(), self.r, spread)
    }

    /// p·d and q·d.
    #[inline(always)]
    fn along(&self, d: V3<T>) -> [T; 2] {
        [dot(self.spread[0], d), dot(self.spread[1], d)]
    }

    /// ∇∇f d.
    #[inline(always)]
    pub fn hessian_product(&self, d: V3<T>) -> V3<T> {
        let (fifth, three) = (self.fifth(), self.u.like(3.0));
        let turned = self.u.like(-15.0) * fifth * self.u * dot(self.r, d);
        let mut out = scale(dot(self.alpha_gradient(), d), self.r);
        out = scale_add(self.alpha(), d, out);
        out = scale_add(three * fifth, self.spread_of(self.along(d)), out);
        scale_add(turned, self.spread_of(self.along), out)
    }

    /// ∇∇α d.
    #[inline(always)]
    pub fn alpha_hessian_product(&self, d: V3<T>) -> V3<T> {
        let like = |x| self.u.like(x);
        let seventh = self.fifth() * self.u;
        let ninth = seventh * self.u;
        let along_d = self.along(d);
        let rd = dot(self.r, d);
        let crd = self.along[0].mul_add(along_d[0], self.along[1] * along_d[1]);
        // ∇β·d
        let slope = seventh * self.series(-15.0, 52.5, -472.5) * rd + like(105.0) * ninth * crd;
        let mut out = scale(slope, self.r);
        out = scale_add(self.beta(), d, out);
        out = scale_add(like(-15.0) * seventh, self.spread_of(along_d), out);
        scale_add(like(105.0) * ninth * rd, self.spread_of(self.along), out)
    }
}

/// w and its first two derivatives by |r|².
#[derive(Clone, Copy)]
pub(super) struct Weight<T> {
    pub value: T,
    pub slope: T,
    curvature: T,
}

impl<T: Lane> Weight<T> {
    #[inline(always)]
    pub fn new(squared: T, [near, far]: [f64; 2]) -> Self {
        let like = |x| squared.like(x);
        let rate = 1.0 / (far - near);
        let t = ((squared - like(near)) * like(rate)).clamp_unit();
        let rest = like(1.0) - t;
        let polynomial = t.mul_add(t.mul_add(like(6.0), like(-15.0)), like(10.0));
        Self {
            value: like(1.0) - t * t * t * polynomial,
            slope: like(-30.0 * rate) * t * t * rest * rest,
            curvature: like(-60.0 * rate * rate) * t * rest * (rest - t),
        }
    }
}

/// A layer: both forms, weighted as the row is.
pub(super) trait Layer: Copy + Sync {
    fn near<T: Lane>(panel: &Panel, s: V3<T>) -> T;
    fn near_gradient<T: Lane>(panel: &Panel, s: V3<T>) -> V3<T>;
    fn near_hessian_product<T: Lane>(panel: &Panel, s: V3<T>, d: V3<T>) -> V3<T>;
    fn far<T: Lane>(panel: &Panel, far: &Multipoles<T>) -> T;
    fn far_gradient<T: Lane>(panel: &Panel, far: &Multipoles<T>) -> V3<T>;
    fn far_hessian_product<T: Lane>(panel: &Panel, far: &Multipoles<T>, d: V3<T>) -> V3<T>;
}

impl Panel {
    /// K.
    #[inline(always)]
    pub fn value<L: Layer, T: Lane>(&self, s: V3<T>) -> T {
        let r = sub(s, constant(s[0], &self.centre));
        let squared = dot(r, r);
        if !squared.any_below(self.reach[1]) {
            return L::far(self, &self.multipoles(r, squared));
        }
        let near = L::near(self, s);
        if !(-squared).any_below(-self.reach[0]) {
            return near;
        }
        let far = L::far(self, &self.beyond(r, squared));
        let w = Weight::new(squared, self.reach);
        w.value.mul_add(near - far, far)
    }

    /// What the blend is made of beside the closed form: F grows without bound towards the panel, where lanes that have nothing of it would lose their digits to it.
    #[inline(always)]
    pub(super) fn beyond<T: Lane>(&self, r: V3<T>, squared: T) -> Multipoles<T> {
        self.multipoles(r, squared.at_least(self.reach[0]))
    }

    /// F at any distance.
    #[cfg(test)]
    pub fn far_value<L: Layer>(&self, s: V3<f64>) -> f64 {
        let r = sub(s, constant(0.0, &self.centre));
        L::far(self, &self.multipoles(r, dot(r, r)))
    }

    /// ∇K = ∇F + w ∇D + 2 w' D r, D = N − F.
    #[inline(always)]
    pub fn gradient<L: Layer, T: Lane>(&self, s: V3<T>) -> V3<T> {
        let r = sub(s, constant(s[0], &self.centre));
        let squared = dot(r, r);
        if !squared.any_below(self.reach[1]) {
            return L::far_gradient(self, &self.multipoles(r, squared));
        }
        let near = L::near_gradient(self, s);
        if !(-squared).any_below(-self.reach[0]) {
            return near;
        }
        let multipoles = self.beyond(r, squared);
        let far = L::far_gradient(self, &multipoles);
        let w = Weight::new(squared, self.reach);
        let difference = L::near(self, s) - L::far(self, &multipoles);
        let out = scale_add(w.value, sub(near, far), far);
        scale_add((w.slope + w.slope) * difference, r, out)
    }

    /// ∇∇K d = ∇∇F d + w ∇∇D d + 2 w' {(r·d) ∇D + (∇D·d) r + D d} + 4 w'' (r·d) D r.
    #[inline(always)]
    pub fn hessian_product<L: Layer, T: Lane>(&self, s: V3<T>, d: V3<T>) -> V3<T> {
        let r = sub(s, constant(s[0], &self.centre));
        let squared = dot(r, r);
        if !squared.any_below(self.reach[1]) {
            return L::far_hessian_product(self, &self.multipoles(r, squared), d);
        }
        let near = L::near_hessian_product(self, s, d);
        if !(-squared).any_below(-self.reach[0]) {
            return near;
        }
        let multipoles = self.beyond(r, squared);
        let far = L::far_hessian_product(self, &multipoles, d);
        let w = Weight::new(squared, self.reach);
        let difference = L::near(self, s) - L::far(self, &multipoles);
        let gradient = sub(
            L::near_gradient(self, s),
            L::far_gradient(self, &multipoles),
        );
        let (slope, rd) = (w.slope + w.slope, dot(r, d));
        let bent = w.curvature.like(4.0) * w.curvature * rd * difference;
        let mut out = scale_add(w.value, sub(near, far), far);
        out = scale_add(slope * rd, gradient, out);
        out = scale_add(slope.mul_add(dot(gradient, d), bent), r, out);
        scale_add(slope * difference, d, out)
    }
}
