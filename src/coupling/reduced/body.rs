//! One body as the reduced coupling sees it.

use super::region::Region;
use crate::adjoint::kernel::Points;
use crate::adjoint::lie::{Mat6, Vec3, Vec6, angular, linear};
use crate::{Error, Result};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// A body compressed to a few sources, in its own frame, for density 1, immutable. Bodies of equal
/// shape share one (`Arc`).
///
/// Held fixed in a flow with potential ψ, the body solutions with the strengths `L Lᵀ ψ(x̄)` at its
/// points x̄; moved with the twist ν it solutions with `Ū ν`; α makes the potential `Σ α_j/|x − x̄_j|`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "CompressedParts", into = "CompressedParts")]
pub struct ReducedBody {
    parts: CompressedParts,
    /// [L, Ū], points × (modes + 6).
    basis: DMatrix<f64>,
    /// The points as targets of the potential kernel.
    targets: Points,
    /// [`ReducedBody::deficit`].
    deficit: f64,
}

/// What a compressed body consists of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompressedParts {
    /// Name, for messages.
    pub name: String,
    /// x̄, m.
    pub points: Vec<Vec3>,
    /// L, points × modes, √m: solution to the potential at the points, S̄ = L Lᵀ (m).
    pub modes: DMatrix<f64>,
    /// Ū, points × 6: strengths (m³/s) that solution a unit twist of the body about its origin.
    pub strengths: DMatrix<f64>,
    /// M̄₀: the body's own added mass about its origin; m³, m⁴, m⁵.
    pub added_mass: Mat6,
    /// Centre of the surface, m.
    pub centre: Vec3,
    /// Largest distance of the surface from the centre, m.
    pub radius: f64,
    /// Displaced volume, m³.
    pub volume: f64,
    /// How well it was fitted.
    pub fit: Fit,
}

/// How well a compressed body stands for the body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fit {
    /// Smallest distance from the surface at which its solutions were fitted, m.
    pub resolved_gap: f64,
    /// Regions in which it is smaller.
    pub regions: Vec<Region>,
    /// How often the edges of its faces were halved for what it was fitted to.
    pub halved: usize,
    /// Points on the surfaces around the body at which it was fitted.
    pub proxies: usize,
    /// The tolerance that the fit to them meets.
    pub reached: f64,
    /// max |Φ_ij − Φ_ji| / max |Φ| of the scattered potentials at the proxies, before symmetrising.
    pub asymmetry: f64,
    /// Largest error of the body's own flow at check points not used in the fit, relative to its
    /// largest potential there.
    pub radiated: f64,
    /// Largest error of the scattered flow between check points not used in the fit, each scaled by
    /// its distance from the surface, relative to the largest.
    pub scattered: f64,
    /// Largest mode left out for being of the wrong sign (the solution of a rigid body is positive
    /// definite), relative to the largest mode.
    pub wrong_sign: f64,
    /// Asymmetry of the body's own added mass before symmetrising.
    pub body_asymmetry: f64,
    /// Estimated relative error of the body's own added mass, where two resolutions tell one.
    pub body_error: Option<f64>,
    /// What the user should know, with its numbers; without the body's name, as it may be kept for others that are made alike.
    pub warnings: Vec<String>,
}

impl Fit {
    /// The smallest gap that is resolved anywhere, m.
    pub fn finest(&self) -> f64 {
        let regions = self.regions.iter().map(|r| r.gap);
        regions.fold(self.resolved_gap, f64::min)
    }
}

