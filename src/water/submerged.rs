//! The bodies in the water: discretised as the settings ask, and coupled.

use super::device::Device;
use super::surface::Coarse;
use super::{Fidelity, Settings};
use crate::adjoint::lie::{Mat6, Pose, Vec3};
use crate::boundary::exact::ExactBoundary;
use crate::boundary::panel::Extrapolated;
use crate::boundary::{BodyBoundary, OneBody, PanelBoundary, Response};
use crate::coupling::full::{MfsBody, Model, Solver};
use crate::coupling::panel::{self, PanelCoupled};
use crate::coupling::reduced::{Cutoff, Reduced, ReducedBody, cache, compress};
use crate::coupling::{Coupling, Exclusions, Isolated};
use crate::geometry::TriMesh;
use crate::scene::{Shape, Wall};
use crate::shape;
use crate::{Error, Result};
use serde::Serialize;
use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

/// A body that the water sees.
pub(crate) struct SubmergedBody<'a> {
    pub name: &'a str,
    /// Surface in the body's frame.
    pub mesh: Option<&'a TriMesh>,
    /// The shape by formula and its pose in the body's frame, if it is an ellipsoid.
    pub ellipsoid: Option<([f64; 3], Pose)>,
    /// A coarser mesh of the shape, where it is one by formula.
    pub coarse: Option<&'a Coarse>,
    /// Given added mass at unit density.
    pub added_mass: Option<Mat6>,
}

/// What was made of the bodies.
pub(crate) struct Made {
    pub coupling: Box<dyn Coupling>,
    /// Faces of all surfaces that were discretised.
    pub faces: usize,
    /// What each body became.
    pub bodies: Vec<Discretisation>,
    pub warnings: Vec<String>,
}

/// How a body is seen by the coupling, and how well.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
    /// Asymmetry of its own added mass before symmetrising.
    pub asymmetry: f64,
    /// Estimated error of its own added mass, where two meshes tell one.
    pub added_mass_error: Option<f64>,
    /// Error of the compressed flow of the body itself at points not fitted to, relative.
    pub radiated_error: f64,
    /// Error of the compressed flow scattered between such points, relative.
    pub scattered_error: f64,
}

/// The semi-axes of a shape by formula that closed forms are known for.
pub(crate) fn semi_axes(shape: &Shape) -> Option<[f64; 3]> {
    match shape {
        Shape::Sphere { radius, .. } => Some([*radius; 3]),
        Shape::Ellipsoid { semi_axes, .. } => Some(*semi_axes),
        _ => None,
    }
}

impl<'a> SubmergedBody<'a> {
    /// Whether its answer depends on a mesh.
    pub fn meshed(&self, settings: &Settings, fidelity: Fidelity) -> bool {
        let formula =
            fidelity != Fidelity::Full && matches!(self.method(settings), Ok(OneBody::Exact));
        self.mesh.is_some() && self.added_mass.is_none() && !formula
    }

    /// The method for this body.
    fn method(&self, settings: &Settings) -> Result<OneBody> {
        match (settings.one_body, self.ellipsoid) {
            (OneBody::Auto, Some(_)) => Ok(OneBody::Exact),
            (OneBody::Auto, None) => Ok(OneBody::Panel),
            (OneBody::Exact, None) => Err(Error::Unsupported {
                what: format!("the method exact for body {:?}", self.name),
                why: "closed forms are known for spheres and ellipsoids by formula".into(),
                instead: "use the method auto, which takes panels for other bodies, or panel"
                    .into(),
            }),
            (method, _) => Ok(method),
        }
    }

    fn surface(&self, fidelity: &str) -> Result<&'a TriMesh> {
        self.mesh.ok_or_else(|| Error::Unsupported {
            what: format!("coupling of body {:?}", self.name),
            why: format!("it has a given added mass but no shape, and {fidelity} needs one"),
            instead: "give it a shape, or use the fidelity isolated".into(),
        })
    }

    /// The body alone, as the compression asks for it.
    fn response(
        &self,
        method: OneBody,
        settings: &Settings,
        gap: f64,
    ) -> Result<Box<dyn Response>> {
        let mesh = self.surface("reduced")?;
        Ok(match (method, &self.ellipsoid) {
            (OneBody::Exact, Some((axes, pose))) => {
                Box::new(ExactBoundary::new(self.name, *axes, pose, gap)?)
            }
            (OneBody::Mfs, _) => {
                let b = &settings.boundary;
                Box::new(BodyBoundary::new(self.name, mesh, b)?)
            }
            _ => {
                let fine = PanelBoundary::new(self.name, mesh)?;
                match self.coarse {
                    Some(Coarse { mesh, ratio }) => {
                        let coarse = PanelBoundary::new(self.name, mesh)?;
                        Box::new(Extrapolated::new(fine, coarse, *ratio)?)
                    }
                    None => Box::new(fine),
                }
            }
        })
    }
}

