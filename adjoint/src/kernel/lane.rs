//! The numbers kernels compute with: one `f64`, a vector of them, or a dual number in tests.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number or a vector of numbers treated element by element.
pub(super) trait Lane:
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
    /// Square root.
    fn sqrt(self) -> Self;
    /// Angle of the point (x, y) = (`x`, `self`), in (−π, π].
    fn atan2(self, x: Self) -> Self;
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
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }
}

/// Three components.
pub(super) type V3<T> = [T; 3];

/// `a − b`.
#[inline(always)]
pub(super) fn sub<T: Lane>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a · b`.
#[inline(always)]
pub(super) fn dot<T: Lane>(a: V3<T>, b: V3<T>) -> T {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

/// `a × b`.
#[inline(always)]
pub(super) fn cross<T: Lane>(a: V3<T>, b: V3<T>) -> V3<T> {
    [
        a[1].mul_add(b[2], -(a[2] * b[1])),
        a[2].mul_add(b[0], -(a[0] * b[2])),
        a[0].mul_add(b[1], -(a[1] * b[0])),
    ]
}

/// `c a`.
#[inline(always)]
pub(super) fn scale<T: Lane>(c: T, a: V3<T>) -> V3<T> {
    [c * a[0], c * a[1], c * a[2]]
}

/// `c a + b`.
#[inline(always)]
pub(super) fn scale_add<T: Lane>(c: T, a: V3<T>, b: V3<T>) -> V3<T> {
    [
        c.mul_add(a[0], b[0]),
        c.mul_add(a[1], b[1]),
        c.mul_add(a[2], b[2]),
    ]
}
