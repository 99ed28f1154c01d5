//! Each body alone.

use super::kind::{ErrorParts, FidelityKind, Knob, Plan, Planned, Start};
use crate::Result;
use crate::adjoint::lie::Mat6;
use crate::coupling;
use crate::geometry::Gap;
use crate::water::device::Device;
use crate::water::method::kind::BodyMethod;
use crate::water::numerics::Numerics;
use crate::water::submerged::{Around, Discretisation, Made, SubmergedBody};
use crate::water::surface::overlaps;

/// Each body's own constant added mass.
pub(super) struct Isolated;

/// A body's own added mass.
#[derive(Clone)]
struct Own {
    added_mass: Mat6,
    method: &'static str,
    faces: usize,
    asymmetry: f64,
    error: Option<f64>,
    warnings: Vec<String>,
}

impl Own {
    fn new(body: &SubmergedBody, method: &dyn BodyMethod, numerics: &Numerics) -> Result<Self> {
        if let Some(added_mass) = body.added_mass {
            return Ok(Self {
                added_mass,
                method: "given",
                faces: 0,
                asymmetry: 0.0,
                error: None,
                warnings: Vec::new(),
            });
        }
        let method = method.for_body(body)?;
        let faces = match method.by_formula() {
            true => 0,
            false => body.surface("isolated")?.faces().len(),
        };
        // Nothing is near: the flow around it isn't asked for.
        let far = body.mesh.map_or(1.0, |m| m.surface_area().sqrt());
        let response = method.response(body, numerics, far)?;
        Ok(Self {
            added_mass: response.added_mass(),
            method: method.label(),
            faces,
            asymmetry: response.asymmetry(),
            error: response.error(),
            warnings: response.warnings().to_vec(),
        })
    }
}

impl FidelityKind for Isolated {
    fn name(&self) -> &'static str {
        "isolated"
    }

    fn knobs(&self) -> &'static [Knob] {
        &[]
    }

    fn coupled(&self) -> bool {
        false
    }

    fn plan(&self, _: &Start, _: &Numerics) -> Result<Planned> {
        Ok(Planned::plain(&Isolated))
    }

    fn couple(
        &self,
        bodies: &[SubmergedBody],
        around: &Around,
        method: &'static dyn BodyMethod,
        numerics: &Numerics,
        _: &Plan,
        _: &mut Device,
    ) -> Result<Made> {
        let mut warnings = Vec::new();
        if !around.walls.is_empty() {
            warnings.push(format!(
                "{} wall(s) have no effect with the fidelity isolated; use reduced or full to feel them",
                around.walls.len()
            ));
        }
        let mut made: Vec<Own> = Vec::with_capacity(bodies.len());
        for (b, body) in bodies.iter().enumerate() {
            let same = (0..b).find(|a| bodies[*a].equal(body));
            made.push(match same {
                Some(a) => Own {
                    warnings: Vec::new(),
                    ..made[a].clone()
                },
                None => Own::new(body, method, numerics)?,
            });
        }
        warnings.extend(made.iter().flat_map(|m| m.warnings.iter().cloned()));
        Ok(Made {
            faces: made.iter().map(|m| m.faces).sum(),
            bodies: made
                .iter()
                .zip(bodies)
                .map(|(own, body)| Discretisation {
                    body: body.name.to_string(),
                    method: own.method,
                    faces: own.faces,
                    asymmetry: own.asymmetry,
                    added_mass_error: own.error,
                    ..Discretisation::default()
                })
                .collect(),
            coupling: Box::new(coupling::Isolated::new(
                made.into_iter().map(|m| m.added_mass).collect(),
            )),
            warnings,
        })
    }

    fn idle_gpu(&self, _: &dyn BodyMethod) -> Result<Option<&'static str>> {
        Ok(Some(
            "the fidelity isolated runs on the CPU: it has nothing to compute on the backend gpu",
        ))
    }

    fn resolved_gap(&self, _: f64, _: f64) -> f64 {
        0.0
    }

    fn gap_warning(&self, gap: &Gap, place: &str, time: &str, hint: &str) -> Option<String> {
        overlaps(gap).then(|| {
            format!(
                "{place} overlap, most at t = {time} s by {:.3e} m; nothing keeps them apart \
                 without the coupled water{hint}",
                -gap.distance
            )
        })
    }

    fn error(&self, parts: &ErrorParts) -> Option<f64> {
        Some(parts.bodies + parts.coupling?)
    }
}