fn name_of(method: OneBody) -> &'static str {
    match method {
        OneBody::Exact => "exact",
        OneBody::Mfs => "mfs",
        OneBody::Panel | OneBody::Auto => "panel",
    }
}

/// What is around the bodies.
pub(crate) struct Water<'a> {
    pub walls: &'a [Wall],
    /// Pairs that don't feel each other, by their numbers among the bodies in the water.
    pub excluded: Exclusions,
    /// Where compressed bodies are kept.
    pub folder: Option<&'a Path>,
}

/// The coupling of `bodies`, with a fidelity that isn't `Auto`, computed on `device`.
pub(crate) fn couple(
    bodies: &[SubmergedBody],
    water: &Water,
    settings: &Settings,
    fidelity: Fidelity,
    plan: &Plan,
    device: &mut Device,
) -> Result<Made> {
    match fidelity {
        Fidelity::Isolated => isolated(bodies, water.walls, settings),
        Fidelity::Full if settings.one_body == OneBody::Panel => panels(bodies, water, settings),
        Fidelity::Full => full(bodies, water, settings, device),
        Fidelity::Reduced | Fidelity::Auto => reduced(bodies, water, settings, plan, device),
    }
}

/// What `Auto` chose for each body and pair; empty: what the settings say.
#[derive(Clone, Debug, Default)]
pub(crate) struct Plan {
    /// Per body.
    pub compress: Vec<compress::Settings>,
    /// Per pair of bodies, equal for a body and its images.
    pub cutoffs: Vec<((usize, usize), Cutoff)>,
}

fn isolated(bodies: &[SubmergedBody], walls: &[Wall], settings: &Settings) -> Result<Made> {
    let mut warnings = Vec::new();
    if !walls.is_empty() {
        warnings.push(format!(
            "{} wall(s) have no effect with the fidelity isolated; use reduced or full to feel them",
            walls.len()
        ));
    }
    let mut made: Vec<Own> = Vec::with_capacity(bodies.len());
    for (b, body) in bodies.iter().enumerate() {
        let same = (0..b).find(|a| equal(&bodies[*a], body));
        made.push(match same {
            Some(a) => Own {
                warnings: Vec::new(),
                ..made[a].clone()
            },
            None => own(body, settings)?,
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
                ..Discretisation::empty()
            })
            .collect(),
        coupling: Box::new(Isolated::new(
            made.into_iter().map(|m| m.added_mass).collect(),
        )),
        warnings,
    })
}

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

/// Whether two bodies have the same surface in their own frames.
fn equal(a: &SubmergedBody, b: &SubmergedBody) -> bool {
    let same = |a: &TriMesh, b: &TriMesh| a.vertices() == b.vertices() && a.faces() == b.faces();
    a.added_mass == b.added_mass
        && a.ellipsoid == b.ellipsoid
        && match (a.mesh, b.mesh) {
            (Some(a), Some(b)) => same(a, b),
            (None, None) => true,
            _ => false,
        }
}

fn own(body: &SubmergedBody, settings: &Settings) -> Result<Own> {
    if let Some(added_mass) = body.added_mass {
        return Ok(Own {
            added_mass,
            method: "given",
            faces: 0,
            asymmetry: 0.0,
            error: None,
            warnings: Vec::new(),
        });
    }
    let method = body.method(settings)?;
    let faces = match method {
        OneBody::Exact => 0,
        _ => body.surface("isolated")?.faces().len(),
    };
    // Nothing is near: the flow around it isn't asked for.
    let far = body.mesh.map_or(1.0, |m| m.surface_area().sqrt());
    let response = body.response(method, settings, far)?;
    Ok(Own {
        added_mass: response.added_mass(),
        method: name_of(method),
        faces,
        asymmetry: response.asymmetry(),
        error: response.error(),
        warnings: response.warnings().to_vec(),
    })
}