impl ReducedBody {
    /// From its parts.
    ///
    /// # Errors
    /// Sizes that don't fit together, numbers that aren't finite.
    pub fn new(parts: CompressedParts) -> Result<Self> {
        let r = parts.points.len();
        let sizes = [parts.modes.nrows(), parts.strengths.nrows()];
        let bad = |what: &str, value: String, right: &str| {
            Error::input(
                format!("compressed body {:?}: {what}", parts.name),
                value,
                right,
            )
        };
        if r == 0 || sizes != [r, r] || parts.strengths.ncols() != 6 {
            return Err(bad(
                "points, rows of modes and of strengths",
                format!("{r}, {}, {}", sizes[0], sizes[1]),
                "must be equal and not zero",
            ));
        }
        let numbers = (parts.points.iter().flat_map(|p| p.iter()))
            .chain(parts.modes.iter())
            .chain(parts.strengths.iter())
            .chain(parts.added_mass.iter())
            .chain(parts.centre.iter())
            .chain([&parts.radius, &parts.volume, &parts.fit.resolved_gap]);
        if let Some(x) = numbers.into_iter().find(|x| !x.is_finite()) {
            return Err(bad("a number", x.to_string(), "must be finite"));
        }
        let m = parts.modes.ncols();
        let mut basis = DMatrix::zeros(r, m + 6);
        basis.columns_mut(0, m).copy_from(&parts.modes);
        basis.columns_mut(m, 6).copy_from(&parts.strengths);
        Ok(Self {
            targets: Points::bare(&parts.points),
            deficit: deficit(&parts),
            basis,
            parts,
        })
    }

    /// The same body, larger by `factor` in all lengths.
    ///
    /// # Errors
    /// A factor that isn't finite and positive, or takes numbers out of range.
    pub fn scaled(&self, factor: f64) -> Result<Self> {
        let mut parts = self.parts.clone();
        if !(factor > 0.0 && factor.is_finite()) {
            return Err(Error::input(
                format!("compressed body {:?}: scale", parts.name),
                factor,
                "must be finite and positive",
            ));
        }
        parts.points.iter_mut().for_each(|p| *p *= factor);
        parts.modes *= factor.sqrt();
        let power = |i: usize, n: i32| factor.powi(n + i32::from(i >= 3));
        for k in 0..6 {
            parts.strengths.column_mut(k).scale_mut(power(k, 2));
            for i in 0..6 {
                parts.added_mass[(i, k)] *= power(i, 1) * power(k, 2);
            }
        }
        parts.centre *= factor;
        parts.radius *= factor;
        parts.volume *= factor.powi(3);
        parts.fit.resolved_gap *= factor;
        let regions = parts.fit.regions.iter();
        parts.fit.regions = regions.map(|r| r.scaled(factor)).collect();
        Self::new(parts)
    }

    /// What it consists of.
    pub fn parts(&self) -> &CompressedParts {
        &self.parts
    }

    /// Number of points r.
    pub fn points(&self) -> usize {
        self.parts.points.len()
    }

    /// Number of modes m: this body's unknowns in the coupled system.
    pub fn modes(&self) -> usize {
        self.parts.modes.ncols()
    }

    /// [L, Ū], points × (modes + 6).
    pub(in crate::coupling) fn basis(&self) -> &DMatrix<f64> {
        &self.basis
    }

    pub(super) fn targets(&self) -> &Points {
        &self.targets
    }

    /// Twice the energy, at unit density, that as much water as the body moves would have at most if it went with a twist.
    pub(in crate::coupling) fn displaced(&self, twist: &Vec6) -> f64 {
        let (mass, arm) = scales(&self.parts);
        let speed = linear(twist).norm() + arm * angular(twist).norm();
        mass * speed * speed
    }

    /// What the body's own added mass is below zero by, scaled by the water displaced: the one-body method's
    /// error in a spin that moves no water, and no matter of gaps.
    pub(super) fn deficit(&self) -> f64 {
        self.deficit
    }
}

/// Volume of the water that the body moves, m³, and the reach of its turns, m.
fn scales(p: &CompressedParts) -> (f64, f64) {
    let linear = p.added_mass.fixed_view::<3, 3>(0, 0).trace();
    (p.volume.max(linear), p.radius + p.centre.norm())
}

fn deficit(p: &CompressedParts) -> f64 {
    let (mass, arm) = scales(p);
    let scale = |i: usize| mass.sqrt() * if i < 3 { 1.0 } else { arm };
    let scaled = Mat6::from_fn(|i, j| p.added_mass[(i, j)] / (scale(i) * scale(j)));
    match scaled.iter().all(|x| x.is_finite()) {
        true => (-scaled.symmetric_eigenvalues().min()).max(0.0),
        false => 0.0,
    }
}

impl TryFrom<CompressedParts> for ReducedBody {
    type Error = Error;

    fn try_from(parts: CompressedParts) -> Result<Self> {
        Self::new(parts)
    }
}

impl From<ReducedBody> for CompressedParts {
    fn from(body: ReducedBody) -> Self {
        body.parts
    }
}
