//! The numbers that sums are made of: plain ones and those that carry a derivative, one at a time or eight side by side.

use num_dual::{Dual64, DualNum};
use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// Numbers side by side.
pub const WIDTH: usize = 8;

/// Whether 1/√x may begin in single precision. By the bits, which are in the order of the numbers: without a branch, which would take vectors apart.
#[inline(always)]
fn usable(x: f32) -> bool {
    const LOW: u32 = 1e-37_f32.to_bits();
    const HIGH: u32 = 1e37_f32.to_bits();
    x.to_bits().wrapping_sub(LOW) <= HIGH - LOW
}

/// 1/√x from single precision by two of Newton's steps: less than half of a root and a quotient.
#[inline(always)]
fn by_newton(x: f64) -> f64 {
    let half = 0.5 * x;
    let mut y = f64::from(1.0 / (x as f32).sqrt());
    y *= 1.5 - half * y * y;
    y *= 1.5 - half * y * y;
    y
}

/// What sums need of numbers.
pub trait Arithmetic:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Mul<f64, Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// A constant.
    fn constant(x: f64) -> Self;
    /// 1/x.
    fn inverse(self) -> Self;
    /// √x.
    fn root(self) -> Self;
    /// 1/√x of what is squares of lengths: to the last digit or two between 1e-37 and 1e37.
    fn inverse_root(self) -> Self {
        self.root().inverse()
    }
}

/// A number of its own.
pub trait Number: Arithmetic + PartialEq + Send + Sync {
    /// Several side by side.
    type Pack: Arithmetic;
    /// From the first of a list on, the last of them again where there are fewer.
    fn pack(from: &[Self]) -> Self::Pack;
    /// One of several.
    fn lane(pack: &Self::Pack, i: usize) -> Self;
    /// The sum of several.
    fn sum(pack: &Self::Pack) -> Self;
    /// Without the derivative.
    fn value(self) -> f64;
    /// xⁿ.
    fn power(self, n: i32) -> Self;
    /// The inverse distances of a point from others, given by their coordinates, if these numbers have loops of their own for them.
    fn inverse_distances(_from: &[Self; 3], _to: [&[Self]; 3], _out: &mut [Self]) -> bool {
        false
    }
}

/// Plain numbers side by side.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Pack([f64; WIDTH]);

/// Numbers with their derivatives side by side.
#[derive(Clone, Copy, Debug)]
pub struct DualPack {
    value: Pack,
    rate: Pack,
}

impl Arithmetic for f64 {
    #[inline(always)]
    fn constant(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn inverse(self) -> Self {
        1.0 / self
    }
    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }
}

