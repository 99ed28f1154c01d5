//! The bodies in the water, what is around them, and what was made of them.

use super::gap_error::Carried;
use super::surface::{Coarse, Surface, pose, semi_axes};
use crate::adjoint::lie::{Mat6, Pose, Vec3};
use crate::coupling::Coupling;
use crate::coupling::film::Films;
use crate::coupling::reduced::Region;
use crate::geometry::{Refinement, Solid, TriMesh};
use crate::multibody::Tree;
use crate::scene::Scene;
use crate::{Error, Result};
use serde::Serialize;
use std::sync::Arc;

/// Smallest gap that is resolved within a region of refined faces, in the longest edges that it allows; they are 0.6 of that on average.
const GAP: f64 = 0.5;

/// A body that the water sees.
pub(crate) struct SubmergedBody<'a> {
    pub name: &'a str,
    /// Surface in the body's frame.
    pub mesh: Option<&'a TriMesh>,
    /// The shape by formula and its pose in the body's frame, if it is an ellipsoid.
    pub ellipsoid: Option<([f64; 3], Pose)>,
    /// The shape by formula as a convex body, where it is one.
    pub solid: Option<&'a Solid>,
    /// A coarser mesh of the shape, where it is one by formula.
    pub coarse: Option<&'a Coarse>,
    /// Given added mass at unit density, body's frame, about its origin: in the place of the body's own.
    pub added_mass: Option<Mat6>,
    /// Where smaller gaps matter than elsewhere.
    pub regions: Vec<Region>,
}

/// What was made of the bodies.
pub(crate) struct Made {
    pub coupling: Box<dyn Coupling>,
    /// Added mass of bodies alone in the water as the coupling has it, unit density, body's frame, about the origin: of those that have another one given
    /// ([`Problem::own`](super::method::kind::Problem::own)).
    pub own: Vec<Option<Mat6>>,
    /// Its derivatives with respect to the shape parameters, each with its body; those of bodies without a given one are ignored.
    pub own_rates: Vec<(usize, Mat6)>,
    /// What each body became.
    pub bodies: Vec<Discretisation>,
    pub warnings: Vec<String>,
    /// By what the water in gaps is carried; none where nothing is known of its error.
    pub carried: Option<Carried>,
    /// All films that there may be, by the bodies' numbers in the water.
    pub films: Films,
}

/// How a body is seen by the coupling, and how well.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Discretisation {
    /// Name of the body.
    pub body: String,
    /// One-body method: `exact`, `panel`, `mfs`, or `given`.
    pub method: &'static str,
    /// Faces of its mesh; 0 where none is used.
    pub faces: usize,
    /// Unknowns in the coupled system.
    pub unknowns: usize,
    /// Points of the compressed body; 0 if it isn't compressed.
    pub points: usize,
    /// Smallest gap that its compression resolves, m.
    pub resolved_gap: Option<f64>,
    /// Regions of the surface in which its compression resolves smaller ones.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub resolved_regions: Vec<Region>,
    /// Asymmetry of its own added mass before symmetrising.
    pub asymmetry: f64,
    /// Estimated error of its own added mass, where two meshes tell one; none where it is given.
    pub added_mass_error: Option<f64>,
    /// Error of the compressed flow of the body itself at points not fitted to, relative.
    pub radiated_error: f64,
    /// Error of the compressed flow scattered between such points, relative.
    pub scattered_error: f64,
}

impl<'a> SubmergedBody<'a> {
    /// Its surface, which `fidelity` needs.
    pub fn surface(&self, fidelity: &str) -> Result<&'a TriMesh> {
        self.mesh.ok_or_else(|| Error::Unsupported {
            what: format!("coupling of body {:?}", self.name),
            why: format!("it has a given added mass but no shape, and {fidelity} needs one"),
            instead: "give it a shape, or use the fidelity isolated".into(),
        })
    }

    /// Whether both have the same surface in their own frames, and the same coarser mesh of it: a mesh has none, where a shape by formula with the same faces does.
    pub fn equal(&self, other: &SubmergedBody) -> bool {
        type Parts<'b> = (&'b [Vec3], &'b [[usize; 3]]);
        fn parts(mesh: &TriMesh) -> Parts<'_> {
            (mesh.vertices(), mesh.faces())
        }
        fn coarse<'b>(body: &SubmergedBody<'b>) -> Option<(Parts<'b>, Option<f64>)> {
            body.coarse.map(|c| (parts(&c.mesh), c.ratio))
        }
        self.regions == other.regions
            && self.ellipsoid == other.ellipsoid
            && self.mesh.map(parts) == other.mesh.map(parts)
            && coarse(self) == coarse(other)
    }
}

