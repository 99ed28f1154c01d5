//! Figures of a whole trajectory, and what they say of the time step.

use super::stability::GAIN;
use super::{GapReport, Rollout};
use crate::adjoint::lie::Vec6;
use crate::dynamics::Drive;
use crate::error::readable;
use serde::Serialize;

/// A body that moves by less than this part of its size over the whole trajectory rests: its momentum is round-off.
const REST: f64 = 1e-8;

/// Figures of a whole trajectory.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Steps made.
    pub steps: usize,
    /// Energy at the start, J.
    pub energy_initial: f64,
    /// Energy at the end, J.
    pub energy_final: f64,
    /// How far it rises above that at the start, at most, J.
    pub energy_gain: f64,
    /// How far it falls below that at the start, at most, J.
    pub energy_loss: f64,
    /// Largest change of the momentum along a motion in which nothing outside acts, relative to the largest momentum of one body over the
    /// trajectory; none where there is no such motion.
    pub momentum_drift: Option<f64>,
    /// Number of such motions: translations, and rotations about an axis, of bodies that feel one another.
    pub momenta_kept: usize,
    /// Most iterations of a coupled solve.
    pub iterations: usize,
    /// Largest asymmetry of M_f before symmetrising.
    pub asymmetry: f64,
    /// Smallest gap between bodies or to a wall, m; none where there is nothing to meet.
    pub min_gap: Option<f64>,
    /// By what the water across gaps is carried, and how far off it is estimated to be.
    pub gaps: GapReport,
    /// Largest gap at which surfaces are taken to touch, m; none where the scene has no contact.
    pub contact_gap: Option<f64>,
    /// Steps that were cut into pieces, being too long for what moved in them.
    pub cut_steps: usize,
    /// Most pieces of a step; one where none was cut.
    pub most_pieces: usize,
}

impl Rollout {
    /// Figures of the whole trajectory.
    pub fn summary(&self) -> Summary {
        let samples = self.samples();
        let start = samples[0].energy();
        let most = |of: &dyn Fn(f64) -> f64| {
            let each = samples.iter().map(|s| of(s.energy() - start));
            each.fold(0.0, f64::max)
        };
        let pieces = self.pieces();
        Summary {
            steps: self.steps(),
            energy_initial: start,
            energy_final: samples[samples.len() - 1].energy(),
            energy_gain: most(&|change| change),
            energy_loss: most(&|change| -change),
            momentum_drift: self.momentum_drift(),
            momenta_kept: self.simulator.kept().twists.len(),
            iterations: samples
                .iter()
                .map(|s| s.report.iterations)
                .max()
                .unwrap_or(0),
            asymmetry: samples
                .iter()
                .map(|s| s.report.asymmetry)
                .fold(0.0, f64::max),
            min_gap: self.nearest().map(|(_, gap)| gap.distance),
            gaps: self.gap_report(),
            contact_gap: (self.simulator.system().contact.iter())
                .flat_map(|model| model.gaps())
                .map(|g| g.gap)
                .reduce(f64::max),
            cut_steps: pieces.iter().filter(|n| **n > 1).count(),
            most_pieces: pieces.iter().fold(1, |most, n| most.max(*n)),
        }
    }

    fn momentum_drift(&self) -> Option<f64> {
        let samples = self.samples();
        let system = self.simulator.system();
        let largest = |part: usize| {
            let each = samples.iter().map(|s| s.largest_momentum);
            each.map(|m| m.fixed_rows::<3>(part).norm())
                .fold(0.0, f64::max)
        };
        let duration = self.simulator.time_step() * self.steps() as f64;
        let parameters = self.simulator.parameters();
        let mass = (0..system.len())
            .map(|b| parameters.mass(b))
            .fold(0.0, f64::max);
        let length = super::gradcheck::unit_displacements(&self.simulator).1;
        let resting = (REST * mass * length / duration.max(self.simulator.time_step()))
            .max(f64::MIN_POSITIVE);
        let scale = [largest(0).max(resting), largest(3).max(resting * length)];
        let drift = |(k, twist): (usize, &Vec6)| {
            let size = scale[0] * twist.fixed_rows::<3>(0).norm()
                + scale[1] * twist.fixed_rows::<3>(3).norm();
            let changes = samples
                .iter()
                .map(|s| (s.kept_momentum[k] - samples[0].kept_momentum[k]).abs());
            changes.fold(0.0, f64::max) / size
        };
        self.simulator
            .kept()
            .twists
            .iter()
            .enumerate()
            .map(drift)
            .reduce(f64::max)
    }

    /// A run in which nothing moves, of bodies that gravity would move.
    pub(super) fn rest_warning(&self) -> Option<String> {
        let (scene, system) = (&self.simulator.scene, self.simulator.system());
        let moves = self.samples().iter().any(|s| s.v.iter().any(|v| *v != 0.0));
        if self.steps() == 0 || moves || scene.gravity != [0.0; 3] {
            return None;
        }
        let parameters = self.simulator.parameters();
        let heavy = |b: &usize| {
            let displaced = parameters.density() * system.bodies[*b].volume;
            let free =
                matches!(system.drives[*b], Drive::Free) && !system.tree.links()[*b].v.is_empty();
            free && displaced > 0.0 && (parameters.mass(*b) - displaced).abs() > 0.01 * displaced
        };
        let first = (0..system.len()).find(heavy)?;
        Some(format!(
            "nothing moves: no force acts, and `gravity` is zero, which is its default; body {:?} of {} kg displaces {} kg of water: give the scene \
             `gravity = [0, 0, -9.81]` if it has weight",
            system.bodies[first].name,
            readable(parameters.mass(first)),
            readable(parameters.density() * system.bodies[first].volume)
        ))
    }

    /// Energy that is lost though nothing takes it.
    pub(super) fn loss_warning(&self) -> Option<String> {
        let system = self.simulator.system();
        let parameters = self.simulator.parameters();
        let samples = self.samples();
        let taken = system.has_current()
            || !system.streams.is_empty()
            || system.contact.is_some()
            || !system.limits.is_empty()
            || system.forces.iter().any(|f| !f.conservative(parameters))
            || system.drives.iter().any(|d| matches!(d, Drive::Motion(_)))
            || samples.iter().any(|s| s.hold.contains(&true))
            || samples.iter().any(|s| s.control.iter().any(|u| *u != 0.0));
        if taken {
            return None;
        }
        let start = samples[0].energy();
        let kinetic = samples.iter().map(|s| s.kinetic_energy).fold(0.0, f64::max);
        let least = (samples.iter()).min_by(|a, b| a.energy().total_cmp(&b.energy()))?;
        let lost = start - least.energy();
        (lost > GAIN * kinetic.max(f64::MIN_POSITIVE)).then(|| {
            format!(
                "the energy falls by {lost:.3e} J, {:.1} % of the largest kinetic energy, by t = {} s, though nothing takes it: the time \
                 step of {} s is too long for these velocities; {}",
                100.0 * lost / kinetic,
                readable(least.time),
                readable(self.simulator.time_step()),
                self.finer()
            )
        })
    }
}
