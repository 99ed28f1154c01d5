//! Meshes as CAD programs write them, with few long faces where a surface is flat or ruled.

use crate::support::bodies::sided_cylinder;
use hydrograd::adjoint::lie::Mat6;
use hydrograd::scene::{Body, Fluid, Scene};
use hydrograd::shape::{TriMesh, build};
use hydrograd::{Fidelity, Settings, Shape, Simulator};

/// A box of twelve triangles.
fn cuboid(size: [f64; 3]) -> Shape {
    let corner = |k: usize| [4, 2, 1].map(|bit| if k & bit == 0 { -0.5 } else { 0.5 });
    let vertices = (0..8).map(|k| {
        let unit = corner(k);
        [0, 1, 2].map(|i| unit[i] * size[i])
    });
    let sides = [
        [0, 1, 3, 2],
        [4, 6, 7, 5],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 5, 7, 3],
    ];
    let halves = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]];
    let vertices: Vec<[f64; 3]> = vertices.collect();
    Shape::triangles(vertices, sides.map(halves).concat())
}

fn as_triangles(shape: &Shape, faces: usize) -> (Shape, TriMesh) {
    let mesh = build(shape, "".as_ref(), Some(faces)).unwrap();
    let vertices: Vec<[f64; 3]> = mesh.vertices().iter().map(|x| (*x).into()).collect();
    (Shape::triangles(vertices, mesh.faces().to_vec()), mesh)
}

fn simulator(shape: &Shape, settings: Settings) -> Simulator {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add(Body::new(shape.clone()).named("part").density(1200.0));
    Simulator::new(&scene, settings).unwrap()
}

fn isolated() -> Settings {
    Settings::default().fidelity(Fidelity::Isolated)
}

fn own(shape: &Shape) -> Mat6 {
    simulator(shape, isolated()).added_mass().unwrap().own(0)
}

/// The largest part by which an entry of the diagonal is off, of those that the water is moved by; what two directions have together, of √(M_ii M_jj).
fn off(shape: &Shape, formula: &Shape, entries: &[usize]) -> f64 {
    let (found, right) = (own(shape), own(formula));
    let mut worst = 0.0_f64;
    for &i in entries {
        for &j in entries {
            let scale = (right[(i, i)] * right[(j, j)]).sqrt();
            worst = worst.max((found[(i, j)] - right[(i, j)]).abs() / scale);
        }
    }
    println!("{}: {worst:.4}", formula.kind());
    worst
}

#[test]
fn few_long_faces_have_the_added_mass_of_the_formula() {
    let all = [0, 1, 2, 3, 4, 5];
    let (radius, length) = (0.1, 0.6);
    let tube = Shape::cylinder(radius, length);
    // Panels on meshes of even faces, as many, are off by as much: these have no second mesh to extrapolate from.
    for sides in [12, 24, 48] {
        let error = off(&sided_cylinder(sides, radius, length), &tube, &all[..5]);
        assert!(error < 0.06, "{sides} sides: {error}");
    }
    let size = [0.5, 0.3, 0.2];
    let error = off(&cuboid(size), &Shape::cuboid(size), &all);
    assert!(error < 0.08, "box: {error}");
    let size = [0.2, 0.2, 0.001];
    let error = off(&cuboid(size), &Shape::cuboid(size), &[2, 3, 4]);
    assert!(error < 0.13, "plate: {error}");
}

/// The body stays what it was: mass, volume, and where it touches.
#[test]
fn dividing_faces_moves_no_surface() {
    let shape = sided_cylinder(24, 0.1, 0.6);
    let given = build(&shape, "".as_ref(), None).unwrap();
    let simulator = simulator(&shape, isolated());
    let seen = simulator.meshes().unwrap().remove(0).unwrap();
    assert!((1000..4000).contains(&seen.faces().len()));
    assert_eq!(&seen.vertices()[..given.vertices().len()], given.vertices());
    assert!(seen.check().is_ok());
    let own = given.mass_properties();
    let volume = seen.mass_properties().volume;
    assert!((volume / own.volume - 1.0).abs() < 1e-12);
    assert_eq!(simulator.parameters().mass(0), 1200.0 * own.volume);
    // A mesh at another scale is divided the same way.
    let Shape::Triangles { vertices, faces } = &shape else {
        panic!()
    };
    let larger = vertices.iter().map(|x| x.map(|x| 1.1 * x));
    let larger = Shape::triangles(larger.collect::<Vec<_>>(), faces.clone());
    let again = self::simulator(&larger, isolated())
        .meshes()
        .unwrap()
        .remove(0)
        .unwrap();
    assert_eq!(again.faces(), seen.faces());
}

#[test]
fn meshes_that_are_fine_enough_stay_as_they_are() {
    let shapes = [
        (Shape::sphere(0.1), 1280),
        (Shape::sphere(0.1), 320),
        (Shape::cylinder(0.1, 0.6), 1280),
        (Shape::cuboid([0.5, 0.3, 0.2]), 640),
    ];
    for (formula, faces) in shapes {
        let (shape, mesh) = as_triangles(&formula, faces);
        let simulator = simulator(&shape, isolated());
        let seen = simulator.meshes().unwrap().remove(0).unwrap();
        assert_eq!(
            (seen.vertices(), seen.faces()),
            (mesh.vertices(), mesh.faces())
        );
        assert!(
            simulator.warnings().is_empty(),
            "{:?}",
            simulator.warnings()
        );
    }
    // As few faces as asked for are fine enough too.
    let shape = cuboid([0.5, 0.3, 0.2]);
    let few = simulator(&shape, isolated().faces(12));
    assert_eq!(few.faces(), 12);
}

/// Vertices that are parameters are those of the mesh that was given: its faces stay, and a warning tells of them.
#[test]
fn long_faces_that_stay_are_told() {
    let shape = cuboid([0.5, 0.3, 0.2]);
    let vertices = isolated().shape_parameters(vec!["part.vertex".into()]);
    let kept = simulator(&shape, vertices);
    assert_eq!(kept.faces(), 12);
    let said = kept.warnings().join("\n");
    for word in ["body \"part\"", "5.831e-1 m", "1280 even faces", "shorter"] {
        assert!(said.contains(word), "{word}: {said}");
    }
    let divided = simulator(&shape, isolated());
    assert!(divided.warnings().is_empty(), "{:?}", divided.warnings());
}

#[test]
fn volume_that_faces_lose_is_told() {
    let full = |faces| {
        let settings = Settings::default().fidelity(Fidelity::Full);
        simulator(&Shape::sphere(0.1).faces(faces), settings)
    };
    let said = full(20).warnings().join("\n");
    for word in [
        "body \"part\"",
        "20 faces",
        "39 % less volume",
        "more faces",
    ] {
        assert!(said.contains(word), "{word}: {said}");
    }
    let said = full(320).warnings().join("\n");
    assert!(!said.contains("less volume"), "{said}");
}
