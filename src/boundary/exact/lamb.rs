//! An ellipsoid that moves through unbounded water, in closed form.
//!
//! With `α_i = abc ∫₀^∞ dλ / ((a_i² + λ) Δ(λ))`, `Δ² = (a² + λ)(b² + λ)(c² + λ)`, so that α₁ + α₂ + α₃ = 2,
//! and V the volume, the added mass at unit density is diagonal:
//!
//! ```text
//! M_i     = V α_i / (2 − α_i)
//! M_{3+i} = V/5 (b² − c²)² (γ − β) / (2 (b² − c²) + (b² + c²) (β − γ))     i = x; others in turn
//! ```
//!
//! and the potential outside (velocity −∇φ), through x on the confocal surface λ,
//!
//! ```text
//! u_x:  φ = abc / (2 − α) · x ∫_λ^∞ dλ / ((a² + λ) Δ)
//! ω_x:  φ = abc (b² − c²) / (2 − (b² + c²) g) · y z ∫_λ^∞ dλ / ((b² + λ)(c² + λ) Δ)
//! ```
//!
//! with `g = (γ − β)/(b² − c²) = abc ∫₀^∞ dλ / ((b² + λ)(c² + λ) Δ)`. All integrals are Carlson's R_D and its
//! divided difference, so nothing cancels as axes become equal: two equal axes give exactly 0 about the
//! third.
//!
//! # References
//! H. Lamb, *Hydrodynamics*, 6th ed. (1932), §114, §115; NIST DLMF 19.16, 19.33.

use super::confocal::Confocal;
use crate::adjoint::lie::{Mat6, Vec3, Vec6};
use crate::special::{Number, r_d, r_d_difference};
use crate::{Error, Result};
use num_dual::Dual64;
use std::f64::consts::PI;

/// Semi-axes outside these leave double precision when multiplied with each other.
const SMALLEST: f64 = 1e-30;
const LARGEST: f64 = 1e30;

/// Added mass of an ellipsoid at unit density about its centre, along its axes, for twists (u, ω):
/// diagonal, m³ and m⁵. `semi_axes` along x, y, z, m.
///
/// # Errors
/// [`Error::Input`] unless the semi-axes are finite and positive (1e-30 to 1e30 m).
pub fn added_mass(semi_axes: [f64; 3]) -> Result<Mat6> {
    check("ellipsoid", semi_axes)?;
    Ok(Lamb::new(semi_axes).added_mass())
}

/// ∂M of [`added_mass`] with each semi-axis: m², m⁴.
///
/// # Errors
/// As there.
pub fn added_mass_slopes(semi_axes: [f64; 3]) -> Result<[Mat6; 3]> {
    check("ellipsoid", semi_axes)?;
    Ok(slopes(semi_axes))
}

/// The same of semi-axes as checked by [`check`].
pub(super) fn slopes(semi_axes: [f64; 3]) -> [Mat6; 3] {
    [0, 1, 2].map(|k| {
        let axes = [0, 1, 2].map(|i| Dual64::new(semi_axes[i], f64::from(i == k)));
        let diagonal = Lamb::new(axes).diagonal().map(|m| m.eps);
        Mat6::from_diagonal(&Vec6::from(diagonal))
    })
}

/// Whether semi-axes can be; `place` begins the message.
pub(super) fn check(place: &str, semi_axes: [f64; 3]) -> Result<()> {
    for (i, a) in semi_axes.iter().enumerate() {
        if !(SMALLEST..=LARGEST).contains(a) {
            return Err(Error::input(
                format!("{place}: semi_axes[{i}]"),
                a,
                "give a finite, positive length in metres (1e-30 to 1e30)",
            ));
        }
    }
    Ok(())
}

/// The coefficients of one ellipsoid. Lengths are relative to the longest semi-axis, so that no power of
/// them leaves double precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lamb<D = f64> {
    /// Longest semi-axis, m.
    scale: f64,
    semi_axes: [D; 3],
    /// α of each axis.
    alpha: [D; 3],
    /// b² − c² about each axis, from the axes as given: dividing them first would lose digits of small
    /// differences.
    difference: [D; 3],
    /// g about each axis.
    g: [D; 3],
    /// 2 − (b² + c²) g about each axis.
    denominator: [D; 3],
}