/// The bodies that the water sees, with their numbers in the scene. Bodies that can't move matter only as boundaries of the
/// `coupled` flow.
pub(crate) fn in_water<'a>(
    scene: &'a Scene,
    surfaces: &'a [Option<Surface>],
    tree: &Tree,
    coupled: bool,
) -> (Vec<usize>, Vec<SubmergedBody<'a>>) {
    let seen = |b: &usize| coupled || moves(scene, tree, *b);
    // Symmetric but for what its check lets pass.
    let matrix = |rows: &Vec<Vec<f64>>| Mat6::from_fn(|i, j| 0.5 * (rows[i][j] + rows[j][i]));
    let submerged = |b: usize| {
        let (body, surface) = (&scene.bodies[b], surfaces[b].as_ref());
        let given = body.added_mass.as_ref();
        (surface.is_some() || given.is_some()).then(|| SubmergedBody {
            name: &body.name,
            mesh: surface.map(|s| &s.mesh),
            ellipsoid: (body.shape.as_ref().and_then(semi_axes))
                .map(|axes| (axes, pose(&body.shape_at))),
            solid: surface.and_then(|s| s.solid.as_ref()),
            coarse: surface.and_then(|s| s.coarse.as_ref()),
            added_mass: given.map(matrix),
            regions: body.refine.iter().map(region).collect(),
        })
    };
    let numbers = (0..scene.bodies.len()).filter(seen);
    numbers.filter_map(|b| Some((b, submerged(b)?))).unzip()
}

/// What `refine` asks of compressed sources: that gaps as wide as its faces are resolved.
fn region(refined: &Refinement) -> Region {
    Region {
        center: refined.center.into(),
        radius: refined.radius,
        gap: GAP * refined.edge,
    }
}

/// Whether anything moves body `b`.
fn moves(scene: &Scene, tree: &Tree, b: usize) -> bool {
    (0..scene.bodies.len()).any(|a| tree.carries(a, b) && !tree.links()[a].columns.is_empty())
}

/// One value per body; bodies with equal surfaces share one.
pub(crate) fn shared<T>(
    bodies: &[SubmergedBody],
    make: impl Fn(&SubmergedBody) -> Result<T>,
) -> Result<Vec<Arc<T>>> {
    shared_by(bodies, |a, b| a.equal(b), make)
}

/// One value per body; bodies that are the `same` share one.
pub(crate) fn shared_by<T>(
    bodies: &[SubmergedBody],
    same: impl Fn(&SubmergedBody, &SubmergedBody) -> bool,
    make: impl Fn(&SubmergedBody) -> Result<T>,
) -> Result<Vec<Arc<T>>> {
    let mut out: Vec<Arc<T>> = Vec::with_capacity(bodies.len());
    for (b, body) in bodies.iter().enumerate() {
        out.push(match (0..b).find(|a| same(&bodies[*a], body)) {
            Some(a) => out[a].clone(),
            None => Arc::new(make(body)?),
        });
    }
    Ok(out)
}

/// What `of` says of each, once for those that are shared.
pub(crate) fn once<T>(made: &[Arc<T>], of: impl Fn(&T) -> &[String]) -> Vec<String> {
    let first = |i: &usize| !made[..*i].iter().any(|m| Arc::ptr_eq(m, &made[*i]));
    let distinct = (0..made.len()).filter(first);
    distinct.flat_map(|i| of(&made[i]).to_vec()).collect()
}
