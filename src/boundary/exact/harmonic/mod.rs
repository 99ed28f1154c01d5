//! An ellipsoid in the flow of point sources, by ellipsoidal harmonics.
//!
//! On confocal surfaces ℓ, with X the unit vector of a point there ([`confocal`](super::confocal)) and
//! `dτ = −dℓ / (2 √((ℓ+A)(ℓ+B)ℓ))`, Laplace's equation and the flux through a piece of the surface are
//!
//! ```text
//! ∂²φ/∂τ² = (ℓ+A) L₁²φ + (ℓ+B) L₂²φ + ℓ L₃²φ = [(ℓ − c²) L² + Σ a_i² L_i²] φ,    −∂φ/∂n dA = ∂φ/∂τ dΩ(X)
//! ```
//!
//! with L = −i X × ∂/∂X: angular momentum on the unit sphere of X. `L²` and `T = A L₁² + B L₂²` commute, so
//! their common eigenfunctions S_k(X), orthonormal, n(n+1) and h_k, separate the equation ([`top`]). With
//! F_k and E_k the solutions in τ outside and inside, 1 at the surface ([`radial`]), and their logarithmic
//! derivatives f = F′, e = −E′ there,
//!
//! ```text
//! 1/|x − y|     = Σ_k 4π/(e + f) E_k(x) F_k(y) S_k(X) S_k(Y)          x nearer
//! scattered     = Σ_k 4π e / (f (e + f)) F_k(x) F_k(y) S_k(X) S_k(Y)
//! ```
//!
//! Exact, but for the degree at which the sum ends; symmetric in x and y; nothing is solved. Spheroids and
//! thin bodies are no special cases: what counts is the gap over the longest semi-axis.
//!
//! # References
//! E. W. Hobson, *The theory of spherical and ellipsoidal harmonics* (1931), ch. XI; G. Dassios,
//! *Ellipsoidal harmonics* (2012).

mod legendre;
mod radial;
mod residual;
mod top;
mod tridiagonal;

use super::confocal::{Confocal, Place};
use crate::adjoint::lie::Vec3;
use crate::solver::matmul;
use crate::{Error, Result};
use faer::reborrow::ReborrowMut;
use faer::{Accum, Mat, MatMut, MatRef};
use legendre::Legendre;
use radial::{Grid, Radial, Spot};
use rayon::prelude::*;
use std::f64::consts::PI;
use top::{Class, Top};

/// Highest degree.
const MOST: usize = 256;
/// Smallest gap over the longest semi-axis: degrees go like its inverse.
const NEAREST: f64 = 0.02;
/// A degree that is less of a source's flux on the surface than this is the last.
const LAST: f64 = 1e-5;
/// Harmonics that are less of it than this are left out.
const LEAST: f64 = 1e-7;
/// A degree that is less of the answer than this is the last to be summed.
const SUMMED: f64 = 1e-9;
/// Largest relative error of an answer, estimated from the last degree, that is let pass.
const TRUNCATED: f64 = 1e-3;
/// Sources that are tried to choose the harmonics.
const SAMPLES: usize = 60;
/// Harmonics in a block of the product.
const BLOCK: usize = 768;
/// Points in a block of the evaluation.
const POINTS: usize = 32;
/// A smaller B than this, in squares of the shortest semi-axis, is none.
const ROUND: f64 = 1e-9;

/// The harmonics of one ellipsoid. Lengths in longest semi-axes.
#[derive(Clone, Debug)]
pub(super) struct Harmonics {
    /// Longest semi-axis, m.
    scale: f64,
    /// The others over it, falling.
    semi_axes: Vec3,
    top: Top,
    grid: Grid,
    /// From degree 1.
    degrees: Vec<Degree>,
    /// As given, m.
    resolved_gap: f64,
}

#[derive(Clone, Debug)]
struct Degree {
    recursion: Vec<[f64; 2]>,
    radials: Vec<Radial>,
    /// With the radial part of each function.
    classes: Vec<(Class, Vec<usize>)>,
    size: usize,
}

/// A point on its way through the degrees.
struct Probe {
    legendre: Legendre,
    spot: Spot,
}

/// What multiplies F S.
#[derive(Clone, Copy)]
enum Weight {
    One,
    /// 4π e/(e + f): a source's flux on the surface.
    Flux,
    /// √(4π e/(f (e + f))): half of the answer.
    Answer,
}

