//! Primitives against closed forms, and the verdict on broken meshes.

use crate::support;
use hydrograd::adjoint::lie::{Pose, Vec3, exp_matrix};
use hydrograd::scene::Shape;
use hydrograd::shape::{
    Kind, MassProperties, Severity, TriMesh, build, check_parts, parse_shape, shape_name,
};
use std::collections::HashSet;
use std::f64::consts::PI;
use std::path::Path;

const SHAPES: [&str; 10] = [
    "sphere:0.7",
    "ellipsoid:1,0.8,0.3",
    "ellipsoid:0.04,0.04,0.01",
    "box:1,1,1",
    "box:1,0.5,0.1",
    "box:0.3,2,0.3",
    "cylinder:0.5,2",
    "cylinder:1,0.05",
    "cylinder:0.1,5",
    "capsule:0.3,1.2",
];

fn mesh(text: &str, faces: usize) -> TriMesh {
    support::mesh(&parse_shape(text).unwrap(), faces)
}

/// Volume and principal inertia (per unit density) of the exact shape.
fn exact(shape: &Shape) -> (f64, Vec3) {
    match *shape {
        Shape::Sphere { radius, .. } => exact(&Shape::Ellipsoid {
            semi_axes: [radius; 3],
            faces: None,
        }),
        Shape::Ellipsoid {
            semi_axes: [a, b, c],
            ..
        } => {
            let v = 4.0 / 3.0 * PI * a * b * c;
            let [a, b, c] = [a * a, b * b, c * c];
            (v, Vec3::new(b + c, a + c, a + b) * (v / 5.0))
        }
        Shape::Box {
            size: [a, b, c], ..
        } => {
            let v = a * b * c;
            let [a, b, c] = [a * a, b * b, c * c];
            (v, Vec3::new(b + c, a + c, a + b) * (v / 12.0))
        }
        Shape::Cylinder {
            radius: r,
            length: l,
            ..
        } => {
            let v = PI * r * r * l;
            let across = v * (3.0 * r * r + l * l) / 12.0;
            (v, Vec3::new(across, across, v * r * r / 2.0))
        }
        Shape::Capsule {
            radius: r,
            length: l,
            ..
        } => {
            let side = PI * r * r * l;
            let ends = 4.0 / 3.0 * PI * r * r * r;
            let across = side * (3.0 * r * r + l * l) / 12.0
                + ends * (0.4 * r * r + l * l / 4.0 + 3.0 / 8.0 * l * r);
            let along = side * r * r / 2.0 + ends * 0.4 * r * r;
            (side + ends, Vec3::new(across, across, along))
        }
        Shape::Prism { .. } | Shape::Mesh { .. } | Shape::Triangles { .. } => {
            unreachable!("not of this list")
        }
    }
}

/// Volume, area and inertia of finer and finer meshes tend to the formula's, with the square of the edge.
#[test]
fn meshes_tend_to_the_formula() {
    for text in SHAPES {
        let shape = parse_shape(text).unwrap();
        let formula = MassProperties::by_formula(&shape).unwrap().unwrap();
        let (volume, inertia) = exact(&shape);
        assert!((formula.volume / volume - 1.0).abs() < 1e-14, "{text}");
        let off = (formula.inertia.diagonal() - inertia).amax() / inertia.amax();
        assert!(off < 1e-14, "{text}: {off:e}");
        let errors = |faces: usize| {
            let m = mesh(text, faces).mass_properties();
            [
                m.volume / formula.volume - 1.0,
                m.area / formula.area - 1.0,
                (m.inertia - formula.inertia).amax() / formula.inertia.amax(),
                (m.centroid - formula.centroid).norm(),
            ]
            .map(f64::abs)
        };
        let (coarse, fine) = (errors(2000), errors(32_000));
        for (c, f) in coarse.iter().zip(&fine) {
            assert!(
                *f < 1e-12 || (*f < 0.2 * c && *f < 4e-3),
                "{text}: {c:e} {f:e}"
            );
        }
    }
    let file = Shape::Mesh {
        path: "some.stl".into(),
        scale: 1.0,
    };
    assert_eq!(MassProperties::by_formula(&file).unwrap(), None);
    let flat = Shape::Box {
        size: [1.0, 0.0, 1.0],
        faces: None,
    };
    let text = MassProperties::by_formula(&flat).unwrap_err().to_string();
    assert!(text.contains("size[1]: got 0"), "{text}");
}
#[test]
fn primitives_are_closed_and_outward_at_any_resolution() {
    for text in SHAPES {
        for target in [1, 4, 13, 20, 100, 321, 1280, 5000, 60_000] {
            let mesh = mesh(text, target);
            let report = mesh.check();
            assert!(report.is_ok(), "{report}");
            let nothing_odd = report.findings.iter().all(|f| f.kind == Kind::Aspect);
            assert!(nothing_odd, "{report}");
            // Euler's formula for a surface without handles.
            let (v, e, f) = (
                mesh.vertices().len(),
                mesh.edges().len(),
                mesh.faces().len(),
            );
            assert_eq!(v + f, e + 2, "{text} {target}");
            assert_eq!(2 * e, 3 * f, "{text} {target}");
        }
    }
}