impl Discretisation {
    fn empty() -> Self {
        Self {
            body: String::new(),
            method: "",
            faces: 0,
            unknowns: 0,
            points: 0,
            resolved_gap: None,
            asymmetry: 0.0,
            added_mass_error: None,
            radiated_error: 0.0,
            scattered_error: 0.0,
        }
    }
}

/// One value per body; bodies with equal surfaces share one.
fn shared<T>(
    bodies: &[SubmergedBody],
    make: impl Fn(&SubmergedBody, &TriMesh) -> Result<T>,
) -> Result<Vec<Arc<T>>> {
    let mut out: Vec<Arc<T>> = Vec::with_capacity(bodies.len());
    for (b, body) in bodies.iter().enumerate() {
        let mesh = body.surface("full")?;
        out.push(match (0..b).find(|a| equal(&bodies[*a], body)) {
            Some(a) => out[a].clone(),
            None => Arc::new(make(body, mesh)?),
        });
    }
    Ok(out)
}

/// What `of` says of each, once for those that are shared.
fn once<T>(made: &[Arc<T>], of: impl Fn(&T) -> &[String]) -> Vec<String> {
    let first = |i: &usize| !made[..*i].iter().any(|m| Arc::ptr_eq(m, &made[*i]));
    let distinct = (0..made.len()).filter(first);
    distinct.flat_map(|i| of(&made[i]).to_vec()).collect()
}

fn full(
    bodies: &[SubmergedBody],
    water: &Water,
    settings: &Settings,
    device: &mut Device,
) -> Result<Made> {
    if settings.one_body == OneBody::Exact {
        return Err(Error::Unsupported {
            what: "the method exact with the fidelity full".into(),
            why: "closed forms are of single bodies".into(),
            instead: "use the fidelity reduced, which couples them, or the method mfs-vertex"
                .into(),
        });
    }
    let mut boundary = settings.boundary;
    if settings.solve.solver == Solver::Gmres {
        // GMRES solves the square system as it is; damping belongs to least squares.
        boundary.damping = 0.0;
    }
    let made = shared(bodies, |body, mesh| {
        let make = if device.factors(mesh.faces().len()) {
            BodyBoundary::new
        } else {
            BodyBoundary::unfactored
        };
        Ok(MfsBody::new(Arc::new(make(body.name, mesh, &boundary)?)))
    })?;
    Ok(Made {
        faces: made.iter().map(|m| m.faces()).sum(),
        warnings: once(&made, |m| &m.boundary.warnings),
        bodies: made
            .iter()
            .zip(bodies)
            .map(|(m, body)| Discretisation {
                body: body.name.to_string(),
                method: "mfs",
                faces: m.faces(),
                unknowns: m.sources(),
                asymmetry: m.boundary.asymmetry,
                ..Discretisation::empty()
            })
            .collect(),
        coupling: Box::new(device.full(Model::new(
            made,
            water.walls,
            water.excluded.clone(),
            settings.solve,
        )?)?),
    })
}

fn panels(bodies: &[SubmergedBody], water: &Water, settings: &Settings) -> Result<Made> {
    let made = shared(bodies, |body, mesh| PanelBoundary::new(body.name, mesh))?;
    let solve = panel::SolveSettings {
        solver: settings.panel,
        tolerance: settings.solve.tolerance,
        ..panel::SolveSettings::default()
    };
    Ok(Made {
        faces: made.iter().map(|m| m.faces.len()).sum(),
        warnings: once(&made, |m| &m.warnings),
        bodies: made
            .iter()
            .zip(bodies)
            .map(|(m, body)| Discretisation {
                body: body.name.to_string(),
                method: "panel",
                faces: m.faces.len(),
                unknowns: m.faces.len(),
                asymmetry: m.asymmetry,
                ..Discretisation::empty()
            })
            .collect(),
        coupling: Box::new(
            PanelCoupled::new(made, water.walls, solve)?.excluding(water.excluded.clone())?,
        ),
    })
}