impl Harmonics {
    /// For sources at `gap` (m) and beyond; `name` of the body for messages.
    pub fn new(name: &str, confocal: &Confocal, gap: f64) -> Result<Self> {
        let scale = confocal.semi_axes[0];
        if gap < NEAREST * scale {
            return Err(Error::Unresolved {
                place: format!("body \"{name}\""),
                quantity: format!(
                    "resolved gap {gap:.6e} m over the longest semi-axis {scale:.6e} m"
                ),
                value: gap / scale,
                limit: NEAREST,
                remedy: "ask for a larger gap".into(),
            });
        }
        let semi_axes = Vec3::from(confocal.semi_axes) / scale;
        let [a, b, _] = confocal.offsets.map(|o| o / (scale * scale));
        let b = if b < ROUND * semi_axes.z * semi_axes.z {
            0.0
        } else {
            b
        };
        let mut out = Self {
            scale,
            semi_axes,
            top: Top::new(a, b),
            grid: Grid::new(a, b, semi_axes.z * semi_axes.z),
            degrees: Vec::new(),
            resolved_gap: gap,
        };
        let mut samples: Vec<Probe> = residual::octant(SAMPLES)
            .iter()
            .map(|d| Ok(out.probe(&out.offset(name, d, gap / scale)?.1, MOST)))
            .collect::<Result<_>>()?;
        let mut totals = vec![0.0; samples.len()];
        let mut small = 0;
        while small < 3 && out.degrees.len() < MOST {
            let (degree, largest) = out.degree(&mut samples, &mut totals)?;
            out.degrees.push(degree);
            small = if largest < LAST { small + 1 } else { 0 };
        }
        Ok(out)
    }

    /// The point at a distance (longest semi-axes) off the surface's point in direction X.
    fn offset(&self, name: &str, direction: &Vec3, gap: f64) -> Result<(Vec3, Place)> {
        let foot = direction.component_mul(&self.semi_axes);
        let normal = direction.component_div(&self.semi_axes).normalize();
        let point = foot + gap * normal;
        let unit = Confocal::new(self.semi_axes.into());
        Ok((point, unit.locate(name, &point)?))
    }

    /// A point at the start, for degrees up to `most`.
    fn probe(&self, place: &Place, most: usize) -> Probe {
        Probe {
            legendre: Legendre::new(self.top.components(&place.direction), most),
            spot: self.grid.spot(place.level),
        }
    }

    /// The next degree, and its largest part in a sample's flux.
    fn degree(&self, samples: &mut [Probe], totals: &mut [f64]) -> Result<(Degree, f64)> {
        let n = self.degrees.len() + 1;
        let found = self.top.classes(n)?;
        // One radial part a function; where the body is round, sines share the cosines'.
        let mut wanted = Vec::new();
        let mut shared = vec![0; n + 1];
        let mut classes = Vec::with_capacity(found.len());
        for class in found {
            let mut radials = Vec::with_capacity(class.values.len());
            for (i, &h) in class.values.iter().enumerate() {
                if class.vectors.is_none() && class.sine {
                    radials.push(shared[class.orders[i]]);
                } else {
                    shared[class.orders[i]] = wanted.len();
                    radials.push(wanted.len());
                    wanted.push((h, class.odd));
                }
            }
            classes.push((class, radials));
        }
        let radials: Vec<Radial> = wanted
            .into_par_iter()
            .map(|(h, odd)| self.grid.radial(n, h, odd))
            .collect();
        let mut degree = Degree {
            recursion: legendre::recursion(n),
            radials,
            size: classes.iter().map(|(_, r)| r.len()).sum(),
            classes,
        };
        let mut values = Mat::zeros(degree.size, samples.len());
        self.fill(&degree, samples, Weight::Flux, values.as_mut());
        let mut most = vec![0.0f64; degree.size];
        let mut largest = 0.0f64;
        for (column, total) in values.col_iter().zip(totals) {
            let own = column.squared_norm_l2();
            *total += own;
            let part = |x: f64| if *total > 0.0 { x / total.sqrt() } else { 0.0 };
            largest = largest.max(part(own.sqrt()));
            for (m, x) in most.iter_mut().zip(column.iter()) {
                *m = m.max(part(x.abs()));
            }
        }
        degree.keep(|k| most[k] > LEAST);
        Ok((degree, largest))
    }