#[test]
fn face_counts_are_near_the_target_and_faces_near_equilateral() {
    for text in SHAPES {
        for target in [300, 1280, 5000, 20_000] {
            let mesh = mesh(text, target);
            let ratio = mesh.faces().len() as f64 / target as f64;
            let aspect = mesh.check().worst_aspect;
            println!(
                "{text} {target}: {} ({ratio:.3}), worst aspect {aspect:.2}",
                mesh.faces().len()
            );
            // Cubes and icosahedra are refined in steps: 12 n² and 20 n² faces, n − 1 to n + 1;
            // cylinders by pairs of bands, discs by rings.
            let step = |unit: f64| 1.0 / (target as f64 / unit).sqrt();
            let allowed = match text.split_once(':').unwrap().0 {
                _ if text == "box:1,1,1" => 2.0 * step(12.0),
                _ if text == "cylinder:1,0.05" => step(12.0),
                "sphere" | "ellipsoid" => step(20.0),
                "box" => 0.05,
                _ => 2.0 / (target as f64).sqrt(),
            };
            let long = if ["cylinder:0.1,5", "cylinder:1,0.05"].contains(&text) {
                10.0
            } else {
                4.0
            };
            assert!(aspect < long, "{text} {target}: {aspect}");
            assert!((ratio - 1.0).abs() <= allowed, "{text} {target}: {ratio}");
        }
    }
    assert_eq!(mesh("sphere:1", 1280).faces().len(), 1280);
    let default = build(&parse_shape("sphere:1").unwrap(), Path::new("."), None).unwrap();
    assert_eq!(default.faces().len(), 1280);
}

#[test]
fn vertices_lie_on_the_exact_surface() {
    for n in [20, 180, 1280] {
        for v in mesh("ellipsoid:3,2,0.5", n).vertices() {
            let level = v.component_div(&Vec3::new(3.0, 2.0, 0.5)).norm();
            assert!((level - 1.0).abs() < 1e-15);
        }
    }
    for v in mesh("capsule:0.3,1.2", 1280).vertices() {
        let z = (v.z.abs() - 0.6).max(0.0);
        assert!((Vec3::new(v.x, v.y, z).norm() - 0.3).abs() < 1e-15);
    }
    for v in mesh("cylinder:0.5,2", 1280).vertices() {
        let (r, z) = (v.xy().norm(), v.z.abs());
        assert!((r - 0.5).abs() < 1e-15 || (r < 0.5 && z == 1.0));
    }
    for v in mesh("box:1,0.5,0.1", 1280).vertices() {
        let level = v.component_div(&Vec3::new(0.5, 0.25, 0.05)).amax();
        assert!((level - 1.0).abs() < 1e-15);
    }
}

