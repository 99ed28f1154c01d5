//! What every way to solve one body gives: added mass against exact values, in any unit and about any origin.

use crate::support::bodies::mapped;
use crate::support::reference::lamb;
use crate::support::{mesh, says};
use hydrograd::adjoint::lie::{Mat6, Vec3, skew};
use hydrograd::boundary::{BodyBoundary, MfsSettings, PanelBoundary, Response};
use hydrograd::scene::Shape;
use hydrograd::{Body, Error, Fidelity, Fluid, Scene, Settings, Simulator, TriMesh};

#[derive(Clone, Copy, Debug)]
enum Method {
    Mfs,
    Panel,
}
use Method::{Mfs, Panel};

/// What both tell of a body.
struct Solved {
    added_mass: Mat6,
    condition: f64,
    asymmetry: f64,
    warnings: Vec<String>,
}

fn solve(method: Method, mesh: &TriMesh) -> Solved {
    match method {
        Mfs => {
            let b = BodyBoundary::new("body", mesh, &MfsSettings::default()).unwrap();
            Solved {
                added_mass: b.added_mass,
                condition: b.condition,
                asymmetry: b.asymmetry,
                warnings: b.warnings.clone(),
            }
        }
        Panel => {
            let b = PanelBoundary::new("body", mesh).unwrap();
            Solved {
                added_mass: b.added_mass,
                condition: b.condition,
                asymmetry: b.asymmetry,
                warnings: b.warnings.clone(),
            }
        }
    }
}

#[test]
fn sphere_and_ellipsoids() {
    // Largest errors of translation and of rotation, %, and largest condition, at 1280 faces.
    for (method, semi_axes, translation, rotation, condition) in [
        (Mfs, [1.0, 1.0, 1.0], 0.35, 0.0, 1e4),
        (Mfs, [1.0, 0.5, 1.0], 1.0, 1.5, 1e4),
        (Mfs, [1.0, 0.25, 1.0], 1.0, 1.5, 1e4),
        (Mfs, [1.0, 0.2, 1.0], 1.0, 1.5, 1e4),
        (Mfs, [1.0, 0.15, 1.0], 1.0, 1.5, 1e4),
        (Mfs, [1.0, 0.1, 1.0], 1.0, 1.5, 1e4),
        (Mfs, [4.0, 2.0, 0.5], 1.0, 1.5, 1e4),
        (Mfs, [5.0, 1.0, 1.0], 1.0, 1.5, 1e4),
        (Mfs, [3.0, 2.0, 1.0], 1.0, 1.5, 1e4),
        (Panel, [1.0, 1.0, 1.0], 0.52, 0.0, 2.1),
        (Panel, [1.0, 0.5, 1.0], 0.6, 1.3, 2.2),
        (Panel, [1.0, 0.2, 1.0], 0.6, 1.2, 4.1),
        (Panel, [1.0, 1.0, 0.1], 0.7, 0.9, 7.4),
        (Panel, [1.0, 1.0, 0.03], 2.2, 1.0, 23.0),
        (Panel, [3.0, 2.0, 1.0], 0.6, 1.4, 2.5),
        (Panel, [5.0, 1.0, 1.0], 0.6, 1.4, 4.0),
    ] {
        let what = format!("{method:?} {semi_axes:?}");
        let b = solve(method, &mesh(&Shape::ellipsoid(semi_axes), 1280));
        let exact = lamb(semi_axes);
        let error = |i: usize| match exact[i] {
            0.0 => 0.0,
            e => 100.0 * (b.added_mass[(i, i)] / e - 1.0),
        };
        let errors: Vec<f64> = (0..6).map(error).collect();
        let worst = |range: &[f64]| range.iter().fold(0.0_f64, |w, e| w.max(e.abs()));
        if let (Panel, true) = (method, semi_axes == [1.0; 3]) {
            assert!((errors[0] + 0.51).abs() < 0.01, "{what}: {errors:?}");
        }
        assert!(worst(&errors[..3]) < translation, "{what}: {errors:?}");
        assert!(worst(&errors[3..]) <= rotation, "{what}: {errors:?}");
        assert!(b.condition < condition, "{what}: {:e}", b.condition);
        assert!(b.asymmetry < 1e-9, "{what}: {:e}", b.asymmetry);
        assert!(b.warnings.is_empty(), "{what}: {:?}", b.warnings);
    }
}

#[test]
fn millimetres_and_kilometres_agree() {
    let unit_mesh = mesh(&Shape::cuboid([1.0, 0.4, 0.7]), 300);
    for (method, tolerance) in [(Mfs, 1e-10), (Panel, 1e-12)] {
        let unit = solve(method, &unit_mesh);
        for scale in [1e-3, 1e3] {
            let b = solve(method, &mapped(&unit_mesh, |x| x * scale));
            for i in 0..6 {
                for j in 0..6 {
                    let power = 3 + i32::from(i > 2) + i32::from(j > 2);
                    let got = b.added_mass[(i, j)] / scale.powi(power);
                    let size = (unit.added_mass[(i, i)] * unit.added_mass[(j, j)]).sqrt();
                    assert!(
                        (got - unit.added_mass[(i, j)]).abs() < tolerance * size,
                        "{method:?} {scale} {i} {j}"
                    );
                }
            }
            assert_eq!(b.warnings.len(), unit.warnings.len());
        }
    }
}