impl Number for f64 {
    type Pack = Pack;
    #[inline(always)]
    fn pack(from: &[f64]) -> Pack {
        if let Some(first) = from.first_chunk::<WIDTH>() {
            return Pack(*first);
        }
        let last = from.last().copied().unwrap_or(0.0);
        let mut out = [last; WIDTH];
        out[..from.len()].copy_from_slice(from);
        Pack(out)
    }
    #[inline(always)]
    fn lane(pack: &Pack, i: usize) -> f64 {
        pack.0[i]
    }
    #[inline(always)]
    fn sum(pack: &Pack) -> f64 {
        let [a, b, c, d, e, f, g, h] = pack.0;
        ((a + b) + (c + d)) + ((e + f) + (g + h))
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
    fn power(self, n: i32) -> f64 {
        self.powi(n)
    }
    #[inline(always)]
    fn inverse_distances(from: &[f64; 3], [x, y, z]: [&[f64]; 3], out: &mut [f64]) -> bool {
        for (((out, x), y), z) in out.iter_mut().zip(x).zip(y).zip(z) {
            let way = [from[0] - x, from[1] - y, from[2] - z];
            *out = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
        }
        let mut outside = 0;
        for x in out.iter() {
            outside |= u32::from(!usable(*x as f32));
        }
        match outside {
            0 => out.iter_mut().for_each(|x| *x = by_newton(*x)),
            _ => out.iter_mut().for_each(|x| *x = 1.0 / x.sqrt()),
        }
        true
    }
}

impl Arithmetic for Dual64 {
    #[inline(always)]
    fn constant(x: f64) -> Self {
        Dual64::from(x)
    }
    #[inline(always)]
    fn inverse(self) -> Self {
        DualNum::recip(&self)
    }
    #[inline(always)]
    fn root(self) -> Self {
        DualNum::sqrt(&self)
    }
}

impl Number for Dual64 {
    type Pack = DualPack;
    #[inline(always)]
    fn pack(from: &[Dual64]) -> DualPack {
        let last = from.last().copied().unwrap_or(Dual64::from(0.0));
        let at = |i: usize| from.get(i).copied().unwrap_or(last);
        let (mut value, mut rate) = ([0.0; WIDTH], [0.0; WIDTH]);
        for i in 0..WIDTH {
            let x = at(i);
            (value[i], rate[i]) = (x.re, x.eps);
        }
        DualPack {
            value: Pack(value),
            rate: Pack(rate),
        }
    }
    #[inline(always)]
    fn lane(pack: &DualPack, i: usize) -> Dual64 {
        Dual64::new(pack.value.0[i], pack.rate.0[i])
    }
    #[inline(always)]
    fn sum(pack: &DualPack) -> Dual64 {
        Dual64::new(f64::sum(&pack.value), f64::sum(&pack.rate))
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self.re
    }
    fn power(self, n: i32) -> Dual64 {
        DualNum::powi(&self, n)
    }
}

impl Pack {
    #[inline(always)]
    fn each(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = self.0;
        for (x, y) in out.iter_mut().zip(&other.0) {
            *x = f(*x, *y);
        }
        Self(out)
    }
}

impl Add for Pack {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.each(other, |x, y| x + y)
    }
}

impl Sub for Pack {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.each(other, |x, y| x - y)
    }
}

impl Mul for Pack {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.each(other, |x, y| x * y)
    }
}

impl Mul<f64> for Pack {
    type Output = Self;
    #[inline(always)]
    fn mul(self, y: f64) -> Self {
        Self(self.0.map(|x| x * y))
    }
}

impl Neg for Pack {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|x| -x))
    }
}

impl AddAssign for Pack {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Arithmetic for Pack {
    #[inline(always)]
    fn constant(x: f64) -> Self {
        Self([x; WIDTH])
    }
    #[inline(always)]
    fn inverse(self) -> Self {
        Self(self.0.map(|x| 1.0 / x))
    }
    #[inline(always)]
    fn root(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }
    #[inline(always)]
    fn inverse_root(self) -> Self {
        let mut outside = 0;
        for x in &self.0 {
            outside |= u32::from(!usable(*x as f32));
        }
        match outside {
            0 => Self(self.0.map(by_newton)),
            _ => self.root().inverse(),
        }
    }
}

impl Add for DualPack {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            rate: self.rate + other.rate,
        }
    }
}

impl Sub for DualPack {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            value: self.value - other.value,
            rate: self.rate - other.rate,
        }
    }
}

impl Mul for DualPack {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            rate: self.value * other.rate + self.rate * other.value,
        }
    }
}

impl Mul<f64> for DualPack {
    type Output = Self;
    #[inline(always)]
    fn mul(self, y: f64) -> Self {
        Self {
            value: self.value * y,
            rate: self.rate * y,
        }
    }
}

impl Neg for DualPack {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            value: -self.value,
            rate: -self.rate,
        }
    }
}

impl AddAssign for DualPack {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Arithmetic for DualPack {
    #[inline(always)]
    fn constant(x: f64) -> Self {
        Self {
            value: Pack::constant(x),
            rate: Pack::constant(0.0),
        }
    }
    #[inline(always)]
    fn inverse(self) -> Self {
        let value = self.value.inverse();
        Self {
            rate: -(self.rate * value * value),
            value,
        }
    }
    #[inline(always)]
    fn root(self) -> Self {
        let value = self.value.root();
        Self {
            rate: self.rate * value.inverse() * 0.5,
            value,
        }
    }
    #[inline(always)]
    fn inverse_root(self) -> Self {
        let value = self.value.inverse_root();
        Self {
            rate: self.rate * (value * value * value) * -0.5,
            value,
        }
    }
}
