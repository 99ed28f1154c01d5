//! Moments of charges about a centre, and moved to another.

use super::exchange::{extend, fold};
use super::{Arithmetic, Table};

/// The moments of a unit charge at `a` from the centre: the monomials aᵏ/k!, those with z above one told by the others.
#[inline(always)]
pub fn monomials<T: Arithmetic>(table: &Table, a: &[T; 3], out: &mut [T]) {
    out[0] = T::constant(1.0);
    for k in 1..table.moments() {
        let mut sum = T::constant(0.0);
        for lower in table.monomial.of(k) {
            sum += out[lower.at] * a[lower.axis] * lower.factor;
        }
        out[k] = sum * table.inverse[k];
    }
}

/// Adds the moments Σ α aᵏ/k! of a charge whose monomials these are.
#[inline(always)]
pub fn add_moments<T: Arithmetic>(monomials: &[T], charge: T, out: &mut [T]) {
    for (out, m) in out.iter_mut().zip(monomials) {
        *out += *m * charge;
    }
}

/// The potential at a place with these monomials, from the coefficients about the centre.
#[inline(always)]
pub fn potential<T: Arithmetic>(monomials: &[T], local: &[T]) -> T {
    let each = monomials.iter().zip(local);
    each.fold(T::constant(0.0), |sum, (m, l)| sum + *m * *l)
}

/// Its gradient in the place.
#[inline(always)]
pub fn potential_gradient<T: Arithmetic>(table: &Table, monomials: &[T], local: &[T]) -> [T; 3] {
    let mut out = [T::constant(0.0); 3];
    for (k, l) in local.iter().enumerate() {
        for lower in table.monomial.of(k) {
            out[lower.axis] += *l * monomials[lower.at] * lower.factor;
        }
    }
    out
}

/// Adds moments about a centre to those about another, from which it is a shift with these `monomials` away; `room` is for as many numbers as
/// there are derivatives.
#[inline(always)]
pub fn shift<T: Arithmetic>(
    table: &Table,
    monomials: &[T],
    from: &[T],
    out: &mut [T],
    room: &mut [T],
) {
    // M'ₖ₊ₗ += Mₖ sˡ/l!
    room.fill(T::constant(0.0));
    for degree in 0..=table.degree() {
        let (range, sums) = table.sums(degree);
        for (m, sums) in from[range].iter().zip(sums) {
            for (s, at) in monomials.iter().zip(sums) {
                room[*at as usize] += *m * *s;
            }
        }
    }
    fold(table, table.degree(), room);
    for (out, x) in out.iter_mut().zip(room) {
        *out += *x;
    }
}

/// Transpose of [`shift`] in the moments: adds coefficients about the other centre, `bar`, to those about the first.
#[inline(always)]
pub fn shift_back<T: Arithmetic>(
    table: &Table,
    monomials: &[T],
    bar: &[T],
    out: &mut [T],
    room: &mut [T],
) {
    room[..bar.len()].copy_from_slice(bar);
    extend(table, table.degree(), room);
    for degree in 0..=table.degree() {
        let (range, sums) = table.sums(degree);
        for (out, sums) in out[range].iter_mut().zip(sums) {
            let mut sum = *out;
            for (s, at) in monomials.iter().zip(sums) {
                sum += room[*at as usize] * *s;
            }
            *out = sum;
        }
    }
}

/// The gradient in the shift of the moments' product with `bar`.
#[inline(always)]
pub fn shift_gradient<T: Arithmetic>(
    table: &Table,
    monomials: &[T],
    from: &[T],
    bar: &[T],
    room: &mut [T],
) -> [T; 3] {
    room[..bar.len()].copy_from_slice(bar);
    extend(table, table.degree(), room);
    // The product is Σₗ cₗ sˡ/l!.
    let mut local = vec![T::constant(0.0); from.len()];
    for degree in 0..=table.degree() {
        let (range, sums) = table.sums(degree);
        for (m, sums) in from[range].iter().zip(sums) {
            for (c, at) in local.iter_mut().zip(sums) {
                *c += *m * room[*at as usize];
            }
        }
    }
    potential_gradient(table, monomials, &local)
}
