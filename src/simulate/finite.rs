//! What leaves floating point is an error that names its step and its coordinate.

use super::Sample;
use crate::dynamics::{Parameters, State, StateBar, WITHIN};
use crate::scene::Scene;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// The error of a number that isn't finite.
fn left(place: String, quantity: String, value: f64, what: &str) -> Error {
    Error::Unresolved {
        place,
        quantity,
        value,
        limit: f64::MAX,
        remedy: format!(
            "the {what} left what floating point holds: take a smaller time step, or the integrator midpoint, and check the sizes of what \
             moves and drives it"
        ),
    }
}

/// The first number that isn't finite is an error.
fn each<'a>(
    values: impl IntoIterator<Item = &'a f64>,
    error: impl FnOnce(usize, f64) -> Error,
) -> Result<()> {
    let mut values = values.into_iter().enumerate();
    match values.find(|(_, x)| !x.is_finite()) {
        None => Ok(()),
        Some((i, x)) => Err(error(i, *x)),
    }
}

fn in_run(step: usize, quantity: String, value: f64) -> Error {
    left(format!("step {step}"), quantity, value, "simulation")
}

/// Of coordinates at the start of a step.
pub(super) fn coordinates(scene: &Scene, step: usize, q: &DVector<f64>) -> Result<()> {
    each(q, |i, x| {
        let label = &scene.coordinate_labels()[i];
        in_run(step, format!("coordinate {label}"), x)
    })
}

/// Of velocities.
pub(super) fn velocities(scene: &Scene, step: usize, v: &DVector<f64>) -> Result<()> {
    each(v, |i, x| {
        let label = &scene.velocity_labels()[i];
        in_run(step, format!("velocity {label}"), x)
    })
}

/// Of a state.
pub(super) fn state(scene: &Scene, state: &State) -> Result<()> {
    coordinates(scene, state.step, &state.q)?;
    each(&state.y, |i, x| {
        let label = &scene.velocity_labels()[i];
        in_run(state.step, format!("momentum of {label}"), x)
    })
}

/// Of what is observed at a state.
pub(super) fn sample(scene: &Scene, step: usize, sample: &Sample) -> Result<()> {
    velocities(scene, step, &sample.v)?;
    let numbers = [
        ("kinetic energy", sample.kinetic_energy),
        ("potential energy", sample.potential_energy),
    ];
    let momentum = sample.momentum.iter().map(|x| ("momentum", *x));
    let bad = numbers.into_iter().chain(momentum);
    let Some((name, x)) = bad.into_iter().find(|(_, x)| !x.is_finite()) else {
        return Ok(());
    };
    let fastest = largest(&sample.v);
    let label = fastest.map_or("nothing".into(), |i| scene.velocity_labels()[i].clone());
    let speed = fastest.map_or(0.0, |i| sample.v[i]);
    let quantity = format!("{name}, with the velocity {label} = {speed:.3e},");
    Err(in_run(step, quantity, x))
}

fn largest(x: &DVector<f64>) -> Option<usize> {
    (0..x.len()).max_by(|a, b| x[*a].abs().total_cmp(&x[*b].abs()))
}

/// Of the cotangent of a state, and of what its step has beside it.
pub(super) fn bars(
    scene: &Scene,
    step: usize,
    bar: &StateBar,
    control: &DVector<f64>,
    parameters: &Parameters,
    gains: &[f64],
) -> Result<()> {
    let error = |of: String, x| {
        left(
            format!("step {step}"),
            format!("gradient with respect to {of}"),
            x,
            "gradient",
        )
    };
    each(&bar.q, |i, x| {
        error(
            format!("the coordinate of {}", scene.velocity_labels()[i]),
            x,
        )
    })?;
    each(&bar.y, |i, x| {
        error(format!("the momentum of {}", scene.velocity_labels()[i]), x)
    })?;
    each(control, |i, x| error(format!("control {i}"), x))?;
    each(gains, |i, x| error(format!("gain {i}"), x))?;
    each(&parameters.to_vec(), |i, x| {
        let name = parameters.names().nth(i).unwrap_or_default();
        error(format!("parameter {name}"), x)
    })
}

/// Of the tangents of a state.
pub(super) fn tangents(
    scene: &Scene,
    step: usize,
    q: &DMatrix<f64>,
    y: &DMatrix<f64>,
) -> Result<()> {
    for (what, tangents) in [("coordinate", q), ("momentum", y)] {
        let rows = tangents.nrows();
        each(tangents.iter(), |i, x| {
            let label = &scene.velocity_labels()[i % rows];
            let quantity = format!("tangent {} of the {what} of {label}", i / rows);
            left(format!("step {step}"), quantity, x, "tangents")
        })?;
    }
    Ok(())
}

/// A mass matrix of which rounding is all that is left, or coordinates that aren't numbers: the run has blown up.
pub(super) fn blown_up(scene: &Scene, state: &State, mut error: Error) -> Error {
    let Error::Unresolved { place, value, .. } = &mut error else {
        return error;
    };
    if place == WITHIN {
        *place = format!("step {}, {WITHIN}", state.step);
        return error;
    }
    // Scaled to a diagonal of one, none is below this.
    let least = -(state.y.len() as f64);
    if !place.starts_with("mass matrix") || *value >= least {
        return error;
    }
    let Some(i) = largest(&state.y) else {
        return error;
    };
    let label = &scene.velocity_labels()[i];
    Error::Unresolved {
        place: format!(
            "step {}, where the momentum of {label} is {:.3e},",
            state.step, state.y[i]
        ),
        quantity: "smallest eigenvalue of M(q), diagonal scaled to one,".into(),
        value: *value,
        limit: 0.0,
        remedy: "the run blows up within this step, and nothing but rounding is left of the mass matrix: take a smaller time step, or the \
                 integrator midpoint"
            .into(),
    }
}
