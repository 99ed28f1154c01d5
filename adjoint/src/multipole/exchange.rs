//! Two clouds of charges, far from each other, by their moments.
//!
//! With moments `Mᵏ = Σ α aᵏ/k!` of one cloud about its centre, Nˡ of another, and R from the other's centre to the first's,
//!
//! ```text
//! Σᵢⱼ αᵢ βⱼ / |xᵢ − yⱼ| = Σ_{|k|+|l| ≤ p} Mᵏ (−1)^|l| Nˡ ∂ᵏ⁺ˡ (1/R)
//! ```
//!
//! up to terms of the degree p + 1 in (size of the clouds)/R. The sum over whole degrees turns and moves with the clouds.

use super::{Arithmetic, Table};

/// The derivatives of 1/|R|, by multi-index, up to the degree of the moments or `one_more`.
#[inline(always)]
pub fn derivatives<T: Arithmetic>(table: &Table, r: &[T; 3], one_more: bool, out: &mut [T]) {
    let square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
    let inverse = square.inverse();
    out[0] = inverse.root();
    for n in 1..table.derivatives(one_more) {
        let mut sum = T::constant(0.0);
        for lower in table.once(n) {
            sum += out[lower.at] * (r[lower.axis] * lower.factor);
        }
        for lower in table.twice(n) {
            sum += out[lower.at] * lower.factor;
        }
        out[n] = sum * inverse;
    }
}

/// Moments with the signs (−1)^|l|, as those of the cloud that R comes from stand in the sum.
#[inline(always)]
pub fn signed<T: Arithmetic>(table: &Table, moments: &[T], out: &mut [T]) {
    for ((out, m), sign) in out.iter_mut().zip(moments).zip(&table.sign) {
        *out = *m * *sign;
    }
}

/// What each cloud's moments see of the other: adds `weight` times the coefficients of the potentials to `seen`, of both; those of n
/// without the signs that n itself comes with ([`signed`]).
#[inline(always)]
pub fn see<T: Arithmetic>(
    table: &Table,
    d: &[T],
    weight: T,
    [m, n]: [&[T]; 2],
    [seen_m, seen_n]: [&mut [T]; 2],
) {
    for (k, (m, seen_m)) in m.iter().zip(seen_m.iter_mut()).enumerate() {
        let (own, mut sum) = (*m * weight, T::constant(0.0));
        for ((n, seen), at) in n.iter().zip(seen_n.iter_mut()).zip(table.sums(k)) {
            let d = d[*at as usize];
            sum += *n * d;
            *seen += own * d;
        }
        *seen_m += sum * weight;
    }
}

/// The energy of two clouds and its gradient in R, from derivatives to one more degree; `both` is room for as many numbers as there are moments.
#[inline(always)]
pub fn energy<T: Arithmetic>(
    table: &Table,
    d: &[T],
    [m, n]: [&[T]; 2],
    both: &mut [T],
) -> (T, [T; 3]) {
    both.fill(T::constant(0.0));
    for (k, m) in m.iter().enumerate() {
        for (n, at) in n.iter().zip(table.sums(k)) {
            both[*at as usize] += *m * *n;
        }
    }
    let (mut energy, mut slope) = (T::constant(0.0), [T::constant(0.0); 3]);
    for ((c, d_own), higher) in both.iter().zip(d.iter()).zip(&table.higher) {
        energy += *c * *d_own;
        for (slope, at) in slope.iter_mut().zip(higher) {
            *slope += *c * d[*at as usize];
        }
    }
    (energy, slope)
}
