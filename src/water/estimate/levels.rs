//! The same bodies on coarser or finer meshes.
//!
//! Bodies with enough faces are coarsened, the others refined; the errors of both groups add up. Shapes by
//! formula are meshed anew; a mesh from a file is coarsened by collapsing edges, or refined by
//! splitting every face into four, so that the polyhedron is the shape.
//!
//! Panels of a body by formula are themselves extrapolated from two meshes, n and n/4. Then the error is
//! the smaller of two: that of the finer mesh alone, and that which the pair n/2, n/8 tells.

use super::case::Case;
use crate::geometry::TriMesh;
use crate::scene::Shape;
use crate::water::surface::{Meshing, Surface, surface};
use crate::{Error, Result};
use nalgebra::DMatrix;
use serde::Serialize;

/// A mesh with at least so many faces is coarsened.
const ENOUGH: usize = 240;
/// Most faces in all of refined meshes.
const MOST: usize = 6000;
/// Orders of the error in 1/faces: of smooth bodies, of polyhedra that stand for them, and with sharp
/// edges. There the leading part goes like the power ⅔ too, but faces are seldom small enough for it to
/// be all.
const SMOOTH: f64 = 1.0;
const FACETED: f64 = 2.0 / 3.0;
const SHARP: f64 = 0.5;
/// The order where two meshes of a smooth body are extrapolated.
const PAIR: f64 = 1.5;
/// Turn of the surface (rad) from which an edge is sharp, and the length of sharp edges, in square roots
/// of the area, from which a mesh from a file is.
const TURN: f64 = 0.96;
const LENGTH: f64 = 0.1;
/// Ratio of faces from which on two meshes differ enough.
const DIFFERENT: f64 = 1.2;
/// What is said of bodies without levels.
const NONE: &str = "extrapolation: no other mesh with enough more or fewer faces could be solved";

/// The same bodies on other meshes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Level {
    /// Faces of all bodies whose meshes matter.
    pub faces: usize,
    /// Size of the difference to the added mass on the scene's own meshes (where those come in pairs,
    /// on the finer of each, or on both).
    pub difference: f64,
    /// The error of the latter that follows from it.
    pub error: f64,
}

/// The levels, and the error that follows; `None` if some body has no level.
pub(crate) fn extrapolate(case: &Case, missing: &mut Vec<String>) -> (Vec<Level>, Option<f64>) {
    let enough = |b: &usize| {
        let surface = case.surfaces[*b].as_ref();
        surface.is_some_and(|s| s.mesh.faces().len() >= ENOUGH)
    };
    let (many, few): (Vec<usize>, Vec<usize>) = case.meshed().into_iter().partition(enough);
    let (mut levels, mut error) = (Vec::new(), Some(0.0));
    for (bodies, factors) in [(many, [0.25, 0.5]), (few, [4.0, 2.0])] {
        if bodies.is_empty() {
            continue;
        }
        let mut group = Group {
            case,
            bodies,
            levels: Vec::new(),
            reasons: Vec::new(),
        };
        let found = group.error(factors);
        levels.append(&mut group.levels);
        if found.is_none() {
            group.reasons.insert(0, NONE.into());
            missing.push(group.reasons.join("; "));
        }
        error = error.zip(found).map(|(a, b)| a + b);
    }
    (levels, error)
}

type Surfaces = [Option<Surface>];

/// Bodies whose meshes change together.
struct Group<'a> {
    case: &'a Case<'a>,
    bodies: Vec<usize>,
    levels: Vec<Level>,
    /// Why there aren't more.
    reasons: Vec<String>,
}

