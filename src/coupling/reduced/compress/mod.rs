//! Compression of one body, offline and once per shape.
//!
//! Around the body lie *proxies*, points at the distances d, 2d, 4d … from its surface, d the smallest
//! gap to be resolved. Any flow that comes from there on outwards is one of sources at proxies, and what
//! the body adds to it is known once it is known at proxies. Inside lie candidates for the body's
//! points. With W the distance of each proxy from the surface and E the potentials of candidates at
//! proxies,
//!
//! ```text
//! W Φ W = V Λ Vᵀ          Φ the potentials at proxies scattered from unit sources at proxies;
//!                         the largest modes of the solution are kept
//! W E_x̄ L ≈ V √Λ          least squares, x̄ the few candidates that explain modes and
//! W E_x̄ Ū ≈ W Φ_own       the body's own flow best
//! ```
//!
//! Φ is symmetric (reciprocity) and positive definite, for a rigid body solutions every flow; what the
//! one-body method and the fit leave of asymmetry and of negative modes is reported.
//!
//! Where others come nearer than d, within a [`Region`], proxies and candidates go on at smaller distances.
//!
//! How tight the fit must be for an error `tolerance` of M̄_f was measured on pairs of spheres, thin
//! ellipsoids and boxes at the resolved gap: the error goes with the square of the rests.

mod modes;
mod proxies;
mod pursuit;
mod region;
mod samples;
mod slope;
mod sources;

use super::views::dense;
use super::{CompressedParts, Fit, ReducedBody, Region};
use crate::adjoint::lie::Vec3;
use crate::boundary::Response;
use crate::geometry::{Ball, Interior, TriMesh};
use crate::{Error, Result};
use faer::Mat;
use proxies::{CANDIDATES, DEPTH, Proxies, SPACING, TANGENT};
use samples::{Candidate, Layer};
use serde::{Deserialize, Serialize};
pub use slope::{ShapeStep, slopes};
use sources::Sources;

/// Largest radius of a body over the gap that it resolves: a needle's proxies are as many as its length asks for.
const MOST_ALONG: f64 = 1e4;
/// Radius of the largest body that is compressed, over its volume by its area: 1.5 · 10⁴ thicknesses of a rod.
const MOST_SLENDER: f64 = 3e4;
/// Most proxies at the smallest distance; a smaller gap isn't resolved on so large a body.
const MOST_PROXIES: f64 = 900.0;
/// Largest gap that is asked to be resolved, in radii of the body.
const FARTHEST: f64 = 10.0;
/// Largest rank: more points are no more accurate, and slow.
const MOST_RANK: usize = 1000;
/// About as many proxies are fitted at most, unless a rank needs more.
const MOST_FITTED: usize = 1100;
/// Most candidates.
const MOST_CANDIDATES: usize = 1200;
/// Modes below this times the root of the tolerance, relative to the largest, are left out.
const MODES: f64 = 0.3;
/// Points are added until every mode and flow is met to this times the root of the tolerance.
const REST: f64 = 2.0;
/// Weight of the body's own flow beside its largest mode: it acts to first order, modes to second.
const OWN: f64 = 3.0;
/// At least this many proxies are fitted for each point, or the fit says nothing between proxies.
const FITTED: usize = 3;

/// How a body is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CompressSettings {
    /// Number of points, as far as the body has room for them; by default as many as `tolerance`
    /// needs.
    pub rank: Option<usize>,
    /// Aimed at error of M̄_f between bodies at the resolved gap, relative to √(M_ii M_jj), that the
    /// compression adds to that of the one-body method.
    pub tolerance: f64,
    /// Smallest gap to other bodies (and half of that to walls) that is resolved, m; by default
    /// [`default_gap`].
    pub resolved_gap: Option<f64>,
}

impl Default for CompressSettings {
    fn default() -> Self {
        Self {
            rank: None,
            tolerance: 3e-3,
            resolved_gap: None,
        }
    }
}

