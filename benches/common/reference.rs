//! Coupled panels on finer meshes: what the errors of added mass are measured against.

use super::added_mass;
use super::support::felt_error;
use hydrograd::scene::Scene;
use hydrograd::simulate::Method;
use hydrograd::{Fidelity, Settings, Shape, Simulator};
use nalgebra::DMatrix;

/// M_f from the finer one of two resolutions, the difference of the coarser one from it, and the faces of the finer one.
pub struct Reference {
    pub matrix: DMatrix<f64>,
    pub rest: f64,
    pub faces: usize,
}

/// With `factors` times as many faces on every body. `full` by panels extrapolates each from two meshes of its own; what is left of their errors
/// follows no order that could be taken away once more.
pub fn reference(scene: &Scene, factors: [f64; 2]) -> hydrograd::Result<Reference> {
    let settings = Settings::default()
        .fidelity(Fidelity::Full)
        .method(Method::Panel);
    let solve = |factor: f64| {
        let simulator = Simulator::new(&refined(scene, factor), settings.clone())?;
        Ok((simulator.faces(), added_mass(&simulator)?))
    };
    let (_, coarse) = solve(factors[0])?;
    let (faces, matrix) = solve(factors[1])?;
    Ok(Reference {
        rest: felt_error(&coarse, &matrix),
        matrix,
        faces,
    })
}

/// The scene with `factor` times as many faces on every body.
fn refined(scene: &Scene, factor: f64) -> Scene {
    let mut scene = scene.clone();
    for shape in scene.bodies.iter_mut().filter_map(|b| b.shape.as_mut()) {
        let faces = match shape {
            Shape::Sphere { faces, .. }
            | Shape::Ellipsoid { faces, .. }
            | Shape::Box { faces, .. }
            | Shape::Cylinder { faces, .. }
            | Shape::Capsule { faces, .. }
            | Shape::Prism { faces, .. } => faces,
            Shape::Mesh { .. } | Shape::Triangles { .. } => continue,
        };
        *faces = faces.map(|n| (factor * n as f64).round() as usize);
    }
    scene
}
