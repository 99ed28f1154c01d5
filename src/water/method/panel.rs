//! Direct boundary elements.

use super::kind::{BodyMethod, Problem, Solved};
use crate::Result;
use crate::adjoint::lie::{Mat6, Vec3};
use crate::boundary::PanelBoundary;
use crate::boundary::panel::{Extrapolated, MassSlopes, Richardson, RichardsonSlopes};
use crate::coupling::film::Films;
use crate::coupling::full::SolveSettings;
use crate::coupling::reduced::cache;
use crate::coupling::{Coupling, ExtrapolatedPanels, FilmedPanels, PanelCoupled, ShapeDirection};
use crate::water::device::Device;
use crate::water::gap_error::Carried;
use crate::water::numerics::Numerics;
use crate::water::shape::ShapeChange;
use crate::water::submerged::{Discretisation, Made, SubmergedBody, once, shared};
use crate::water::surface::Coarse;
use std::sync::Arc;

/// Iterations of the coupled panels after which they are given up, unless another number is asked for.
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

/// How a body's added mass changes with the vertices of its meshes.
enum Slopes {
    Single(Arc<PanelBoundary>, Box<MassSlopes>),
    Both(
        Arc<PanelBoundary>,
        Arc<PanelBoundary>,
        Box<RichardsonSlopes>,
    ),
}

impl Slopes {
    fn new(made: &Meshes, body: &SubmergedBody) -> Result<Self> {
        let fine = made.fine.clone();
        Ok(match (&made.coarse, body.coarse) {
            (Some(coarse), Some(Coarse { ratio, .. })) => {
                let slopes = RichardsonSlopes::new(fine.clone(), coarse.clone(), *ratio)?;
                Self::Both(fine, coarse.clone(), Box::new(slopes))
            }
            _ => {
                let slopes = fine.added_mass_slopes();
                Self::Single(fine, Box::new(slopes))
            }
        })
    }

    /// Of the body alone.
    fn alone(&self, change: &ShapeChange) -> Mat6 {
        match self {
            Self::Single(fine, slopes) => slopes.along(&velocities(change, fine)),
            Self::Both(fine, coarse, slopes) => {
                slopes.along(&velocities(change, fine), &velocities(change, coarse))
            }
        }
    }

    /// Of what the coupling takes for the body alone.
    fn coupled(&self, change: &ShapeChange) -> Mat6 {
        match self {
            Self::Single(..) => self.alone(change),
            Self::Both(fine, coarse, slopes) => {
                slopes.coupled_along(&velocities(change, fine), &velocities(change, coarse))
            }
        }
    }
}

/// Of the vertices of a body's panels, per unit of a shape parameter.
fn velocities(change: &ShapeChange, body: &PanelBoundary) -> Vec<Vec3> {
    change.at_vertices(body.panels().vertices())
}

/// The shape parameters as coupled panels take them.
struct Directions {
    fine: Vec<ShapeDirection>,
    coarse: Vec<ShapeDirection>,
    /// Of each body alone.
    own: Vec<(usize, Mat6)>,
    /// Rates of the ratio of the edges of each body.
    ratios: Vec<f64>,
}

impl Directions {
    fn new(problem: &Problem, made: &[Arc<Meshes>]) -> Result<Self> {
        let mut out = Self {
            fine: Vec::new(),
            coarse: Vec::new(),
            own: Vec::new(),
            ratios: Vec::new(),
        };
        for group in problem.changes.chunk_by(|a, b| a.0 == b.0) {
            let body = group[0].0;
            let meshes = &made[body];
            let slopes = Slopes::new(meshes, &problem.bodies[body])?;
            for (_, change) in group {
                let own = slopes.coupled(change);
                let direction = |of: &PanelBoundary| ShapeDirection {
                    body,
                    vertices: velocities(change, of),
                    added_mass: meshes.coarse.as_ref().map(|_| own),
                };
                let coarse = meshes.coarse.as_ref().unwrap_or(&meshes.fine);
                out.fine.push(direction(&meshes.fine));
                out.coarse.push(direction(coarse));
                out.own.push((body, own));
                out.ratios.push(match &slopes {
                    Slopes::Single(..) => 0.0,
                    Slopes::Both(fine, coarse, slopes) => {
                        slopes.ratio_along(&velocities(change, fine), &velocities(change, coarse))
                    }
                });
            }
        }
        Ok(out)
    }

    /// Rates of the ratio that all bodies are extrapolated with: that of the first body that has it.
    fn ratio_rates(&self, made: &[Arc<Meshes>], ratio: f64) -> Vec<f64> {
        let first = made
            .iter()
            .position(|m| m.known.is_some_and(|k| k.ratio == ratio));
        let rates = self.fine.iter().zip(&self.ratios);
        let rate = |(shape, rate): (&ShapeDirection, &f64)| match Some(shape.body) == first {
            true => *rate,
            false => 0.0,
        };
        rates.map(rate).collect()
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
        match self {
            Self::Alone(panels) => panels.with_films(&surfaces, problem.walls),
            Self::Extrapolated(panels) => panels.with_films(&surfaces, problem.walls),
        }
    }
}