impl CompressSettings {
    /// Checks the values.
    ///
    /// # Errors
    /// A rank of zero or beyond what is fitted, a tolerance outside 0 to 1, a gap that isn't a positive length.
    pub fn validate(&self) -> Result<()> {
        if let Some(rank) = self.rank.filter(|r| *r == 0 || *r > MOST_RANK) {
            return Err(Error::input(
                "settings: rank",
                rank,
                format!(
                    "a whole number of points a body from 1 to {MOST_RANK}, such as 80, or none"
                ),
            ));
        }
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return Err(Error::input(
                "settings: tolerance of the compression",
                self.tolerance,
                "a number between 0 and 1, such as 1e-3",
            ));
        }
        match self.resolved_gap {
            Some(gap) if !(gap > 0.0 && gap.is_finite()) => Err(Error::input(
                "settings: resolved_gap",
                gap,
                "a positive length in m, or none",
            )),
            _ => Ok(()),
        }
    }
}

/// What a body is compressed to, and what it is fitted to.
struct Chosen {
    /// Ball around the body.
    ball: Ball,
    volume: f64,
    gap: f64,
    regions: Vec<Region>,
    fitted: Proxies,
    checked: Proxies,
    /// Weighted potentials of the chosen combinations of sources at the proxies.
    field: Mat<f64>,
    /// The sources, and the strength of each in each combination.
    points: Vec<Vec3>,
    spread: Mat<f64>,
    /// Modes of the solution that are kept, and the body's own flow, weighted at the proxies.
    modes: Mat<f64>,
    own: Mat<f64>,
    /// Of the scattered flow, before symmetrising.
    asymmetry: f64,
    /// Largest mode of the wrong sign, relative to the largest.
    wrong_sign: f64,
    /// The longest rest of what is fitted.
    left: f64,
}

