//! Meshes refined where bodies come near others.

use crate::support::{self, says};
use hydrograd::adjoint::lie::Vec3;
use hydrograd::scene::{Body, Fluid, Refinement, Scene, Shape};
use hydrograd::shape::{self, Kind, MAX_ADDED_FACES, MassProperties, TriMesh, build, parse_shape};
use hydrograd::{Fidelity, Settings, Simulator};
use std::path::Path;

/// A shape, a point of its surface, and a base mesh.
const CASES: [(&str, [f64; 3], usize); 12] = [
    ("sphere:1", [0.0, 0.0, 1.0], 320),
    ("sphere:1", [0.6, 0.0, 0.8], 20),
    ("ellipsoid:0.2,0.05,0.2", [0.2, 0.0, 0.0], 980),
    ("ellipsoid:1,0.02,1", [0.0, 0.02, 0.0], 320),
    ("box:1,0.5,0.3", [0.5, 0.25, 0.15], 300),
    ("box:1,1,1", [0.1, 0.13, 0.5], 12),
    (
        "prism:0.8,0,0.06,1.2,0,1.6,0,1.6,0.32,0,0.48",
        [0.2, 1.6, 0.0],
        400,
    ),
    ("cylinder:0.5,2", [0.5, 0.0, 0.3], 300),
    ("cylinder:0.5,2", [0.5, 0.0, 1.0], 300),
    ("cylinder:1,0.05", [1.0, 0.0, 0.0], 100),
    ("capsule:0.3,1.2", [0.3, 0.0, 0.6], 200),
    ("capsule:0.3,1.2", [0.0, 0.0, 0.9], 24),
];

fn mesh(text: &str, faces: usize) -> (Shape, TriMesh) {
    let shape = parse_shape(text).unwrap();
    let mesh = support::mesh(&shape, faces);
    (shape, mesh)
}

fn ball(center: [f64; 3], radius: f64, edge: f64) -> Refinement {
    Refinement {
        center,
        radius,
        edge,
    }
}

fn refined(shape: &Shape, mesh: &TriMesh, regions: &[Refinement]) -> TriMesh {
    shape::refine(mesh, shape, regions, "body \"test\"").unwrap()
}

/// A region of a case: edges an eighth of the mean one, out to twice the mean one.
fn region(mesh: &TriMesh, center: [f64; 3]) -> Refinement {
    let area = mesh.mass_properties().area;
    let mean = (4.0 / 3f64.sqrt() * area / mesh.faces().len() as f64).sqrt();
    ball(center, 2.0 * mean, mean / 8.0)
}

fn smallest_angle(mesh: &TriMesh) -> f64 {
    let angles = (0..mesh.faces().len()).flat_map(|f| {
        let c = mesh.corners(f);
        [0, 1, 2].map(|k| (c[(k + 1) % 3] - c[k]).angle(&(c[(k + 2) % 3] - c[k])))
    });
    angles.fold(f64::INFINITY, f64::min)
}

/// Distance from a point to the segment from `a` to `b`.
fn to_segment(p: &Vec3, a: &Vec3, b: &Vec3) -> f64 {
    let d = b - a;
    let along = ((p - a).dot(&d) / d.norm_squared()).clamp(0.0, 1.0);
    (p - a - d * along).norm()
}

#[test]
fn refined_meshes_are_closed_and_short_edged_where_asked() {
    for (text, center, faces) in CASES {
        let (shape, base) = mesh(text, faces);
        let region = region(&base, center);
        let fine = refined(&shape, &base, &[region]);
        let report = fine.check();
        assert!(report.is_ok(), "{text}: {report}");
        let nothing_odd = report.findings.iter().all(|f| f.kind == Kind::Aspect);
        assert!(nothing_odd, "{text}: {report}");
        let (v, f) = (fine.vertices().len(), fine.faces().len());
        assert_eq!(2 * v, f + 4, "{text}: Euler's formula");
        assert!(f > base.faces().len() + 20, "{text}: {f}");
        assert_eq!(fine.vertices()[..base.vertices().len()], *base.vertices());
        let center = Vec3::from(center);
        for edge in fine.edges() {
            let [a, b] = edge.vertices.map(|v| fine.vertices()[v]);
            if to_segment(&center, &a, &b) <= region.radius {
                let length = (b - a).norm();
                assert!(length <= region.edge, "{text}: {length} > {}", region.edge);
            }
        }
        let (angle, before) = (smallest_angle(&fine), smallest_angle(&base));
        println!(
            "{text:50} {:6} -> {f:6} faces, angle {:5.1} -> {:5.1}",
            base.faces().len(),
            before.to_degrees(),
            angle.to_degrees()
        );
        // New vertices of a curved part aren't in the plane of the bound.
        let flat = matches!(shape, Shape::Box { .. } | Shape::Prism { .. });
        let part = if flat { 0.5 - 1e-9 } else { 0.49 };
        assert!(angle > part * before, "{text}: {angle} of {before}");
    }
}

