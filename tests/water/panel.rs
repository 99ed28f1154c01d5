//! One body by the panel method, against exact values.

use crate::support::bodies::{graded_box, mapped};
use crate::support::reference::lamb;
use crate::support::{directions, mesh};
use faer::Mat;
use hydrograd::adjoint::lie::{Mat6, Vec3};
use hydrograd::boundary::panel::{MOST_FACES, richardson};
use hydrograd::boundary::{PanelBoundary, Response};
use hydrograd::scene::Shape;
use hydrograd::{Error, TriMesh};

fn ellipsoid(semi_axes: [f64; 3], faces: usize) -> TriMesh {
    mesh(&Shape::ellipsoid(semi_axes), faces)
}

fn build(mesh: &TriMesh) -> PanelBoundary {
    PanelBoundary::new("body", mesh).unwrap()
}

/// Largest relative error of the diagonal, where the exact value isn't 0.
fn worst(m: &Mat6, exact: &[f64; 6]) -> f64 {
    (0..6)
        .filter(|i| exact[*i] > 0.0)
        .map(|i| (m[(i, i)] / exact[i] - 1.0).abs())
        .fold(0.0, f64::max)
}

fn relative(a: &Mat<f64>, b: &Mat<f64>) -> f64 {
    (a - b).norm_l2() / b.norm_l2()
}

#[test]
fn second_order_and_extrapolation() {
    let exact = lamb([1.0; 3]);
    let meshes = [320, 1280, 5120].map(|n| build(&ellipsoid([1.0; 3], n)));
    let errors = meshes.each_ref().map(|b| worst(&b.added_mass, &exact));
    for pair in errors.windows(2) {
        let fall = pair[0] / pair[1];
        assert!(fall > 3.8 && fall < 4.2, "{errors:?}");
    }
    for (i, left) in [(1, 1e-4), (2, 2e-5)] {
        let r = richardson(&meshes[i], &meshes[i - 1]).unwrap();
        assert_eq!(r.order, 2.0);
        assert!((r.ratio - 2.0).abs() < 0.02, "{}", r.ratio);
        // The fine mesh's error is told to a tenth, that of the extrapolated value from above.
        assert!((r.fine_error / errors[i] - 1.0).abs() < 0.1, "{r:?}");
        let error = worst(&r.added_mass, &exact);
        assert!(error < left && error < r.error, "{error:e} {r:?}");
    }
    // Meshes alike say nothing.
    let error = richardson(&meshes[1], &meshes[1]).unwrap_err();
    assert!(matches!(error, Error::Input { .. }), "{error}");
    assert!(error.to_string().contains("1280"), "{error}");
}

#[test]
fn extrapolation_of_thin_and_sharp_bodies() {
    for s in [[1.0, 0.2, 1.0], [1.0, 1.0, 0.1], [3.0, 2.0, 1.0]] {
        let (fine, coarse) = (build(&ellipsoid(s, 1280)), build(&ellipsoid(s, 320)));
        let r = richardson(&fine, &coarse).unwrap();
        let (exact, order) = (lamb(s), r.order);
        assert_eq!(order, 2.0, "{s:?}");
        let (before, after) = (
            worst(&fine.added_mass, &exact),
            worst(&r.added_mass, &exact),
        );
        assert!(before < 1.2 * r.fine_error, "{s:?} {before} {r:?}");
        assert!(
            after < r.error && after < 0.15 * before,
            "{s:?} {after} {r:?}"
        );
    }
    // Boxes: graded meshes of up to 6400 faces, extrapolated.
    for (size, exact, left) in [
        (
            [1.0; 3],
            [0.6384, 0.6384, 0.6384, 0.0393, 0.0393, 0.0393],
            0.012,
        ),
        (
            [1.0, 0.4, 0.7],
            [0.09596, 0.3460, 0.1497, 0.00616, 0.00828, 0.01549],
            0.012,
        ),
    ] {
        let shape = Shape::Box { size, faces: None };
        let of = |faces: usize| build(&mesh(&shape, faces));
        let (fine, coarse) = (of(1280), of(320));
        let r = richardson(&fine, &coarse).unwrap();
        assert_eq!(r.order, 4.0 / 3.0);
        let (before, after) = (
            worst(&fine.added_mass, &exact),
            worst(&r.added_mass, &exact),
        );
        assert!(before < r.fine_error && before < 0.05, "{before} {r:?}");
        assert!(after < r.error && after < left, "{after} {r:?}");
    }
}