/// Lays out proxies and candidates, and chooses among the latter.
fn choose(
    name: &str,
    mesh: &TriMesh,
    response: &dyn Response,
    settings: &CompressSettings,
    regions: &[Region],
) -> Result<Chosen> {
    settings.validate()?;
    let surface = Interior::new(mesh);
    let Ball { center, radius } = mesh.bounding_ball();
    let area = surface.faces.area();
    let slenderness = radius * area / surface.faces.volume();
    if slenderness > MOST_SLENDER {
        return Err(Error::Unresolved {
            place: format!("body {name:?}"),
            quantity: "radius over volume by area".into(),
            value: slenderness,
            limit: MOST_SLENDER,
            remedy: "so slender a body isn't compressed: its places would take minutes and gigabytes; use the fidelity full or isolated, or several bodies in a row".into(),
        });
    }
    let finest = finest_gap(area).max(radius / MOST_ALONG);
    let asked = settings.resolved_gap;
    if let Some(far) = asked.filter(|g| *g > FARTHEST * radius) {
        return Err(Error::input(
            format!("body {name:?}: resolved gap"),
            far,
            format!(
                "at most {:.3e} m, {FARTHEST} radii of the body: there is no use in a larger one",
                FARTHEST * radius
            ),
        ));
    }
    let gap = asked
        .unwrap_or_else(|| default_gap(surface.faces.volume(), area))
        .max(finest);
    let (mut fitted, mut checked) = proxies(&surface, gap, radius, SPACING);
    let needed = FITTED * settings.rank.unwrap_or(0);
    let count = fitted.points.len().max(1);
    if count > needed.max(MOST_FITTED) {
        // Long bodies have many on the outer surfaces.
        let wider = (count as f64 / needed.max(MOST_FITTED) as f64).sqrt();
        (fitted, checked) = proxies(&surface, gap, radius, wider * SPACING);
    } else if count < needed {
        let closer = (fitted.points.len() as f64 / needed as f64).sqrt();
        (fitted, checked) = proxies(&surface, gap, radius, 0.9 * closer * SPACING);
    }
    let none = |quantity: &str, remedy: String| Error::Unresolved {
        place: format!("body {name:?}"),
        quantity: quantity.into(),
        value: 0.0,
        limit: 1.0,
        remedy,
    };
    let mut candidates = candidates(&surface, gap, radius);
    let regions = region::add(
        &surface,
        gap,
        regions,
        (&mut fitted, &mut checked),
        &mut candidates,
    );
    let sources = Sources::new(&candidates);
    let field = sources.columns(&potentials_weighted(&fitted, &sources.points));
    if candidates.is_empty() {
        let remedy = format!("the mesh ({} faces) is too coarse", surface.faces.len());
        return Err(none("points inside for its compressed sources", remedy));
    }
    let own = fitted.radiated(response)?;
    let mut scattered = fitted.scattered(response)?;
    let asymmetry = symmetrise(&mut scattered);
    let cut = MODES * settings.tolerance.sqrt();
    let found = modes::largest(&scattered, cut).ok_or_else(|| {
        let quantity = "modes of its solution to the water that were found";
        none(quantity, "use a more even mesh".into())
    })?;
    drop(scattered);
    let top = found.values.first().copied().unwrap_or(0.0);
    let wrong_sign = found.lowest.abs() / top;
    let m = found.values.len();
    let modes = Mat::from_fn(own.nrows(), m, |i, k| {
        found.vectors[(i, k)] * found.values[k].sqrt()
    });
    let sizes: Vec<f64> = (0..6).map(|k| own.col(k).norm_l2()).collect();
    let linear = sizes[..3].iter().copied().fold(0.0, f64::max);
    let angular = sizes[3..]
        .iter()
        .copied()
        .fold(1e-3 * linear * radius, f64::max);
    let targets = Mat::from_fn(own.nrows(), m + 6, |i, k| match k.checked_sub(m) {
        None => modes[(i, k)] / top.sqrt(),
        Some(k) => OWN * own[(i, k)] / if k < 3 { linear } else { angular },
    });
    let (rest, most) = match settings.rank {
        Some(rank) => (0.0, rank),
        None => (REST * settings.tolerance.sqrt(), usize::MAX),
    };
    let most = most.min(fitted.points.len() / FITTED);
    let (columns, left) = pursuit::pursuit(&field, &targets, rest, most);
    let field = Mat::from_fn(field.nrows(), columns.len(), |i, k| field[(i, columns[k])]);
    let (points, spread) = sources.chosen(&columns);
    Ok(Chosen {
        ball: Ball { center, radius },
        volume: surface.faces.volume(),
        gap,
        regions,
        fitted,
        checked,
        // No more modes than columns.
        modes: modes.get(.., ..m.min(columns.len())).to_owned(),
        field,
        points,
        spread,
        own,
        asymmetry,
        wrong_sign,
        left,
    })
}

/// Compresses the body `name` with a mesh in its frame, whose flow `response` knows.
///
/// A resolved gap below [`finest_gap`] is raised to it: see [`Fit::resolved_gap`]. Within `regions` smaller gaps are resolved; one
/// for which that would take too many proxies has its gap raised: see [`Fit::regions`].
///
/// # Errors
/// Settings out of range, and what the one-body method doesn't resolve.
pub fn compress(
    name: &str,
    mesh: &TriMesh,
    response: &dyn Response,
    settings: &CompressSettings,
    regions: &[Region],
) -> Result<ReducedBody> {
    let chosen = choose(name, mesh, response, settings, regions)?;
    let modes = pursuit::least_squares(&chosen.field, &chosen.modes);
    let strengths = pursuit::least_squares(&chosen.field, &chosen.own);
    let (modes, strengths) = (&chosen.spread * modes, &chosen.spread * strengths);

    // What the compressed body says at points that it was not fitted to.
    let checked = &chosen.checked;
    let there = potentials_weighted(checked, &chosen.points);
    let radiated = relative(&(&there * &strengths), &checked.radiated(response)?);
    let scattered = checked.scattered(response)?;
    let solution = &there * &modes;
    let scattered = relative(&(&solution * solution.transpose()), &scattered);
    ReducedBody::new(CompressedParts {
        name: name.to_string(),
        modes: dense(&modes),
        strengths: dense(&strengths),
        added_mass: response.added_mass(),
        centre: chosen.ball.center,
        radius: chosen.ball.radius,
        volume: chosen.volume,
        fit: Fit {
            resolved_gap: chosen.gap,
            regions: chosen.regions,
            halved: response.halved(),
            proxies: chosen.fitted.points.len(),
            reached: (chosen.left / REST).powi(2),
            asymmetry: chosen.asymmetry,
            radiated,
            scattered,
            wrong_sign: chosen.wrong_sign,
            body_asymmetry: response.asymmetry(),
            body_error: response.error(),
            warnings: unnamed(name, response.warnings()),
        },
        points: chosen.points,
    })
}