#[test]
fn flat_bodies_keep_their_volume_and_curved_ones_gain_what_they_lacked() {
    for (text, center, faces) in CASES {
        let (shape, base) = mesh(text, faces);
        let fine = refined(&shape, &base, &[region(&base, center)]);
        let exact = MassProperties::by_formula(&shape).unwrap().unwrap();
        let (before, after) = (base.mass_properties(), fine.mass_properties());
        let off = |p: &MassProperties| exact.volume - p.volume;
        if matches!(shape, Shape::Box { .. } | Shape::Prism { .. }) {
            assert!(
                off(&after).abs() < 1e-12 * exact.volume,
                "{text}: {:e} {:e}",
                off(&before),
                off(&after)
            );
            assert!((after.area / exact.area - 1.0).abs() < 1e-12, "{text}");
            let size = base.diameter();
            assert!(
                (after.centroid - exact.centroid).norm() < 1e-12 * size,
                "{text}"
            );
        } else {
            assert!(off(&after) > 0.0 && off(&after) < off(&before), "{text}");
            assert!(
                after.area > before.area && after.area < exact.area,
                "{text}"
            );
        }
    }
    // All of a sphere: the finer, the nearer.
    let (shape, base) = mesh("sphere:1", 80);
    let exact = 4.0 / 3.0 * std::f64::consts::PI;
    let volume = |edge| {
        let fine = refined(&shape, &base, &[ball([0.0; 3], 1.0, edge)]);
        fine.mass_properties().volume
    };
    let (coarse, middle, fine) = (volume(10.0), volume(0.2), volume(0.05));
    assert_eq!(coarse, base.mass_properties().volume);
    assert!(exact - middle < 0.1 * (exact - coarse));
    assert!(exact - fine < 0.1 * (exact - middle) && fine < exact);
}

#[test]
fn new_vertices_lie_on_the_shape() {
    for (text, center, faces) in CASES {
        let (shape, base) = mesh(text, faces);
        let fine = refined(&shape, &base, &[region(&base, center)]);
        for x in &fine.vertices()[base.vertices().len()..] {
            let round = x.xy().norm();
            let off = match shape {
                Shape::Sphere { radius, .. } => x.norm() / radius - 1.0,
                Shape::Ellipsoid { semi_axes, .. } => {
                    x.component_div(&Vec3::from(semi_axes)).norm() - 1.0
                }
                Shape::Cylinder { radius, length, .. } => {
                    let (side, end) = (round / radius - 1.0, 2.0 * x.z.abs() / length - 1.0);
                    side.max(end)
                }
                Shape::Capsule { radius, length, .. } => {
                    let beyond = (x.z.abs() - 0.5 * length).max(0.0);
                    round.hypot(beyond) / radius - 1.0
                }
                _ => 0.0,
            };
            assert!(off.abs() < 1e-12, "{text}: {x:?} off by {off}");
        }
    }
}

#[test]
fn faces_grow_from_ring_to_ring() {
    // On flat ground of even faces, neighbours differ by two bisections of an edge at most.
    let (shape, base) = mesh("box:1,1,1", 12);
    let fine = refined(&shape, &base, &[ball([0.1, 0.2, 0.5], 0.02, 0.01)]);
    let longest = |f: usize| {
        let c = fine.corners(f);
        let edges = [0, 1, 2].map(|k| (c[(k + 1) % 3] - c[k]).norm());
        edges.into_iter().fold(0.0_f64, f64::max)
    };
    for edge in fine.edges() {
        let [a, b] = edge.faces.map(longest);
        let ratio = (a / b).max(b / a);
        assert!(ratio < 2.01, "{ratio}");
    }
    assert!(fine.faces().len() < 600, "{}", fine.faces().len());
}

