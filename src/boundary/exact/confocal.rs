//! Confocal ellipsoids: through each point outside an ellipsoid goes one that has the same foci.
//!
//! With a ≥ b ≥ c, A = a² − c², B = b² − c², the surface ℓ has the squares (ℓ + A, ℓ + B, ℓ) of
//! semi-axes; ℓ = c² is the body's. A point of it is known by ℓ and the unit vector
//! X = (x/√(ℓ+A), y/√(ℓ+B), z/√ℓ).

use crate::adjoint::lie::Vec3;
use crate::{Error, Result};

/// The family of one ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Confocal {
    /// The ellipsoid's axes in falling order of length: 0, 1, 2 for x, y, z.
    pub order: [usize; 3],
    /// a ≥ b ≥ c, m.
    pub semi_axes: [f64; 3],
    /// A, B, 0, m².
    pub offsets: [f64; 3],
}

/// Where a point is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// ℓ, m².
    pub level: f64,
    /// X, components along the axes in falling order of length.
    pub direction: Vec3,
}

/// How much of the semi-axes a point may be inside by rounding, as Σ (x/a)².
const ROUNDING: f64 = 1e-9;

impl Confocal {
    pub fn new(semi_axes: [f64; 3]) -> Self {
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &j| semi_axes[j].total_cmp(&semi_axes[i]));
        let sorted = order.map(|i| semi_axes[i]);
        let c = sorted[2];
        Self {
            order,
            semi_axes: sorted,
            offsets: sorted.map(|a| (a - c) * (a + c)),
        }
    }

    /// ℓ of the body's surface.
    pub fn surface(&self) -> f64 {
        self.semi_axes[2] * self.semi_axes[2]
    }

    /// Where `x` (m, axes of the ellipsoid) is; `body` names the body in errors.
    pub fn locate(&self, body: &str, x: &Vec3) -> Result<Place> {
        let sorted = self.order.map(|i| x[i]);
        let inside: f64 = (0..3)
            .map(|i| (sorted[i] / self.semi_axes[i]).powi(2))
            .sum();
        if !inside.is_finite() {
            return Err(Error::input(
                format!("body \"{body}\": point"),
                format!("({}, {}, {})", x.x, x.y, x.z),
                "give finite coordinates in metres",
            ));
        }
        if inside < 1.0 - ROUNDING {
            return Err(Error::input(
                format!("body \"{body}\": point"),
                format!("({:.6e}, {:.6e}, {:.6e}) inside the body", x.x, x.y, x.z),
                "give a point in the water",
            ));
        }
        let level = self.level(&sorted);
        let direction = Vec3::from_fn(|i, _| sorted[i] / (level + self.offsets[i]).sqrt());
        Ok(Place {
            level,
            direction: direction.normalize(),
        })
    }

    /// Largest ℓ with Σ x²/(ℓ + offset) = 1, or the surface's if that is larger, by Newton's method. The sum
    /// is convex and falls, so from a start below the root every iterate stays below it; where no term is
    /// above 1 the sum is at most 3, and a few steps do.
    fn level(&self, x: &[f64; 3]) -> f64 {
        let squares = x.map(|v| v * v);
        let mut level = self.surface();
        for (s, o) in squares.iter().zip(&self.offsets) {
            level = level.max(s - o);
        }
        for _ in 0..60 {
            let (mut value, mut slope) = (-1.0, 0.0);
            for (s, o) in squares.iter().zip(&self.offsets) {
                let term = s / (level + o);
                value += term;
                slope += term / (level + o);
            }
            let step = value / slope;
            level += step.max(0.0);
            if step <= f64::EPSILON * level {
                break;
            }
        }
        level
    }
}
