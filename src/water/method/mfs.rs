//! Fundamental solutions: sources inside the surface.

use super::kind::{BodyMethod, Problem, Solved};
use crate::Result;
use crate::adjoint::lie::{Mat6, Pose};
use crate::boundary::{self, BodyBoundary};
use crate::coupling::film::Films;
use crate::coupling::full::{FullSolver, Model};
use crate::coupling::{Coupling, Exclusions};
use crate::water::device::Device;
use crate::water::numerics::Numerics;
use crate::water::submerged::{Discretisation, Made, SubmergedBody, once, shared};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Sources under vertices or faces.
pub(super) struct Mfs(pub boundary::Method);

impl Mfs {
    fn settings(&self, numerics: &Numerics) -> boundary::MfsSettings {
        boundary::MfsSettings {
            method: self.0,
            ..numerics.mfs
        }
    }
}

/// A body's added mass alone in the water, symmetric; one that has no factor is solved for it.
fn alone(body: &Arc<BodyBoundary>, problem: &Problem, device: &mut Device) -> Result<Mat6> {
    if body.factored() {
        return Ok(body.added_mass);
    }
    let (none, solve) = (Exclusions::none(), problem.numerics.solve);
    let coupling = device.full(Model::new(vec![body.clone()], &[], none, solve)?)?;
    let solved = coupling.evaluate(&[Pose::identity()], &DMatrix::identity(6, 6))?;
    let m = solved.momenta();
    Ok(Mat6::from_fn(|i, j| 0.5 * (m[(i, j)] + m[(j, i)])))
}

impl BodyMethod for Mfs {
    fn label(&self) -> &'static str {
        "mfs"
    }

    fn steps_together(&self) -> bool {
        true
    }

    fn by_sources(&self) -> bool {
        true
    }

    fn made_from(&self, _: &SubmergedBody, numerics: &Numerics) -> serde_json::Value {
        serde_json::json!(["mfs", self.settings(numerics)])
    }

    fn response(&self, body: &SubmergedBody, numerics: &Numerics, _: f64) -> Solved {
        let mesh = body.surface("reduced")?;
        let settings = self.settings(numerics);
        let made = BodyBoundary::new(body.name, mesh, &settings)?;
        Ok(Box::new(made))
    }

    fn couple(&self, problem: &Problem, device: &mut Device) -> Result<Made> {
        let mut settings = self.settings(problem.numerics);
        if problem.numerics.solve.solver == FullSolver::Gmres {
            // GMRES solves the square system as it is; damping belongs to least squares.
            settings.damping = 0.0;
        }
        let made = shared(problem.bodies, |body| {
            let mesh = body.surface("full")?;
            let make = if device.factors(mesh.faces().len()) {
                BodyBoundary::new
            } else {
                BodyBoundary::unfactored
            };
            make(body.name, mesh, &settings)
        })?;
        let own = problem.own(|b| alone(&made[b], problem, device))?;
        Ok(Made {
            own_rates: Vec::new(),
            own,
            carried: None,
            films: Films::default(),
            warnings: once(&made, |m| &m.warnings),
            bodies: problem.named(made.iter().map(|m| Discretisation {
                method: self.label(),
                faces: m.faces.len(),
                unknowns: m.sources.len(),
                asymmetry: m.asymmetry,
                ..Discretisation::default()
            })),
            coupling: Box::new(device.full(Model::new(
                made,
                problem.walls,
                problem.excluded.clone(),
                problem.numerics.solve,
            )?)?),
        })
    }
}