fn reduced(
    bodies: &[SubmergedBody],
    water: &Water,
    settings: &Settings,
    plan: &Plan,
    device: &mut Device,
) -> Result<Made> {
    let coupling = compressed_all(bodies, water, settings, plan)?;
    let made = coupling.reduced_bodies();
    let method = |body: &SubmergedBody| Ok(name_of(body.method(settings)?));
    let methods = bodies.iter().map(method).collect::<Result<Vec<_>>>()?;
    Ok(Made {
        faces: bodies
            .iter()
            .filter_map(|b| Some(b.mesh?.faces().len()))
            .sum(),
        warnings: compression_warnings(bodies, made, settings, plan),
        bodies: made
            .iter()
            .zip(bodies)
            .zip(&methods)
            .map(|((m, body), method)| {
                let fit = &m.parts().fit;
                Discretisation {
                    body: body.name.to_string(),
                    method,
                    faces: body.mesh.map_or(0, |m| m.faces().len()),
                    unknowns: m.modes(),
                    points: m.points(),
                    resolved_gap: Some(fit.resolved_gap),
                    asymmetry: fit.body_asymmetry,
                    added_mass_error: fit.body_error,
                    radiated_error: fit.radiated,
                    scattered_error: fit.scattered,
                }
            })
            .collect(),
        coupling: device.reduced(coupling)?,
    })
}

/// All bodies compressed and coupled.
pub(crate) fn compressed_all(
    bodies: &[SubmergedBody],
    water: &Water,
    settings: &Settings,
    plan: &Plan,
) -> Result<Reduced> {
    let mut made: Vec<Arc<ReducedBody>> = Vec::with_capacity(bodies.len());
    for (b, body) in bodies.iter().enumerate() {
        let method = body.method(settings)?;
        let chosen = plan.compress.get(b).copied().unwrap_or(settings.compress);
        made.push(compressed(body, method, settings, &chosen, water.folder)?);
    }
    let cutoff = |a: usize, b: usize| {
        let pair = (a.min(b), a.max(b));
        let found = plan.cutoffs.iter().find(|(p, _)| *p == pair);
        found.map(|(_, cutoff)| *cutoff)
    };
    let names = bodies.iter().map(|b| b.name.to_string());
    Ok(Reduced::new(made, water.walls, cutoff)?
        .excluding(&water.excluded)?
        .named(names))
}

/// What each body answers by its own method; bodies that are equal share one. Sources as near as
/// `gaps` (m, one a body) are resolved where the method has to know.
pub(crate) fn responses(
    bodies: &[SubmergedBody],
    settings: &Settings,
    gaps: &[f64],
) -> Result<Vec<Arc<dyn Response>>> {
    let mut out: Vec<Arc<dyn Response>> = Vec::with_capacity(bodies.len());
    for (b, body) in bodies.iter().enumerate() {
        let same = |a: &usize| equal(&bodies[*a], body) && gaps[*a] == gaps[b];
        out.push(match (0..b).find(same) {
            Some(a) => out[a].clone(),
            None => {
                let method = body.method(settings)?;
                Arc::from(body.response(method, settings, gaps[b])?)
            }
        });
    }
    Ok(out)
}

/// Part of the flow that a body throws back, at points not fitted to, that compression may leave out before the user hears of it: the default leaves a
/// quarter at the nearest points, worth 0.3 % of the added mass; beyond this it is several per cent.
const MISSED: f64 = 0.6;

/// What the user should know of compressed bodies.
fn compression_warnings(
    bodies: &[SubmergedBody],
    made: &[Arc<ReducedBody>],
    settings: &Settings,
    plan: &Plan,
) -> Vec<String> {
    let mut out = Vec::new();
    for (b, (body, made)) in bodies.iter().zip(made).enumerate() {
        if bodies[..b].iter().any(|a| equal(a, body)) {
            continue;
        }
        let parts = made.parts();
        let size = parts.radius;
        out.extend(
            parts
                .fit
                .warnings
                .iter()
                .map(|w| format!("{w} (lengths of this message in units of {size:.3e} m)")),
        );
        let asked = plan
            .compress
            .get(b)
            .unwrap_or(&settings.compress)
            .resolved_gap;
        let got = parts.fit.resolved_gap;
        let missed = parts.fit.scattered.max(parts.fit.radiated);
        if missed > MISSED {
            out.push(format!(
                "body {:?}: its {} compressed sources leave {:.0} % of its flow at the smallest gap that they \
                 were fitted for: use a higher rank, or the tolerance instead",
                body.name,
                parts.points.len(),
                100.0 * missed
            ));
        }
        if let Some(asked) = asked.filter(|a| *a < 0.98 * got) {
            out.push(format!(
                "body {:?}: gaps under {got:.3e} m aren't resolved by its compressed sources, for all \
                 that {asked:.3e} m were asked for: its surface is too large; use a plane wall for a \
                 floor, or the fidelity full",
                body.name
            ));
        }
    }
    out
}

