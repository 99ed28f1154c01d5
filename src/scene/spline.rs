//! Motions through given points.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A motion through given points, by the natural cubic spline: twice continuously differentiable, of all such curves the one that bends least. Before the first point and
/// after the last it goes on straight.
///
/// A recording's noise is its own, and its second derivative is the acceleration of a joint: give points as far apart as the motion is smooth, each the mean of what was
/// recorded about it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Points", into = "Points")]
pub struct Spline {
    points: Points,
    /// Second derivatives at the points, m/s² or rad/s².
    bends: Vec<f64>,
}

/// As a scene gives them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Points {
    /// s, ascending.
    times: Vec<f64>,
    /// m or rad.
    values: Vec<f64>,
}

impl TryFrom<Points> for Spline {
    type Error = Error;

    fn try_from(points: Points) -> Result<Self> {
        Self::new(points.times, points.values)
    }
}

impl From<Spline> for Points {
    fn from(spline: Spline) -> Self {
        spline.points
    }
}

impl Spline {
    /// Through `values` (m or rad) at `times` (s).
    ///
    /// # Errors
    /// Fewer than two points, as many times as values, numbers that aren't finite, and times that don't ascend.
    pub fn new(times: Vec<f64>, values: Vec<f64>) -> Result<Self> {
        let refused = |field: &str, value: String, expected: &str| {
            Err(Error::input(
                format!("spline motion: {field}"),
                value,
                expected,
            ))
        };
        let (n, m) = (times.len(), values.len());
        if n < 2 || n != m {
            return refused(
                "times and values",
                format!("{n} and {m} of them"),
                "give as many values as times, two at least",
            );
        }
        for (field, numbers) in [("times", &times), ("values", &values)] {
            if let Some(i) = numbers.iter().position(|x| !x.is_finite()) {
                let place = format!("{field}[{i}]");
                return refused(&place, numbers[i].to_string(), "give finite numbers");
            }
        }
        if let Some(i) = (1..n).find(|i| times[*i] <= times[i - 1]) {
            return refused(
                &format!("times[{i}]"),
                format!("{} after {}", times[i], times[i - 1]),
                "times must ascend",
            );
        }
        let bends = bends(&times, &values);
        if let Some(i) = bends.iter().position(|x| !x.is_finite()) {
            return refused(
                &format!("values[{i}]"),
                values[i].to_string(),
                "points so near in time and far apart leave floating point",
            );
        }
        Ok(Self {
            points: Points { times, values },
            bends,
        })
    }

    /// When the points are, s.
    pub fn times(&self) -> &[f64] {
        &self.points.times
    }

    /// Where they are, m or rad.
    pub fn values(&self) -> &[f64] {
        &self.points.values
    }

    /// The same motion shifted by `offset`, m or rad.
    pub fn shifted(mut self, offset: f64) -> Self {
        self.points.values.iter_mut().for_each(|x| *x += offset);
        self
    }

    /// Coordinate, its rate and the rate's rate at time `t`.
    pub(super) fn at(&self, t: f64) -> [f64; 3] {
        let Points { times, values } = &self.points;
        let last = times.len() - 1;
        let i = times.partition_point(|x| *x <= t).clamp(1, last) - 1;
        let h = times[i + 1] - times[i];
        let (m, n) = (self.bends[i], self.bends[i + 1]);
        let slope = (values[i + 1] - values[i]) / h;
        // The rate at either end of the piece.
        let (start, end) = (
            slope - h * (2.0 * m + n) / 6.0,
            slope + h * (m + 2.0 * n) / 6.0,
        );
        if t < times[0] {
            return [values[0] + start * (t - times[0]), start, 0.0];
        }
        if t > times[last] {
            return [values[last] + end * (t - times[last]), end, 0.0];
        }
        let s = t - times[i];
        let jerk = (n - m) / h;
        [
            values[i] + s * (start + s * (0.5 * m + s * jerk / 6.0)),
            start + s * (m + 0.5 * s * jerk),
            m + s * jerk,
        ]
    }
}

/// Second derivatives of the natural spline: a tridiagonal system, diagonally dominant.
fn bends(times: &[f64], values: &[f64]) -> Vec<f64> {
    let n = times.len();
    let h: Vec<f64> = times.windows(2).map(|t| t[1] - t[0]).collect();
    let slope: Vec<f64> = (values.windows(2).zip(&h))
        .map(|(x, h)| (x[1] - x[0]) / h)
        .collect();
    // Above the diagonal and to the right, after elimination.
    let (mut above, mut right) = (vec![0.0; n], vec![0.0; n]);
    for i in 1..n - 1 {
        let diagonal = 2.0 * (h[i - 1] + h[i]) - h[i - 1] * above[i - 1];
        above[i] = h[i] / diagonal;
        let given = 6.0 * (slope[i] - slope[i - 1]);
        right[i] = (given - h[i - 1] * right[i - 1]) / diagonal;
    }
    for i in (1..n - 1).rev() {
        right[i] -= above[i] * right[i + 1];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Through its points, C² across them, straight beyond, and a cubic with no bend at its ends found as it is.
    #[test]
    fn it_is_the_natural_spline() -> Result<()> {
        let times = vec![0.0, 0.4, 1.0, 1.3, 2.0];
        let cubic = |t: f64| t * t * (3.0 - 0.5 * t) - 6.0 * t;
        let values: Vec<f64> = times.iter().map(|t| cubic(*t)).collect();
        let spline = Spline::new(times.clone(), values.clone())?;
        for (t, x) in times.iter().zip(&values) {
            assert!((spline.at(*t)[0] - x).abs() < 1e-13);
            let [before, after] = [t - 1e-9, t + 1e-9].map(|t| spline.at(t));
            assert!((0..3).all(|k| (before[k] - after[k]).abs() < 1e-6));
        }
        // Its bends vanish at both ends.
        let times: Vec<f64> = (0..=60)
            .map(|i| f64::from(i) * std::f64::consts::PI / 60.0)
            .collect();
        let sine = Spline::new(times.clone(), times.iter().map(|t| t.sin()).collect())?;
        let worst = (0..300)
            .map(|i| f64::from(i) * 0.01)
            .map(|t| (sine.at(t)[0] - t.sin()).abs());
        assert!(worst.fold(0.0, f64::max) < 1e-7);
        let end = sine.at(std::f64::consts::PI + 0.5);
        assert!((end[0] + 0.5).abs() < 1e-5 && (end[1] + 1.0).abs() < 1e-5 && end[2] == 0.0);
        Ok(())
    }

    #[test]
    fn bad_points_are_refused() {
        let cases = [
            (vec![0.0], vec![1.0], "two at least"),
            (vec![0.0, 1.0], vec![1.0], "as many"),
            (vec![0.0, 0.0], vec![1.0, 2.0], "ascend"),
            (vec![0.0, f64::NAN], vec![1.0, 2.0], "times[1]"),
            (vec![0.0, 1.0], vec![1.0, f64::INFINITY], "values[1]"),
            (
                vec![0.0, 1e-300, 1.0],
                vec![0.0, 1e300, 0.0],
                "floating point",
            ),
        ];
        for (times, values, said) in cases {
            let error = Spline::new(times, values).err().map(|e| e.to_string());
            assert!(
                error.as_ref().is_some_and(|e| e.contains(said)),
                "{error:?}"
            );
        }
    }
}