/// M about an origin that lies at −shift from the old one: twists (u, ω) there are (u + ω × shift, ω)
/// here.
#[test]
fn another_origin_transforms_the_matrix() {
    let centred = mesh(&Shape::ellipsoid([0.3, 0.2, 0.1]), 320);
    for method in [Mfs, Panel] {
        let here = solve(method, &centred);
        for (shift, tolerance) in [
            (Vec3::new(0.4, -0.2, 0.1), 1e-9),
            (Vec3::new(300.0, 0.0, -900.0), 1e-6),
        ] {
            let there = solve(method, &mapped(&centred, |x| x + shift));
            let mut turn = Mat6::identity();
            turn.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(&shift));
            let expected = turn.transpose() * here.added_mass * turn;
            let error = (there.added_mass - expected).abs().max() / expected.abs().max();
            assert!(error < tolerance, "{method:?} {shift:?}: {error:e}");
        }
    }
}

/// Bodies that were never solved alone refuse to tell their flow.
#[test]
fn without_a_factor_there_is_no_flow() {
    let ball = mesh(&Shape::sphere(1.0), 80);
    let body = BodyBoundary::unfactored("large", &ball, &MfsSettings::default()).unwrap();
    let away = [Vec3::new(0.0, 0.0, 2.0)];
    let (radiated, scattered) = (body.radiated(&away), body.scattered(&away, &away));
    for (found, flow) in [(radiated, "radiated"), (scattered, "scattered")] {
        let error = found.err().unwrap();
        assert!(matches!(error, Error::Unsupported { .. }), "{error}");
        says(error, &[flow, "\"large\"", "80 faces"]);
    }
}

/// What no method can use is no mesh to begin with.
#[test]
fn bad_surfaces_are_errors() {
    let sphere = mesh(&Shape::sphere(1.0), 80);
    let (v, f) = (sphere.vertices().to_vec(), sphere.faces().to_vec());
    let new = |v: &[Vec3], f: &[[usize; 3]]| TriMesh::new("bad", v.to_vec(), f.to_vec());
    let refused = |v: &[Vec3], f: &[[usize; 3]]| {
        let error = new(v, f).unwrap_err();
        assert!(matches!(error, Error::Mesh { .. }), "{error}");
        assert!(error.to_string().contains("bad"), "{error}");
    };
    refused(&[], &[]);
    refused(&v, &f[1..]);
    refused(&vec![Vec3::zeros(); v.len()], &f);
    let inward: Vec<_> = f.iter().map(|t| [t[0], t[2], t[1]]).collect();
    refused(&v, &inward);
    let mut broken = v.clone();
    broken[3].x = f64::NAN;
    refused(&broken, &f);
    let mut one = f.clone();
    one[0].swap(0, 1);
    refused(&v, &one);
    let mut wild = f.clone();
    wild[0][1] = 999;
    refused(&v, &wild);
    // What no face uses is left out.
    let mut unused = v.clone();
    unused.push(Vec3::new(0.1, 0.0, 0.0));
    assert_eq!(new(&unused, &f).unwrap(), new(&v, &f).unwrap());
}

/// A box by formula, whose added mass is extrapolated from two meshes, beside a mesh of the same faces, which is the only one of its body: neither takes the other's, whichever comes first.
#[test]
fn equal_faces_do_not_make_equal_bodies() {
    let shape = Shape::cuboid([1.0, 0.4, 0.7]).faces(300);
    let faces = mesh(&shape, 300);
    let vertices: Vec<[f64; 3]> = faces.vertices().iter().map(|x| (*x).into()).collect();
    let triangles = Shape::triangles(vertices, faces.faces());
    let own = |shapes: &[&Shape]| -> Vec<Mat6> {
        let mut scene = Scene::new(Fluid::fresh_water());
        for (k, shape) in shapes.iter().enumerate() {
            let body = Body::new((*shape).clone()).density(1200.0);
            scene.add(body.at([0.0, 5.0 * k as f64, 0.0]));
        }
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let found = simulator.added_mass().unwrap();
        (0..shapes.len()).map(|k| found.own(k)).collect()
    };
    let [a, b] = [&shape, &triangles].map(|s| own(&[s])[0]);
    assert!((a - b).amax() > 1e-4 * a.amax());
    for (shapes, alone) in [
        ([&shape, &triangles], [a, b]),
        ([&triangles, &shape], [b, a]),
    ] {
        for (found, alone) in own(&shapes).iter().zip(&alone) {
            assert!((found - alone).amax() < 1e-12 * alone.amax());
        }
    }
}