/// Faces of the mesh around a body by formula, from which the points of its compression are laid out:
/// what they are fitted to doesn't depend on it.
const LAYOUT_FACES: usize = 2000;

/// The surface that a body is compressed around, in the body's frame.
fn layout<'a>(body: &SubmergedBody<'a>, method: OneBody) -> Result<Cow<'a, TriMesh>> {
    let mesh = body.surface("reduced")?;
    match (method, body.ellipsoid) {
        (OneBody::Exact, Some((semi_axes, pose))) => {
            let shape = Shape::ellipsoid(semi_axes).faces(LAYOUT_FACES);
            Ok(Cow::Owned(
                shape::build(&shape, Path::new(""), None)?.transformed(&pose),
            ))
        }
        _ => Ok(Cow::Borrowed(mesh)),
    }
}

/// Steps of the grid, relative to the body's size, on which lengths are compared.
const GRID: f64 = (1u64 << 30) as f64;

/// The body compressed, from the cache if it is there.
///
/// It is computed in units of its own size, with lengths rounded to [`GRID`]: bodies of the same
/// shape share it whatever their size, to the last bit.
fn compressed(
    body: &SubmergedBody,
    method: OneBody,
    settings: &Settings,
    chosen: &compress::Settings,
    folder: Option<&Path>,
) -> Result<Arc<ReducedBody>> {
    chosen.validate()?;
    let mesh = layout(body, method)?;
    let size = mesh.bounding_ball().radius;
    let round = |x: f64| (x / size * GRID).round() / GRID;
    let vertices: Vec<Vec3> = mesh.vertices().iter().map(|v| v.map(round)).collect();
    let unit = TriMesh::new(mesh.name(), vertices, mesh.faces().to_vec())?;
    let coarse = body.coarse.filter(|_| method == OneBody::Panel).map(|c| {
        let vertices = c.mesh.vertices().iter().map(|v| v.map(round)).collect();
        let mesh = TriMesh::new(c.mesh.name(), vertices, c.mesh.faces().to_vec())?;
        Ok::<_, Error>(Coarse { mesh, ..*c })
    });
    let coarse = coarse.transpose()?;
    let ellipsoid = body.ellipsoid.filter(|_| method == OneBody::Exact);
    let ellipsoid = ellipsoid.map(|(axes, pose)| {
        let at = Pose::new(pose.rotation, pose.translation.map(round));
        (axes.map(round), at)
    });
    let gap = chosen.resolved_gap.map(round);
    let chosen = compress::Settings {
        resolved_gap: Some(gap.unwrap_or_else(|| {
            compress::default_gap(unit.mass_properties().volume, unit.surface_area())
        })),
        ..*chosen
    };
    let formula = ellipsoid.map(|(axes, pose)| {
        let turn: Vec<f64> = pose.rotation.iter().copied().collect();
        (axes, turn, <[f64; 3]>::from(pose.translation))
    });
    let fundamental = (method == OneBody::Mfs).then_some(settings.boundary);
    let made_from = (
        method,
        formula,
        fundamental,
        coarse.as_ref().map(|c| c.mesh.faces().len()),
    );
    let key = cache::Key::new(&unit, &made_from, &chosen);
    let found = cache::fetch(key, folder, || {
        let own = SubmergedBody {
            name: body.name,
            mesh: Some(&unit),
            ellipsoid,
            coarse: coarse.as_ref(),
            added_mass: None,
        };
        let gap = chosen
            .resolved_gap
            .unwrap_or(0.0)
            .max(compress::finest_gap(unit.surface_area()));
        let response = own.response(method, settings, gap)?;
        compress::compress(body.name, &unit, response.as_ref(), &chosen)
    });
    let found = found.map_err(|e| e.in_units_of(size))?;
    Ok(Arc::new(found.scaled(size)?))
}
