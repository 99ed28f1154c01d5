//! The numbers kernels compute with: one `f64`, a vector of them, or a dual number in tests.

use pulp::Simd;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number or a vector of numbers treated element by element.
pub(crate) trait Lane:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The constant `value`, in as many lanes as `self`.
    fn like(self, value: f64) -> Self;
    /// `self · b + c`.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// `c − self · b`.
    fn neg_mul_add(self, b: Self, c: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Inverse hyperbolic tangent, of numbers from 0 to 1; from 1 − `f64::EPSILON` on that of this.
    fn artanh(self) -> Self;
    /// Angle of the point (x, y) = (`x`, `self`), in (−π, π].
    fn atan2(self, x: Self) -> Self;
    /// The nearest number from 0 to 1.
    fn clamp_unit(self) -> Self;
    /// The number, or `bound` where it is below that.
    fn at_least(self, bound: f64) -> Self;
    /// Whether a number in any lane is below `bound`.
    fn any_below(self, bound: f64) -> bool;
}

impl Lane for f64 {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        // Not fused: without the instruction `f64::mul_add` is a library call.
        self * b + c
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        c - self * b
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn artanh(self) -> Self {
        f64::atanh(self.min(1.0 - f64::EPSILON))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }
    #[inline(always)]
    fn clamp_unit(self) -> Self {
        self.clamp(0.0, 1.0)
    }
    #[inline(always)]
    fn at_least(self, bound: f64) -> Self {
        self.max(bound)
    }
    #[inline(always)]
    fn any_below(self, bound: f64) -> bool {
        self < bound
    }
}

/// A vector register, together with the permission to use its instructions.
///
/// Everything that touches it must be inlined into the function that `pulp` compiled for the
/// processor found at run time, hence `inline(always)` throughout and no closures.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes<S: Simd> {
    simd: S,
    /// The register.
    pub v: S::f64s,
}

impl<S: Simd> Lanes<S> {
    /// From a register.
    #[inline(always)]
    pub fn new(simd: S, v: S::f64s) -> Self {
        Self { simd, v }
    }

    /// The same number in every lane.
    #[inline(always)]
    pub fn splat(simd: S, value: f64) -> Self {
        Self::new(simd, simd.splat_f64s(value))
    }
}

impl<S: Simd> Add for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self::new(self.simd, self.simd.add_f64s(self.v, b.v))
    }
}

impl<S: Simd> Sub for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self::new(self.simd, self.simd.sub_f64s(self.v, b.v))
    }
}

impl<S: Simd> Mul for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self::new(self.simd, self.simd.mul_f64s(self.v, b.v))
    }
}

impl<S: Simd> Div for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        Self::new(self.simd, self.simd.div_f64s(self.v, b.v))
    }
}

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(self.simd, self.simd.neg_f64s(self.v))
    }
}

/// `(atan t / t − 1)/t²` as a polynomial in `t²`, for `|t| ≤ tan π/8`: interpolation at Chebyshev
/// nodes, relative error of the arctangent 8e-18.
const ATAN: [f64; 11] = [
    -0.3333333333333333,
    0.19999999999995513,
    -0.1428571428466518,
    0.11111111015146714,
    -0.0909090457366906,
    0.07692183087342026,
    -0.06664509989818045,
    0.058581362519061465,
    -0.05085383488842831,
    0.03922974453661223,
    -0.019174543572021332,
];

/// Up to here 14 terms of the series of artanh have all digits.
const SERIES: f64 = 0.25;

/// tan π/8.
const TAN_PI_8: f64 = std::f64::consts::SQRT_2 - 1.0;