impl Group<'_> {
    fn error(&mut self, factors: [f64; 2]) -> Option<f64> {
        let case = self.case;
        let mut single = case.surfaces.clone();
        let mut pairs = 0;
        for b in &self.bodies {
            if let Some(surface) = &mut single[*b] {
                pairs += usize::from(surface.coarse.take().is_some());
            }
        }
        if pairs == 0 {
            return self.worst(&case.surfaces, case.own(), &factors);
        }
        // The single mesh's error bounds that of the pair, whose own may tell more.
        let known = case.value(&single);
        let known = known.map_err(|e| self.reasons.push(e.to_string())).ok()?;
        let plain = self.worst(&single, &known, &factors);
        if factors[0] > 1.0 {
            return plain;
        }
        let pair = self.worst(&case.surfaces, case.own(), &[0.5]);
        plain.into_iter().chain(pair).reduce(f64::min)
    }

    /// The largest error that the levels tell of `from`, whose added mass is `known`.
    fn worst(&mut self, from: &Surfaces, known: &DMatrix<f64>, factors: &[f64]) -> Option<f64> {
        let mut worst: Option<f64> = None;
        for factor in factors {
            match self.level(from, known, *factor) {
                Ok(Some(level)) => {
                    worst = Some(level.error.max(worst.unwrap_or(0.0)));
                    self.levels.push(level);
                }
                Ok(None) => {}
                Err(error) => self
                    .reasons
                    .push(format!("with {factor} times the faces: {error}")),
            }
        }
        worst
    }

    /// With `factor` times the faces; `None` where meshes can't have that.
    fn level(&self, from: &Surfaces, known: &DMatrix<f64>, factor: f64) -> Result<Option<Level>> {
        let case = self.case;
        let paired = |b: &usize| from[*b].as_ref().is_some_and(|s| s.coarse.is_some());
        let pairs = self.bodies.iter().any(paired);
        let (mut ratio, mut order, mut total) = (f64::INFINITY, f64::INFINITY, 0);
        let mut surfaces = from.to_vec();
        for b in &self.bodies {
            let Some(own) = &from[*b] else { continue };
            let Some(mut other) = other(case, *b, own, factor)? else {
                return Ok(None);
            };
            if !pairs {
                other.coarse = None;
            }
            let alone = order_of(case, *b, &own.mesh);
            let both = own.coarse.is_some() && other.coarse.is_some();
            order = order.min(if both && alone == SMOOTH { PAIR } else { alone });
            let faces = other.mesh.faces().len();
            let more = faces as f64 / own.mesh.faces().len() as f64;
            ratio = ratio.min(if factor < 1.0 { 1.0 / more } else { more });
            total += faces;
            surfaces[*b] = Some(other);
        }
        if ratio < DIFFERENT {
            return Ok(None);
        }
        if factor > 1.0 && total > MOST {
            return Err(Error::Unsupported {
                what: format!("a refined mesh with {total} faces"),
                why: format!("it would take long; at most {MOST} are solved"),
                instead: format!("give every body at least {ENOUGH} faces"),
            });
        }
        let difference = case.size(&(case.value(&surfaces)? - known));
        let error = match factor < 1.0 {
            true => difference / (ratio.powf(order) - 1.0),
            false => difference / (1.0 - ratio.powf(-order)),
        };
        Ok(Some(Level {
            faces: total,
            difference,
            error,
        }))
    }
}

/// The surface of a body with `factor` times the faces, also in its refined regions.
fn other(case: &Case, body: usize, own: &Surface, factor: f64) -> Result<Option<Surface>> {
    let times = |faces: usize| (faces as f64 * factor).round() as usize;
    let (own, base) = (&own.mesh, times(own.base));
    let target = times(own.faces().len());
    let body = &case.scene().bodies[body];
    match &body.shape {
        Some(shape) if shape.is_mesh() && factor < 1.0 => {
            Ok(Some(Surface::of_mesh(own.coarsened(target)?)))
        }
        Some(shape) if shape.is_mesh() && factor == 4.0 => Ok(Some(Surface::of_mesh(own.split()))),
        Some(shape) if shape.is_mesh() => Ok(None),
        _ => {
            let meshing = Meshing {
                faces: Some(base),
                ..case.subject.choices.meshing()
            };
            surface(body, meshing, factor.powf(-0.5))
        }
    }
}

/// The order of a body's error.
fn order_of(case: &Case, body: usize, own: &TriMesh) -> f64 {
    match &case.scene().bodies[body].shape {
        Some(Shape::Sphere { .. } | Shape::Ellipsoid { .. } | Shape::Capsule { .. }) => SMOOTH,
        Some(shape)
            if shape.is_mesh()
                && own.sharp_edge_length(TURN) <= LENGTH * own.mass_properties().area.sqrt() =>
        {
            FACETED
        }
        _ => SHARP,
    }
}
