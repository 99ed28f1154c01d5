//! The same bodies on coarser or finer meshes.
//!
//! Bodies with enough faces are coarsened, the others refined; the errors of both groups add up. Shapes by
//! formula are meshed anew; a mesh from a file is coarsened by collapsing edges, or refined by
//! splitting every face into four, so that the polyhedron is the shape.

use super::case::Case;
use crate::scene::Shape;
use crate::shape::TriMesh;
use crate::simulate::assemble::{self, Surface};
use crate::{Error, Result};
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
/// Turn of the surface (rad) from which an edge is sharp, and the length of sharp edges, in square roots
/// of the area, from which a mesh from a file is.
const TURN: f64 = 0.96;
const LENGTH: f64 = 0.1;
/// Ratio of faces from which on two meshes differ enough.
const DIFFERENT: f64 = 1.2;

/// The same bodies on other meshes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Level {
    /// Faces of all bodies whose meshes matter.
    pub faces: usize,
    /// Size of the difference to the added mass on the scene's own meshes.
    pub difference: f64,
    /// The error of the latter that follows from it.
    pub error: f64,
}

/// The levels, and the error that follows; `None` if some body has no level.
pub(super) fn extrapolate(case: &Case, missing: &mut Vec<String>) -> (Vec<Level>, Option<f64>) {
    let bodies = case.meshed();
    let enough = |b: &usize| faces(case, *b) >= ENOUGH;
    let (many, few): (Vec<usize>, Vec<usize>) = bodies.into_iter().partition(enough);
    let (mut levels, mut error) = (Vec::new(), Some(0.0));
    for (group, factors) in [(many, [0.25, 0.5]), (few, [4.0, 2.0])] {
        if group.is_empty() {
            continue;
        }
        let (mut worst, mut reasons) = (None, vec![]);
        for factor in factors {
            match level(case, &group, factor) {
                Ok(Some(level)) => {
                    worst = Some(level.error.max(worst.unwrap_or(0.0)));
                    levels.push(level);
                }
                Ok(None) => {}
                Err(error) => reasons.push(format!(
                    "extrapolation from {factor} times the faces: {error}"
                )),
            }
        }
        if worst.is_none() && reasons.is_empty() {
            reasons.push("extrapolation: no mesh with fewer or more faces".into());
        }
        if worst.is_none() {
            missing.extend(reasons);
        }
        error = error.zip(worst).map(|(a, b)| a + b);
    }
    (levels, error)
}

fn faces(case: &Case, body: usize) -> usize {
    let surface = case.surfaces[body].as_ref();
    surface.map_or(0, |s| s.mesh.faces().len())
}

/// The added mass with `factor` times the faces for `bodies`; `None` where their meshes can't have
/// that.
fn level(case: &Case, bodies: &[usize], factor: f64) -> Result<Option<Level>> {
    let (mut ratio, mut order, mut total) = (f64::INFINITY, SMOOTH, 0);
    let mut surfaces = case.surfaces.clone();
    for b in bodies {
        let Some(Surface { mesh: own, .. }) = &case.surfaces[*b] else {
            continue;
        };
        let Some(surface) = other(case, *b, own, factor)? else {
            return Ok(None);
        };
        let faces = surface.mesh.faces().len();
        order = order.min(order_of(case, *b, own));
        let more = faces as f64 / own.faces().len() as f64;
        ratio = ratio.min(if factor < 1.0 { 1.0 / more } else { more });
        total += faces;
        surfaces[*b] = Some(surface);
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
    let difference = case.size(&case.difference(&surfaces)?);
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

/// The surface of a body with `factor` times the faces.
fn other(case: &Case, body: usize, own: &TriMesh, factor: f64) -> Result<Option<Surface>> {
    let target = (own.faces().len() as f64 * factor).round() as usize;
    let body = &case.scene().bodies[body];
    match &body.shape {
        Some(Shape::Mesh { .. }) if factor < 1.0 => {
            Ok(Some(Surface::of_mesh(own.coarsened(target)?)))
        }
        Some(Shape::Mesh { .. }) if factor == 4.0 => Ok(Some(Surface::of_mesh(own.split()))),
        Some(Shape::Mesh { .. }) => Ok(None),
        _ => assemble::surface(body, case.simulator.settings(), Some(target)),
    }
}

/// The order of a body's error.
fn order_of(case: &Case, body: usize, own: &TriMesh) -> f64 {
    match &case.scene().bodies[body].shape {
        Some(Shape::Sphere { .. } | Shape::Ellipsoid { .. } | Shape::Capsule { .. }) => SMOOTH,
        Some(Shape::Mesh { .. })
            if own.sharp_edges(TURN) <= LENGTH * own.mass_properties().area.sqrt() =>
        {
            FACETED
        }
        _ => SHARP,
    }
}
