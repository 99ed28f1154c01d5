//! Trajectories as arrays: time, states, poses, energies and momentum, one row a state.

use super::{Numbers, Rollout};
use crate::array;
use crate::error::in_order;
use crate::interrupt::{light, long, short};
use hydrograd::simulate::{Sample, observable};
use pyo3::prelude::*;
use rayon::prelude::*;

impl Rollout {
    fn numbers<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&Sample) -> Vec<f64>,
        shape: &[usize],
    ) -> Numbers<'py> {
        let samples = self.inner.samples();
        let mut whole = vec![samples.len()];
        whole.extend(shape);
        array::to_python(py, samples.iter().flat_map(of).collect(), &whole)
    }
}

#[pymethods]
impl Rollout {
    /// Time, (N + 1,), s.
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        self.numbers(py, |s| vec![s.time], &[])
    }

    /// Joint coordinates, (N + 1, q_size), m, rad and unit quaternions (w, x, y, z).
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let n = self.inner.simulator().system().tree.coordinates();
        self.numbers(py, |s| s.q.as_slice().to_vec(), &[n])
    }

    /// Generalised velocities, (N + 1, v_size), m/s and rad/s.
    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let n = self.inner.simulator().system().tree.velocities();
        self.numbers(py, |s| s.v.as_slice().to_vec(), &[n])
    }

    /// The open-loop controls, (N, control_size), N and N m.
    #[getter]
    pub(super) fn controls<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let controls = self.inner.controls();
        array::transposed(py, controls, &[controls.nrows()])
    }

    /// The controls that acted, those of the scene's or your own controller included, (N, control_size), N and N m.
    #[getter]
    fn applied_controls<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let controls = self.inner.applied_controls();
        array::transposed(py, &controls, &[controls.nrows()])
    }

    /// Positions of the bodies' origins, (N + 1, bodies, 3), m, world axes.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let of = |s: &Sample| {
            s.poses
                .iter()
                .flat_map(|p| [p.translation.x, p.translation.y, p.translation.z])
                .collect()
        };
        self.numbers(py, of, &[self.bodies(), 3])
    }

    /// Rotation matrices of the bodies, body to world, (N + 1, bodies, 3, 3).
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let of = |s: &Sample| {
            s.poses
                .iter()
                .flat_map(|p| p.rotation.transpose().as_slice().to_vec())
                .collect()
        };
        self.numbers(py, of, &[self.bodies(), 3, 3])
    }

    /// Velocities of the bodies, (N + 1, bodies, 6), world axes: of the origin, m/s, and angular, rad/s.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let made = light(py, || Ok(self.inner.velocities()))?;
        array::transposed(py, &made, &[self.bodies(), 6])
    }

    /// Kinetic energy of bodies and fluid, (N + 1,), J.
    #[getter]
    fn kinetic_energy<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        self.numbers(py, |s| vec![s.kinetic_energy], &[])
    }

    /// Potential energy of weight, buoyancy, springs, joints and tendons (those at the control 0), (N + 1,), J.
    #[getter]
    fn potential_energy<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        self.numbers(py, |s| vec![s.potential_energy], &[])
    }

    /// Total momentum of bodies and fluid, (N + 1, 6): linear, kg m/s, then angular about the world's origin, kg m²/s.
    #[getter]
    fn momentum<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        self.numbers(py, |s| s.momentum.as_slice().to_vec(), &[6])
    }

    /// Smallest gap between bodies or to a wall, (N + 1,), m; NaN where there is nothing to meet.
    #[getter]
    fn min_gap<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let gaps = short(py, || Ok(self.inner.gaps()))?;
        let distances: Vec<f64> = gaps
            .iter()
            .map(|g| g.map_or(f64::NAN, |g| g.distance))
            .collect();
        let n = distances.len();
        array::to_python(py, distances, &[n])
    }

    /// What an inertial measurement unit at the site of this name reads at every state (n, 6): acceleration less gravity (m/s²) and rates (rad/s), in the site's axes. At the last state no step begins: no control acts, and nothing touches.
    fn imu<'py>(&self, py: Python<'py>, site: &str) -> Numbers<'py> {
        let n = self.inner.states().len();
        let (inner, site) = (self.inner.clone(), site.to_string());
        let read = long(py, move |_| {
            in_order((0..n).into_par_iter().map(|k| inner.imu(&site, k)))
        })?;
        let values = read.iter().flat_map(|r| [r.specific_force, r.rates]);
        let values = values.flat_map(|x| [x.x, x.y, x.z]).collect();
        array::to_python(py, values, &[n, 6])
    }

    /// An observable at the states 0 … N by its name, (N + 1, …): "positions", "energy", "momentum", …; an unknown name's error has the list.
    fn observe<'py>(&self, py: Python<'py>, name: &str) -> Numbers<'py> {
        let made = short(py, || {
            let found = observable::observable(name)?;
            Ok((found, self.inner.observe(name)?))
        })?;
        let shape = made.0.shape(self.inner.simulator().system());
        array::transposed(py, &made.1, &shape)
    }
}
