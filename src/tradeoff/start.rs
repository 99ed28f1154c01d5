//! What a simulator says of a scene's start and of its trajectory.

use super::progress::Watch;
use crate::Result;
use crate::dynamics::Drive;
use crate::scene::{Preset, Scene};
use crate::simulate::{Controls, Fidelity, Observation, Settings, Simulator};
use nalgebra::{DMatrix, DVector};

/// The scene at its start, over the velocities that forces decide.
#[derive(Clone, Debug)]
pub(super) struct Start {
    /// The water's part of the mass matrix, JᵀM_fJ: kg, kg m, kg m².
    pub added_mass: DMatrix<f64>,
    /// The mass matrix.
    pub mass: DMatrix<f64>,
    /// The mass matrix times the acceleration; zeros where only values were asked for.
    pub force: DVector<f64>,
}

impl Start {
    /// M_f and M alone.
    pub fn values(simulator: &Simulator) -> Result<Self> {
        let (system, parameters) = (simulator.system(), simulator.parameters());
        let (q, _) = simulator.start();
        let mut dry = parameters.clone();
        *dry.density_mut() = 0.0;
        let (dry, wet) = (
            system.evaluate(&dry, q, 0.0)?,
            system.evaluate(parameters, q, 0.0)?,
        );
        let (rigid, all) = (dry.mass_matrix(), wet.mass_matrix());
        let free = free(simulator)?;
        let block = |m: &DMatrix<f64>| m.select_rows(&free).select_columns(&free);
        Ok(Self {
            added_mass: block(&(all - rigid)),
            mass: block(all),
            force: DVector::zeros(free.len()),
        })
    }

    /// The same with the forces on it: the scene's own, and those that its velocity makes.
    pub fn with_forces(self, simulator: &Simulator) -> Result<Self> {
        let (q, v) = simulator.start();
        let system = simulator.system();
        let e = system.linearise(simulator.parameters(), q, 0.0)?;
        let given = e.mass_times(&given_accelerations(simulator));
        let force = e.inertial_force(v, &first_action(simulator)?.0)? - given;
        Ok(Self {
            force: force.select_rows(&free(simulator)?),
            ..self
        })
    }

    /// Acceleration under the forces and a further one; none where the mass matrix isn't positive definite.
    pub fn acceleration(&self, extra: &DVector<f64>) -> Option<DVector<f64>> {
        let factor = self.mass.clone().cholesky()?;
        Some(factor.solve(&(&self.force + extra)))
    }
}

/// Controls and held bodies of the first step.
fn first_action(simulator: &Simulator) -> Result<(DVector<f64>, Vec<bool>)> {
    let (q, v) = simulator.start();
    let action = simulator.policy().act(&Observation {
        step: 0,
        time: 0.0,
        time_step: simulator.time_step(),
        q,
        v,
        mode: 0,
    })?;
    let mut control = DVector::zeros(simulator.system().controls);
    for (c, x) in control.iter_mut().zip(action.control) {
        *c += x;
    }
    Ok((control, action.hold))
}

/// Numbers of the velocities that forces decide at the start.
pub(super) fn free(simulator: &Simulator) -> Result<Vec<usize>> {
    let system = simulator.system();
    let hold = first_action(simulator)?.1;
    let links = system.tree.links().iter().zip(&system.drives).enumerate();
    Ok(links
        .filter(|(b, (_, drive))| **drive == Drive::Free && !hold.get(*b).copied().unwrap_or(false))
        .flat_map(|(_, (link, _))| link.v.clone())
        .collect())
}

/// Accelerations of joints with a given motion, zero for others.
fn given_accelerations(simulator: &Simulator) -> DVector<f64> {
    let system = simulator.system();
    let mut out = DVector::zeros(system.tree.velocities());
    for (link, drive) in system.tree.links().iter().zip(&system.drives) {
        if let Drive::Motion(motions) = drive {
            for (i, motion) in link.v.clone().zip(motions) {
                out[i] = motion.acceleration(0.0);
            }
        }
    }
    out
}

/// A trajectory's coordinates and velocities.
#[derive(Clone, Debug)]
pub(super) struct Path {
    /// Time step, s.
    pub time_step: f64,
    pub q: Vec<DVector<f64>>,
    pub v: Vec<DVector<f64>>,
}

impl Path {
    /// # Errors
    /// The first step that fails, and the end that was asked for.
    pub fn new(simulator: &Simulator, steps: usize, watch: &mut Watch) -> Result<Self> {
        let controls = Controls::zeros(simulator, steps);
        let initial = simulator.initial().map_err(|e| e.at_time(0.0))?;
        let rollout = simulator.rollout_from(&initial, &controls, |_| watch.poll())?;
        let samples = rollout.samples();
        Ok(Self {
            time_step: simulator.time_step(),
            q: samples.iter().map(|s| s.q.clone()).collect(),
            v: samples.iter().map(|s| s.v.clone()).collect(),
        })
    }
}

/// Each body in water of its own, on few faces: for what doesn't depend on the water.
pub(super) fn isolated(scene: &Scene) -> Result<Simulator> {
    let settings = Settings::preset(Preset::Default)
        .fidelity(Fidelity::Isolated)
        .faces(80);
    Simulator::new(scene, settings)
}
