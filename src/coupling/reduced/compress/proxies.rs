//! Points around a body at which its flow is fitted, and how they and the candidates inside it are spaced.

use crate::Result;
use crate::adjoint::lie::Vec3;
use crate::boundary::Response;
use faer::Mat;

/// Proxies are this many times their distance from the surface apart.
pub(super) const SPACING: f64 = 0.75;
/// Depths of the candidates, relative to the distances of the proxies.
pub(super) const DEPTH: f64 = 0.6;
/// Candidates are this many times their depth apart.
pub(super) const CANDIDATES: f64 = 1.0;
/// Candidates stay inside this part of the inner tangent ball.
pub(super) const TANGENT: f64 = 0.7;
/// One proxy in this many is kept from the fit to check it.
pub(super) const CHECK: usize = 6;

/// Proxies with their distances from the surface.
#[derive(Default)]
pub(super) struct Proxies {
    pub points: Vec<Vec3>,
    pub distances: Vec<f64>,
}

impl Proxies {
    /// Adds points at the distance `offset`, and one in [`CHECK`] of them to those that check the fit.
    pub fn add(&mut self, checked: &mut Self, points: Vec<Vec3>, offset: f64) {
        for (i, p) in points.into_iter().enumerate() {
            let to = match i % CHECK == CHECK - 1 {
                true => &mut *checked,
                false => &mut *self,
            };
            to.points.push(p);
            to.distances.push(offset);
        }
    }

    /// W Φ_own: the body's own flow.
    pub fn radiated(&self, response: &dyn Response) -> Result<Mat<f64>> {
        let own = response.radiated(&self.points)?;
        Ok(Mat::from_fn(own.nrows(), 6, |i, j| {
            own[(i, j)] * self.distances[i]
        }))
    }

    /// W Φ W: the scattered flow.
    pub fn scattered(&self, response: &dyn Response) -> Result<Mat<f64>> {
        let mut potentials = response.scattered(&self.points, &self.points)?;
        for (j, right) in self.distances.iter().enumerate() {
            for (i, left) in self.distances.iter().enumerate() {
                potentials[(i, j)] *= left * right;
            }
        }
        Ok(potentials)
    }
}