/// Warnings of a body without its name: it may be kept for others that are made alike.
fn unnamed(name: &str, warnings: &[String]) -> Vec<String> {
    let prefix = format!("body \"{name}\": ");
    let each = warnings.iter();
    each.map(|w| w.strip_prefix(&prefix).unwrap_or(w).to_owned())
        .collect()
}

/// The smallest gap (m) that a compressed body with the surface `area` (m²) can resolve.
pub fn finest_gap(area: f64) -> f64 {
    (area / MOST_PROXIES).sqrt() / SPACING
}

/// The gap (m) that a body of `volume` (m³) and surface `area` (m²) resolves where nothing is asked for:
/// [`usual_gap`], or the finest that it can.
pub fn default_gap(volume: f64, area: f64) -> f64 {
    usual_gap(volume, area).max(finest_gap(area))
}

/// A quarter of the radius of the ball with this ratio of volume to area, m.
pub fn usual_gap(volume: f64, area: f64) -> f64 {
    0.75 * volume / area
}

/// Replaces the matrix by its symmetric part; the largest difference from its transpose, relative to
/// the largest entry.
fn symmetrise(a: &mut Mat<f64>) -> f64 {
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for j in 0..a.ncols() {
        for i in 0..=j {
            let (x, y) = (a[(i, j)], a[(j, i)]);
            worst = worst.max((x - y).abs());
            largest = largest.max(x.abs()).max(y.abs());
            a[(i, j)] = 0.5 * (x + y);
            a[(j, i)] = 0.5 * (x + y);
        }
    }
    worst / largest
}

/// Largest difference of two matrices, relative to the largest entry of the second.
fn relative(a: &Mat<f64>, b: &Mat<f64>) -> f64 {
    (a - b).norm_max() / b.norm_max()
}

/// Proxies to fit to and others to check at, `spacing` times their distance from the surface apart.
fn proxies(surface: &Interior, gap: f64, radius: f64, spacing: f64) -> (Proxies, Proxies) {
    let (mut fitted, mut checked) = (Proxies::default(), Proxies::default());
    let mut offset = gap;
    loop {
        let around = samples::around(surface, offset, spacing * offset, None);
        fitted.add(&mut checked, around, offset);
        if offset > 2.0 * radius {
            return (fitted, checked);
        }
        offset *= 2.0;
    }
}

/// W E.
fn potentials_weighted(proxies: &Proxies, sources: &[Vec3]) -> Mat<f64> {
    Mat::from_fn(proxies.points.len(), sources.len(), |i, j| {
        proxies.distances[i] / (proxies.points[i] - sources[j]).norm()
    })
}

/// Points inside, at several depths.
fn candidates(surface: &Interior, gap: f64, radius: f64) -> Vec<Candidate> {
    let mut spacing = CANDIDATES;
    loop {
        let mut out = Vec::new();
        let mut depth = DEPTH * gap;
        while depth < radius {
            let layer = Layer {
                depth,
                spacing,
                tangent: TANGENT,
                plate: CANDIDATES * DEPTH * gap,
            };
            out.extend(samples::inside(surface, layer, None));
            depth *= 2.0;
        }
        let out = samples::thin(out, 1e-3 * gap, |c| c.point);
        if out.len() <= MOST_CANDIDATES {
            return out;
        }
        spacing *= 1.05 * (out.len() as f64 / MOST_CANDIDATES as f64).sqrt();
    }
}
