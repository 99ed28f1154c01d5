//! Prisms: their meshes against closed forms, and profiles that can't be.

use crate::support;
use hydrograd::adjoint::lie::Vec3;
use hydrograd::scene::Shape;
use hydrograd::shape::{Kind, TriMesh, build, parse_shape, shape_name};
use std::collections::HashSet;
use std::path::Path;

/// A gripper's finger, a cube, a plate, a triangle given clockwise, a hexagon, and profiles with an edge
/// far shorter than the others.
const PRISMS: [&str; 7] = [
    "prism:0.8,0,0.06,1.2,0,1.6,0,1.6,0.32,0,0.48",
    "prism:1,-0.5,-0.5,0.5,-0.5,0.5,0.5,-0.5,0.5",
    "prism:0.1,-0.5,-0.5,0.5,-0.5,0.5,0.5,-0.5,0.5",
    "prism:1,0,0,0,1,1,0",
    "prism:0.3,1,0,0.5,0.8,-0.5,0.8,-1,0,-0.5,-0.8,0.5,-0.8",
    "prism:2,0,0,1.6,0,1.6,0.06,0,0.5",
    "prism:0.8,0,0,0.06,0,0.3,1.5,0,1.6",
];

fn mesh(text: &str, faces: usize) -> TriMesh {
    support::mesh(&parse_shape(text).unwrap(), faces)
}

/// Volume, centroid and inertia about it (per unit density) of a prism, by Green's theorem.
fn exact_prism(shape: &Shape) -> (f64, Vec3, nalgebra::Matrix3<f64>) {
    let Shape::Prism {
        profile, length, ..
    } = shape
    else {
        unreachable!("a prism is expected");
    };
    let n = profile.len();
    // ∫ of 1, y, z, y², z², yz.
    let mut moments = [0.0; 6];
    for k in 0..n {
        let ([a, b], [c, d]) = (profile[k], profile[(k + 1) % n]);
        let w = a * d - c * b;
        let each = [
            1.0 / 2.0,
            (a + c) / 6.0,
            (b + d) / 6.0,
            (a * a + a * c + c * c) / 12.0,
            (b * b + b * d + d * d) / 12.0,
            (a * d + 2.0 * a * b + 2.0 * c * d + c * b) / 24.0,
        ];
        moments.iter_mut().zip(each).for_each(|(m, x)| *m += w * x);
    }
    let sign = moments[0].signum();
    let [area, y, z, yy, zz, yz] = moments.map(|m| m * sign);
    let (y, z) = (y / area, z / area);
    let (yy, zz, yz) = (yy - area * y * y, zz - area * z * z, yz - area * y * z);
    let xx = area * length * length / 12.0;
    #[rustfmt::skip]
    let inertia = nalgebra::Matrix3::new(
        yy + zz, 0.0,     0.0,
        0.0,     xx + zz, -yz,
        0.0,     -yz,     xx + yy,
    ) * *length;
    (area * length, Vec3::new(0.0, y, z), inertia)
}

#[test]
fn prisms_are_closed_and_symmetric_at_any_resolution() {
    for text in PRISMS {
        for target in [1, 4, 13, 20, 100, 321, 1280, 5000, 20_000] {
            let mesh = mesh(text, target);
            let report = mesh.check();
            assert!(report.is_ok(), "{report}");
            let nothing_odd = report.findings.iter().all(|f| f.kind == Kind::Aspect);
            assert!(nothing_odd, "{report}");
            // Euler's formula for a surface without handles.
            let (v, f) = (mesh.vertices().len(), mesh.faces().len());
            assert_eq!(2 * v, f + 4, "{text} {target}");
            // Its own mirror image in x, bit for bit.
            let bits = |v: &Vec3| [v.x + 0.0, v.y, v.z].map(f64::to_bits);
            let faces = |sign: f64| -> HashSet<[[u64; 3]; 3]> {
                let corners = |f: usize| {
                    mesh.corners(f)
                        .map(|v| bits(&Vec3::new(sign * v.x, v.y, v.z)))
                };
                let sorted = (0..f).map(|f| {
                    let mut c = corners(f);
                    c.sort_unstable();
                    c
                });
                sorted.collect()
            };
            assert!(faces(1.0) == faces(-1.0), "{text} {target}");
        }
    }
}

