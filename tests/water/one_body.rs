//! One body by fundamental solutions: depth of the sources, convergence, settings, and the factor of its equations.

use crate::support::mesh;
use crate::support::reference::lamb;
use hydrograd::adjoint::lie::{Mat6, Vec3};
use hydrograd::boundary::{BodyBoundary, Depth, Method, MfsSettings, Readout, RowScaling};
use hydrograd::scene::Shape;
use hydrograd::{Error, TriMesh};

fn ellipsoid(semi_axes: [f64; 3], faces: usize) -> TriMesh {
    mesh(&Shape::ellipsoid(semi_axes), faces)
}

fn build(mesh: &TriMesh, settings: &MfsSettings) -> BodyBoundary {
    BodyBoundary::new("body", mesh, settings).unwrap()
}

/// Errors in percent; 0 where the exact value is 0.
fn errors(m: &Mat6, exact: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|i| match exact[i] {
        0.0 => 0.0,
        e => 100.0 * (m[(i, i)] / e - 1.0),
    })
}

fn worst(errors: &[f64]) -> f64 {
    errors.iter().fold(0.0, |w, e| w.max(e.abs()))
}

#[test]
fn errors_fall_with_the_square_of_the_edge() {
    let semi_axes = [1.0, 0.25, 1.0];
    let error = |faces| {
        let b = build(&ellipsoid(semi_axes, faces), &MfsSettings::default());
        worst(&errors(&b.added_mass, &lamb(semi_axes)))
    };
    assert!(error(1280) < 0.4 * error(320));
}

#[test]
fn published_equations_at_fixed_depths() {
    let sphere = ellipsoid([1.0; 3], 1280);
    let exact = lamb([1.0; 3]);
    let face = [(0.02, -69.4), (0.05, -16.0), (0.1, -1.74), (0.2, -0.88)];
    let vertex = [(0.02, -3.02), (0.05, -1.12), (0.1, -0.37), (0.2, -0.29)];
    for (method, figures) in [(Method::MfsFace, face), (Method::MfsVertex, vertex)] {
        for (depth, percent) in figures {
            let b = build(&sphere, &MfsSettings::plain(method, Depth::Fixed(depth)));
            let e = errors(&b.added_mass, &exact)[0];
            assert!(
                (e - percent).abs() < 0.02 + 0.005 * percent.abs(),
                "{method:?} {depth}: {e}"
            );
        }
    }
}

#[test]
fn a_fixed_depth_is_checked() {
    let coin = ellipsoid([1.0, 0.2, 1.0], 320);
    let at = |d| {
        let settings = MfsSettings {
            depth: Depth::Fixed(d),
            ..Default::default()
        };
        BodyBoundary::new("coin", &coin, &settings)
    };
    let shallow = at(1e-3).unwrap().warnings.join("\n");
    assert!(
        shallow.contains("\"coin\"") && shallow.contains("1.000e-3 m"),
        "{shallow}"
    );
    assert!(shallow.contains("too small"), "{shallow}");
    let deep = at(0.18).unwrap().warnings.join("\n");
    assert!(
        deep.contains("\"coin\"") && deep.contains("thickness 2.174e-1 m"),
        "{deep}"
    );
    // Past the other side.
    assert!(matches!(at(0.5), Err(Error::Unresolved { .. })));
    for d in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(at(d), Err(Error::Input { .. })), "{d}");
    }
}

#[test]
fn sharp_edges_converge() {
    // By extrapolation of a panel method: cube 0.638; plate 0.520 across.
    let cube = Shape::cuboid([1.0; 3]);
    let b = build(&mesh(&cube, 1280), &MfsSettings::default());
    assert!(
        (b.added_mass[(0, 0)] / 0.638 - 1.0).abs() < 0.02,
        "{}",
        b.added_mass
    );
    let plate = Shape::Box {
        size: [1.0, 0.1, 1.0],
        faces: None,
    };
    let b = build(&mesh(&plate, 1280), &MfsSettings::default());
    assert!(
        (b.added_mass[(1, 1)] / 0.520 - 1.0).abs() < 0.04,
        "{}",
        b.added_mass
    );
    let column = Shape::Cylinder {
        radius: 0.06,
        length: 1.8,
        faces: None,
    };
    let b = build(&mesh(&column, 1280), &MfsSettings::default());
    assert!(
        (b.added_mass[(0, 0)] / 0.0194 - 1.0).abs() < 0.02,
        "{}",
        b.added_mass
    );
}

