//! What is observed of a rollout, one entry each: recordings, objectives and Python read it by name.
//!
//! To add one: a file with its type, its [`Observable`], and, if it has derivatives, its [`Differentiable`]; and
//! its line in [`OBSERVABLES`].

mod acceleration;
mod angular_momentum;
mod attitude;
mod contact;
mod energy;
mod entry;
mod frames;
mod gap;
mod joint;
mod momentum;
mod pose;
pub(super) mod velocity;

pub use entry::{Differentiable, Observable, Observed, ObservedBars, ObservedTangents, Reading};

pub(super) use acceleration::without_steps;

use crate::dynamics::System;
use crate::{Error, Result};
use frames::Of;

/// All of them.
pub const OBSERVABLES: &[&dyn Observable] = &[
    &joint::Coordinates,
    &joint::Velocities,
    &pose::Positions(Of::Bodies),
    &pose::Rotations(Of::Bodies),
    &attitude::Attitudes(Of::Bodies),
    &velocity::Velocities(Of::Bodies),
    &velocity::Gyros(Of::Bodies),
    &acceleration::Accelerations(Of::Bodies),
    &pose::Positions(Of::Sites),
    &pose::Rotations(Of::Sites),
    &attitude::Attitudes(Of::Sites),
    &velocity::Velocities(Of::Sites),
    &velocity::Gyros(Of::Sites),
    &acceleration::Accelerations(Of::Sites),
    &energy::Kinetic,
    &energy::Potential,
    &energy::Total,
    &momentum::Momentum,
    &angular_momentum::AngularMomentum,
    &gap::SmallestGap,
    &gap::Error,
    &contact::Forces,
];

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

/// The tangent by which an entry of the observable of this name moves, which is that entry's alone; none of a quaternion's, or a rotation matrix's.
///
/// # Errors
/// As [`differentiable`].
pub fn tangent_of(name: &str, system: &System, entry: usize) -> Result<Option<usize>> {
    let found = differentiable(name)?;
    let entries: usize = observable(name)?.shape(system).iter().product();
    Ok(match found.tangents(system) == entries {
        true => Some(entry),
        false => found.tangent_of(system, entry),
    })
}

/// The derivatives of the observable of this name.
///
/// # Errors
/// A name that none has, or an observable without derivatives.
pub fn differentiable(name: &str) -> Result<&'static dyn Differentiable> {
    observable(name)?.differentiable().ok_or_else(|| {
        let with = OBSERVABLES.iter().filter(|o| o.differentiable().is_some());
        let names: Vec<&str> = with.map(|o| o.name()).collect();
        Error::Unsupported {
            what: format!("a derivative of the observable {name:?}"),
            why: "it has none".into(),
            instead: format!("take one of {names:?}"),
        }
    })
}
