//! Coupled panels on two meshes, extrapolated: what the errors of added mass are measured against.

use super::added_mass;
use super::support::felt_error;
use hydrograd::scene::Scene;
use hydrograd::simulate::Method;
use hydrograd::{Fidelity, Settings, Shape, Simulator};
use nalgebra::DMatrix;

/// M_f from two meshes, the difference of the finer one from it, and the faces of the finer one.
pub struct Reference {
    pub matrix: DMatrix<f64>,
    pub rest: f64,
    pub faces: usize,
}

/// M = M_fine + (M_fine − M_coarse) / ((N_fine/N_coarse)^{p/2} − 1): the size of the faces is 1/√N.
pub fn reference(scene: &Scene, meshes: [f64; 2], order: f64) -> hydrograd::Result<Reference> {
    let settings = Settings::default()
        .fidelity(Fidelity::Full)
        .method(Method::Panel);
    let solve = |factor: f64| {
        let simulator = Simulator::new(&refined(scene, factor), settings.clone())?;
        Ok((simulator.faces(), added_mass(&simulator)?))
    };
    let (fewer, coarse) = solve(meshes[0])?;
    let (faces, fine) = solve(meshes[1])?;
    let gain = (faces as f64 / fewer as f64).powf(order / 2.0) - 1.0;
    let matrix = &fine + (&fine - coarse) / gain;
    Ok(Reference {
        rest: felt_error(&fine, &matrix),
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