#[test]
fn volume_and_inertia_converge_with_order_two() {
    for text in SHAPES {
        let shape = parse_shape(text).unwrap();
        let (volume, inertia) = exact(&shape);
        let error = |m: &MassProperties| {
            [
                (m.volume / volume - 1.0).abs(),
                (m.inertia.diagonal().component_div(&inertia) - Vec3::repeat(1.0)).amax(),
            ]
        };
        // The more slender, the later are cells even.
        let base = if text == "cylinder:0.1,5" {
            20_480
        } else {
            1280
        };
        let resolutions = [1, 2, 4, 8, 16, 32].map(|n| mesh(text, n * base));
        let errors = resolutions.each_ref().map(|m| error(&m.mass_properties()));
        for k in 0..2 {
            if text.starts_with("box") {
                // Plane sides: exact at any resolution.
                assert!(errors.iter().all(|e| e[k] < 1e-13), "{text}: {errors:?}");
                continue;
            }
            // Least squares over ln(error) against ln(h), h = faces^(−½): the numbers around and
            // along a body don't grow in step.
            let points: Vec<[f64; 2]> = (0..errors.len())
                .map(|i| {
                    [
                        -0.5 * (resolutions[i].faces().len() as f64).ln(),
                        errors[i][k].ln(),
                    ]
                })
                .collect();
            let mean = |j: usize| points.iter().map(|p| p[j]).sum::<f64>() / points.len() as f64;
            let (x, y) = (mean(0), mean(1));
            let order = points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum::<f64>()
                / points.iter().map(|p| (p[0] - x).powi(2)).sum::<f64>();
            println!(
                "{text}: {:?} to {:?}, order {order:.3}",
                errors[0], errors[5]
            );
            // Coarse round bodies have cells stretched along them, evened out later.
            let allowed = if text.starts_with('c') { 0.2 } else { 0.02 };
            assert!(
                (order - 2.0).abs() < allowed,
                "{text}: order {order}, {errors:?}"
            );
            // Inscribed, so too small, by a little.
            let default = error(&mesh(text, 1280).mass_properties());
            assert!(default[k] < 0.05, "{text}: {default:?}");
        }
    }
}

#[test]
fn primitives_are_their_own_mirror_images() {
    for text in SHAPES {
        for target in [1, 100, 330, 1280] {
            let mesh = mesh(text, target);
            let size = mesh.diameter();
            for axis in 0..3 {
                let image: Vec<usize> = mesh
                    .vertices()
                    .iter()
                    .map(|v| {
                        let mut w = *v;
                        w[axis] = -w[axis];
                        mesh.vertices()
                            .iter()
                            .position(|u| (u - w).norm() < 4e-16 * size)
                            .unwrap_or_else(|| panic!("{text} {target}: {v:?} along {axis}"))
                    })
                    .collect();
                let sorted = |mut f: [usize; 3]| {
                    f.sort_unstable();
                    f
                };
                let faces: HashSet<_> = mesh.faces().iter().map(|f| sorted(*f)).collect();
                for f in mesh.faces() {
                    let mirrored = sorted(f.map(|v| image[v]));
                    assert!(
                        faces.contains(&mirrored),
                        "{text} {target}: {f:?} along {axis}"
                    );
                }
            }
            let mass = mesh.mass_properties();
            assert!(mass.centroid.norm() < 1e-15 * size);
            let products =
                mass.inertia - nalgebra::Matrix3::from_diagonal(&mass.inertia.diagonal());
            assert!(products.amax() < 1e-15 * mass.inertia.trace());
        }
    }
    // A cube is also the same along x, y and z.
    let cube = mesh("box:1,1,1", 1000).mass_properties();
    let diagonal = cube.inertia.diagonal();
    assert!((diagonal - Vec3::repeat(diagonal.mean())).amax() < 1e-15);
}

