//! What a trajectory's smallest gap is worth: the added mass across it and its slope, beside those of coupled panels.

use super::{Fidelity, Method, Rollout, Simulator};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3, Vec6};
use crate::geometry::{Gap, Other};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::cmp::Ordering;

/// Step of the differences that give a gap's direction, of the length of the edges there.
const STEP: f64 = 1e-5;

/// A rollout's smallest gap, by the fidelity that ran and by coupled panels ([`Rollout::check_gap`]).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GapCheck {
    /// When, s.
    pub time: f64,
    /// The smallest gap, m.
    pub gap: f64,
    /// Names of the bodies; of the second none for a wall. The first is the smaller one, or the one that moves.
    pub bodies: (String, Option<String>),
    /// Added mass M of the first body, all others at rest, along the direction in which the gap opens: by the run, and by panels, kg.
    pub added_mass: [f64; 2],
    /// Its slope, by the run and by panels, kg/m: at a speed u across the gap the water's force is half of it times u².
    pub slope: [f64; 2],
    /// Faces of the panels.
    pub faces: usize,
}

impl GapCheck {
    /// Error of the added mass, relative to that of panels.
    pub fn added_mass_error(&self) -> f64 {
        self.added_mass[0] / self.added_mass[1] - 1.0
    }

    /// Error of the slope, and so of the force, relative to that of panels: it says little where that force is next to none
    /// ([`GapCheck::force_share`]).
    pub fn force_error(&self) -> f64 {
        self.slope[0] / self.slope[1] - 1.0
    }

    /// The force by panels as a part of that of an added mass that goes as the inverse of the gap h, ½ M u²/h at a speed u across it: |slope| h/M.
    pub fn force_share(&self) -> f64 {
        self.slope[1].abs() * self.gap / self.added_mass[1]
    }
}

impl Rollout {
    /// Compares the water across the smallest gap of the trajectory with that of coupled panels (`full`, method `panel`, the scene's own faces, with films),
    /// which takes their setup and a solve. None where there is no gap, no water, and where the rollout is by coupled panels already.
    ///
    /// # Errors
    /// Whatever coupled panels report: bodies that touch, and bodies whose added mass is given without a shape.
    pub fn check_gap(&self) -> Result<Option<GapCheck>> {
        let simulator = self.simulator();
        let mut choices = simulator.choices().clone();
        let by_panels = choices.water.method.together() == Method::Panel;
        let Some((at, gap)) = self.nearest() else {
            return Ok(None);
        };
        let density = simulator.parameters().density();
        if simulator.fidelity() == Fidelity::Full && by_panels || density == 0.0 {
            return Ok(None);
        }
        let sample = &self.samples()[at];
        let Some(across) = Across::new(simulator, &sample.poses, &gap) else {
            return Ok(None);
        };
        choices.water.fidelity = Fidelity::Full;
        choices.water.method = Method::Panel;
        choices.water.numerics.films = true;
        choices.water.backend = super::Backend::Cpu;
        let panels = Simulator::with_choices(&simulator.scene, choices, None)?;
        let name = |b: usize| simulator.system().bodies[b].name.clone();
        let (Some(by_run), Some(by_panels)) = (across.of(simulator)?, across.of(&panels)?) else {
            return Ok(None);
        };
        Ok(Some(GapCheck {
            time: sample.time,
            gap: gap.distance,
            bodies: (name(across.body), across.other.map(name)),
            added_mass: [by_run.0, by_panels.0].map(|m| density * m),
            slope: [by_run.1, by_panels.1].map(|m| density * m),
            faces: panels.faces(),
        }))
    }
}

/// A displacement that opens a gap.
struct Across<'a> {
    poses: &'a [Pose],
    body: usize,
    other: Option<usize>,
    /// Unit vector along which the body moves.
    direction: Vec3,
}

impl<'a> Across<'a> {
    /// None where no motion changes the gap.
    fn new(simulator: &Simulator, poses: &'a [Pose], gap: &Gap) -> Option<Self> {
        let system = simulator.system();
        let carriers = simulator.scene.carriers();
        // What moves before what stands, and the smaller one of two that do.
        let order = |b: usize| (carriers.is_static(b), system.bodies[b].volume);
        let first = |a: usize, b: usize| order(a).partial_cmp(&order(b)) != Some(Ordering::Greater);
        let seen = |body: usize| system.submerged().any(|(b, _)| b == body);
        let (mover, other) = match gap.second {
            Other::Body(b) if !first(gap.first, b) => (b, Some(gap.first)),
            Other::Body(b) => (gap.first, Some(b)),
            Other::Wall(_) => (gap.first, None),
        };
        // What nothing moves isn't in the water where bodies don't feel each other.
        let (body, other) = match other {
            _ if seen(mover) => (mover, other),
            Some(b) if seen(b) => (b, Some(mover)),
            _ => return None,
        };
        let step = STEP * gap.edge;
        let distance = |shift: Vec3| {
            let mut moved = poses.to_vec();
            moved[body].translation += shift;
            let there = simulator.gaps().between((gap.first, gap.second), &moved);
            there.map_or(0.0, |g| g.distance)
        };
        let slope = |axis: usize| {
            let shift = Vec3::ith(axis, step);
            distance(shift) - distance(-shift)
        };
        Some(Self {
            poses,
            body,
            other,
            direction: Vec3::from_fn(|axis, _| slope(axis)).try_normalize(0.0)?,
        })
    }

    /// Added mass of the body along it and its slope, density 1: m³, m². None of a simulator in whose water it isn't; which bodies are, and so
    /// their numbers there, is each fidelity's own.
    fn of(&self, simulator: &Simulator) -> Result<Option<(f64, f64)>> {
        let system = simulator.system();
        let in_water: Vec<usize> = system.submerged().map(|(b, _)| b).collect();
        let poses: Vec<Pose> = in_water.iter().map(|b| self.poses[*b]).collect();
        let Some(own) = in_water.iter().position(|b| *b == self.body) else {
            return Ok(None);
        };
        let mut twist = DMatrix::zeros(6 * poses.len(), 1);
        let along = self.poses[self.body].rotation.tr_mul(&self.direction);
        twist.fixed_view_mut::<3, 1>(6 * own, 0).copy_from(&along);
        let found = system.differentiable()?.linearise(&poses, &twist)?;
        let one = DVector::from_element(1, 1.0);
        let wrench: Vec6 = found.gradient(&one, &one)?[own];
        let slope = wrench.fixed_rows::<3>(0).dot(&self.direction);
        Ok(Some((twist.dot(found.momenta()), slope)))
    }
}
