//! Moments of charges about a centre, and moved to another.

use super::{Arithmetic, Table};

/// The monomials aᵏ/k!, moments of a unit charge at `a` from the centre.
#[inline(always)]
pub fn monomials<T: Arithmetic>(table: &Table, a: &[T; 3], out: &mut [T]) {
    out[0] = T::constant(1.0);
    for (k, lower) in table
        .monomial
        .iter()
        .enumerate()
        .take(table.moments())
        .skip(1)
    {
        out[k] = out[lower.at] * a[lower.axis] * lower.factor;
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
    for (l, lower) in local.iter().zip(&table.lower) {
        for (out, lower) in out.iter_mut().zip(lower) {
            if let Some(at) = lower {
                *out += *l * monomials[*at as usize];
            }
        }
    }
    out
}

/// Adds moments about a centre to those about another, from which it is a shift with these `monomials` away.
pub fn shift<T: Arithmetic>(table: &Table, monomials: &[T], from: &[T], out: &mut [T]) {
    // M'ₖ₊ₗ += Mₖ sˡ/l!
    for (k, m) in from.iter().enumerate() {
        for (s, at) in monomials.iter().zip(table.sums(k)) {
            out[*at as usize] += *m * *s;
        }
    }
}

/// Transpose of [`shift`] in the moments: adds coefficients about the other centre, `bar`, to those about the first.
pub fn shift_back<T: Arithmetic>(table: &Table, monomials: &[T], bar: &[T], out: &mut [T]) {
    for (k, out) in out.iter_mut().enumerate() {
        for (s, at) in monomials.iter().zip(table.sums(k)) {
            *out += bar[*at as usize] * *s;
        }
    }
}

/// The gradient in the shift of the moments' product with `bar`.
pub fn shift_gradient<T: Arithmetic>(
    table: &Table,
    monomials: &[T],
    from: &[T],
    bar: &[T],
) -> [T; 3] {
    // The product is Σₗ cₗ sˡ/l!.
    let mut local = vec![T::constant(0.0); from.len()];
    for (k, m) in from.iter().enumerate() {
        for (c, at) in local.iter_mut().zip(table.sums(k)) {
            *c += *m * bar[*at as usize];
        }
    }
    potential_gradient(table, monomials, &local)
}