impl<S: Simd> Lane for Lanes<S> {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self::splat(self.simd, value)
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self::new(self.simd, self.simd.mul_add_e_f64s(self.v, b.v, c.v))
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Self::new(self.simd, self.simd.negate_mul_add_e_f64s(self.v, b.v, c.v))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::new(self.simd, self.simd.sqrt_f64s(self.v))
    }
    /// The series where all numbers are small, which the edges of distant triangles are; else one number after the other.
    #[inline(always)]
    fn artanh(self) -> Self {
        let simd = self.simd;
        let mut numbers = [self.v];
        let numbers: &mut [f64] = pulp::bytemuck::cast_slice_mut(&mut numbers);
        let mut small = true;
        for t in numbers.iter() {
            small &= *t <= SERIES;
        }
        if small {
            let u = self * self;
            let mut sum = self.like(1.0 / 27.0);
            for k in (0..13).rev() {
                sum = sum.mul_add(u, self.like(1.0 / f64::from(2 * k + 1)));
            }
            return self * sum;
        }
        for t in numbers.iter_mut() {
            *t = t.artanh();
        }
        Self::new(simd, S::as_simd_f64s(numbers).0[0])
    }
    /// One division: the quotient of the smaller by the larger, rotated by π/4 where it is large, then a
    /// polynomial. Relative error about 2e-16, also for a tiny `self` and for `x ≤ 0`.
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
        let simd = self.simd;
        let ax = Self::new(simd, simd.abs_f64s(x.v));
        let ay = Self::new(simd, simd.abs_f64s(self.v));
        let small = Self::new(simd, simd.min_f64s(ax.v, ay.v));
        let large = Self::new(simd, simd.max_f64s(ax.v, ay.v));
        // atan q = π/4 + atan((q − 1)/(q + 1))
        let rotated = simd.greater_than_f64s(small.v, (large * self.like(TAN_PI_8)).v);
        let above = simd.select_f64s(rotated, (small - large).v, small.v);
        let below = simd.select_f64s(rotated, (small + large).v, large.v);
        let t = Self::new(simd, simd.div_f64s(above, below));
        let u = t * t;
        let mut p = self.like(ATAN[10]);
        p = p.mul_add(u, self.like(ATAN[9]));
        p = p.mul_add(u, self.like(ATAN[8]));
        p = p.mul_add(u, self.like(ATAN[7]));
        p = p.mul_add(u, self.like(ATAN[6]));
        p = p.mul_add(u, self.like(ATAN[5]));
        p = p.mul_add(u, self.like(ATAN[4]));
        p = p.mul_add(u, self.like(ATAN[3]));
        p = p.mul_add(u, self.like(ATAN[2]));
        p = p.mul_add(u, self.like(ATAN[1]));
        p = p.mul_add(u, self.like(ATAN[0]));
        let mut angle = p.mul_add(t * u, t);
        let back = (angle + self.like(FRAC_PI_4)).v;
        angle = Self::new(simd, simd.select_f64s(rotated, back, angle.v));
        let steep = simd.greater_than_f64s(ay.v, ax.v);
        let back = (self.like(FRAC_PI_2) - angle).v;
        angle = Self::new(simd, simd.select_f64s(steep, back, angle.v));
        let behind = simd.less_than_f64s(x.v, self.like(0.0).v);
        let back = (self.like(PI) - angle).v;
        angle = Self::new(simd, simd.select_f64s(behind, back, angle.v));
        // The sign of y; the angle is positive here.
        let sign = simd.and_f64s(self.v, self.like(-0.0).v);
        Self::new(simd, simd.or_f64s(angle.v, sign))
    }
    #[inline(always)]
    fn clamp_unit(self) -> Self {
        let simd = self.simd;
        let above = simd.max_f64s(self.v, self.like(0.0).v);
        Self::new(simd, simd.min_f64s(above, self.like(1.0).v))
    }
    #[inline(always)]
    fn at_least(self, bound: f64) -> Self {
        let simd = self.simd;
        Self::new(simd, simd.max_f64s(self.v, self.like(bound).v))
    }
    #[inline(always)]
    fn any_below(self, bound: f64) -> bool {
        let below = self.simd.less_than_f64s(self.v, self.like(bound).v);
        self.simd.first_true_m64s(below) < S::F64_LANES
    }
}

/// Three components.
pub(crate) type V3<T> = [T; 3];

/// `a − b`.
#[inline(always)]
pub(crate) fn sub<T: Lane>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a · b`.
#[inline(always)]
pub(crate) fn dot<T: Lane>(a: V3<T>, b: V3<T>) -> T {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

/// `a × b`.
#[inline(always)]
pub(crate) fn cross<T: Lane>(a: V3<T>, b: V3<T>) -> V3<T> {
    [
        a[2].neg_mul_add(b[1], a[1] * b[2]),
        a[0].neg_mul_add(b[2], a[2] * b[0]),
        a[1].neg_mul_add(b[0], a[0] * b[1]),
    ]
}

/// `c a`.
#[inline(always)]
pub(crate) fn scale<T: Lane>(c: T, a: V3<T>) -> V3<T> {
    [c * a[0], c * a[1], c * a[2]]
}

/// `c a + b`.
#[inline(always)]
pub(crate) fn scale_add<T: Lane>(c: T, a: V3<T>, b: V3<T>) -> V3<T> {
    [
        c.mul_add(a[0], b[0]),
        c.mul_add(a[1], b[1]),
        c.mul_add(a[2], b[2]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arctangent_is_right_to_round_off_in_all_quadrants() {
        let simd = pulp::Scalar;
        let mut worst: f64 = 0.0;
        for i in 0..4000 {
            let size = 10_f64.powf(-14.0 + 0.007 * f64::from(i));
            for (y, x) in [(size, 1.0), (size, -1.0), (-size, 1.0), (-size, -1.0)] {
                let lanes = Lanes::splat(simd, y).atan2(Lanes::splat(simd, x)).v;
                worst = worst.max((lanes / y.atan2(x) - 1.0).abs());
            }
        }
        assert!(worst < 5e-16, "{worst:e}");
    }
}
