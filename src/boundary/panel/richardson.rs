//! Two meshes of one shape: a better added mass, and how far off each is.
//!
//! The error falls with a power p of the edge length h: 2 on a smooth body; 4/3 with sharp edges, where
//! the potential goes like r^⅔ (at a right angle of the body). From a fine and a coarse mesh, ρ = h_coarse/h_fine,
//!
//! ```text
//! M = M_fine + (M_fine − M_coarse)/(ρᵖ − 1)
//! ```
//!
//! takes the leading part away. The fine mesh's error is estimated with the same p on a smooth body,
//! and with p = 1 on one with sharp edges, where faces are seldom small enough for the leading part to be
//! all; that of M as smaller by the factor from the coarse mesh's error to the fine one's once more. A
//! rim that the faces don't resolve counts as sharp. A thickness that they don't resolve isn't noticed:
//! several faces across it are needed.

use super::PanelBoundary;
use crate::adjoint::lie::{Mat6, Vec3, Vec6};
use crate::boundary::{Response, scaled};
use crate::{Error, Result};
use faer::Mat;

/// Least ratio of edge lengths from which two meshes say something.
const RATIO: f64 = 1.2;
/// Length of sharp edges, in square roots of the area, from which a body counts as sharp.
const SHARP: f64 = 0.1;
/// Part of the coarse mesh's sharp edges that must be sharp in the fine one: a resolved rim fades.
const LASTS: f64 = 0.7;

/// Outcome of [`richardson`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Richardson {
    /// Extrapolated added mass, density 1: kg, kg·m, kg·m².
    pub added_mass: Mat6,
    /// Estimated error of the fine mesh's added mass: max |ΔM_ij| / √(M_ii M_jj), a diagonal entry
    /// under a hundredth of the displaced fluid's inertia counting as that hundredth.
    pub fine_error: f64,
    /// Estimated error of the extrapolated one, in the same measure.
    pub error: f64,
    /// Order p of the error in the edge length: 2, or 4/3 with sharp edges.
    pub order: f64,
    /// Ratio ρ of the edge lengths.
    pub ratio: f64,
}

impl Richardson {
    /// As [`richardson()`], with a given ratio of the edges where the numbers of faces don't tell it, and without negative energy.
    pub(crate) fn of(
        fine: &PanelBoundary,
        coarse: &PanelBoundary,
        ratio: Option<f64>,
    ) -> Result<Self> {
        let ratio = ratio.unwrap_or_else(|| edge(coarse) / edge(fine));
        let mut found = richardson_of_ratio(fine, coarse, ratio)?;
        found.added_mass = positive(&found.added_mass, fine.faces.volume(), 0.0);
        Ok(found)
    }

    /// Added mass for a body whose coupling is extrapolated as well. About an axis of revolution faces move a little water that the shape doesn't;
    /// a neighbour may take as much of that away as extrapolation does of the `coarse` mesh's, and no energy may become negative.
    pub(crate) fn coupled(&self, coarse: &PanelBoundary) -> Mat6 {
        let volume = coarse.faces.volume();
        let least = (coarse.added_mass.component_div(&displaced(volume))).symmetric_eigenvalues();
        let room = least.min().max(0.0) / (self.ratio * self.ratio - 1.0);
        positive(&self.added_mass, volume, room)
    }
}

/// Extrapolates the added mass of two meshes of one shape.
///
/// # Errors
/// Meshes that don't differ enough: ρ, the ratio of √(area/faces), under 1.2.
pub fn richardson(fine: &PanelBoundary, coarse: &PanelBoundary) -> Result<Richardson> {
    richardson_of_ratio(fine, coarse, edge(coarse) / edge(fine))
}

/// √(area/faces), m.
fn edge(b: &PanelBoundary) -> f64 {
    (b.faces.area() / b.faces.len() as f64).sqrt()
}

