//! The same scene on coarser or finer meshes.

use super::case::Case;
use crate::scene::Shape;
use crate::shape::TriMesh;
use crate::simulate::assemble;
use crate::{Error, Result};
use serde::Serialize;

/// Coarser meshes have at least this many faces a body.
const FEWEST: usize = 60;
/// Most faces in all of a finer mesh.
const MOST: usize = 10_000;
/// Orders of the error in 1/faces: smooth bodies, and bodies with sharp edges.
const SMOOTH: f64 = 1.0;
const SHARP: f64 = 2.0 / 3.0;
/// Ratio of faces from which on two meshes differ enough.
const DIFFERENT: f64 = 1.2;

/// The same scene on other meshes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Level {
    /// Faces of all bodies.
    pub faces: usize,
    /// Difference of the added mass to that on the scene's own meshes.
    pub difference: f64,
    /// The error of the latter that follows from it.
    pub error: f64,
}

pub(super) fn levels(case: &Case, missing: &mut Vec<String>) -> Vec<Level> {
    let settings = case.simulator.settings();
    let scene = &case.simulator.scene;
    let wet = case.wet(&case.meshes);
    let used: Vec<usize> = (0..scene.bodies.len())
        .filter(|b| {
            let name = &scene.bodies[*b].name;
            let found = wet.iter().find(|w| w.name == name);
            found.is_some_and(|w| w.meshed(settings, case.fidelity))
        })
        .collect();
    if used.is_empty() {
        return Vec::new();
    }
    let faces = |b: &usize| case.meshes[*b].as_ref().map_or(0, |m| m.faces().len());
    let file = |b: &usize| matches!(scene.bodies[*b].shape, Some(Shape::Mesh { .. }));
    let fewest = used.iter().map(faces).min().unwrap_or(0);
    let factors: &[f64] = if used.iter().any(file) {
        &[4.0]
    } else if fewest >= 4 * FEWEST {
        &[0.25, 0.5]
    } else {
        &[2.0, 4.0]
    };
    let mut out = Vec::new();
    for factor in factors {
        match level(case, &used, *factor) {
            Ok(level) => out.push(level),
            Err(error) => missing.push(format!("extrapolation from {factor} × the faces: {error}")),
        }
    }
    out
}

fn level(case: &Case, used: &[usize], factor: f64) -> Result<Level> {
    let scene = &case.simulator.scene;
    let (mut least, mut order, mut total) = (f64::INFINITY, SMOOTH, 0);
    let mut meshes: Vec<Option<TriMesh>> = case.meshes.clone();
    for b in used {
        let Some(own) = &case.meshes[*b] else {
            continue;
        };
        let n = own.faces().len() as f64;
        let mesh = match &scene.bodies[*b].shape {
            Some(Shape::Mesh { .. }) => own.split(),
            _ => {
                let target = (n * factor).round() as usize;
                assemble::mesh(&scene.bodies[*b], Some(target))?.unwrap_or_else(|| own.clone())
            }
        };
        let smooth = matches!(
            scene.bodies[*b].shape,
            Some(Shape::Sphere { .. } | Shape::Ellipsoid { .. } | Shape::Capsule { .. })
        );
        if !smooth {
            order = SHARP;
        }
        let ratio = mesh.faces().len() as f64 / n;
        least = least.min(if factor < 1.0 { 1.0 / ratio } else { ratio });
        total += mesh.faces().len();
        meshes[*b] = Some(mesh);
    }
    if least < DIFFERENT || (factor > 1.0 && total > MOST) {
        return Err(Error::Unsupported {
            what: format!("a mesh with {factor} times the faces"),
            why: format!("{total} faces, {least:.2} times as many or few"),
            instead: "give other numbers of faces".into(),
        });
    }
    let difference = case.size(&case.difference(&meshes)?);
    let error = if factor < 1.0 {
        difference / (least.powf(order) - 1.0)
    } else {
        difference / (1.0 - least.powf(-order))
    };
    Ok(Level {
        faces: total,
        difference,
        error,
    })
}