impl BodyMethod for Panel {
    fn label(&self) -> &'static str {
        "panel"
    }

    fn extrapolates(&self) -> bool {
        true
    }

    fn by_panels(&self) -> bool {
        true
    }

    fn steps_together(&self) -> bool {
        true
    }

    fn made_from(&self, body: &SubmergedBody, _: &Numerics) -> serde_json::Value {
        let coarse = body.coarse.map(|c| (cache::mesh_digest(&c.mesh), c.ratio));
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

    fn added_mass_slopes(
        &self,
        body: &SubmergedBody,
        _: &Numerics,
        changes: &[&ShapeChange],
    ) -> Result<Vec<Mat6>> {
        let made = Meshes::new(body)?;
        let slopes = Slopes::new(&made, body)?;
        Ok(changes.iter().map(|change| slopes.alone(change)).collect())
    }

    fn couple(&self, problem: &Problem, device: &mut Device) -> Result<Made> {
        let made = shared(problem.bodies, Meshes::new)?;
        let shapes = Directions::new(problem, &made)?;
        let own: Vec<_> = (made.iter())
            .map(|m| Some(m.known?.coupled(m.coarse.as_ref()?)))
            .collect();
        let (asked, usual) = (problem.numerics.solve, SolveSettings::default());
        let solve = SolveSettings {
            max_iterations: match asked.max_iterations == usual.max_iterations {
                true => MOST_ITERATIONS,
                false => asked.max_iterations,
            },
            ..asked
        };
        let coupled = |meshes: Vec<Arc<PanelBoundary>>| -> Result<PanelCoupled> {
            let excluded = problem.excluded.clone();
            let made = PanelCoupled::new(meshes, problem.walls, excluded, solve)?;
            let names = problem.bodies.iter().map(|b| b.name.to_string());
            Ok(made.named(names).with_added_mass(&own))
        };
        let own_rates = shapes.own.clone();
        // Bodies with different ratios: the largest takes least away.
        let ratios = made.iter().filter_map(|m| Some(m.known?.ratio));
        let ratio = ratios.fold(0.0, f64::max);
        let ratio_rates = shapes.ratio_rates(&made, ratio);
        let coarse = || {
            let meshes = made.iter().map(|m| m.coarse.as_ref().unwrap_or(&m.fine));
            (ratio > 0.0)
                .then(|| coupled(meshes.cloned().collect()))
                .transpose()
        };
        let fine = coupled(made.iter().map(|m| m.fine.clone()).collect())?;
        let panels = match device.panels(fine, coarse)? {
            (fine, Some(coarse)) => {
                let both = ExtrapolatedPanels::new(fine, coarse, ratio)?;
                Panels::Extrapolated(both.with_shapes(shapes.fine, shapes.coarse, ratio_rates)?)
            }
            (fine, None) => Panels::Alone(fine.with_shapes(shapes.fine)?),
        };
        let (coupling, films): (Box<dyn Coupling>, _) = match problem.numerics.films {
            false => (panels.boxed(), Films::default()),
            true => {
                let filmed = panels.filmed(problem)?;
                let films = filmed.films().clone();
                device.films = !films.is_empty();
                (Box::new(filmed), films)
            }
        };
        let alone = problem.own(|b| Ok(own[b].unwrap_or(made[b].fine.added_mass)))?;
        Ok(Made {
            own: alone,
            own_rates,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TriMesh;

    /// A tetrahedron with its top at a height.
    fn mesh(top: f64) -> TriMesh {
        let corner = |x: f64, y: f64, z: f64| Vec3::new(x, y, z);
        let vertices = vec![
            corner(0.0, 0.0, 0.0),
            corner(1.0, 0.0, 0.0),
            corner(0.0, 1.0, 0.0),
            corner(0.0, 0.0, top),
        ];
        TriMesh::new(
            "tetrahedron",
            vertices,
            vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
        )
        .unwrap()
    }

    #[test]
    fn another_coarse_mesh_is_another_body() {
        let fine = mesh(1.0);
        let key = |top: f64, ratio: Option<f64>| {
            let coarse = Coarse {
                mesh: mesh(top),
                ratio,
            };
            let body = SubmergedBody {
                name: "body",
                mesh: Some(&fine),
                ellipsoid: None,
                solid: None,
                coarse: Some(&coarse),
                added_mass: None,
                regions: Vec::new(),
            };
            Panel.made_from(&body, &Numerics::default())
        };
        assert_eq!(key(0.5, None), key(0.5, None));
        assert_ne!(key(0.5, None), key(0.6, None));
        assert_ne!(key(0.5, None), key(0.5, Some(2.0)));
    }
}