    /// Goes on to a degree and writes the values of its functions at some points: functions × points.
    fn fill(&self, degree: &Degree, probes: &mut [Probe], weight: Weight, mut out: MatMut<f64>) {
        let rate = self.grid.rate();
        let weights: Vec<f64> = degree
            .radials
            .iter()
            .map(|r| {
                let share = r.inside / (r.inside + r.outside);
                match weight {
                    Weight::One => 1.0,
                    Weight::Flux => 4.0 * PI * share,
                    Weight::Answer => (4.0 * PI * share * rate / r.outside).sqrt(),
                }
            })
            .collect();
        for probe in probes.iter_mut() {
            probe.legendre.advance(&degree.recursion);
        }
        let mut from = 0;
        for (class, radials) in &degree.classes {
            let size = radials.len();
            let mut own = out.rb_mut().subrows_mut(from, size);
            from += size;
            let basis = Mat::from_fn(class.orders.len(), probes.len(), |i, j| {
                probes[j].legendre.value(class.orders[i], class.sine)
            });
            match &class.vectors {
                None => own.copy_from(&basis),
                Some(v) => {
                    let (add, v) = (Accum::Replace, v.transpose());
                    matmul(own.rb_mut(), add, v, basis.as_ref(), 1.0);
                }
            }
        }
        let mut factors = vec![0.0; degree.radials.len()];
        for (probe, column) in probes.iter().zip(out.col_iter_mut()) {
            for ((f, r), w) in factors.iter_mut().zip(&degree.radials).zip(&weights) {
                *f = w * self.grid.value(r, &probe.spot);
            }
            let radials = degree.classes.iter().flat_map(|(_, r)| r);
            for (x, r) in column.iter_mut().zip(radials) {
                *x *= factors[*r];
            }
        }
    }

    /// Values of the functions of some degrees at all points, functions × points, and the largest norm
    /// of each degree.
    fn values(
        &self,
        degrees: &[Degree],
        probes: &mut [Probe],
        weight: Weight,
    ) -> (Mat<f64>, Vec<f64>) {
        let size: usize = degrees.iter().map(|d| d.size).sum();
        let mut out = Mat::zeros(size, probes.len());
        let blocks = blocks(out.as_mut());
        let norms = blocks
            .into_par_iter()
            .zip(probes.par_chunks_mut(POINTS))
            .map(|(mut block, probes)| {
                let mut from = 0;
                let mut norms = Vec::with_capacity(degrees.len());
                for degree in degrees {
                    let mut own = block.rb_mut().subrows_mut(from, degree.size);
                    self.fill(degree, probes, weight, own.rb_mut());
                    from += degree.size;
                    norms.push(own.col_iter().map(|c| c.norm_l2()).fold(0.0, f64::max));
                }
                norms
            })
            .reduce(
                || vec![0.0; degrees.len()],
                |a, b| a.iter().zip(&b).map(|(a, b)| f64::max(*a, *b)).collect(),
            );
        (out, norms)
    }

    /// Number of harmonics and the highest degree.
    pub fn size(&self) -> (usize, usize) {
        (
            self.degrees.iter().map(|d| d.size).sum(),
            self.degrees.len(),
        )
    }

