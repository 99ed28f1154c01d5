//! Grasps with random forces.

use hydrograd::adjoint::sample::Samples;
use nalgebra::{DMatrix, DVector};

/// Where everything is at the start and how fast, and the forces on the column and the two fingers in each step, N.
pub struct RandomGrasp {
    pub start: DVector<f64>,
    pub velocity: DVector<f64>,
    pub forces: DMatrix<f64>,
}

impl RandomGrasp {
    /// Column, and fingers that close and now and then open, each for a while; the coin, with these coordinates in `q` (across, up, rotation),
    /// somewhere between them.
    pub fn draw(random: &mut Samples, q: &DVector<f64>, coin: [usize; 3], steps: usize) -> Self {
        let mut forces = DMatrix::zeros(3, steps);
        for n in 0..steps {
            let before = (n > 0 && n % 40 != 0).then(|| forces.column(n - 1).into_owned());
            let mut next = || random.between(-500.0, 2000.0);
            let drawn =
                before.unwrap_or_else(|| DVector::from_vec(vec![next() - 750.0, next(), -next()]));
            forces.set_column(n, &drawn);
        }
        let mut start = q.clone();
        start[coin[0]] += random.between(-0.4, 0.2);
        start[coin[1]] += random.between(-0.1, 0.1);
        start[coin[2]] += random.between(-1.0, 1.0);
        Self {
            velocity: DVector::zeros(start.len()),
            start,
            forces,
        }
    }

    /// From the same places without forces: the fingers close at some speed, column and coin move anyhow.
    pub fn thrown(&self, random: &mut Samples, coin: [usize; 3]) -> Self {
        let mut velocity = DVector::zeros(self.start.len());
        velocity[0] = random.between(-0.5, 0.5);
        velocity[1] = random.between(0.0, 1.0);
        velocity[2] = random.between(-1.0, 0.0);
        for (at, size) in coin.into_iter().zip([0.5, 0.5, 2.0]) {
            velocity[at] = random.between(-size, size);
        }
        Self {
            start: self.start.clone(),
            velocity,
            forces: 0.0 * &self.forces,
        }
    }
}
