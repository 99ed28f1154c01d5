//! Thin plates and slender bodies: what is small in them is told or right, and compression keeps what their two sides do.

use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::shape::build;
use hydrograd::{Fidelity, Settings, Simulator};
use nalgebra::DMatrix;
use std::path::Path;

fn added_mass(scene: &Scene, fidelity: Fidelity) -> (DMatrix<f64>, Vec<String>) {
    let simulator = Simulator::new(scene, Settings::default().fidelity(fidelity)).unwrap();
    let matrix = simulator.added_mass().unwrap().matrix;
    (matrix, simulator.warnings().to_vec())
}

fn alone(shape: Shape) -> (DMatrix<f64>, Vec<String>) {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add(Body::new(shape).density(998.0));
    added_mass(&scene, Fidelity::Isolated)
}

/// Discs of a hundredth of their radius, one over the other: the sources of one side alone can't draw in what those of the other give off.
#[test]
fn compression_keeps_what_both_sides_of_a_plate_do() {
    for (gap, allowed) in [(1.0, 0.005), (0.3, 0.015)] {
        let mut scene = Scene::new(Fluid::fresh_water());
        let thickness = 0.01;
        for (name, z) in [("lower", 0.0), ("upper", thickness + gap)] {
            let disc = Shape::cylinder(1.0, thickness).faces(1280);
            scene.add(Body::new(disc).named(name).density(998.0).at([0.0, 0.0, z]));
        }
        let (truth, _) = added_mass(&scene, Fidelity::Full);
        for fidelity in [Fidelity::Reduced, Fidelity::Auto] {
            let (found, told) = added_mass(&scene, fidelity);
            let scale = |i: usize, j: usize| (truth[(i, i)] * truth[(j, j)]).sqrt();
            // Along the plates there is nothing to speak of.
            let across = [2, 3, 4, 8, 9, 10];
            let errors = across.iter().flat_map(|&i| across.map(|j| (i, j)));
            let errors = errors.map(|(i, j)| (found[(i, j)] - truth[(i, j)]).abs() / scale(i, j));
            let worst = errors.fold(0.0, f64::max);
            println!("gap {gap}, {fidelity:?}: {worst:.1e} of sqrt(M_ii M_jj)");
            assert!(worst < allowed, "{gap} {fidelity:?}: {worst}");
            assert_eq!(told, Vec::<String>::new());
        }
    }
}

/// Edgewise the added mass of a disc goes with its thickness squared, and is told where its faces lose it.
#[test]
fn a_disc_too_thin_for_its_faces_is_told() {
    let disc = |thickness: f64, faces: usize| alone(Shape::cylinder(1.0, thickness).faces(faces));
    let (fine, told) = disc(0.01, 5120);
    assert_eq!(told, Vec::<String>::new());
    let (coarse, told) = disc(0.01, 1280);
    assert_eq!(told, Vec::<String>::new());
    let error = coarse[(0, 0)] / fine[(0, 0)] - 1.0;
    println!("0.01: {error:.3} edgewise");
    assert!(error.abs() < 0.05, "{error}");
    let (coarse, told) = disc(0.003, 1280);
    let (fine, _) = disc(0.003, 5120);
    let error = coarse[(0, 0)] / fine[(0, 0)] - 1.0;
    println!("0.003: {error:.3} edgewise, {told:?}");
    assert!(error.abs() > 0.1, "{error}");
    assert!(
        told.len() == 1 && told[0].contains("a thickness of"),
        "{told:?}"
    );
}

/// The bound that README gives, slender and thin ones included.
#[test]
fn ellipsoids_by_panels_are_within_what_is_claimed() {
    for (semi_axes, allowed) in [
        ([1.0, 1.0, 1.0], 2e-4),
        ([1.0, 1.0, 0.1], 1e-3),
        ([4.0, 2.0, 0.5], 1e-3),
        ([10.0, 1.0, 1.0], 1e-3),
        ([1.0, 1.0, 0.01], 2e-2),
    ] {
        let mut scene = Scene::new(Fluid::fresh_water());
        let shape = Shape::ellipsoid(semi_axes).faces(1280);
        scene.add(Body::new(shape).density(998.0));
        let [exact, panel] = [
            hydrograd::simulate::Method::Exact,
            hydrograd::simulate::Method::Panel,
        ]
        .map(|method| {
            let settings = Settings::default()
                .fidelity(Fidelity::Isolated)
                .method(method);
            Simulator::new(&scene, settings)
                .unwrap()
                .added_mass()
                .unwrap()
                .matrix
        });
        let worst = (0..6)
            .filter(|i| exact[(*i, *i)] > 1e-6 * exact.amax())
            .map(|i| (panel[(i, i)] / exact[(i, i)] - 1.0).abs())
            .fold(0.0, f64::max);
        println!("{semi_axes:?}: {worst:.1e}");
        assert!(worst < allowed, "{semi_axes:?}: {worst}");
    }
}

/// Faces are what was asked for, as far as the shape allows, however slender.
#[test]
fn slender_bodies_have_the_faces_that_they_were_asked_for() {
    for size in [[1e6, 0.1, 0.1], [1e3, 1.0, 0.1], [1.0, 1.0, 1e-3]] {
        for asked in [80, 1280] {
            let shape = Shape::cuboid(size).faces(asked);
            let mesh = build(&shape, Path::new("."), None).unwrap();
            let faces = mesh.faces().len();
            println!("{size:?}: {faces} for {asked}");
            assert!(
                faces < 2 * asked && faces > asked / 3,
                "{size:?} {asked}: {faces}"
            );
        }
    }
}
