//! Where a term wants something to be: a place, or a table of places in time.

use crate::{Error, Result};

/// A target that stands, or one that moves: straight from row to row of a table in the simulation's time, and standing before and after it.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    times: Vec<f64>,
    values: Vec<Vec<f64>>,
}

impl Target {
    /// A target that stands.
    pub fn fixed(value: impl Into<Vec<f64>>) -> Self {
        Self {
            times: vec![0.0],
            values: vec![value.into()],
        }
    }

    /// A target that moves: times, s, and its value at each of them.
    ///
    /// # Errors
    /// No rows, another number of values than times, times that don't grow or aren't finite.
    pub fn table(times: Vec<f64>, values: Vec<Vec<f64>>) -> Result<Self> {
        if times.is_empty() || times.len() != values.len() {
            return Err(Error::input(
                "target: table",
                format!("{} times and {} values", times.len(), values.len()),
                "must have at least one row, and a value for each time",
            ));
        }
        let grows = times.windows(2).all(|w| w[0] < w[1]);
        if !grows || times.iter().any(|t| !t.is_finite()) {
            return Err(Error::input(
                "target: times",
                format!("{times:?}"),
                "must be finite and grow",
            ));
        }
        Ok(Self { times, values })
    }

    /// Its rows.
    pub(super) fn rows(&self) -> &[Vec<f64>] {
        &self.values
    }

    /// The rows between which it is at a time, and how far it has come from the first to the second.
    pub(super) fn at(&self, time: f64) -> (&[f64], &[f64], f64) {
        let after = self.times.partition_point(|t| *t <= time);
        let last = self.times.len() - 1;
        let (a, b) = (after.saturating_sub(1), after.min(last));
        let part = match a == b {
            true => 0.0,
            false => ((time - self.times[a]) / (self.times[b] - self.times[a])).clamp(0.0, 1.0),
        };
        (&self.values[a], &self.values[b], part)
    }

    /// The same where rows are plain numbers.
    pub(super) fn plain(&self, time: f64) -> impl Iterator<Item = f64> + '_ {
        let (a, b, part) = self.at(time);
        a.iter().zip(b).map(move |(a, b)| a + part * (b - a))
    }

    /// Refuses rows of another length, and numbers that aren't finite.
    pub(super) fn check(&self, place: &str, length: usize) -> Result<()> {
        for row in &self.values {
            if row.len() != length || row.iter().any(|x| !x.is_finite()) {
                return Err(Error::input(
                    format!("{place}: target"),
                    format!("{row:?}"),
                    format!("must be {length} finite numbers"),
                ));
            }
        }
        Ok(())
    }
}

impl From<Vec<f64>> for Target {
    fn from(value: Vec<f64>) -> Self {
        Self::fixed(value)
    }
}

impl<const N: usize> From<[f64; N]> for Target {
    fn from(value: [f64; N]) -> Self {
        Self::fixed(value)
    }
}

impl From<f64> for Target {
    fn from(value: f64) -> Self {
        Self::fixed([value])
    }
}
