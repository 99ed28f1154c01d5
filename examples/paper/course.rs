//! The swimmer's run as a function of its gait: what it swims, what its motors spend, and the derivatives of both.

use crate::sqp::{Bounds, Vector};
use crate::swim::{path, scene, simulator, steps};
use crate::work::{self, MOTORS};
use hydrograd::{Controls, Fidelity, Result, Rollout, Simulator};
use nalgebra::{Matrix3, Vector3};
use std::error::Error;

/// The variables, in logarithms of what they are of the scene's own, and where they have to stay: amplitudes of the three joints' targets, rad, frequency, rad/s, length, stiffness, N m/rad,
/// and damping, N m s/rad.
pub const NAMES: [&str; 7] = [
    "trunk_rad",
    "stem_rad",
    "tail_rad",
    "frequency_rad_s",
    "length",
    "stiffness_n_m",
    "damping_n_m_s",
];
const LOW: [f64; 7] = [0.02, 0.02, 0.02, 4.0, 0.5, 0.5, 0.01];
const HIGH: [f64; 7] = [0.6, 0.6, 0.6, 12.0, 2.0, 40.0, 3.0];
/// Numbers among the wave's gains of those that follow the amplitudes.
const GAINS: [usize; 4] = [3, 4, 6, 7];

/// A run with what it comes to.
pub struct Swum {
    pub rollout: Rollout,
    /// Of the head, m.
    pub distance: f64,
    /// Of the motors, J.
    pub work: f64,
}

pub struct Course {
    simulator: Simulator,
    steps: usize,
    head: usize,
    /// The wave's coefficients from the amplitudes of the joints.
    coefficients: Matrix3<f64>,
    /// The variables of the scene's own gait.
    own: Vector,
}

impl Course {
    pub fn new(quick: bool) -> std::result::Result<Self, Box<dyn Error>> {
        let simulator = simulator(&scene()?, Fidelity::Auto, quick)?;
        let places = Vector3::new(1.0, 2.0, 3.0) / 3.0;
        let amplitudes = Matrix3::from_columns(&[0, 1, 2].map(|n| places.map(|s: f64| s.powi(n))));
        let gains = simulator.policy().gains();
        let own = amplitudes * Vector3::from_column_slice(&gains[..MOTORS]);
        let rest = GAINS.map(|g| gains[g]);
        Ok(Self {
            coefficients: amplitudes.try_inverse().ok_or("places of the joints")?,
            own: Vector::from_iterator(NAMES.len(), own.iter().copied().chain(rest)),
            head: simulator.scene().body("head").map_or(0, |id| id.0),
            steps: steps(quick),
            simulator,
        })
    }

    pub fn bounds(&self) -> Bounds {
        let of = |bound: [f64; 7]| {
            Vector::from_column_slice(&bound).zip_map(&self.own, |b, own| (b / own).ln())
        };
        Bounds {
            low: of(LOW),
            high: of(HIGH),
        }
    }

    pub fn values(&self, x: &Vector) -> Vector {
        x.map(f64::exp).component_mul(&self.own)
    }

    fn gains(&self, x: &Vector) -> Vec<f64> {
        let (mut gains, values) = (self.simulator.policy().gains(), self.values(x));
        let wave = self.coefficients * values.fixed_rows::<MOTORS>(0);
        gains[..MOTORS].copy_from_slice(wave.as_slice());
        for (k, g) in GAINS.into_iter().enumerate() {
            gains[g] = values[MOTORS + k];
        }
        gains
    }

    fn rollout(&self, x: &Vector, steps: usize) -> Result<Rollout> {
        let mut simulator = self.simulator.clone();
        simulator.set_policy(self.simulator.policy().with_gains(&self.gains(x))?);
        simulator.rollout(&Controls::zeros(&simulator, steps))
    }

    pub fn swim(&self, x: &Vector) -> Result<Swum> {
        let rollout = self.rollout(x, self.steps)?;
        let (along, spent) = (path(&rollout, "head").0, work::motors(&rollout));
        Ok(Swum {
            distance: along[self.steps] - along[0],
            work: spent[self.steps],
            rollout,
        })
    }

    /// Derivatives of something by the variables, from those by the gains.
    fn by_variables(&self, x: &Vector, by_gains: &[f64]) -> Vector {
        let by_wave = Vector3::from_column_slice(&by_gains[..MOTORS]);
        let by_amplitudes = self.coefficients.tr_mul(&by_wave);
        let rest = GAINS.map(|g| by_gains[g]);
        let all = by_amplitudes.iter().copied().chain(rest);
        Vector::from_iterator(NAMES.len(), all).component_mul(&self.values(x))
    }

    /// Derivatives of distance and work by the variables.
    pub fn slopes(&self, x: &Vector, swum: &Swum) -> Result<[Vector; 2]> {
        let mut bars = swum.rollout.zero_cotangents();
        bars.positions[(3 * self.head, self.steps)] = 1.0;
        let distance = swum.rollout.vjp(&bars)?.gains;
        let work = work::by_gains(&swum.rollout)?;
        Ok([distance, work].map(|by_gains| self.by_variables(x, &by_gains)))
    }

    /// Distance by work of the steps that come after, as many as before.
    pub fn economy_later(&self, x: &Vector) -> Result<f64> {
        let n = self.steps;
        let rollout = self.rollout(x, 2 * n)?;
        let (along, spent) = (path(&rollout, "head").0, work::motors(&rollout));
        Ok((along[2 * n] - along[n]) / (spent[2 * n] - spent[n]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_agree_with_central_differences() {
        let course = Course::new(true).unwrap();
        let x = Vector::from_fn(NAMES.len(), |i, _| 0.1 - 0.03 * i as f64);
        let along = Vector::from_fn(NAMES.len(), |i, _| 1e-5 * (1.0 - 0.4 * i as f64));
        let [distance, work] = course.slopes(&x, &course.swim(&x).unwrap()).unwrap();
        let [before, after] = [&x - &along, &x + &along].map(|x| course.swim(&x).unwrap());
        let agree = |slope: Vector, change: f64| {
            let told = 2.0 * slope.dot(&along);
            assert!((change / told - 1.0).abs() < 1e-6, "{change} {told}");
        };
        agree(distance, after.distance - before.distance);
        agree(work, after.work - before.work);
    }
}
