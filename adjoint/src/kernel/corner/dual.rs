//! A number with its tangent, over any lanes: formulas that are written once for numbers carry one along.

use crate::kernel::lane::{Lane, V3};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// `value + tangent ε`, ε² = 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dual<T> {
    value: T,
    pub tangent: T,
}

/// A vector from its value and tangent.
#[inline(always)]
pub(super) fn dual<T: Lane>(value: V3<T>, tangent: V3<T>) -> V3<Dual<T>> {
    let of = [
        (value[0], tangent[0]),
        (value[1], tangent[1]),
        (value[2], tangent[2]),
    ];
    let [(a, da), (b, db), (c, dc)] = of;
    [Dual::new(a, da), Dual::new(b, db), Dual::new(c, dc)]
}

impl<T: Lane> Dual<T> {
    #[inline(always)]
    fn new(value: T, tangent: T) -> Self {
        Self { value, tangent }
    }
}

impl<T: Lane> Add for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self::new(self.value + b.value, self.tangent + b.tangent)
    }
}

impl<T: Lane> Sub for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self::new(self.value - b.value, self.tangent - b.tangent)
    }
}

impl<T: Lane> Mul for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        let tangent = self.tangent.mul_add(b.value, self.value * b.tangent);
        Self::new(self.value * b.value, tangent)
    }
}

impl<T: Lane> Div for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        let value = self.value / b.value;
        Self::new(value, value.neg_mul_add(b.tangent, self.tangent) / b.value)
    }
}

impl<T: Lane> Neg for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.value, -self.tangent)
    }
}

impl<T: Lane> Lane for Dual<T> {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self::new(self.value.like(value), self.value.like(0.0))
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        let tangent = self.value.mul_add(b.tangent, c.tangent);
        Self::new(
            self.value.mul_add(b.value, c.value),
            self.tangent.mul_add(b.value, tangent),
        )
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        let tangent = self.value.neg_mul_add(b.tangent, c.tangent);
        Self::new(
            self.value.neg_mul_add(b.value, c.value),
            self.tangent.neg_mul_add(b.value, tangent),
        )
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        Self::new(root, self.tangent / (root + root))
    }
    #[inline(always)]
    fn artanh(self) -> Self {
        let rest = self.value.neg_mul_add(self.value, self.value.like(1.0));
        Self::new(self.value.artanh(), self.tangent / rest)
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let square = x.value.mul_add(x.value, self.value * self.value);
        let turned = self.value.neg_mul_add(x.tangent, x.value * self.tangent);
        Self::new(self.value.atan2(x.value), turned / square)
    }
    /// The tangent isn't cut off: what it is asked for, the weight of a blend, has none at either end.
    #[inline(always)]
    fn clamp_unit(self) -> Self {
        Self::new(self.value.clamp_unit(), self.tangent)
    }
    /// Nor here, where that blend is all of one form.
    #[inline(always)]
    fn at_least(self, bound: f64) -> Self {
        Self::new(self.value.at_least(bound), self.tangent)
    }
    #[inline(always)]
    fn any_below(self, bound: f64) -> bool {
        self.value.any_below(bound)
    }
}
