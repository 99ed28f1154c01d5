//! How a compressed body changes with its shape.

use crate::adjoint::lie::{Mat6, Vec3};
use nalgebra::DMatrix;

/// How a compressed body changes with a shape parameter, per unit of that, in its own frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeSlope {
    /// Of the points.
    pub points: Vec<Vec3>,
    /// Of Ū, points × 6.
    pub strengths: DMatrix<f64>,
    /// Of S̄, points × points, symmetric.
    pub solution: DMatrix<f64>,
    /// Of M̄₀.
    pub added_mass: Mat6,
}

impl ShapeSlope {
    /// The same of a body that is larger by `factor` in all lengths, for a parameter in the same units as before.
    pub fn scaled(mut self, factor: f64) -> Self {
        let power = |i: usize, n: i32| factor.powi(n + i32::from(i >= 3));
        self.points.iter_mut().for_each(|p| *p *= factor);
        self.solution *= factor;
        for k in 0..6 {
            self.strengths.column_mut(k).scale_mut(power(k, 2));
        }
        self
    }
}