#[test]
fn the_same_mesh_comes_out_twice_and_regions_add_up() {
    for (text, center, faces) in CASES {
        let (shape, base) = mesh(text, faces);
        let one = region(&base, center);
        let other = ball(one.center, 2.0 * one.radius, 2.0 * one.edge);
        let both = [one, other];
        assert_eq!(refined(&shape, &base, &both), refined(&shape, &base, &both));
        let count = |regions: &[Refinement]| refined(&shape, &base, regions).faces().len();
        assert!(count(&both) >= count(&both[..1]), "{text}");
        assert_eq!(refined(&shape, &base, &[]), base);
    }
    // A ball that only the sphere itself reaches, not its coarse mesh.
    let (shape, base) = mesh("sphere:1", 20);
    let middle = base.centroid(0).normalize();
    assert!(middle.dot(&base.centroid(0)) < 0.9);
    let fine = refined(&shape, &base, &[ball(middle.into(), 0.05, 0.02)]);
    assert!(fine.check().is_ok() && fine.faces().len() > 100);
}

#[test]
fn a_mesh_from_a_file_is_refined_on_its_own_faces() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wedge.obj");
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    std::fs::write(&path, text).unwrap();
    let shape = Shape::mesh(&path);
    let base = build(&shape, Path::new(""), None).unwrap();
    let fine = refined(&shape, &base, &[ball([1.0, 0.0, 0.0], 0.2, 0.05)]);
    assert!(fine.check().is_ok() && fine.faces().len() > 50);
    let volume = fine.mass_properties().volume;
    assert!((volume - 1.0 / 6.0).abs() < 1e-15);
    // For contact it is the tetrahedron that it was.
    let pose = hydrograd::adjoint::lie::Pose::identity();
    let of = |m| hydrograd::contact::ContactShape::of_mesh(m, pose).unwrap();
    assert!((of(&fine).radius() - of(&base).radius()).abs() < 1e-15);
}

#[test]
fn regions_that_can_not_be_are_refused_by_name() {
    let (shape, base) = mesh("box:1,1,1", 300);
    let refused = |region: Refinement, words: &[&str]| {
        let good = ball([0.5; 3], 0.1, 0.05);
        let error = shape::refine(&base, &shape, &[good, region], "body \"box\"").unwrap_err();
        says(error, words);
    };
    let corner = [0.5; 3];
    let nan = f64::NAN;
    refused(
        ball([0.0, nan, 0.0], 0.1, 0.1),
        &["body \"box\": refine[1].center", "NaN", "finite"],
    );
    for bad in [0.0, -1.0, nan, f64::INFINITY] {
        let got = format!("got {bad}");
        refused(ball(corner, bad, 0.1), &["refine[1].radius", &got]);
        refused(ball(corner, 0.1, bad), &["refine[1].edge", &got]);
    }
    refused(
        ball([0.0, 0.0, 2.0], 0.2, 0.1),
        &[
            "refine[1]",
            "nowhere",
            "no nearer than 1.5",
            "[0.0, 0.0, 2.0]",
        ],
    );
    refused(ball([1e300; 3], 0.2, 0.1), &["refine[1]", "nowhere"]);
    // Inside, too: the surface is meant.
    refused(ball([0.0; 3], 0.2, 0.1), &["no nearer than 5.0"]);
    refused(
        ball(corner, 1e-3, 1e-9),
        &["refine[1].edge", "at least 1.7e-6"],
    );
    let most = MAX_ADDED_FACES.to_string();
    refused(
        ball(corner, 10.0, 1e-3),
        &["refine[1].edge", "0.001", "e7 faces", "adds at most", &most],
    );
    // The region that asks for them is named, not the one with the shortest edge.
    let few = ball(corner, 1e-3, 1e-4);
    let many = ball(corner, 10.0, 1.5e-3);
    for (regions, name) in [([few, many], "refine[1]"), ([many, few], "refine[0]")] {
        let error = shape::refine(&base, &shape, &regions, "body \"box\"").unwrap_err();
        says(error, &[&format!("{name}.edge"), "0.0015", "e7 faces"]);
    }
}