/// A cube stays one where a length comes of a sum, and what has a square side keeps it.
#[test]
fn lengths_that_differ_by_rounding_are_the_same() {
    let a = 0.3 - 0.2;
    assert!(a != 0.1);
    for (rounded, right) in [
        ([a, 0.1, 0.1], [0.1; 3]),
        ([0.1, a, 0.02], [0.1, 0.1, 0.02]),
    ] {
        for faces in [80, 320, 1280] {
            let [rounded, right] =
                [rounded, right].map(|size| support::mesh(&Shape::cuboid(size), faces));
            assert_eq!(rounded.faces(), right.faces());
            for (x, y) in rounded.vertices().iter().zip(right.vertices()) {
                assert!((x - y).norm() < 1e-15);
            }
        }
    }
    // Sides that are nearly alike have the same cells: differences by sizes don't see another mesh.
    for (near, right) in [
        ([0.2, 0.16, 0.2000002], [0.2, 0.16, 0.2]),
        ([0.2, 0.2, 0.203], [0.2; 3]),
        ([0.197, 0.2, 0.203], [0.2; 3]),
    ] {
        for faces in [80, 320, 1280] {
            let [near, right] =
                [near, right].map(|size| support::mesh(&Shape::cuboid(size), faces));
            assert_eq!(near.faces(), right.faces());
        }
    }
}

#[test]
fn mass_properties_survive_distance_and_rotation() {
    let body = mesh("box:1,0.5,0.1", 300);
    let here = body.mass_properties();
    let turn = exp_matrix(&Vec3::new(0.4, -1.0, 0.7));
    let far = Vec3::new(3e5, -2e5, 1e5);
    let there = body.transformed(&Pose::new(turn, far)).mass_properties();
    // Coordinates of 4e5 hold 6e-11 of the metre: nothing more may be lost.
    assert!((there.volume / here.volume - 1.0).abs() < 1e-8);
    assert!((there.centroid - far).norm() < 1e-9);
    let expected = turn * here.inertia * turn.transpose();
    assert!((there.inertia - expected).amax() < 1e-8 * expected.trace());
    // Twice as large, about a point that isn't its centroid.
    let moved = body.transformed(&Pose::new(turn, Vec3::new(0.1, 0.2, -0.3)));
    let scaled = moved.scaled(2.0).unwrap().mass_properties();
    let original = moved.mass_properties();
    assert!((scaled.volume / original.volume - 8.0).abs() < 1e-13);
    assert!((scaled.area / original.area - 4.0).abs() < 1e-13);
    assert!((scaled.inertia - 32.0 * original.inertia).amax() < 1e-13 * scaled.inertia.trace());
}

#[test]
fn mass_properties_of_a_body_that_is_not_convex() {
    // An L: the unit square prism of 2 × 2 × 1 without a quarter, by hand.
    let outline = [[0., 0.], [2., 0.], [2., 1.], [1., 1.], [1., 2.], [0., 2.]];
    let mut vertices = Vec::new();
    for z in [0.0, 1.0] {
        vertices.extend(outline.map(|[x, y]| Vec3::new(x, y, z)));
    }
    let cap = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
    let mut faces: Vec<[usize; 3]> = Vec::new();
    faces.extend(cap.map(|[a, b, c]| [a, c, b]));
    faces.extend(cap.map(|f| f.map(|v| v + 6)));
    for i in 0..6 {
        let j = (i + 1) % 6;
        faces.extend([[i, j, j + 6], [i, j + 6, i + 6]]);
    }
    let mass = TriMesh::new("L", vertices, faces)
        .unwrap()
        .mass_properties();
    assert!((mass.volume - 3.0).abs() < 1e-14);
    assert!((mass.area - 14.0).abs() < 1e-14);
    // Three unit cubes at (½, ½), (3/2, ½), (½, 3/2).
    let c = Vec3::new(5.0 / 6.0, 5.0 / 6.0, 0.5);
    assert!((mass.centroid - c).norm() < 1e-14);
    let d2 = |x: f64, y: f64| (x - c.x).powi(2) + (y - c.y).powi(2);
    let izz = 3.0 / 6.0 + d2(0.5, 0.5) + d2(1.5, 0.5) + d2(0.5, 1.5);
    let ixy = -[(0.5, 0.5), (1.5, 0.5), (0.5, 1.5)]
        .iter()
        .map(|(x, y)| (x - c.x) * (y - c.y))
        .sum::<f64>();
    assert!((mass.inertia[(2, 2)] - izz).abs() < 1e-14);
    assert!((mass.inertia[(0, 1)] - ixy).abs() < 1e-14);
}

type Parts = (Vec<Vec3>, Vec<[usize; 3]>);

