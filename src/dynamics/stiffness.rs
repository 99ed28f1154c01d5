//! How fast forces that depend on the velocity slow what moves: what explicit integrators must resolve.
//!
//! With D = ∂g/∂v, g being the forces in the user's coordinates without the water's inertia, the rates are the eigenvalues of M^-½ ½(−D − Dᵀ) M^-½ on the coordinates
//! that nothing drives.

use super::force::{Loads, Velocity};
use super::{Drive, Evaluation, Parameters, System};
use crate::Result;
use nalgebra::{DMatrix, DVector};

/// The fastest of the rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping {
    /// 1/s.
    pub rate: f64,
    /// The body whose joint it slows most.
    pub body: usize,
}

impl System {
    /// The fastest rate at which forces slow what moves, if it is above `enough` (1/s). Water is asked for its inertia only where the bodies' own is too small.
    ///
    /// # Errors
    /// As [`System::evaluate`].
    pub fn damping(
        &self,
        parameters: &Parameters,
        q: &DVector<f64>,
        v: &DVector<f64>,
        control: &DVector<f64>,
        enough: f64,
    ) -> Result<Option<Damping>> {
        let kinematics = self.kinematics(q)?;
        let momenta = self.spatial_momenta(&kinematics, None);
        let report = Default::default();
        let dry = Evaluation::new(self, parameters, q, kinematics, momenta, report);
        let slowed = -dry.load_rates(v, control);
        let slowed = 0.5 * (&slowed + slowed.transpose());
        if slowed.iter().all(|x| *x == 0.0) {
            return Ok(None);
        }
        let fast = |m: &DMatrix<f64>| self.fastest(m, &slowed).filter(|d| d.rate > enough);
        // The water only adds to the inertia.
        let alone = self.fastest(&dry.mass_matrix, &slowed);
        if alone.is_some_and(|d| d.rate <= enough) {
            return Ok(None);
        }
        if !self.in_water(parameters) {
            return Ok(fast(&dry.mass_matrix));
        }
        Ok(fast(&self.evaluate_apart(parameters, q)?.mass_matrix))
    }

    /// None where the inertia isn't positive definite.
    fn fastest(&self, mass_matrix: &DMatrix<f64>, slowed: &DMatrix<f64>) -> Option<Damping> {
        let each = self.drives.iter().zip(self.tree.links()).enumerate();
        let free: Vec<(usize, usize)> = each
            .filter(|(_, (drive, _))| **drive == Drive::Free)
            .flat_map(|(b, (_, link))| link.v.clone().map(move |i| (b, i)))
            .collect();
        let block = |m: &DMatrix<f64>| {
            DMatrix::from_fn(free.len(), free.len(), |i, j| m[(free[i].1, free[j].1)])
        };
        if free.is_empty() {
            return None;
        }
        let lower = block(mass_matrix).cholesky()?.unpack();
        let half = lower.solve_lower_triangular(&block(slowed))?;
        let scaled = lower.solve_lower_triangular(&half.transpose())?;
        if !scaled.iter().all(|x| x.is_finite()) {
            return None;
        }
        let found = (0.5 * (&scaled + scaled.transpose())).symmetric_eigen();
        let k = found.eigenvalues.imax();
        Some(Damping {
            rate: found.eigenvalues[k],
            body: free[found.eigenvectors.column(k).iamax()].0,
        })
    }
}

impl Evaluation<'_> {
    /// ∂g/∂v of the forces that act in the course of a step, user coordinates.
    fn load_rates(&self, v: &DVector<f64>, control: &DVector<f64>) -> DMatrix<f64> {
        let tree = &self.system.tree;
        let n = v.len();
        let units: Vec<DVector<f64>> = (0..n)
            .map(|k| DVector::from_fn(n, |i, _| f64::from(i == k)))
            .collect();
        let along: Vec<_> = (units.iter())
            .map(|dv| tree.twists(&self.kinematics, dv))
            .collect();
        let changes: Vec<Velocity> = (units.iter().zip(&along))
            .map(|(v, twists)| Velocity { twists, v })
            .collect();
        let mut out: Vec<Loads> = (0..n).map(|_| Loads::zeros(self.system.len(), n)).collect();
        let twists = tree.twists(&self.kinematics, v);
        let at = self.moving(&twists, v, control);
        for force in self.system.smooth_forces() {
            force.jvps(&at, &changes, &mut out);
        }
        let mut rates = DMatrix::zeros(n, n);
        for (k, Loads { wrenches, joints }) in out.into_iter().enumerate() {
            let column = tree.project(&self.kinematics.columns, wrenches) + joints;
            rates.set_column(k, &column);
        }
        rates
    }
}