/// The axes after axis i in cyclic order.
fn others(i: usize) -> (usize, usize) {
    ((i + 1) % 3, (i + 2) % 3)
}

/// A number for each axis, from it and the others after it.
fn each<D>(f: impl Fn(usize, usize, usize) -> D) -> [D; 3] {
    [0, 1, 2].map(|i| {
        let (j, k) = others(i);
        f(i, j, k)
    })
}

impl<D: Number> Lamb<D> {
    /// `semi_axes` as checked by [`check`].
    pub fn new(semi_axes: [D; 3]) -> Self {
        let scale = semi_axes.iter().fold(0.0f64, |m, a| m.max(a.re()));
        let axes = semi_axes.map(|a| a / scale);
        let squares = axes.map(|a| a * a);
        let product = axes[0] * (2.0 / 3.0) * axes[1] * axes[2];
        let alpha = each(|i, j, k| product * r_d(squares[j], squares[k], squares[i]));
        let difference =
            each(|_, j, k| (semi_axes[j] - semi_axes[k]) / scale * (axes[j] + axes[k]));
        let g = each(|i, j, k| product * r_d_difference(squares[i], squares[j], squares[k]));
        let denominator = each(|i, j, k| {
            let (long, short) = if axes[j].re() >= axes[k].re() {
                (j, k)
            } else {
                (k, j)
            };
            let (b, c) = (squares[long], squares[short]);
            if c.re() > 0.5 * b.re() {
                -((b + c) * g[i]) + 2.0
            } else {
                // The same with 2 = α + β + γ, where the other form would cancel.
                let [alpha, beta, gamma] = [alpha[i], alpha[long], alpha[short]];
                (b * (alpha + beta * 2.0) - c * (alpha + gamma * 2.0)) / (b - c)
            }
        });
        Self {
            scale,
            semi_axes: axes,
            alpha,
            difference,
            g,
            denominator,
        }
    }

    /// Added mass about the centre, along the axes: its diagonal.
    fn diagonal(&self) -> [D; 6] {
        let [a, b, c] = self.semi_axes;
        let volume = a * (4.0 / 3.0 * PI) * b * c;
        let cube = self.scale.powi(3);
        let mut diagonal = [D::from(0.0); 6];
        for i in 0..3 {
            let (j, k) = others(i);
            let left = self.alpha[j] + self.alpha[k];
            diagonal[i] = volume * cube * self.alpha[i] / left;
            let difference = self.difference[i];
            diagonal[3 + i] = volume * (cube * self.scale * self.scale) / 5.0
                * (difference * difference * self.g[i] / self.denominator[i]);
        }
        diagonal
    }
}

impl Lamb {
    /// About the centre, along the axes.
    pub fn added_mass(&self) -> Mat6 {
        Mat6::from_diagonal(&Vec6::from(self.diagonal()))
    }

    /// Potentials of the six unit twists (about the centre, along the axes) at a point x (m) of the
    /// confocal surface `level`, m²/s and m³/s.
    pub fn potentials(&self, confocal: &Confocal, x: &Vec3, level: f64) -> Vec6 {
        let x = x / self.scale;
        let level = level / (self.scale * self.scale);
        let mut squares = [0.0; 3];
        for (axis, offset) in confocal.order.iter().zip(&confocal.offsets) {
            squares[*axis] = level + offset / (self.scale * self.scale);
        }
        let [a, b, c] = self.semi_axes;
        let product = 2.0 / 3.0 * a * b * c;
        let mut out = Vec6::zeros();
        for i in 0..3 {
            let (j, k) = others(i);
            let left = self.alpha[j] + self.alpha[k];
            out[i] = self.scale * product / left * x[i] * r_d(squares[j], squares[k], squares[i]);
            let difference = self.difference[i];
            if difference != 0.0 {
                out[3 + i] = self.scale * self.scale * product * difference / self.denominator[i]
                    * x[j]
                    * x[k]
                    * r_d_difference(squares[i], squares[j], squares[k]);
            }
        }
        out
    }
}