/// Broken meshes, made of an ellipsoid of 80 faces: name, parts, what must be found, count.
fn broken() -> Vec<(&'static str, Parts, Kind, usize)> {
    let good = mesh("ellipsoid:1,0.8,0.5", 80);
    let (v, f) = (good.vertices().to_vec(), good.faces().to_vec());
    let with = |change: &dyn Fn(&mut Parts)| {
        let mut parts = (v.clone(), f.clone());
        change(&mut parts);
        parts
    };
    let flip = |face: &mut [usize; 3]| face.swap(1, 2);
    vec![
        ("empty", (Vec::new(), Vec::new()), Kind::Empty, 1),
        ("no faces", (v.clone(), Vec::new()), Kind::Empty, 1),
        (
            "open",
            with(&|(_, f)| {
                f.remove(17);
            }),
            Kind::OpenEdge,
            3,
        ),
        (
            "inverted",
            with(&|(_, f)| f.iter_mut().for_each(flip)),
            Kind::Inward,
            1,
        ),
        (
            "one flipped",
            with(&|(_, f)| flip(&mut f[41])),
            Kind::Orientation,
            1,
        ),
        (
            "most flipped",
            with(&|(_, f)| f[..60].iter_mut().for_each(flip)),
            Kind::Orientation,
            20,
        ),
        (
            "zero area",
            // A flap of no area in an edge: still closed.
            with(&|(v, f)| {
                let [a, b, c] = f[5];
                v.push(v[a] * 0.5 + v[b] * 0.5);
                let m = v.len() - 1;
                f[5] = [m, b, c];
                f.push([a, m, c]);
                f.push([a, b, m]);
            }),
            Kind::ZeroArea,
            1,
        ),
        (
            "repeated corner",
            with(&|(_, f)| f.push([3, 3, 4])),
            Kind::ZeroArea,
            1,
        ),
        (
            "duplicate",
            with(&|(_, f)| {
                let [a, b, c] = f[7];
                f.push([b, c, a]);
            }),
            Kind::DuplicateFace,
            1,
        ),
        ("NaN", with(&|(v, _)| v[9].y = f64::NAN), Kind::NotFinite, 1),
        (
            "infinite",
            with(&|(v, _)| v[9].y = f64::INFINITY),
            Kind::NotFinite,
            1,
        ),
        (
            "out of range",
            with(&|(_, f)| f[12][1] = 1_000_000),
            Kind::IndexOutOfRange,
            1,
        ),
        (
            "a piece in another",
            with(&|(v, f)| {
                let n = v.len();
                v.extend(v.clone().iter().map(|p| p * 0.5));
                f.extend(f.clone().iter().map(|t| t.map(|i| i + n)));
            }),
            Kind::Nested,
            1,
        ),
        (
            "a cavity",
            with(&|(v, f)| {
                let n = v.len();
                v.extend(v.clone().iter().map(|p| p * 0.5));
                f.extend(f.clone().iter().map(|&[a, b, c]| [a + n, c + n, b + n]));
            }),
            Kind::Inward,
            1,
        ),
        (
            "a fin",
            with(&|(v, f)| {
                let [a, b, _] = f[0];
                v.push(v[a] * 2.0);
                f.push([a, b, v.len() - 1]);
            }),
            Kind::NonManifoldEdge,
            1,
        ),
        (
            "flat",
            (
                [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 0.]]
                    .map(Vec3::from)
                    .to_vec(),
                vec![[0, 1, 2], [1, 3, 2], [0, 3, 1], [0, 2, 3]],
            ),
            Kind::NoVolume,
            1,
        ),
    ]
}

