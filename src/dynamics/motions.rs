//! Motions of a few bodies among many.

use nalgebra::{DMatrix, DVector};

/// Frame velocities of some motions, by those that aren't zero: a motion of few bodies takes little room.
#[derive(Clone, Debug, Default)]
pub struct Motions {
    velocities: usize,
    /// Of each motion its velocities, with their numbers.
    each: Vec<Vec<(usize, f64)>>,
}

impl Motions {
    /// Of so many velocities, from those of each motion that aren't zero, with their numbers.
    pub(super) fn new(velocities: usize, each: Vec<Vec<(usize, f64)>>) -> Self {
        Self { velocities, each }
    }

    /// Those that move none of the velocities in `held`.
    pub(super) fn sparing(&self, held: &[bool]) -> Self {
        let free = |motion: &&Vec<(usize, f64)>| motion.iter().all(|(i, x)| *x == 0.0 || !held[*i]);
        let each = self.each.iter().filter(free);
        Self::new(self.velocities, each.cloned().collect())
    }

    /// Number of motions.
    pub fn len(&self) -> usize {
        self.each.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.each.is_empty()
    }

    /// Of frame momenta, one a velocity, the part along each motion.
    pub fn tr_mul(&self, momenta: &DVector<f64>) -> DVector<f64> {
        let along = |motion: &Vec<(usize, f64)>| motion.iter().map(|(i, x)| x * momenta[*i]).sum();
        DVector::from_iterator(self.len(), self.each.iter().map(along))
    }

    /// Frame velocities of all motions at these rates.
    pub fn mul(&self, rates: &DVector<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(self.velocities);
        for (motion, rate) in self.each.iter().zip(rates.iter()) {
            motion.iter().for_each(|(i, x)| out[*i] += x * rate);
        }
        out
    }

    /// All of them, velocities × motions.
    pub fn dense(&self) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.velocities, self.len());
        for (k, motion) in self.each.iter().enumerate() {
            motion.iter().for_each(|(i, x)| out[(*i, k)] = *x);
        }
        out
    }
}