#[test]
fn coarsest_meshes_give_positive_matrices_or_an_error() {
    let tetrahedron = TriMesh::new(
        "tetrahedron",
        vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()],
        vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    )
    .unwrap();
    let cube = Shape::cuboid([1.0; 3]);
    for mesh in [
        tetrahedron,
        mesh(&cube, 12),
        ellipsoid([1.0; 3], 20),
        mesh(&cube, 48),
    ] {
        for method in [Method::MfsVertex, Method::MfsFace] {
            for rows in [RowScaling::Scaled, RowScaling::Unscaled] {
                for readout in [Readout::Corrected, Readout::Centre] {
                    for damping in [0.0, 3e-3] {
                        let settings = MfsSettings {
                            method,
                            rows,
                            readout,
                            damping,
                            depth: Depth::Auto,
                        };
                        match BodyBoundary::new("body", &mesh, &settings) {
                            Ok(b) => {
                                assert!(b.added_mass.iter().all(|x| x.is_finite()));
                                assert!((0..3).all(|i| b.added_mass[(i, i)] > 0.0));
                            }
                            // A dozen faces may be too few for undamped or for face sources.
                            Err(Error::Unresolved { .. }) => {
                                assert!(method == Method::MfsFace || damping == 0.0);
                            }
                            Err(e) => panic!("{settings:?}: {e}"),
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn the_factor_is_that_of_the_damped_equations() {
    let b = build(&ellipsoid([1.0, 0.5, 0.7], 80), &MfsSettings::default());
    let (k, r) = (b.flux_matrix(), b.factor());
    let (normal, square) = (k.transpose() * k, r.transpose() * r);
    let size = normal.norm_max();
    for i in 0..b.sources.len() {
        for j in 0..b.sources.len() {
            let d = if i == j { b.damping[i].powi(2) } else { 0.0 };
            assert!((normal[(i, j)] + d - square[(i, j)]).abs() < 1e-12 * size);
        }
    }
    // (KᵀK + D²) α = KᵀF̄, by two solves with R.
    let f = faer::Mat::from_fn(b.faces.len(), 6, |i, j| b.twist_rows[i][j]);
    let mut x = k.transpose() * f;
    b.solve_factor_transpose(x.as_mut());
    b.solve_factor(x.as_mut());
    for (j, a) in b.strengths.iter().enumerate() {
        assert!((0..6).all(|c| (x[(j, c)] - a[c]).abs() < 1e-8));
    }
}

#[test]
fn settings_that_cannot_be_are_errors() {
    let sphere = ellipsoid([1.0; 3], 80);
    let settings = MfsSettings {
        damping: f64::NAN,
        ..Default::default()
    };
    assert!(BodyBoundary::new("bad", &sphere, &settings).is_err());
    // Sources outside, past the other side.
    let settings = MfsSettings {
        depth: Depth::Fixed(3.0),
        ..Default::default()
    };
    let error = BodyBoundary::new("bad", &sphere, &settings);
    assert!(matches!(error, Err(Error::Unresolved { .. })));
}

#[test]
fn settings_read_from_toml() {
    let text = "method = \"mfs-face\"\ndepth = { fixed = 0.02 }\nrows = \"unscaled\"";
    let s: MfsSettings = toml::from_str(text).unwrap();
    assert_eq!(s.method, Method::MfsFace);
    assert_eq!(s.depth, Depth::Fixed(0.02));
    assert_eq!(s.rows, RowScaling::Unscaled);
    assert_eq!(s.damping, MfsSettings::default().damping);
}
