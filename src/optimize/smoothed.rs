//! Gradients of a function averaged over a neighbourhood, for trajectories whose own gradient says little.
//!
//! ```text
//! f_σ(x) = E f(x + σ ε),   ε ~ N(0, 1)
//! ∇f_σ ≈ mean ∇f(x + σ ε_i)                                    first order
//!      ≈ mean (f(x + σ ε_i) − f(x − σ ε_i)) ε_i / 2σ           order zero
//! ```
//!
//! Where f is smooth the first varies less; where it jumps (a contact is missed or made) the first doesn't see the jumps, and the second, which
//! is unbiased, does. The directions ε are those of a seed and come with their opposites: the same at every x (common random numbers), so
//! that f_σ as sampled is a function that can be descended, and differences of it mean something.
//!
//! # References
//! H. J. T. Suh, M. Simchowitz, K. Zhang, R. Tedrake, "Do Differentiable Simulators Give Better Policy Gradients?", ICML 2022.

use super::descent::checked;
use crate::adjoint::sample::Samples;
use crate::{Error, Result};
use rayon::prelude::*;

/// The neighbourhood, and how it is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// σ: standard deviation of each entry of x, in its units.
    pub spread: f64,
    /// Directions; each is taken forth and back.
    pub directions: usize,
    /// Which directions.
    pub seed: u64,
}

impl Default for Smoothing {
    fn default() -> Self {
        Self {
            spread: 0.05,
            directions: 16,
            seed: 1,
        }
    }
}

/// A gradient by samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Its entries.
    pub gradient: Vec<f64>,
    /// Variance of each, as a mean of so many directions.
    pub variance: Vec<f64>,
}

impl Estimate {
    /// From what each direction gave.
    fn of(samples: &[Vec<f64>], length: usize) -> Self {
        let count = samples.len() as f64;
        let mean = |k: usize| samples.iter().map(|s| s[k]).sum::<f64>() / count;
        let gradient: Vec<f64> = (0..length).map(mean).collect();
        let variance = |k: usize| {
            let squares = samples.iter().map(|s| (s[k] - gradient[k]).powi(2));
            // One direction tells nothing of how they vary.
            match samples.len() {
                0 | 1 => f64::INFINITY,
                _ => squares.sum::<f64>() / (count * (count - 1.0)),
            }
        };
        Self {
            variance: (0..length).map(variance).collect(),
            gradient,
        }
    }

    fn total(&self) -> f64 {
        self.variance.iter().sum()
    }
}

/// A function and its gradient, averaged over a neighbourhood.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed {
    /// Mean of the function.
    pub cost: f64,
    /// Standard deviation of the function over the neighbourhood.
    pub deviation: f64,
    /// Mean of its gradients.
    pub first: Estimate,
    /// Slope of its values, which sees jumps.
    pub zeroth: Estimate,
    /// Samples that failed; their directions are left out.
    pub failures: usize,
}

impl Smoothed {
    /// Both estimates, each weighted by the inverse of its total variance; that of order zero alone where they differ by more than three standard deviations of
    /// their difference, which is what jumps do.
    pub fn mixed(&self) -> Vec<f64> {
        let (first, zeroth) = (self.first.total(), self.zeroth.total());
        let sides = || self.first.gradient.iter().zip(&self.zeroth.gradient);
        let apart: f64 = sides().map(|(a, b)| (a - b).powi(2)).sum();
        let all = first + zeroth;
        let part = match all > 0.0 && all.is_finite() {
            true => zeroth / all,
            false => 1.0,
        };
        let part = if apart > 9.0 * all { 0.0 } else { part };
        sides().map(|(a, b)| part * a + (1.0 - part) * b).collect()
    }
}

/// Averages a function and its gradient around `x`, on all cores; the result doesn't depend on their number.
///
/// # Errors
/// A spread that isn't positive, no directions, the error of a sample if none of the directions could be evaluated, and [`Error::Stopped`] of any sample.
pub fn smoothed(
    function: impl Fn(&[f64]) -> Result<(f64, Vec<f64>)> + Sync,
    x: &[f64],
    smoothing: &Smoothing,
) -> Result<Smoothed> {
    let Smoothing {
        spread,
        directions,
        seed,
    } = *smoothing;
    if !(spread > 0.0 && spread.is_finite()) {
        let expected = "must be a positive number";
        return Err(Error::input("smoothing: spread", spread, expected));
    }
    if directions == 0 {
        let expected = "must be at least 1";
        return Err(Error::input("smoothing: directions", 0, expected));
    }
    let mut random = Samples::new(seed);
    let along: Vec<Vec<f64>> = (0..directions)
        .map(|_| x.iter().map(|_| random.normal()).collect())
        .collect();
    let at = |sample: usize| {
        let step = if sample.is_multiple_of(2) {
            spread
        } else {
            -spread
        };
        let ahead = x.iter().zip(&along[sample / 2]);
        let moved: Vec<f64> = ahead.map(|(x, e)| x + step * e).collect();
        checked(function(&moved), x.len())
    };
    let mut found: Vec<_> = (0..2 * directions).into_par_iter().map(at).collect();
    let stopped = |f: &Result<_>| matches!(f, Err(Error::Stopped { .. }));
    if let Some(at) = found.iter().position(stopped)
        && let Err(stop) = found.swap_remove(at)
    {
        return Err(stop);
    }
    let failures = found.iter().filter(|f| f.is_err()).count();
    let mut whole = Vec::new();
    let mut broken = None;
    let mut found = found.into_iter();
    for along in &along {
        match (found.next(), found.next()) {
            (Some(Ok(forth)), Some(Ok(back))) => whole.push((along, forth, back)),
            (Some(Err(e)), _) | (_, Some(Err(e))) => broken = broken.or(Some(e)),
            _ => {}
        }
    }
    if let (true, Some(error)) = (whole.is_empty(), broken) {
        return Err(error);
    }
    let costs: Vec<f64> = whole.iter().flat_map(|(_, f, b)| [f.0, b.0]).collect();
    let cost = costs.iter().sum::<f64>() / costs.len() as f64;
    let squares = costs.iter().map(|c| (c - cost).powi(2)).sum::<f64>();
    let first = whole.iter().map(|(_, f, b)| {
        let both = f.1.iter().zip(&b.1);
        both.map(|(f, b)| 0.5 * (f + b)).collect()
    });
    let zeroth = whole.iter().map(|(along, f, b)| {
        let slope = (f.0 - b.0) / (2.0 * spread);
        along.iter().map(|e| slope * e).collect()
    });
    Ok(Smoothed {
        deviation: (squares / costs.len() as f64).sqrt(),
        first: Estimate::of(&first.collect::<Vec<_>>(), x.len()),
        zeroth: Estimate::of(&zeroth.collect::<Vec<_>>(), x.len()),
        cost,
        failures,
    })
}
