//! How well sources at the resolved gap are answered: the normal velocity that is left on the surface, at
//! points of which the harmonics know nothing.

use super::{Harmonics, Probe, Weight};
use crate::Result;
use crate::adjoint::lie::Vec3;
use crate::error::in_order;
use faer::Mat;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Rings of check points around a source's direction and points on each.
const RINGS: usize = 24;
const AROUND: usize = 16;

/// Directions over one octant, the axes among them; the others follow no pattern that the zeros of
/// harmonics could.
pub(super) fn octant(count: usize) -> Vec<Vec3> {
    // Powers of the real root of x³ = x + 1: even in two dimensions.
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let spread = (0..count).map(|k| {
        let k = k as f64 + 0.5;
        let (u, azimuth) = (
            (k / PLASTIC) % 1.0,
            FRAC_PI_2 * ((k / (PLASTIC * PLASTIC)) % 1.0),
        );
        let s = (1.0 - u * u).sqrt();
        Vec3::new(s * azimuth.cos(), s * azimuth.sin(), u)
    });
    [Vec3::x(), Vec3::y(), Vec3::z()]
        .into_iter()
        .chain(spread)
        .collect()
}

/// Directions of the sources that are tried: the ends of the shortest and of the longest axis, and some
/// between.
const TRIED: [[f64; 3]; 6] = [
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.3, 0.21, 0.93],
    [0.65, 0.35, 0.67],
    [0.83, 0.51, 0.24],
];

impl Harmonics {
    /// Norm of the normal velocity that is left on the surface over that of the source's own, in the worst
    /// case of the sources tried at the resolved gap. `name` of the body for messages.
    pub fn residual(&self, name: &str) -> Result<f64> {
        let gap = self.resolved_gap / self.scale;
        let of = |d: &[f64; 3]| self.residual_of(name, &Vec3::from(*d).normalize(), gap);
        let parts = in_order(TRIED.par_iter().map(of))?;
        Ok(parts.into_iter().fold(0.0, f64::max))
    }

    fn residual_of(&self, name: &str, direction: &Vec3, gap: f64) -> Result<f64> {
        let most = self.degrees.len();
        let (source, place) = self.offset(name, direction, gap)?;
        let mut at_source = [self.probe(&place, most)];
        let checks = around(direction, gap);
        let mut probes: Vec<Probe> = checks
            .iter()
            .map(|(d, _)| Ok(self.probe(&self.offset(name, d, 0.0)?.1, most)))
            .collect::<Result<_>>()?;
        // ∂φ/∂τ = −∂φ/∂n dA/dΩ at each check point.
        let mut answers = Mat::zeros(checks.len(), 1);
        for degree in self.degrees.chunks(8) {
            let (own, _) = self.values(degree, &mut at_source, Weight::Flux);
            let (left, _) = self.values(degree, &mut probes, Weight::One);
            answers += left.transpose() * own;
        }
        let (mut left, mut all) = (0.0, 0.0);
        for ((d, solid_angle), answer) in checks.iter().zip(answers.col(0).iter()) {
            let n = d.component_div(&self.semi_axes);
            // dA/dΩ
            let stretch = self.semi_axes.product() * n.norm();
            let away = d.component_mul(&self.semi_axes) - source;
            let asked = n.normalize().dot(&away) / away.norm().powi(3);
            let area = solid_angle * stretch;
            left += area * (asked + answer / stretch).powi(2);
            all += area * asked * asked;
        }
        Ok((left / all).sqrt())
    }
}

/// Directions all over the sphere, close together around one within `width`, with their solid angles.
fn around(centre: &Vec3, width: f64) -> Vec<(Vec3, f64)> {
    let side = Vec3::new(centre.y, centre.z, -centre.x);
    let u = centre.cross(&side).normalize();
    let w = centre.cross(&u);
    // θ = width sinh(k s), s from 0 to 1.
    let width = width.min(1.0);
    let k = (PI / width).asinh();
    let mut out = Vec::with_capacity(RINGS * AROUND);
    for ring in 0..RINGS {
        let s = (ring as f64 + 0.5) / RINGS as f64;
        let angle = width * (k * s).sinh();
        let slope = width * k * (k * s).cosh() / RINGS as f64;
        for i in 0..AROUND {
            let azimuth = TAU * (i as f64 + 0.5 * (ring % 2) as f64 + 0.25) / AROUND as f64;
            let d = centre * angle.cos() + (u * azimuth.cos() + w * azimuth.sin()) * angle.sin();
            out.push((d, angle.sin() * slope * TAU / AROUND as f64));
        }
    }
    out
}