/// The same for meshes whose edges have a known ratio everywhere: where regions are refined, the number of
/// faces doesn't tell it.
fn richardson_of_ratio(
    fine: &PanelBoundary,
    coarse: &PanelBoundary,
    ratio: f64,
) -> Result<Richardson> {
    if ratio.is_nan() || ratio < RATIO {
        return Err(Error::input(
            format!("body \"{}\": faces of two meshes", fine.name),
            format!("{} and {}", fine.faces.len(), coarse.faces.len()),
            format!(
                "the fine mesh needs at least {:.2} times as many as the coarse one",
                RATIO * RATIO
            ),
        ));
    }
    let step = fine.added_mass - coarse.added_mass;
    let size = edge(fine) * (fine.faces.len() as f64).sqrt();
    let sharp = fine.sharp_edges > SHARP * size && fine.sharp_edges > LASTS * coarse.sharp_edges;
    let (order, cautious) = if sharp { (4.0 / 3.0, 1.0) } else { (2.0, 2.0) };
    let change = scaled(&step, &fine.added_mass, &fine.faces);
    let fine_error = change / (ratio.powf(cautious) - 1.0);
    Ok(Richardson {
        added_mass: fine.added_mass + step / (ratio.powf(order) - 1.0),
        fine_error,
        error: fine_error / ratio.powf(cautious),
        order,
        ratio,
    })
}

/// The answer of a fine mesh and, times a factor, its difference from that of a coarse one: see
/// [`richardson()`]. It is linear, so that the flow around the body is extrapolated as its added mass is.
pub struct Extrapolated {
    fine: PanelBoundary,
    coarse: PanelBoundary,
    found: Richardson,
    /// Of a twist what moves water: of one whose energy extrapolation leaves under zero, and so is none, the flow is none.
    moves: Mat6,
}

impl Extrapolated {
    /// From a fine and a coarse mesh of one shape, and the ratio of their edges where the numbers of faces
    /// don't tell it.
    ///
    /// # Errors
    /// Meshes that don't differ enough.
    pub fn new(fine: PanelBoundary, coarse: PanelBoundary, ratio: Option<f64>) -> Result<Self> {
        let found = Richardson::of(&fine, &coarse, ratio)?;
        let raw = richardson_of_ratio(&fine, &coarse, found.ratio)?.added_mass;
        Ok(Self {
            moves: moving(&raw, fine.faces.volume()),
            found,
            fine,
            coarse,
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

/// The nearest added mass without energies under `least`: about an axis of revolution extrapolation can leave
/// a little that is negative. Compared in units of the water displaced, `volume` in m³.
fn positive(m: &Mat6, volume: f64, least: f64) -> Mat6 {
    let units = displaced(volume);
    let mut eigen = m.component_div(&units).symmetric_eigen();
    if eigen.eigenvalues.min() >= least {
        return *m;
    }
    eigen.eigenvalues.apply(|x| *x = x.max(least));
    eigen.recompose().component_mul(&units)
}

/// The part of a twist whose energies aren't negative, by the same measure as [`positive`].
fn moving(m: &Mat6, volume: f64) -> Mat6 {
    let units = displaced(volume);
    let eigen = m.component_div(&units).symmetric_eigen();
    if eigen.eigenvalues.min() >= 0.0 {
        return Mat6::identity();
    }
    let kept = eigen.eigenvalues.map(|x| if x < 0.0 { 0.0 } else { 1.0 });
    let vectors = eigen.eigenvectors;
    let projection = vectors * Mat6::from_diagonal(&kept) * vectors.transpose();
    let root = |i: usize| units[(i, i)].sqrt();
    Mat6::from_fn(|i, j| projection[(i, j)] * root(j) / root(i))
}

/// Inertia of the water displaced, in mass and, roughly, in rotation: units of a 6 × 6 matrix.
pub(super) fn displaced(volume: f64) -> Mat6 {
    let roots = Vec6::from_fn(|i, _| {
        let power = if i < 3 { 1.0 } else { 5.0 / 3.0 };
        volume.powf(0.5 * power)
    });
    roots * roots.transpose()
}

impl Response for Extrapolated {
    fn added_mass(&self) -> Mat6 {
        self.found.added_mass
    }

    fn radiated(&self, points: &[Vec3]) -> Result<Mat<f64>> {
        let fine = self.fine.radiated(points)?;
        let both = self.extrapolate(fine, &self.coarse.radiated(points)?);
        let moves = Mat::from_fn(6, 6, |i, j| self.moves[(i, j)]);
        Ok(both * moves)
    }

    fn scattered(&self, sources: &[Vec3], points: &[Vec3]) -> Result<Mat<f64>> {
        let fine = self.fine.scattered(sources, points)?;
        Ok(self.extrapolate(fine, &self.coarse.scattered(sources, points)?))
    }

    fn asymmetry(&self) -> f64 {
        self.fine.asymmetry
    }

    fn warnings(&self) -> &[String] {
        &self.fine.warnings
    }

    fn error(&self) -> Option<f64> {
        Some(self.found.error)
    }
}
