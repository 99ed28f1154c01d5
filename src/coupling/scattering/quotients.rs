//! Whether a symmetric system has a negative eigenvalue, as far as a search for its solution tells.
//!
//! In the directions v₁, v₂, … of a search by GMRES a symmetric A is tridiagonal, αₖ = vₖᵀAvₖ beside βₖ = vₖ₊₁ᵀAvₖ (Lanczos). A negative eigenvalue of a part of it is a quotient xᵀAx/xᵀx of
//! some x, and so proof of one of A. Its factor L D Lᵀ grows by an entry of D a direction, at two sums and no product.

use crate::solver::dot;

/// How far below zero, the identity's being one: levels leave out less.
const NEGATIVE: f64 = 1e-2;
/// Part of the square of an image that may be off from that of its parts; where more is, directions don't follow from each other.
const OFF: f64 = 1e-8;

/// What is known of the directions so far.
#[derive(Default)]
pub(super) struct Quotients {
    last: Option<Last>,
    negative: bool,
}

/// The last direction.
struct Last {
    image: Vec<f64>,
    /// What of the square of its image is left for the next direction: βₖ².
    next: f64,
    /// Entry of D.
    pivot: f64,
}

impl Quotients {
    /// Takes the next direction with its image. Where a search begins anew, so does this; nothing is told of one that isn't of size one.
    pub fn push(&mut self, v: &[f64], image: &[f64]) {
        if self.negative {
            return;
        }
        if (dot(v, v) - 1.0).abs() > OFF {
            self.last = None;
            return;
        }
        let (along, square) = (dot(v, image), dot(image, image));
        let follows = |last: &Last| {
            let beta = dot(v, &last.image);
            let off = (beta * beta - last.next).abs();
            (off <= OFF * dot(&last.image, &last.image)).then_some((beta * beta, last.pivot))
        };
        let (before, pivot) = self.last.as_ref().and_then(follows).unwrap_or((0.0, 1.0));
        let pivot = along + NEGATIVE - before / pivot;
        // Nothing is told of what isn't a number.
        self.negative = pivot <= 0.0;
        self.last = Some(Last {
            image: image.to_vec(),
            next: square - along * along - before,
            pivot,
        });
    }

    /// A number that some quotient is below, if any is known to be below zero.
    pub fn negative(&self) -> Option<f64> {
        self.negative.then_some(-NEGATIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::Quotients;
    use crate::solver::{Columns, gmres};
    use std::cell::RefCell;

    /// What a search tells of a matrix with these eigenvalues, `restart` directions at a time.
    fn told(eigenvalues: &[f64], restart: usize) -> Option<f64> {
        let n = eigenvalues.len();
        let right = Columns::from_fn(n, 1, |i, _| (1.0 + 0.7 * i as f64).sin());
        let found = RefCell::new(Quotients::default());
        let apply = |v: &Columns, _: &[usize]| {
            let image = Columns::from_fn(n, 1, |i, _| eigenvalues[i] * v.at(i, 0));
            found.borrow_mut().push(&v.data, &image.data);
            [v.clone(), image]
        };
        gmres(apply, &right, 1e-10, 300, restart);
        found.into_inner().negative()
    }

    #[test]
    fn a_negative_eigenvalue_is_told_and_no_other() {
        let spread = |least: f64| -> Vec<f64> {
            (0..80)
                .map(|i| {
                    if i == 40 {
                        least
                    } else {
                        0.2 + 0.02 * i as f64
                    }
                })
                .collect()
        };
        for restart in [7, 60] {
            for least in [1e-3, 0.0, -5e-3, 0.3] {
                assert_eq!(told(&spread(least), restart), None, "{least} {restart}");
            }
            for least in [-0.05, -0.5, -3.0] {
                assert!(told(&spread(least), restart).is_some(), "{least} {restart}");
            }
        }
    }
}