#[test]
fn prisms_have_even_faces_and_nearly_as_many_as_asked() {
    for text in PRISMS {
        let mut target = 100.0;
        let (mut worst, mut off) = (0.0_f64, 0.0_f64);
        let mut uneven = [1.0_f64, 1.0];
        while target < 10_000.0 {
            let mesh = mesh(text, target as usize);
            let (aspect, count) = (mesh.check().worst_aspect, mesh.faces().len() as f64);
            // A plate a tenth as thick has cells across it that few faces can't make even.
            let allowed = if target < 300.0 { 5.0 } else { 2.5 };
            assert!(aspect < allowed, "{text} {target}: {aspect}");
            let miss = (count / target - 1.0).abs();
            // Equal edges are divided alike, so that the numbers come in steps, wide ones with few faces.
            let step = if target < 700.0 {
                2.0 / f64::sqrt(target)
            } else {
                0.03
            };
            assert!(miss < step, "{text} {target}: {count}");
            // As even as a box, whose smallest and largest faces of 1000 are 0.5 and 1.8 of the mean.
            if target > 700.0 {
                let areas = (0..mesh.faces().len()).map(|f| mesh.area(f));
                let (least, most) =
                    areas.fold((f64::INFINITY, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
                let mean = mesh.mass_properties().area / count;
                uneven = [uneven[0].min(least / mean), uneven[1].max(most / mean)];
            }
            (worst, off) = (worst.max(aspect), off.max(miss));
            target *= 1.21;
        }
        println!(
            "{text}: aspect up to {worst:.2}, {:.1} % off the target, areas {uneven:.2?} of the mean",
            100.0 * off
        );
        assert!(uneven[0] > 0.25 && uneven[1] < 3.0, "{text}: {uneven:?}");
    }
}

#[test]
fn prisms_are_exact_and_the_order_of_their_corners_does_not_matter() {
    for text in PRISMS {
        let shape = parse_shape(text).unwrap();
        let (volume, centroid, inertia) = exact_prism(&shape);
        for faces in [1, 100, 1280, 10_000] {
            let body = mesh(text, faces);
            let mass = body.mass_properties();
            assert!((mass.volume / volume - 1.0).abs() < 1e-13, "{text} {faces}");
            assert!((mass.centroid - centroid).norm() < 1e-13, "{text} {faces}");
            let error = (mass.inertia - inertia).amax();
            assert!(error < 1e-13 * inertia.trace(), "{text} {faces}: {error}");
            let Shape::Prism {
                profile, length, ..
            } = &shape
            else {
                unreachable!();
            };
            let mut back = profile.clone();
            back.reverse();
            let reversed = build(&Shape::prism(back, *length), Path::new("."), Some(faces));
            assert_eq!(reversed.unwrap().mass_properties().volume.signum(), 1.0);
        }
    }
    // A profile's place doesn't matter, nor does the unit: bit for bit for powers of two.
    let finger = mesh(PRISMS[0], 900);
    for unit in [2f64.powi(-40), 2f64.powi(60)] {
        let Shape::Prism {
            profile, length, ..
        } = parse_shape(PRISMS[0]).unwrap()
        else {
            unreachable!();
        };
        let profile: Vec<_> = profile.iter().map(|p| p.map(|x| x * unit)).collect();
        let scaled = build(
            &Shape::prism(profile, length * unit),
            Path::new("."),
            Some(900),
        )
        .unwrap();
        assert_eq!(scaled.faces(), finger.faces());
        assert!(
            scaled
                .vertices()
                .iter()
                .zip(finger.vertices())
                .all(|(a, b)| *a == b * unit)
        );
    }
}

#[test]
fn vertices_lie_on_the_exact_surface() {
    for v in mesh(PRISMS[0], 1280).vertices() {
        // Depth inside each plane of the finger; on the surface the least is zero.
        let (x, y, z) = (v.x, v.y, v.z);
        let planes = [
            0.4 - x.abs(),
            y,
            1.6 - y,
            z,
            z - 0.06 + 0.05 * y,
            0.48 - 0.1 * y - z,
        ];
        let least = planes.into_iter().fold(f64::INFINITY, f64::min);
        assert!(least.abs() < 1e-15, "{v:?}: {least}");
    }
}

/// However extreme the lengths, there is a mesh of about the size asked, or an error.
#[test]
fn extreme_prisms_end() {
    for thin in [1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 1e-30] {
        let flat = [[0.0, 0.0], [1.0, 0.0], [1.0, thin], [0.0, thin]];
        let square = [[0.0, 0.0], [thin, 0.0], [thin, thin], [0.0, thin]];
        let triangle = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        for shape in [
            Shape::prism(flat, 1.0),
            Shape::prism(flat, thin),
            Shape::prism(square, 1.0),
            Shape::prism(triangle, thin),
            Shape::prism(triangle, 1.0 / thin),
        ] {
            for target in [1, 100, 1280, 10_000] {
                match build(&shape, Path::new("."), Some(target)) {
                    Ok(mesh) => {
                        let count = mesh.faces().len();
                        assert!(count <= 2 * target.max(20), "{shape:?} {target}: {count}");
                    }
                    Err(error) => assert!(thin < 1e-5, "{shape:?} {target}: {error}"),
                }
            }
        }
    }
}

#[test]
fn short_forms_come_back() {
    for text in PRISMS {
        let shape = parse_shape(text).unwrap();
        assert_eq!(parse_shape(&shape_name(&shape)).unwrap(), shape);
    }
}

#[test]
fn bad_profiles_name_the_corner() {
    for (text, parts) in [
        ("prism:1,0,0,1,0", ["prism:1,0,0,1,0", "Y1,Z1", "7 or more"]),
        ("prism:1,0,0,1,0,1,1,0", ["prism:", "LENGTH", "odd"]),
        ("prism:-1,0,0,1,0,0,1", ["length", "-1", "positive"]),
        ("prism:1,0,0,nan,0,0,1", ["profile[1]", "NaN", "finite"]),
        (
            "prism:1,0,0,1,0,1,0,0,1",
            ["profile[2]", "[1.0, 0.0]", "same as profile[1]"],
        ),
        (
            "prism:1,0,0,1,0,0,1,0,0",
            ["profile[0]", "[0.0, 0.0]", "same as profile[3]"],
        ),
        (
            "prism:1,0,0,1,0,2,0,1,1",
            ["profile[1]", "[1.0, 0.0]", "line between"],
        ),
        (
            "prism:1,0,0,2,0,1,0,0,1",
            ["profile[1]", "[2.0, 0.0]", "turns back"],
        ),
        (
            "prism:1,0,0,1,0,1,1,0.5,0.2,0,1",
            ["profile[3]", "[0.5, 0.2]", "inwards"],
        ),
        (
            "prism:1,0,0,0,1,0.5,0.2,1,1,1,0",
            ["profile[2]", "[0.5, 0.2]", "convex"],
        ),
        (
            "prism:1,0,0,1,1,1,0,0,1",
            ["profile[", "crosses itself", "convex"],
        ),
        (
            "prism:1,1,0,-0.81,0.59,0.31,-0.95,0.31,0.95,-0.81,-0.59",
            ["profile[2]", "more than once", "in their order"],
        ),
    ] {
        let error = parse_shape(text).unwrap_err().to_string();
        for part in parts {
            assert!(error.contains(part), "{text:?}: {error:?} lacks {part:?}");
        }
    }
}