#[test]
fn the_number_of_faces_foretold_is_about_right() {
    // What is refused is counted by the same rule that what isn't can be held against.
    for (text, edge) in [("box:1,1,1", 4e-3), ("sphere:0.5", 3e-3)] {
        let (shape, base) = mesh(text, 1280);
        let error = shape::refine(&base, &shape, &[ball([0.0; 3], 10.0, edge)], "it").unwrap_err();
        let text = error.to_string();
        let number = text
            .split("about ")
            .nth(1)
            .and_then(|t| t.split(' ').next());
        let foretold = number.unwrap().parse::<f64>().unwrap();
        let coarse = refined(&shape, &base, &[ball([0.0; 3], 10.0, 8.0 * edge)]);
        let scaled = 64.0 * coarse.faces().len() as f64;
        println!("{foretold} foretold, {scaled} by scaling");
        assert!(
            (0.6..1.7).contains(&(foretold / scaled)),
            "{foretold} {scaled}"
        );
    }
}

/// A box alone.
fn boxed(body: impl FnOnce(Body) -> Body) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    let plain = Body::new(Shape::cuboid([1.0, 0.5, 0.3]))
        .named("box")
        .density(998.0);
    scene.add(body(plain));
    scene
}

#[test]
fn scenes_take_regions_in_the_body_s_frame() {
    // The shape's corner (½, ¼, 0.15) is at the body's (−0.25 + 2, ½, 0.15).
    let turn = std::f64::consts::FRAC_PI_2;
    let make = |center: [f64; 3]| {
        boxed(|b| {
            b.shape_at([2.0, 0.0, 0.0], [0.0, 0.0, turn])
                .refine(center, 0.05, 0.01)
        })
    };
    let settings = |f| Settings::default().fidelity(Fidelity::Isolated).faces(f);
    let count = |scene: &Scene, faces| Simulator::new(scene, settings(faces)).unwrap().faces();
    let plain = boxed(|b| b);
    for faces in [100, 1000] {
        let (without, with) = (count(&plain, faces), count(&make([1.75, 0.5, 0.15]), faces));
        assert!(with > without + 50, "{with} {without}");
    }
    let error = Simulator::new(&make([0.5, 0.25, 0.15]), settings(100))
        .err()
        .unwrap();
    says(error, &["body \"box\": refine[0]", "nowhere"]);
    // As text, there and back.
    let scene = make([1.75, 0.5, 0.15]);
    let text = scene.to_toml().unwrap();
    assert_eq!(Scene::from_toml(&text, "").unwrap(), scene);
    let file = |entry: &str| {
        let text = format!(
            "time_step = 0.01\nsteps = 1\nfluid = {{ density = 998.0 }}\n[[bodies]]\nname = \"box\"\n\
             shape = {{ kind = \"box\", size = [1.0, 0.5, 0.3], faces = 100 }}\ndensity = 998.0\n\
             refine = [{entry}]\n"
        );
        Scene::from_toml(&text, "")
    };
    let good = file("{ center = [0.5, 0.25, 0.15], radius = 0.05, edge = 0.01 }").unwrap();
    assert_eq!(good.bodies[0].refine, [ball([0.5, 0.25, 0.15], 0.05, 0.01)]);
    says(
        file("{ center = [0.5, 0.25, 0.15], radius = 0.05, edges = 0.01 }").unwrap_err(),
        &[
            "line 8",
            "body \"box\": refine[0]",
            "`edges`",
            "did you mean `edge`?",
        ],
    );
    says(
        file("{ center = [0.5, 0.25, 0.15], radius = 0.05 }").unwrap_err(),
        &["line 8", "refine[0] lacks the key `edge`"],
    );
    let checked = |scene: Scene| scene.validate().unwrap_err();
    says(
        checked(boxed(|b| b.refine([0.0; 3], -1.0, 0.1))),
        &["body \"box\": refine[0].radius", "-1"],
    );
    let mut dry = boxed(|b| b.refine([0.0; 3], 1.0, 0.1));
    dry.bodies[0].shape = None;
    says(checked(dry), &["body \"box\": refine", "without a shape"]);
}
