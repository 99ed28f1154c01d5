//! Proportional–derivative control.

use super::{Action, ActionBar, Observation, Policy, expect};
use crate::Result;
use nalgebra::DVector;

/// One actuated coordinate of a [`Pd`] controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PdAxis {
    /// Control that it drives.
    pub control: usize,
    /// Its coordinate in q.
    pub q: usize,
    /// Its velocity in v.
    pub v: usize,
    /// Target, m or rad.
    pub target: f64,
    /// Stiffness, N/m or N m/rad.
    pub stiffness: f64,
    /// Damping, N s/m or N m s/rad.
    pub damping: f64,
}

/// Proportional–derivative control, `u = stiffness (target − q) − damping v`. Gains: target, stiffness and
/// damping of each axis in turn.
#[derive(Clone, Debug)]
pub struct Pd {
    /// Number of controls of the system.
    pub controls: usize,
    /// Number of velocities of the system.
    pub velocities: usize,
    /// Axes.
    pub axes: Vec<PdAxis>,
}

impl Policy for Pd {
    fn act(&self, observed: &Observation) -> Result<Action> {
        let mut control = vec![0.0; self.controls];
        for a in &self.axes {
            control[a.control] +=
                a.stiffness * (a.target - observed.q[a.q]) - a.damping * observed.v[a.v];
        }
        Ok(Action::control(control))
    }

    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> Result<ActionBar> {
        let mut bar = ActionBar {
            q: vec![0.0; self.velocities],
            v: vec![0.0; self.velocities],
            gains: Vec::with_capacity(3 * self.axes.len()),
        };
        for a in &self.axes {
            let u = control_bar[a.control];
            bar.q[a.v] -= a.stiffness * u;
            bar.v[a.v] -= a.damping * u;
            bar.gains.extend([
                a.stiffness * u,
                (a.target - observed.q[a.q]) * u,
                -observed.v[a.v] * u,
            ]);
        }
        Ok(bar)
    }

    fn gains(&self) -> Vec<f64> {
        let row = |a: &PdAxis| [a.target, a.stiffness, a.damping];
        self.axes.iter().flat_map(row).collect()
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        expect(3 * self.axes.len(), gains)?;
        let mut out = self.clone();
        for (a, g) in out.axes.iter_mut().zip(gains.chunks_exact(3)) {
            (a.target, a.stiffness, a.damping) = (g[0], g[1], g[2]);
        }
        Ok(Box::new(out))
    }
}
