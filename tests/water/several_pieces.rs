//! A mesh in several pieces against a body for each, held together: one and the same in the water.

use crate::support::mesh;
use hydrograd::adjoint::lie::{Mat6, Vec3};
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::Method;
use hydrograd::{Fidelity, Settings, Simulator, TriMesh};
use nalgebra::DMatrix;

const APART: f64 = 2.5;

fn shape(mesh: &TriMesh) -> Shape {
    let vertices: Vec<[f64; 3]> = mesh.vertices().iter().map(|x| (*x).into()).collect();
    Shape::triangles(vertices, mesh.faces().to_vec())
}

fn scene(bodies: &[Body]) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 1.0,
        current: [0.0; 3],
    });
    for body in bodies {
        scene.add(body.clone());
    }
    scene
}

/// Two spheres in one mesh, and two bodies of which one carries the other.
fn both() -> [Scene; 2] {
    let sphere = mesh(&Shape::sphere(1.0), 320);
    let n = sphere.vertices().len();
    let shifted = sphere
        .vertices()
        .iter()
        .map(|x| x + Vec3::new(APART, 0.0, 0.0));
    let vertices: Vec<Vec3> = sphere.vertices().iter().copied().chain(shifted).collect();
    let second = sphere.faces().iter().map(|f| f.map(|v| v + n));
    let faces = sphere.faces().iter().copied().chain(second).collect();
    let pair = TriMesh::new("pair", vertices, faces).unwrap();
    let one = Body::new(shape(&sphere)).density(1.0).named("one");
    let other = Body::new(shape(&sphere)).density(1.0).named("other");
    let other = other.at([APART, 0.0, 0.0]).child_of("one").fixed();
    [
        scene(&[Body::new(shape(&pair)).density(1.0)]),
        scene(&[one, other]),
    ]
}

fn added_mass(scene: &Scene, fidelity: Fidelity, method: Method) -> DMatrix<f64> {
    let settings = Settings::default().fidelity(fidelity).method(method);
    let simulator = Simulator::new(scene, settings).unwrap();
    simulator.added_mass().unwrap().matrix
}

#[test]
fn one_body_in_two_pieces_is_two_that_are_held_together() {
    // The twist of the first body is that of both.
    let mut shift = Mat6::identity();
    shift[(1, 5)] = APART;
    shift[(2, 4)] = -APART;
    let mut twists = DMatrix::zeros(12, 6);
    twists.view_mut((0, 0), (6, 6)).fill_with_identity();
    twists.view_mut((6, 0), (6, 6)).copy_from(&shift);
    let [pair, two] = both();
    for method in [Method::Panel, Method::MfsVertex, Method::MfsFace] {
        let apart = added_mass(&two, Fidelity::Full, method);
        let held = twists.transpose() * apart * &twists;
        for fidelity in [Fidelity::Full, Fidelity::Isolated, Fidelity::Auto] {
            let one = added_mass(&pair, fidelity, method);
            let error = (&one - &held).amax() / held.amax();
            println!("{method:?} {fidelity:?}: {error:.1e}");
            assert!(error < 1e-4, "{method:?} {fidelity:?}: {error:e}");
        }
    }
}

/// A mesh that crosses itself is refused by every method and fidelity, in the same words.
#[test]
fn what_crosses_itself_is_refused_by_all() {
    let sphere = mesh(&Shape::sphere(1.0), 320);
    // The half above turned inside out, through the half below.
    let turned = |x: &Vec3| match x.z > 0.0 {
        true => [x.x, x.y, -x.z * (0.9 + 0.7 * x.x)],
        false => (*x).into(),
    };
    let vertices: Vec<[f64; 3]> = sphere.vertices().iter().map(turned).collect();
    let shape = Shape::triangles(vertices, sphere.faces().to_vec());
    let scene = scene(&[Body::new(shape).density(1.0).named("dented")]);
    let mut said = Vec::new();
    for fidelity in [
        Fidelity::Full,
        Fidelity::Isolated,
        Fidelity::Reduced,
        Fidelity::Auto,
    ] {
        for method in [
            Method::Panel,
            Method::MfsVertex,
            Method::MfsFace,
            Method::Auto,
        ] {
            let settings = Settings::default().fidelity(fidelity).method(method);
            said.push(Simulator::new(&scene, settings).err().unwrap().to_string());
        }
    }
    println!("{}", said[0]);
    assert!(said.iter().all(|s| *s == said[0]));
    for part in [
        "body \"dented\"",
        "pass through each other",
        " with ",
        "hull",
    ] {
        assert!(said[0].contains(part), "{}", said[0]);
    }
}
