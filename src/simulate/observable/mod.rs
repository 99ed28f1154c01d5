//! What is observed of a rollout, one entry each: recordings, objectives and Python read it by name.
//!
//! To add one: a file with its type, its [`Observable`], and, if a cotangent of it can seed a reverse sweep, its [`Transpose`]; and
//! its line in [`OBSERVABLES`].

mod angular_momentum;
mod energy;
mod gap;
mod joint;
mod momentum;
mod pose;
pub(super) mod velocity;

use super::Sample;
use crate::adjoint::lie::Vec6;
use crate::dynamics::{Parameters, System};
use crate::geometry::Gap;
use crate::multibody::Kinematics;
use crate::scene::Scene;
use crate::{Error, Result};
use nalgebra::DVector;

/// All of them.
pub const OBSERVABLES: &[&dyn Observable] = &[
    &joint::Coordinates,
    &joint::Velocities,
    &pose::Positions,
    &pose::Rotations,
    &velocity::Velocities,
    &energy::Kinetic,
    &energy::Potential,
    &energy::Total,
    &momentum::Momentum,
    &angular_momentum::AngularMomentum,
    &gap::SmallestGap,
];

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
    fn value(&self, at: &Reading) -> Vec<f64>;

    /// Its transpose, where there is one.
    fn transpose(&self) -> Option<&dyn Transpose> {
        None
    }
}

/// Transpose of an observable at one state.
pub trait Transpose: Sync {
    /// Number of entries of its cotangent: those of its tangent space.
    fn tangents(&self, system: &System) -> usize;

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
    /// Gives the smallest gap, if there is anything to meet; it may have to be measured.
    pub gap: Box<dyn Fn() -> Option<Gap> + 'a>,
}

/// A state, as transposes of observables see it.
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

/// The observable of this name.
///
/// # Errors
/// A name that none has.
pub fn observable(name: &str) -> Result<&'static dyn Observable> {
    let found = OBSERVABLES.iter().find(|o| o.name() == name);
    found.copied().ok_or_else(|| {
        let names: Vec<&str> = OBSERVABLES.iter().map(|o| o.name()).collect();
        Error::input(
            "observable",
            format!("{name:?}"),
            format!("must be one of {names:?}"),
        )
    })
}

/// The transpose of the observable of this name.
///
/// # Errors
/// A name that none has, or an observable without a transpose.
pub fn transpose(name: &str) -> Result<&'static dyn Transpose> {
    observable(name)?.transpose().ok_or_else(|| {
        let with = OBSERVABLES.iter().filter(|o| o.transpose().is_some());
        let names: Vec<&str> = with.map(|o| o.name()).collect();
        Error::Unsupported {
            what: format!("a cotangent of the observable {name:?}"),
            why: "it has no transpose".into(),
            instead: format!("take one of {names:?}"),
        }
    })
}

/// Labels `body.axis` of three entries a body.
fn by_body(scene: &Scene, entries: &[&str]) -> Vec<String> {
    let each = scene.bodies.iter();
    each.flat_map(|b| entries.iter().map(move |e| format!("{}.{e}", b.name)))
        .collect()
}
