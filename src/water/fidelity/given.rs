//! Given added masses in the place of bodies' own, where bodies feel each other.

use crate::Result;
use crate::adjoint::lie::Mat6;
use crate::coupling::Given;
use crate::water::method::kind::Problem;
use crate::water::submerged::{Made, SubmergedBody};

/// A direction that hardly moves water (a round body's spin, a plate along itself) counts as this part of the water displaced.
pub(super) const LEAST: f64 = 0.01;

/// Ratio of given and computed, or of computed and given, from which on the user is told.
const APART: f64 = 2.0;

/// Puts what is given in the place of the bodies' own; nothing where the coupling tells none of these.
pub(super) fn put(problem: &Problem, mut made: Made) -> Result<Made> {
    if made.own.iter().all(Option::is_none) {
        return Ok(made);
    }
    let mut change = Vec::with_capacity(made.own.len());
    for (b, (body, own)) in problem.bodies.iter().zip(&made.own).enumerate() {
        let (Some(given), Some(own)) = (&body.added_mass, own) else {
            change.push(Mat6::zeros());
            continue;
        };
        change.push(given - own);
        let same = |a: &SubmergedBody| a.added_mass == body.added_mass && a.equal(body);
        if !problem.bodies[..b].iter().any(same) {
            made.warnings.extend(told(body, given, own));
        }
        // Nothing is known of what is given.
        made.bodies[b].added_mass_error = None;
    }
    if made.coupling.give(&change) {
        return Ok(made);
    }
    let given = |b: usize| problem.bodies[b].added_mass.is_some();
    let rates = made.own_rates.iter();
    let rates = rates.map(|&(b, rate)| (b, if given(b) { rate } else { Mat6::zeros() }));
    let rates = rates.collect();
    made.coupling = Box::new(Given::new(made.coupling, change)?.with_shapes(rates)?);
    Ok(made)
}

/// What the user should know of a given added mass that isn't like the computed one.
fn told(body: &SubmergedBody, given: &Mat6, own: &Mat6) -> Option<String> {
    let volume = body.mesh.map_or(0.0, |m| m.mass_properties().volume);
    let ratio = |i: usize| {
        let size = if i < 3 { 1.0 } else { volume.cbrt().powi(2) };
        let least = LEAST * volume * size;
        given[(i, i)].max(least) / own[(i, i)].max(least)
    };
    let off = |i: usize| ratio(i).max(1.0 / ratio(i));
    let worst = (0..6).max_by(|i, j| off(*i).total_cmp(&off(*j)))?;
    (off(worst) > APART).then(|| {
        let unit = if worst < 3 { "m³" } else { "m⁵" };
        format!(
            "body {:?}: the given added_mass has {:.3e} {unit} at [{worst}][{worst}], {:.3e} {unit} follow from its shape: a factor of {:.2}. What is given counts for \
             the body alone; what others and walls change of it follows from the shape",
            body.name,
            given[(worst, worst)],
            own[(worst, worst)],
            ratio(worst),
        )
    })
}
