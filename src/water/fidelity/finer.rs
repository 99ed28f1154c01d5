//! What compressed bodies are fitted to: a body's answers by faces that are short enough for the gaps that its sources resolve.
//!
//! Panels answer for the water that comes from sources about as far off as they are long. Where a body's faces are longer, what it throws back
//! is off by tens of per cent, and a better fit to that makes it worse. Steps don't depend on how many there are: so they are made as short as
//! it takes, on the surface as it is.

use crate::Result;
use crate::adjoint::lie::{Mat6, Vec3};
use crate::boundary::Response;
use crate::geometry::{TriMesh, equilateral_edge, halved};
use crate::water::method::kind::{BodyMethod, Solved};
use crate::water::numerics::Numerics;
use crate::water::submerged::SubmergedBody;
use crate::water::surface::Coarse;
use faer::Mat;

/// Edges of the faces that a body is fitted with, at most, over the gap that its sources resolve.
const LONG: f64 = 2.25;
/// Most faces that it is divided into.
const MOST: usize = 3200;

/// How often a body's edges are halved for it.
pub(super) fn halvings(method: &dyn BodyMethod, mesh: &TriMesh, gap: f64) -> usize {
    if !method.by_panels() {
        return 0;
    }
    let mut faces = mesh.faces().len();
    let (mut edge, mut times) = (equilateral_edge(mesh.surface_area() / faces as f64), 0);
    while edge > LONG * gap && 4 * faces <= MOST {
        (edge, faces, times) = (0.5 * edge, 4 * faces, times + 1);
    }
    times
}

/// A body's meshes with their edges halved.
struct Halved {
    mesh: Option<TriMesh>,
    coarse: Option<Coarse>,
}

impl Halved {
    /// So many times.
    fn new(body: &SubmergedBody, times: usize) -> Self {
        Self {
            mesh: body.mesh.map(|mesh| halved(mesh, times)),
            // What two meshes are extrapolated by is how far their edges are apart, which stays.
            coarse: body.coarse.map(|c| Coarse {
                mesh: halved(&c.mesh, times),
                ..*c
            }),
        }
    }

    /// The body with them.
    fn body<'a>(&'a self, of: &SubmergedBody<'a>) -> SubmergedBody<'a> {
        SubmergedBody {
            mesh: self.mesh.as_ref(),
            coarse: self.coarse.as_ref(),
            regions: of.regions.clone(),
            ..*of
        }
    }
}

/// The body alone, resolved for sources as near as `gap` (m): its flow by faces whose edges are halved `times` times, its added mass by its own,
/// as every fidelity has it, and what streams act on.
pub(in crate::water) fn response(
    method: &dyn BodyMethod,
    body: &SubmergedBody,
    numerics: &Numerics,
    (gap, times): (f64, usize),
) -> Solved {
    let own = method.response(body, numerics, gap)?;
    if times == 0 {
        return Ok(own);
    }
    let finer = Halved::new(body, times);
    let flow = method.response(&finer.body(body), numerics, gap)?;
    Ok(Box::new(Finer { own, flow, times }))
}

/// A body's added mass by its own faces, and its flow by finer ones.
struct Finer {
    own: Box<dyn Response>,
    flow: Box<dyn Response>,
    times: usize,
}

impl Response for Finer {
    fn added_mass(&self) -> Mat6 {
        self.own.added_mass()
    }

    fn radiated(&self, points: &[Vec3]) -> Result<Mat<f64>> {
        self.flow.radiated(points)
    }

    fn scattered(&self, sources: &[Vec3], points: &[Vec3]) -> Result<Mat<f64>> {
        self.flow.scattered(sources, points)
    }

    fn asymmetry(&self) -> f64 {
        self.own.asymmetry()
    }

    fn halved(&self) -> usize {
        self.times
    }

    fn error(&self) -> Option<f64> {
        self.own.error()
    }

    fn warnings(&self) -> &[String] {
        self.own.warnings()
    }
}
