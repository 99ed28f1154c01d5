//! Values and rates of given motions.

use super::{Motion, Spline};
use crate::Result;

impl Motion {
    /// Through `values` (m or rad) at `times` (s): a [`Spline`].
    ///
    /// # Errors
    /// As [`Spline::new`].
    pub fn through(times: Vec<f64>, values: Vec<f64>) -> Result<Self> {
        Spline::new(times, values).map(Self::Spline)
    }

    /// Coordinate at time `t` (s), m or rad.
    pub fn value(&self, t: f64) -> f64 {
        match self {
            Motion::Spline(spline) => spline.at(t)[0],
            &Motion::Linear { offset, rate } => offset + rate * t,
            &Motion::Sine {
                offset,
                amplitude,
                frequency,
                phase,
            } => offset + amplitude * (frequency * t + phase).sin(),
        }
    }

    /// Rate at time `t`, m/s or rad/s.
    pub fn rate(&self, t: f64) -> f64 {
        match self {
            Motion::Spline(spline) => spline.at(t)[1],
            &Motion::Linear { rate, .. } => rate,
            &Motion::Sine {
                amplitude,
                frequency,
                phase,
                ..
            } => amplitude * frequency * (frequency * t + phase).cos(),
        }
    }

    /// Rate of the rate at time `t`, m/s² or rad/s².
    pub fn acceleration(&self, t: f64) -> f64 {
        match self {
            Motion::Spline(spline) => spline.at(t)[2],
            Motion::Linear { .. } => 0.0,
            &Motion::Sine {
                amplitude,
                frequency,
                phase,
                ..
            } => -amplitude * frequency.powi(2) * (frequency * t + phase).sin(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_the_derivatives() {
        let sine = Motion::Sine {
            offset: 0.3,
            amplitude: 1.7,
            frequency: 2.1,
            phase: 0.4,
        };
        let linear = Motion::Linear {
            offset: -0.2,
            rate: 0.9,
        };
        let h = 1e-5;
        let spline = Spline::new(
            vec![0.0, 0.5, 1.1, 2.0, 3.0],
            vec![0.2, -0.4, 0.1, 0.9, 0.3],
        );
        let spline = Motion::Spline(spline.expect("a spline"));
        for motion in [sine, linear, spline] {
            for t in [-0.3, 0.2, 0.8, 1.7, 3.1] {
                let slope = |f: &dyn Fn(f64) -> f64| (f(t + h) - f(t - h)) / (2.0 * h);
                assert!((slope(&|t| motion.value(t)) - motion.rate(t)).abs() < 1e-8);
                assert!((slope(&|t| motion.rate(t)) - motion.acceleration(t)).abs() < 1e-8);
            }
        }
    }
}
