//! Two clouds of charges, far from each other, by their moments.
//!
//! With moments `Mᵏ = Σ α aᵏ/k!` of one cloud about its centre, Nˡ of another, and R from the other's centre to the first's,
//!
//! ```text
//! Σᵢⱼ αᵢ βⱼ / |xᵢ − yⱼ| = Σ_{|k|, |l| ≥ 1, |k|+|l| ≤ p} Mᵏ (−1)^|l| Nˡ ∂ᵏ⁺ˡ (1/R)
//! ```
//!
//! for clouds whose charges add up to nothing, up to terms of the degree p + 1 in (size of the clouds)/R. The sum over whole degrees turns and moves with the clouds. As 1/R is harmonic, moments with z above
//! one are told by others ([`Table`]).

use super::{Arithmetic, Table};

/// The derivatives of 1/|R|, by multi-index, up to the degree of the moments or `one_more`.
#[inline(always)]
pub fn derivatives<T: Arithmetic>(table: &Table, r: &[T; 3], one_more: bool, out: &mut [T]) {
    let square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
    let inverse = square.inverse();
    out[0] = inverse.root();
    let degree = table.degree() + usize::from(one_more);
    for (n, at) in table.derived(one_more).skip(1) {
        let mut sum = T::constant(0.0);
        for lower in table.once.of(n) {
            sum += out[lower.at] * (r[lower.axis] * lower.factor);
        }
        for lower in table.twice.of(n) {
            sum += out[lower.at] * lower.factor;
        }
        out[at] = sum * inverse;
    }
    extend(table, degree, out);
}

/// All derivatives that products of moments need, as [`derivatives`] gives them, from the first [`Table::kept`] of them; `out` has room for [`Table::derivatives`].
#[inline(always)]
pub fn unfold<T: Arithmetic>(table: &Table, kept: &[T], out: &mut [T]) {
    out[..kept.len()].copy_from_slice(kept);
    extend(table, table.degree(), out);
}

/// Of what is harmonic, the indices with z = 2 from the others.
#[inline(always)]
pub(super) fn extend<T: Arithmetic>(table: &Table, degree: usize, out: &mut [T]) {
    for (at, [a, b]) in table.folds(degree) {
        out[at] = -(out[a] + out[b]);
    }
}

/// Transpose of [`extend`]: what stands at z = 2 goes to the others.
#[inline(always)]
pub(super) fn fold<T: Arithmetic>(table: &Table, degree: usize, out: &mut [T]) {
    for (at, [a, b]) in table.folds(degree) {
        let x = -out[at];
        out[a] += x;
        out[b] += x;
    }
}

/// Moments with the signs (−1)^|l|, as those of the cloud that R comes from stand in the sum.
#[inline(always)]
pub fn signed<T: Arithmetic>(table: &Table, moments: &[T], out: &mut [T]) {
    for ((out, m), sign) in out.iter_mut().zip(moments).zip(&table.sign) {
        *out = *m * *sign;
    }
}

/// What each cloud's moments see of the other, by all derivatives that products of moments need: adds `weight` times the coefficients of the potentials to `seen`, of both; those of n
/// without the signs that n itself comes with ([`signed`]).
#[inline(always)]
pub fn see<T: Arithmetic>(
    table: &Table,
    d: &[T],
    weight: T,
    [m, n]: [&[T]; 2],
    [seen_m, seen_n]: [&mut [T]; 2],
) {
    for degree in table.degrees() {
        let (range, mut sums) = table.sums(degree);
        let (m, seen_m) = (&m[range.clone()], &mut seen_m[range]);
        // Two at once: what n is and sees is loaded and stored half as often.
        let (mut own, mut seen) = (m.chunks_exact(2), seen_m.chunks_exact_mut(2));
        for (m, seen_m) in (&mut own).zip(&mut seen) {
            let (Some(first), Some(second)) = (sums.next(), sums.next()) else {
                return;
            };
            let (own, mut sum) = ([m[0] * weight, m[1] * weight], [T::constant(0.0); 2]);
            let each = n[1..].iter().zip(&mut seen_n[1..]);
            for ((n, seen), (i, j)) in each.zip(first.iter().zip(second)) {
                let d = [d[*i as usize], d[*j as usize]];
                sum[0] += *n * d[0];
                sum[1] += *n * d[1];
                *seen += own[0] * d[0] + own[1] * d[1];
            }
            seen_m[0] += sum[0] * weight;
            seen_m[1] += sum[1] * weight;
        }
        let last = own.remainder().iter().zip(seen.into_remainder());
        for ((m, seen_m), at) in last.zip(sums) {
            let (own, mut sum) = (*m * weight, T::constant(0.0));
            for ((n, seen), at) in n[1..].iter().zip(&mut seen_n[1..]).zip(at) {
                let d = d[*at as usize];
                sum += *n * d;
                *seen += own * d;
            }
            *seen_m += sum * weight;
        }
    }
}

/// The energy of two clouds and its gradient in R, from derivatives to one more degree; `both` is room for as many numbers as derivatives.
#[inline(always)]
pub fn energy<T: Arithmetic>(
    table: &Table,
    d: &[T],
    [m, n]: [&[T]; 2],
    both: &mut [T],
) -> (T, [T; 3]) {
    both.fill(T::constant(0.0));
    for degree in table.degrees() {
        let (range, sums) = table.sums(degree);
        for (m, sums) in m[range].iter().zip(sums) {
            for (n, at) in n[1..].iter().zip(sums) {
                both[*at as usize] += *m * *n;
            }
        }
    }
    fold(table, table.degree(), both);
    let (mut energy, mut slope) = (T::constant(0.0), [T::constant(0.0); 3]);
    for ((c, d_own), higher) in both.iter().zip(d.iter()).zip(&table.higher) {
        energy += *c * *d_own;
        for (slope, at) in slope.iter_mut().zip(higher) {
            *slope += *c * d[*at as usize];
        }
    }
    (energy, slope)
}

#[cfg(test)]
mod tests {
    use super::super::MOST;
    use super::*;

    #[test]
    fn kept_derivatives_tell_all() {
        for degree in 2..=MOST {
            let table = Table::new(degree);
            let mut all = vec![0.0; table.derivatives()];
            derivatives(&table, &[0.7, -1.1, 0.4], false, &mut all);
            let mut told = vec![0.0; table.derivatives()];
            unfold(&table, &all[..table.kept()], &mut told);
            assert_eq!(told, all, "{degree}");
        }
    }
}
