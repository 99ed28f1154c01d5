//! A body from two meshes of one shape: what each says, extrapolated.

use super::richardson::richardson_of_ratio;
use super::{PanelBoundary, Richardson, richardson};
use crate::Result;
use crate::adjoint::lie::{Mat6, Vec3, Vec6};
use crate::boundary::response::Response;
use faer::Mat;

/// The answer of a fine mesh and, times a factor, its difference from that of a coarse one: see
/// [`richardson()`]. It is linear, so that the flow around the body is extrapolated as its added mass is.
pub struct Extrapolated {
    fine: PanelBoundary,
    coarse: PanelBoundary,
    found: Richardson,
}

impl Extrapolated {
    /// From a fine and a coarse mesh of one shape, and the ratio of their edges where the numbers of faces
    /// don't tell it.
    ///
    /// # Errors
    /// Meshes that don't differ enough.
    pub fn new(fine: PanelBoundary, coarse: PanelBoundary, ratio: Option<f64>) -> Result<Self> {
        let mut found = match ratio {
            Some(ratio) => richardson_of_ratio(&fine, &coarse, ratio)?,
            None => richardson(&fine, &coarse)?,
        };
        found.added_mass = positive(&found.added_mass, fine.faces.volume());
        Ok(Self {
            fine,
            coarse,
            found,
        })
    }

    fn extrapolate(&self, mut fine: Mat<f64>, coarse: &Mat<f64>) -> Mat<f64> {
        let factor = 1.0 / (self.found.ratio.powf(self.found.order) - 1.0);
        for j in 0..fine.ncols() {
            for i in 0..fine.nrows() {
                fine[(i, j)] += factor * (fine[(i, j)] - coarse[(i, j)]);
            }
        }
        fine
    }
}

/// The nearest added mass without negative energy: about an axis of revolution extrapolation can leave
/// a little. Compared in units of the water displaced, `volume` in m³.
fn positive(m: &Mat6, volume: f64) -> Mat6 {
    let displaced = Vec6::from_fn(|i, _| {
        let power = if i < 3 { 1.0 } else { 5.0 / 3.0 };
        volume.powf(0.5 * power)
    });
    let units = Mat6::from_fn(|i, j| displaced[i] * displaced[j]);
    let mut eigen = m.component_div(&units).symmetric_eigen();
    if eigen.eigenvalues.min() >= 0.0 {
        return *m;
    }
    eigen.eigenvalues.apply(|x| *x = x.max(0.0));
    eigen.recompose().component_mul(&units)
}

impl Response for Extrapolated {
    fn added_mass(&self) -> Mat6 {
        self.found.added_mass
    }

    fn radiated(&self, points: &[Vec3]) -> Result<Mat<f64>> {
        let fine = self.fine.radiated(points)?;
        Ok(self.extrapolate(fine, &self.coarse.radiated(points)?))
    }

    fn scattered(&self, sources: &[Vec3], points: &[Vec3]) -> Result<Mat<f64>> {
        let fine = self.fine.scattered(sources, points)?;
        Ok(self.extrapolate(fine, &self.coarse.scattered(sources, points)?))
    }

    fn asymmetry(&self) -> f64 {
        self.fine.asymmetry
    }

    fn condition(&self) -> f64 {
        self.fine.condition
    }

    fn warnings(&self) -> &[String] {
        &self.fine.warnings
    }

    fn error(&self) -> Option<f64> {
        Some(self.found.error)
    }
}