#[test]
fn broken_meshes_are_refused_with_place_and_remedy() {
    for (name, (v, f), kind, count) in broken() {
        let report = check_parts(name, &v, &f);
        let finding = report
            .find(kind)
            .unwrap_or_else(|| panic!("{name}: {report}"));
        assert_eq!(finding.severity, Severity::Error, "{name}");
        assert_eq!(finding.count, count, "{report}");
        assert!(!report.is_ok() && report.volume.is_none(), "{name}");
        // The cause is named first, not a consequence of it.
        assert_eq!(report.findings[0].kind, kind, "{report}");
        assert_eq!(finding.face.is_some(), kind != Kind::Empty, "{report}");
        assert_eq!(
            finding.position.is_none(),
            matches!(kind, Kind::Empty | Kind::IndexOutOfRange)
        );
        assert!(finding.remedy.len() > 10);
        let error = TriMesh::new(name, v, f).unwrap_err().to_string();
        assert!(error.starts_with(&format!("mesh {name}: ")), "{error}");
        assert!(error.contains(&finding.problem), "{error}");
        assert!(error.contains(&finding.remedy), "{error}");
        if let Some(face) = finding.face {
            assert!(
                error.contains(&format!("face {face}, counted from 0")),
                "{error}"
            );
        }
        println!("{error}\n{report}\n");
    }
}

#[test]
fn the_place_is_the_right_one() {
    let at = |name: &str| {
        let (name, (v, f), kind, _) = broken().into_iter().find(|b| b.0 == name).unwrap();
        check_parts(name, &v, &f).find(kind).unwrap().clone()
    };
    let good = mesh("ellipsoid:1,0.8,0.5", 80);
    let flipped = at("one flipped");
    assert_eq!(flipped.face, Some(41));
    assert!((Vec3::from(flipped.position.unwrap()) - good.centroid(41)).norm() < 1e-15);
    assert_eq!(at("duplicate").face, Some(80));
    assert_eq!(at("zero area").face, Some(81));
    assert_eq!(at("out of range").face, Some(12));
    assert_eq!(at("a piece in another").face, Some(80));
    // The hole's first edge lies on the hole.
    let hole = Vec3::from(at("open").position.unwrap());
    let [a, b, c] = good.corners(17);
    let middles = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
    assert!(middles.iter().any(|m| (m - hole).norm() < 1e-15));
}

#[test]
fn a_one_sided_strip_is_told_from_a_flipped_face() {
    let n = 9;
    let mut vertices = Vec::new();
    for i in 0..n {
        let a = 2.0 * PI * i as f64 / n as f64;
        for s in [-0.3, 0.3] {
            let r = 1.0 + s * (a / 2.0).cos();
            vertices.push(Vec3::new(r * a.cos(), r * a.sin(), s * (a / 2.0).sin()));
        }
    }
    let mut faces = Vec::new();
    for i in 0..n {
        // After one turn the strip's edges have changed places.
        let [c, d] = if i + 1 < n {
            [2 * i + 2, 2 * i + 3]
        } else {
            [1, 0]
        };
        faces.extend([[2 * i, c, 2 * i + 1], [c, d, 2 * i + 1]]);
    }
    let report = check_parts("strip", &vertices, &faces);
    assert!(report.find(Kind::OneSided).is_some(), "{report}");
    assert!(report.find(Kind::Orientation).is_none(), "{report}");
}

#[test]
fn warnings_do_not_refuse() {
    let good = mesh("sphere:1", 80);
    let (mut v, f) = (good.vertices().to_vec(), good.faces().to_vec());
    v.push(v[3]);
    let report = check_parts("loose", &v, &f);
    for kind in [Kind::DuplicateVertex, Kind::UnreferencedVertex] {
        let finding = report.find(kind).unwrap();
        assert_eq!((finding.severity, finding.count), (Severity::Warning, 1));
    }
    assert!(report.is_ok());
    assert!(report.volume.unwrap() > 0.0);
    TriMesh::new("loose", v, f).unwrap();

    let needle = mesh("ellipsoid:1,0.01,0.01", 320).check();
    assert_eq!(
        needle.find(Kind::Aspect).unwrap().severity,
        Severity::Warning
    );
    assert!(needle.is_ok());
}

