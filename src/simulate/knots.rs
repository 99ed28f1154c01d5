//! Controls through knots.

use super::{Controls, Simulator};
use crate::{Error, Result};
use nalgebra::DMatrix;

/// Open-loop controls that run straight from knot to knot, evenly spaced from the first step to the last, and stay within limits:
/// a few numbers x in place of one per control and step. At a knot a control is `limit · tanh x`; x has one number per knot and control,
/// the controls of a knot together.
#[derive(Clone, Debug, PartialEq)]
pub struct Knots {
    limits: Vec<f64>,
    knots: usize,
    steps: usize,
}

/// How near to its limit a control may start: tanh never gets there.
const INSIDE: f64 = 0.99;

impl Knots {
    /// `knots` knots over `steps` steps, with the largest absolute value of each control (N or N m).
    ///
    /// # Errors
    /// Fewer than two knots, more knots than steps, another number of limits than controls, or one that isn't positive.
    pub fn new(simulator: &Simulator, steps: usize, knots: usize, limits: &[f64]) -> Result<Self> {
        let controls = simulator.system().controls;
        if knots < 2 || knots > steps {
            return Err(Error::input(
                "knots",
                knots,
                format!("must be at least 2, and at most the {steps} steps"),
            ));
        }
        if limits.len() != controls {
            return Err(Error::input(
                "knots: limits",
                format!("{} numbers", limits.len()),
                format!("must be {controls} numbers, one per control"),
            ));
        }
        if let Some(bad) = limits.iter().find(|l| !(**l > 0.0 && l.is_finite())) {
            return Err(Error::input(
                "knots: limits",
                bad,
                "must be positive numbers, N or N m",
            ));
        }
        Ok(Self {
            limits: limits.to_vec(),
            knots,
            steps,
        })
    }

    /// Length of x.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.knots * self.limits.len()
    }

    /// Knot before step `n` and how far it is on the way to the next one.
    fn place(&self, n: usize) -> (usize, f64) {
        let at = n as f64 * (self.knots - 1) as f64 / (self.steps - 1) as f64;
        let knot = (at as usize).min(self.knots - 2);
        (knot, at - knot as f64)
    }

    fn check(&self, x: &[f64]) -> Result<()> {
        if x.len() == self.len() {
            return Ok(());
        }
        Err(Error::input(
            "knots: x",
            format!("{} numbers", x.len()),
            format!("must be {} numbers", self.len()),
        ))
    }

    fn check_shape(&self, what: &str, controls: &DMatrix<f64>) -> Result<()> {
        let right = (self.limits.len(), self.steps);
        if controls.shape() == right {
            return Ok(());
        }
        Err(Error::input(
            what,
            format!("{:?}", controls.shape()),
            format!("must have the shape {right:?}"),
        ))
    }

    /// The controls of x.
    ///
    /// # Errors
    /// A wrong length, values that aren't finite, or another simulator's number of controls.
    pub fn controls(&self, simulator: &Simulator, x: &[f64]) -> Result<Controls> {
        self.check(x)?;
        let m = self.limits.len();
        let knot = |k: usize, c: usize| self.limits[c] * x[k * m + c].tanh();
        Controls::from_matrix(
            simulator,
            DMatrix::from_fn(m, self.steps, |c, n| {
                let (k, part) = self.place(n);
                (1.0 - part) * knot(k, c) + part * knot(k + 1, c)
            }),
        )
    }

    /// Transpose of [`Knots::controls`]: the cotangent of x from that of the controls (controls × steps).
    ///
    /// # Errors
    /// A wrong length or shape.
    pub fn controls_vjp(&self, x: &[f64], controls_bar: &DMatrix<f64>) -> Result<Vec<f64>> {
        self.check(x)?;
        let m = self.limits.len();
        self.check_shape("knots: cotangent of the controls", controls_bar)?;
        let mut bar = vec![0.0; x.len()];
        for n in 0..self.steps {
            let (k, part) = self.place(n);
            for c in 0..m {
                bar[k * m + c] += (1.0 - part) * controls_bar[(c, n)];
                bar[(k + 1) * m + c] += part * controls_bar[(c, n)];
            }
        }
        for (i, b) in bar.iter_mut().enumerate() {
            *b *= self.limits[i % m] * (1.0 - x[i].tanh().powi(2));
        }
        Ok(bar)
    }

    /// The x whose controls take those of `controls` at the knots, limits kept: where to start from controls that are known.
    ///
    /// # Errors
    /// Controls of another shape.
    pub fn through(&self, controls: &Controls) -> Result<Vec<f64>> {
        let m = self.limits.len();
        self.check_shape("knots: controls", controls.matrix())?;
        let last = (self.steps - 1) as f64 / (self.knots - 1) as f64;
        Ok((0..self.len())
            .map(|i| {
                let n = ((i / m) as f64 * last).round() as usize;
                let share = controls.matrix()[(i % m, n)] / self.limits[i % m];
                share.clamp(-INSIDE, INSIDE).atanh()
            })
            .collect())
    }
}
