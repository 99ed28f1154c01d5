//! Values and rates of given motions.

use super::Motion;

impl Motion {
    /// Coordinate at time `t` (s), m or rad.
    pub fn value(&self, t: f64) -> f64 {
        match *self {
            Motion::Linear { offset, rate } => offset + rate * t,
            Motion::Sine {
                offset,
                amplitude,
                frequency,
                phase,
            } => offset + amplitude * (frequency * t + phase).sin(),
        }
    }

    /// Rate at time `t`, m/s or rad/s.
    pub fn rate(&self, t: f64) -> f64 {
        match *self {
            Motion::Linear { rate, .. } => rate,
            Motion::Sine {
                amplitude,
                frequency,
                phase,
                ..
            } => amplitude * frequency * (frequency * t + phase).cos(),
        }
    }

    /// Rate of the rate at time `t`, m/s² or rad/s².
    pub fn acceleration(&self, t: f64) -> f64 {
        match *self {
            Motion::Linear { .. } => 0.0,
            Motion::Sine {
                amplitude,
                frequency,
                phase,
                ..
            } => -amplitude * frequency.powi(2) * (frequency * t + phase).sin(),
        }
    }
}
