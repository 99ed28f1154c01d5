//! Each body alone.

use super::kind::{FidelityKind, Knob};
use crate::Result;
use crate::adjoint::lie::Mat6;
use crate::coupling;
use crate::coupling::film::Films;
use crate::geometry::Gap;
use crate::water::device::Device;
use crate::water::method::kind::{Problem, far};
use crate::water::shape::ShapeChange;
use crate::water::submerged::{Discretisation, Made, SubmergedBody, once, shared_by};
use crate::water::surface::overlaps;
use std::sync::Arc;

/// Each body's own constant added mass.
pub(super) struct Isolated;

/// A body's own added mass.
struct Own {
    added_mass: Mat6,
    as_made: Discretisation,
    warnings: Vec<String>,
}

impl Own {
    fn new(problem: &Problem, body: &SubmergedBody) -> Result<Self> {
        if let Some(added_mass) = body.added_mass {
            return Ok(Self {
                added_mass,
                as_made: Discretisation {
                    method: "given",
                    ..Discretisation::default()
                },
                warnings: Vec::new(),
            });
        }
        let method = problem.method_for(body)?;
        let faces = match method.by_formula() {
            true => 0,
            false => body.surface("isolated")?.faces().len(),
        };
        let response = method.response(body, problem.numerics, far(body))?;
        Ok(Self {
            added_mass: response.added_mass(),
            as_made: Discretisation {
                method: method.label(),
                faces,
                asymmetry: response.asymmetry(),
                added_mass_error: response.error(),
                ..Discretisation::default()
            },
            warnings: response.warnings().to_vec(),
        })
    }
}

/// Each body's own added mass at unit density, body's frame, about its origin.
pub(in crate::water) fn own_added_mass(problem: &Problem) -> Result<Vec<Mat6>> {
    let made = owns(problem)?;
    Ok(made.iter().map(|m| m.added_mass).collect())
}

/// Derivatives of the bodies' own added mass with respect to the shape parameters, each with its body; zero of one that is given.
pub(in crate::water) fn own_slopes(problem: &Problem) -> Result<Vec<(usize, Mat6)>> {
    let mut out = Vec::with_capacity(problem.changes.len());
    for group in problem.changes.chunk_by(|a, b| a.0 == b.0) {
        let b = group[0].0;
        let body = &problem.bodies[b];
        let slopes = match body.added_mass {
            Some(_) => vec![Mat6::zeros(); group.len()],
            None => alone_slopes(problem, body, group)?,
        };
        out.extend(slopes.into_iter().map(|slope| (b, slope)));
    }
    Ok(out)
}

/// Those of a body as computed, whatever is given, with respect to its parameters.
pub(in crate::water) fn alone_slopes(
    problem: &Problem,
    body: &SubmergedBody,
    group: &[(usize, &ShapeChange)],
) -> Result<Vec<Mat6>> {
    let changes: Vec<&ShapeChange> = group.iter().map(|(_, change)| *change).collect();
    let method = problem.method_for(body)?;
    method.added_mass_slopes(body, problem.numerics, &changes)
}

/// Of equal bodies with the same added mass given, or none, one.
fn owns(problem: &Problem) -> Result<Vec<Arc<Own>>> {
    let same = |a: &SubmergedBody, b: &SubmergedBody| a.added_mass == b.added_mass && a.equal(b);
    shared_by(problem.bodies, same, |b| Own::new(problem, b))
}

impl FidelityKind for Isolated {
    fn knobs(&self) -> &'static [Knob] {
        &[]
    }

    fn coupled(&self) -> bool {
        false
    }

    fn couple(&self, problem: &Problem, _: &mut Device) -> Result<Made> {
        let mut warnings = Vec::new();
        if !problem.walls.is_empty() {
            warnings.push(format!(
                "{} wall(s) have no effect on the water with the fidelity isolated, and only a section [contact] makes them solid; use reduced or full to feel them",
                problem.walls.len()
            ));
        }
        let made = owns(problem)?;
        warnings.extend(once(&made, |m| &m.warnings));
        let added = made.iter().map(|m| m.added_mass).collect();
        let coupling = coupling::Isolated::new(added).with_shapes(own_slopes(problem)?)?;
        Ok(Made {
            own_rates: Vec::new(),
            carried: None,
            films: Films::default(),
            own: vec![None; made.len()],
            bodies: problem.named(made.iter().map(|m| m.as_made.clone())),
            coupling: Box::new(coupling),
            warnings,
        })
    }

    fn idle_gpu(&self) -> Option<&'static str> {
        Some("the fidelity isolated runs on the CPU: it has nothing to compute on the backend gpu")
    }

    fn resolved_gap(&self, _: f64, _: f64) -> f64 {
        0.0
    }

    fn gap_warning(
        &self,
        gap: &Gap,
        _: f64,
        place: &str,
        time: &str,
        hint: &str,
    ) -> Option<String> {
        overlaps(gap).then(|| {
            format!(
                "{place} overlap, most at t = {time} s by {:.3e} m; with the fidelity isolated nothing but contact \
                 keeps them apart{hint}",
                -gap.distance
            )
        })
    }

    fn error(&self, bodies: f64, _: Option<f64>, coupling: Option<f64>) -> Option<f64> {
        Some(bodies + coupling?)
    }
}