#[test]
fn boxes_and_cylinders() {
    for (shape, faces) in [
        (
            Shape::Box {
                size: [1.0, 0.1, 0.6],
                faces: None,
            },
            600,
        ),
        (
            Shape::Cylinder {
                radius: 0.06,
                length: 1.8,
                faces: None,
            },
            600,
        ),
        (
            Shape::Capsule {
                radius: 0.3,
                length: 0.4,
                faces: None,
            },
            300,
        ),
        (
            Shape::Box {
                size: [1.0; 3],
                faces: None,
            },
            12,
        ),
    ] {
        // About another origin, so that nothing vanishes by symmetry.
        let away = Vec3::new(0.2, -0.3, 0.1);
        let b = build(&mapped(&mesh(&shape, faces), |x| x + away));
        assert!(b.added_mass.iter().all(|x| x.is_finite()));
        assert_eq!(b.added_mass, b.added_mass.transpose());
        let least = b.added_mass.symmetric_eigenvalues().min();
        assert!(least > -1e-3 * b.added_mass.diagonal().max(), "{least}");
        assert!(
            b.asymmetry.is_finite() && b.asymmetry < 0.02,
            "{}",
            b.asymmetry
        );
        assert!(b.condition < 20.0, "{}", b.condition);
    }
    // Sheared, without any symmetry.
    let sheared = |x: &Vec3| Vec3::new(x.x + 0.4 * x.y, x.y + 0.2 * x.z * x.x, x.z);
    let b = build(&mapped(&ellipsoid([0.5, 0.3, 0.2], 320), sheared));
    assert!(b.asymmetry > 1e-6 && b.asymmetry < 0.01, "{}", b.asymmetry);
}

#[test]
fn threads_do_not_change_a_bit() {
    let mesh = mesh(&Shape::cuboid([1.0, 0.4, 0.7]), 300);
    let points: Vec<Vec3> = directions(70).iter().map(|d| d * 1.3).collect();
    let answers = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let b = build(&mesh);
            let radiated = b.radiated(&points).unwrap();
            let scattered = b.scattered(&points, &points).unwrap();
            (b.added_mass, b.condition.to_bits(), radiated, scattered)
        })
    };
    let (one, two) = (answers(1), answers(2));
    assert!(one == two);
}

#[test]
fn a_moving_sphere_is_a_dipole() {
    let b = build(&ellipsoid([1.0; 3], 1280));
    for (distance, limit) in [(1.05, 0.02), (1.2, 0.009), (2.0, 0.008), (100.0, 0.008)] {
        let points: Vec<Vec3> = directions(40).iter().map(|d| d * distance).collect();
        let found = b.radiated(&points).unwrap();
        // φ = u·x / 2r³, and nothing from turning.
        let exact = Mat::from_fn(40, 6, |i, k| match k < 3 {
            true => 0.5 * points[i][k] / distance.powi(3),
            false => 0.0,
        });
        let error = relative(&found, &exact);
        assert!(error < limit, "{distance}: {error}");
    }
}

/// Potential that a rigid unit sphere at the origin adds to that of a unit source at y, seen at x.
fn sphere_series(x: &Vec3, y: &Vec3) -> f64 {
    let r = x.norm() * y.norm();
    let c = x.dot(y) / r;
    let (mut before, mut legendre) = (1.0, c);
    let (mut power, mut sum) = (1.0 / r, 0.0);
    for l in 1..400 {
        let l = f64::from(l);
        power /= r;
        sum += l / (l + 1.0) * power * legendre;
        (before, legendre) = (
            legendre,
            ((2.0 * l + 1.0) * c * legendre - l * before) / (l + 1.0),
        );
    }
    sum
}

#[test]
fn a_sphere_in_the_flow_of_a_source() {
    let b = build(&ellipsoid([1.0; 3], 1280));
    for (gap, limit, reciprocity) in [(0.2, 0.022, 6e-4), (0.5, 0.009, 1e-4), (1.0, 0.0075, 1e-5)] {
        let points: Vec<Vec3> = directions(50).iter().map(|d| d * (1.0 + gap)).collect();
        let found = b.scattered(&points, &points).unwrap();
        let exact = Mat::from_fn(50, 50, |i, j| sphere_series(&points[i], &points[j]));
        let error = relative(&found, &exact);
        assert!(error < limit, "{gap}: {error}");
        let asymmetry = relative(&found, &found.transpose().to_owned());
        assert!(asymmetry < reciprocity, "{gap}: {asymmetry:e}");
    }
    // Fewer points than sources, and none.
    let points: Vec<Vec3> = directions(5).iter().map(|d| d * 1.7).collect();
    let found = b.scattered(&points, &points[..2]).unwrap();
    assert_eq!((found.nrows(), found.ncols()), (2, 5));
    let none = b.scattered(&[], &points).unwrap();
    assert_eq!((none.nrows(), none.ncols()), (5, 0));
    assert_eq!(b.radiated(&[]).unwrap().nrows(), 0);
}

#[test]
fn what_is_too_large_is_an_error() {
    let many = ellipsoid([1.0; 3], MOST_FACES + 400);
    let faces = many.faces().len();
    assert!(faces > MOST_FACES);
    let error = PanelBoundary::new("large", &many).unwrap_err();
    assert!(matches!(error, Error::Unsupported { .. }), "{error}");
    let text = error.to_string();
    assert!(
        text.contains("large") && text.contains(&faces.to_string()) && text.contains("GB"),
        "{text}"
    );
}

#[test]
fn edges_want_small_faces() {
    let exact = [0.6384, 0.6384, 0.6384, 0.0393, 0.0393, 0.0393];
    let cube = Shape::Box {
        size: [1.0; 3],
        faces: None,
    };
    let even = build(&mesh(&cube, 768));
    let fine = PanelBoundary::new("box", &graded_box([1.0; 3], [8; 3])).unwrap();
    let (even, fine) = (
        worst(&even.added_mass, &exact),
        worst(&fine.added_mass, &exact),
    );
    assert!(fine < 0.02 && fine < 0.4 * even, "{fine} {even}");
}