#[test]
fn verdicts_do_not_depend_on_the_unit_of_length() {
    for scale in [1e-6, 1e-3, 1.0, 1e3, 1e6] {
        for text in SHAPES {
            let mesh = mesh(text, 320);
            let scaled = mesh.scaled(scale).unwrap();
            let (one, other) = (mesh.check(), scaled.check());
            assert_eq!(one.findings.len(), other.findings.len(), "{other}");
            assert!(other.is_ok());
            let ratio = other.volume.unwrap() / one.volume.unwrap() / scale.powi(3);
            assert!((ratio - 1.0).abs() < 1e-12, "{text} {scale}");
        }
        for (name, (v, f), ..) in broken() {
            let scaled: Vec<Vec3> = v.iter().map(|p| p * scale).collect();
            let kinds = |v: &[Vec3]| {
                let report = check_parts(name, v, &f);
                let found = report.findings.iter();
                found.map(|x| (x.kind, x.count, x.face)).collect::<Vec<_>>()
            };
            assert_eq!(kinds(&v), kinds(&scaled), "{name} {scale}");
        }
    }
}

#[test]
fn reports_are_written_for_people_and_for_programs() {
    let (name, (v, f), ..) = broken().remove(2);
    let report = check_parts(name, &v, &f);
    let text = report.to_string();
    assert!(text.contains("error: 3 edges with one face only"), "{text}");
    assert!(text.contains("close the holes"), "{text}");
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["findings"][0]["kind"], "open-edge");
    assert_eq!(json["findings"][0]["severity"], "error");
    assert_eq!(json["volume"], serde_json::Value::Null);
    let good = mesh("sphere:1", 1280).check();
    assert!(good.to_string().contains("ok: closed"), "{good}");
    assert!(
        serde_json::to_value(&good).unwrap()["volume"]
            .as_f64()
            .unwrap()
            > 4.1
    );
}

#[test]
fn short_forms_come_back() {
    for text in SHAPES {
        let shape = parse_shape(text).unwrap();
        assert_eq!(parse_shape(&shape_name(&shape)).unwrap(), shape);
    }
    assert_eq!(
        parse_shape(" Box: 1, 2.5e-1 ,3").unwrap(),
        Shape::Box {
            size: [1.0, 0.25, 3.0],
            faces: None
        }
    );
}

#[test]
fn bad_parameters_name_field_value_and_remedy() {
    for (text, parts) in [
        ("sphere:-1", ["radius", "-1", "positive"]),
        ("sphere:0", ["radius", "0", "positive"]),
        ("sphere:nan", ["radius", "NaN", "finite"]),
        ("sphere:inf", ["radius", "inf", "finite"]),
        ("sphere:1e200", ["radius", "1e200", "metres"]),
        ("ellipsoid:1,0,2", ["semi_axes[1]", "0", "positive"]),
        ("box:1,2,-3", ["size[2]", "-3", "positive"]),
        ("cylinder:1,-2", ["length", "-2", "positive"]),
        ("capsule:1,0", ["length", "0", "sphere"]),
        ("capsule:-1,1", ["radius", "-1", "positive"]),
        ("sphere:", ["sphere:", "RADIUS", "1 number"]),
        ("sphere", ["sphere", "RADIUS", "1 number"]),
        ("box:1,2", ["box:1,2", "box:A,B,C", "3 number"]),
        ("box:1,2,x", ["box:1,2,x", "box:A,B,C", "3 number"]),
        ("spere:1", ["spere", "did you mean sphere", "capsule:"]),
        ("torus:1", ["torus", "known are", "capsule:"]),
        ("", ["\"\"", "known are", "capsule:"]),
    ] {
        let error = parse_shape(text).unwrap_err().to_string();
        for part in parts {
            assert!(error.contains(part), "{text:?}: {error:?} lacks {part:?}");
        }
    }
    let sphere = parse_shape("sphere:1").unwrap();
    for faces in [0, 100_000_000] {
        let error = build(&sphere, Path::new("."), Some(faces)).unwrap_err();
        assert!(error.to_string().contains("faces"), "{error}");
    }
    // So thin that faces have no area: an error, not a mesh.
    let sheet = parse_shape("ellipsoid:1,1,1e-14").unwrap();
    assert!(build(&sheet, Path::new("."), None).is_err());
}

#[test]
fn an_index_out_of_range_is_refused_before_it_is_used() {
    let error = TriMesh::new("few", vec![Vec3::zeros(); 2], vec![[0, 1, 2]]).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("face 0") && text.contains("[0, 1, 2]"),
        "{text}"
    );
}
