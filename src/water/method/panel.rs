//! Direct boundary elements.

use super::kind::{BodyMethod, Problem, Solved};
use crate::boundary::PanelBoundary;
use crate::boundary::panel::{Extrapolated, Richardson};
use crate::coupling::PanelCoupled;
use crate::coupling::full::SolveSettings;
use crate::water::device::Device;
use crate::water::numerics::Numerics;
use crate::water::submerged::{Discretisation, Made, SubmergedBody, once, shared};
use crate::water::surface::Coarse;
use crate::{Error, Result};

/// Iterations of the coupled panels after which they are given up.
const MOST_ITERATIONS: usize = 500;
/// Part of an edge from which panels resolve a gap: a disc flat over a wall, which is hard, has 7 % too much added mass there.
const RESOLVED: f64 = 0.1;

/// Panels, of two meshes extrapolated where there are two.
pub(super) struct Panel;

impl BodyMethod for Panel {
    fn label(&self) -> &'static str {
        "panel"
    }

    fn extrapolates(&self) -> bool {
        true
    }

    fn steps_together(&self) -> bool {
        true
    }

    fn made_from(&self, body: &SubmergedBody, _: &Numerics) -> serde_json::Value {
        let coarse = body.coarse.map(|c| c.mesh.faces().len());
        serde_json::json!(["panel", coarse])
    }

    fn response(&self, body: &SubmergedBody, _: &Numerics, _: f64) -> Solved {
        let mesh = body.surface("reduced")?;
        let fine = PanelBoundary::new(body.name, mesh)?;
        Ok(match body.coarse {
            Some(Coarse { mesh, ratio }) => {
                let coarse = PanelBoundary::new(body.name, mesh)?;
                Box::new(Extrapolated::new(fine, coarse, *ratio)?)
            }
            None => Box::new(fine),
        })
    }

    fn couple(&self, problem: &Problem, _: &mut Device) -> Result<Made> {
        let made = shared(problem.bodies, |body| {
            PanelBoundary::new(body.name, body.surface("full")?)
        })?;
        let known = made.iter().zip(problem.bodies).map(|(fine, body)| {
            let Some(Coarse { mesh, ratio }) = body.coarse else {
                return Ok(None);
            };
            let coarse = PanelBoundary::new(body.name, mesh)?;
            Ok(Some(Richardson::of(fine, &coarse, *ratio)?))
        });
        let known = known.collect::<Result<Vec<_>>>()?;
        let own: Vec<_> = known.iter().map(|k| k.map(|k| k.added_mass)).collect();
        let solve = SolveSettings {
            max_iterations: MOST_ITERATIONS,
            ..problem.numerics.solve
        };
        Ok(Made {
            warnings: once(&made, |m| &m.warnings),
            bodies: problem.named(made.iter().zip(&known).map(|(m, known)| Discretisation {
                method: self.label(),
                faces: m.faces.len(),
                unknowns: m.faces.len(),
                asymmetry: m.asymmetry,
                added_mass_error: known.map(|k| k.error),
                ..Discretisation::default()
            })),
            coupling: Box::new(
                PanelCoupled::new(made, problem.walls, problem.excluded.clone(), solve)?
                    .with_added_mass(&own),
            ),
        })
    }

    fn resolved_edges(&self) -> f64 {
        RESOLVED
    }

    fn check_gpu(&self) -> Result<()> {
        Err(Error::Unsupported {
            what: "the method panel with the fidelity full and the backend gpu".into(),
            why: "coupled panels are computed on the CPU alone".into(),
            instead: "use the backend cpu, or the method mfs-vertex".into(),
        })
    }
}