    /// Potentials at `points` of what the body adds to unit sources at `sources` (places as in
    /// [`Confocal`], m): points × sources, 1/m. `name` of the body for messages.
    pub fn scattered(&self, name: &str, sources: &[Place], points: &[Place]) -> Result<Mat<f64>> {
        let same = sources == points;
        let unit = |p: &Place| {
            let level = p.level / (self.scale * self.scale);
            self.probe(&Place { level, ..*p }, self.degrees.len())
        };
        let mut at_sources: Vec<Probe> = sources.iter().map(unit).collect();
        let mut at_points: Vec<Probe> = match same {
            true => Vec::new(),
            false => points.iter().map(unit).collect(),
        };
        let mut out = Mat::zeros(points.len(), sources.len());
        let mut bounds: Vec<f64> = Vec::new();
        let mut from = 0;
        while from < self.degrees.len() && !ended(&bounds) {
            let (mut to, mut size) = (from, 0);
            while to < self.degrees.len() && size < BLOCK {
                size += self.degrees[to].size;
                to += 1;
            }
            let degrees = &self.degrees[from..to];
            let (right, norms) = self.values(degrees, &mut at_sources, Weight::Answer);
            if same {
                bounds.extend(norms.iter().map(|x| x * x));
                add_product(&mut out, right.as_ref(), right.as_ref(), 1.0 / self.scale);
            } else {
                let (left, own) = self.values(degrees, &mut at_points, Weight::Answer);
                bounds.extend(norms.iter().zip(&own).map(|(x, y)| x * y));
                add_product(&mut out, left.as_ref(), right.as_ref(), 1.0 / self.scale);
            }
            from = to;
        }
        if !ended(&bounds) {
            let rest = remainder(&bounds);
            if rest > TRUNCATED {
                return Err(Error::Unresolved {
                    place: format!("body \"{name}\""),
                    quantity: format!(
                        "relative error of the flow that it adds to sources too near to it, by degree {} of its \
                         harmonics",
                        self.degrees.len()
                    ),
                    value: rest,
                    limit: TRUNCATED,
                    remedy: format!(
                        "move the points farther away, or ask for a smaller resolved gap than {:.6e} m",
                        self.resolved_gap
                    ),
                });
            }
        }
        Ok(out)
    }
}

/// Whether the last degrees are next to nothing.
fn ended(bounds: &[f64]) -> bool {
    let largest = bounds.iter().fold(0.0f64, |m, b| m.max(*b));
    let tail = bounds.iter().rev().take(3);
    bounds.len() > 3 && tail.fold(0.0f64, |m, b| m.max(*b)) <= SUMMED * largest
}

/// What is left, relative to the sum, as a geometric series from its last terms.
fn remainder(bounds: &[f64]) -> f64 {
    let n = bounds.len();
    let sum: f64 = bounds.iter().sum();
    let last = bounds[n - 1].max(if n > 1 { bounds[n - 2] } else { 0.0 });
    let ratio = (last / bounds[n / 2]).powf(1.0 / (n - n / 2) as f64);
    if sum > 0.0 {
        last / (1.0 - ratio.min(0.999)) / sum
    } else {
        0.0
    }
}

/// `out += scale · leftᵀ right`, columns in parallel.
fn add_product(out: &mut Mat<f64>, left: MatRef<f64>, right: MatRef<f64>, scale: f64) {
    let blocks = blocks(out.as_mut());
    blocks.into_par_iter().enumerate().for_each(|(i, block)| {
        let right = right.subcols(POINTS * i, block.ncols());
        matmul(block, Accum::Add, left.transpose(), right, scale);
    });
}

/// Columns in blocks of [`POINTS`].
fn blocks(mut whole: MatMut<'_, f64>) -> Vec<MatMut<'_, f64>> {
    let mut out = Vec::with_capacity(whole.ncols().div_ceil(POINTS));
    while whole.ncols() > POINTS {
        let (block, rest) = whole.split_at_col_mut(POINTS);
        out.push(block);
        whole = rest;
    }
    out.push(whole);
    out
}

impl Degree {
    /// Leaves out the functions for which `wanted` is false, and radial parts that none needs.
    fn keep(&mut self, wanted: impl Fn(usize) -> bool) {
        let mut at = 0;
        for (class, radials) in &mut self.classes {
            let kept: Vec<usize> = (0..radials.len()).filter(|j| wanted(at + j)).collect();
            at += radials.len();
            *radials = kept.iter().map(|&j| radials[j]).collect();
            match &mut class.vectors {
                None => class.orders = kept.iter().map(|&j| class.orders[j]).collect(),
                Some(v) => *v = Mat::from_fn(v.nrows(), kept.len(), |i, j| v[(i, kept[j])]),
            }
        }
        self.classes.retain(|(_, r)| !r.is_empty());
        self.size = self.classes.iter().map(|(_, r)| r.len()).sum();
        let mut used = vec![None; self.radials.len()];
        for r in self.classes.iter().flat_map(|(_, r)| r) {
            used[*r] = Some(0);
        }
        for (next, slot) in used.iter_mut().flatten().enumerate() {
            *slot = next;
        }
        let mut index = used.iter();
        self.radials
            .retain(|_| index.next().is_some_and(|u| u.is_some()));
        for r in self.classes.iter_mut().flat_map(|(_, r)| r) {
            *r = used[*r].unwrap_or(0);
        }
    }
}
