//! Direct boundary elements.

use super::kind::{BodyMethod, Problem, Solved};
use crate::Result;
use crate::boundary::PanelBoundary;
use crate::boundary::panel::{Extrapolated, Richardson};
use crate::coupling::full::SolveSettings;
use crate::coupling::{Coupling, ExtrapolatedPanels, FilmedPanels, PanelCoupled};
use crate::water::device::Device;
use crate::water::gap_error::Carried;
use crate::water::numerics::Numerics;
use crate::water::submerged::{Discretisation, Made, SubmergedBody, once, shared};
use crate::water::surface::Coarse;
use std::sync::Arc;

/// Iterations of the coupled panels after which they are given up.
const MOST_ITERATIONS: usize = 500;
/// Part of an edge from which panels resolve a gap: a disc flat over a wall, which is hard, has 7 % too much added mass there.
const RESOLVED: f64 = 0.1;
/// The same with films in narrower gaps than half an edge, which are right further down than any gap that they were held against.
const RESOLVED_BY_FILMS: f64 = 0.007;

/// Panels, of two meshes extrapolated where there are two.
pub(super) struct Panel;

/// A body's panels, on two meshes where there are two.
struct Meshes {
    fine: Arc<PanelBoundary>,
    coarse: Option<Arc<PanelBoundary>>,
    known: Option<Richardson>,
}

impl Meshes {
    fn new(body: &SubmergedBody) -> Result<Self> {
        let fine = PanelBoundary::new(body.name, body.surface("full")?)?;
        let (mut coarse, mut known) = (None, None);
        if let Some(Coarse { mesh, ratio }) = body.coarse {
            let fewer = PanelBoundary::new(body.name, mesh)?;
            known = Some(Richardson::of(&fine, &fewer, *ratio)?);
            coarse = Some(Arc::new(fewer));
        }
        Ok(Self {
            fine: Arc::new(fine),
            coarse,
            known,
        })
    }
}

/// All bodies' panels, coupled.
enum Panels {
    Alone(PanelCoupled),
    Extrapolated(ExtrapolatedPanels),
}

impl Panels {
    fn boxed(self) -> Box<dyn Coupling> {
        match self {
            Self::Alone(panels) => Box::new(panels),
            Self::Extrapolated(panels) => Box::new(panels),
        }
    }

    fn filmed(self, problem: &Problem) -> Result<FilmedPanels> {
        let mut surfaces = Vec::with_capacity(problem.bodies.len());
        for body in problem.bodies {
            surfaces.push((body.surface("full")?, body.solid));
        }
        let filmed = match self {
            Self::Alone(panels) => panels.with_films(&surfaces, problem.walls),
            Self::Extrapolated(panels) => panels.with_films(&surfaces, problem.walls),
        };
        Ok(filmed?.named(problem.bodies.iter().map(|b| b.name.to_string())))
    }
}

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

    fn couple(&self, problem: &Problem, device: &mut Device) -> Result<Made> {
        let made = shared(problem.bodies, Meshes::new)?;
        let own: Vec<_> = (made.iter())
            .map(|m| Some(m.known?.coupled(m.coarse.as_ref()?)))
            .collect();
        let solve = SolveSettings {
            max_iterations: MOST_ITERATIONS,
            ..problem.numerics.solve
        };
        let mut coupled = |meshes: Vec<Arc<PanelBoundary>>| -> Result<PanelCoupled> {
            let excluded = problem.excluded.clone();
            let made = PanelCoupled::new(meshes, problem.walls, excluded, solve)?;
            device.panels(made.with_added_mass(&own))
        };
        let fine = coupled(made.iter().map(|m| m.fine.clone()).collect())?;
        // Bodies with different ratios: the largest takes least away.
        let ratios = made.iter().filter_map(|m| Some(m.known?.ratio));
        let ratio = ratios.fold(0.0, f64::max);
        let panels = if ratio > 0.0 {
            let meshes = made.iter().map(|m| m.coarse.as_ref().unwrap_or(&m.fine));
            let coarse = coupled(meshes.cloned().collect())?;
            Panels::Extrapolated(ExtrapolatedPanels::new(fine, coarse, ratio)?)
        } else {
            Panels::Alone(fine)
        };
        let (coupling, films): (Box<dyn Coupling>, _) = match problem.numerics.films {
            false => (panels.boxed(), Vec::new()),
            true => {
                let filmed = panels.filmed(problem)?;
                let films = filmed.film_extents(problem.walls)?;
                device.films = !films.is_empty();
                (Box::new(filmed), films)
            }
        };
        let alone = problem.own(|b| Ok(own[b].unwrap_or(made[b].fine.added_mass)))?;
        Ok(Made {
            own: alone,
            carried: Some(Carried::Panels),
            films,
            warnings: once(&made, |m| &m.fine.warnings),
            bodies: problem.named(made.iter().map(|m| Discretisation {
                method: self.label(),
                faces: m.fine.faces.len(),
                unknowns: m.fine.faces.len(),
                asymmetry: m.fine.asymmetry,
                added_mass_error: m.known.map(|known| known.error),
                ..Discretisation::default()
            })),
            coupling,
        })
    }

    fn resolved_edges(&self, films: bool) -> f64 {
        if films { RESOLVED_BY_FILMS } else { RESOLVED }
    }

    fn has_films(&self) -> bool {
        true
    }

    // Faces that lie in one another have no side to be seen from.
    fn may_touch(&self) -> bool {
        false
    }
}
