//! What an entry gives, and what it reads.

use super::super::{GapError, Sample};
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::dynamics::{ContactForce, Parameters, System};
use crate::geometry::Gap;
use crate::multibody::Kinematics;
use crate::scene::Scene;
use nalgebra::DVector;
use std::f64::consts::TAU;

/// A quantity at every state of a rollout.
pub trait Observable: Sync {
    /// Its name.
    fn name(&self) -> &'static str;

    /// Its unit, and where it is taken.
    fn unit(&self) -> &'static str;

    /// Dimensions of its value at one state; none for a number.
    fn shape(&self, system: &System) -> Vec<usize>;

    /// Names of the entries of its value, last index fastest.
    fn labels(&self, scene: &Scene) -> Vec<String>;

    /// Its value at a state, last index fastest.
    ///
    /// # Errors
    /// What it can't be found without fails.
    fn value(&self, at: &Reading) -> Result<Vec<f64>>;

    /// Whether its entries are angles, the same after a whole turn.
    fn is_angle(&self) -> bool {
        false
    }

    /// By how much an entry misses what it is to be: angles by the shorter way round.
    fn miss(&self, value: f64, goal: f64) -> f64 {
        let off = value - goal;
        match self.is_angle() {
            true => off - TAU * (off / TAU).round(),
            false => off,
        }
    }

    /// Its derivatives, where it has any.
    fn differentiable(&self) -> Option<&dyn Differentiable> {
        None
    }
}

/// Derivatives of an observable at one state.
pub trait Differentiable: Sync {
    /// Number of entries of its tangents and cotangents: those of its tangent space.
    fn tangents(&self, system: &System) -> usize;

    /// Whether it is what something gains over a step, by the step's length: that something is what [`Differentiable::jvp`] and [`Differentiable::vjp`] are of.
    fn is_gain(&self) -> bool {
        false
    }

    /// Of an observable that hasn't as many entries as its tangents: which of these an entry moves by, if that is one of its own.
    fn tangent_of(&self, _system: &System, _entry: usize) -> Option<usize> {
        None
    }

    /// Its tangent as the state moves.
    fn jvp(&self, at: &Observed, along: &ObservedTangents) -> Vec<f64>;

    /// Adds the gradient of `bar` · value.
    fn vjp(&self, at: &Observed, bar: &[f64], out: &mut ObservedBars);
}

/// A state of a rollout, as observables read it.
pub struct Reading<'a> {
    /// The system.
    pub system: &'a System,
    /// Its parameters.
    pub parameters: &'a Parameters,
    /// What is kept of the state.
    pub sample: &'a Sample,
    /// What is kept of the ends of the step that starts there, at the last state of the one that ends there; none of a rollout without steps.
    pub step: Option<[&'a Sample; 2]>,
    /// Length of a step, s.
    pub time_step: f64,
    /// Gives the smallest gap, if there is anything to meet; it may have to be measured.
    pub gap: Box<dyn Fn() -> Option<Gap> + 'a>,
    /// Estimates the error of the water across it, where one is known.
    pub gap_error: Box<dyn Fn() -> Option<GapError> + 'a>,
    /// Finds the contacts of the step that ended there; none at the start.
    pub contacts: Box<dyn Fn() -> Result<Vec<ContactForce>> + 'a>,
}

/// A state, as derivatives of observables see it.
pub struct Observed<'a> {
    /// The system.
    pub system: &'a System,
    /// Its parameters.
    pub parameters: &'a Parameters,
    /// Poses of the bodies.
    pub kinematics: &'a Kinematics,
    /// Generalised velocity.
    pub v: &'a DVector<f64>,
    /// Spatial twists of the bodies.
    pub twists: &'a [Vec6],
}

/// How a state moves in one direction.
pub struct ObservedTangents<'a> {
    /// Spatial displacements of the bodies.
    pub displacement: &'a [Vec6],
    /// Tangents of the spatial twists of the bodies.
    pub twist: &'a [Vec6],
    /// Of the coordinates, in their tangent space.
    pub q: &'a [f64],
    /// Of the generalised velocity.
    pub v: &'a [f64],
    /// Of the parameters; none where they stay.
    pub parameters: Option<&'a Parameters>,
}

/// What a transpose adds to.
pub struct ObservedBars<'a> {
    /// Cotangents of the poses: work on a spatial displacement of each body.
    pub pose: &'a mut [Vec6],
    /// Of the spatial twists of the bodies.
    pub twist: &'a mut [Vec6],
    /// Of the coordinates in their tangent space.
    pub q: &'a mut DVector<f64>,
    /// Of the generalised velocity.
    pub v: &'a mut DVector<f64>,
    /// Of the parameters, at a given velocity.
    pub parameters: &'a mut Parameters,
}

/// Labels `body.axis` of three entries a body.
pub(super) fn by_body(scene: &Scene, entries: &[&str]) -> Vec<String> {
    let each = scene.bodies.iter();
    each.flat_map(|b| entries.iter().map(move |e| format!("{}.{e}", b.name)))
        .collect()
}
