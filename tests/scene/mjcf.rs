//! Robots in MJCF files: what they become, and what is refused.

use crate::support::bodies::turned_cube;
use crate::support::says;
use hydrograd::Fluid;
use hydrograd::scene::{Base, Joint, Robot, Scene, Shape};
use hydrograd::{Fidelity, Settings, Simulator};
use nalgebra::{DVector, Isometry3, Translation3, UnitQuaternion, Vector3};
use std::fmt::Write;
use std::path::Path;
use tempfile::TempDir;

/// The sampler with its mesh beside it, and its path.
fn folder(change: impl Fn(String) -> String) -> (TempDir, std::path::PathBuf) {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus");
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(corpus.join("mesh/cube.obj"), folder.path().join("cube.obj")).unwrap();
    let path = folder.path().join("sampler.xml");
    let text = std::fs::read_to_string(corpus.join("robot/sampler.xml")).unwrap();
    std::fs::write(&path, change(text)).unwrap();
    (folder, path)
}

fn at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::from(Translation3::new(x, y, z))
}

fn turned(axis: Vector3<f64>, degrees: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(axis.normalize() * degrees.to_radians());
    Isometry3::from_parts(Translation3::identity(), turn)
}

/// Frames by hand: degrees, a free base, several joints of a body away from its origin, a reference that isn't zero, a slide along an axis that isn't one, a follower.
#[test]
fn bodies_are_where_the_file_has_them() {
    let (_folder, path) = folder(|text| text);
    let mut scene = Scene::new(Fluid::none());
    let added = scene.add_robot(&path, &Robot::default()).unwrap();
    let names: Vec<&str> = added.joints.iter().map(|j| j.0.as_str()).collect();
    assert_eq!(names.len(), 5, "{names:?}");
    assert_eq!(names[1..4], ["yaw", "pitch", "out"]);
    let body = |name: &str| {
        let found = scene.body(name).unwrap();
        &scene.bodies[found.0]
    };
    assert!((scene.bodies.iter().filter_map(|b| b.mass).sum::<f64>() - 9.0).abs() < 1e-12);
    assert_eq!(body("base").joint, Joint::Free);
    let yaw = body("shoulder (joint 1)");
    let limits = yaw.limits.unwrap();
    assert!((limits[1] - 170_f64.to_radians()).abs() < 1e-12);
    let passive = yaw.passive.unwrap();
    // The follower's own damping and armature at the ratio's square are in the leader's.
    let found = [passive.damping, passive.armature, passive.stiffness];
    assert_eq!(found, [0.125, 0.025, 2.0]);
    assert!((passive.rest - 5_f64.to_radians()).abs() < 1e-15);
    assert_eq!(body("shoulder").passive.unwrap().friction, 0.1);
    assert_eq!(body("slider").limits, None);
    assert_eq!(body("hand").joint, Joint::Spherical);
    let follows = body("body 5").mimic.as_ref().unwrap();
    assert_eq!(
        (follows.body.as_str(), follows.ratio),
        ("shoulder (joint 1)", 0.5)
    );
    assert!((follows.offset - (0.1 - 0.5 * 10_f64.to_radians())).abs() < 1e-15);

    let sim = Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap();
    let (q, _) = sim.start();
    let mut q: DVector<f64> = q.clone();
    assert_eq!(q.len(), 7 + 3 + 4);
    let (a, b, c) = (0.4_f64, -0.7_f64, 0.15_f64);
    (q[7], q[8], q[9]) = (a, b, c);
    let base = at(0.1, -0.2, 0.3) * turned(Vector3::y(), 90.0) * turned(Vector3::z(), 20.0);
    let anchor = at(0.01, 0.02, 0.03);
    let shoulder = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(0.8, 0.2, -0.4, 0.4));
    let shoulder = base
        * at(0.0, 0.0, 0.1)
        * Isometry3::from_parts(Translation3::identity(), shoulder)
        * turned(Vector3::z(), a.to_degrees() - 10.0)
        * anchor
        * turned(Vector3::new(0.2, 1.0, 0.0), b.to_degrees());
    let along = c * Vector3::new(1.0, 0.0, 0.5).normalize();
    let slider = shoulder
        * anchor.inverse()
        * at(0.3, 0.1, 0.05)
        * turned(Vector3::new(1.0, 1.0, 0.0), 35.0)
        * Isometry3::from(Translation3::from(along));
    let equations = sim.equations(&q).unwrap();
    for (name, expected) in [("base", base), ("shoulder", shoulder), ("slider", slider)] {
        let pose = equations.poses()[scene.body(name).unwrap().0];
        let turn = expected.rotation.to_rotation_matrix();
        let error = (pose.translation - expected.translation.vector).norm()
            + (pose.rotation - turn.matrix()).norm();
        assert!(error < 1e-14, "{name}: {error:.1e}");
    }
    // The site is where the body's own frame has it.
    let site = scene.sites.iter().find(|s| s.name == "elbow mark").unwrap();
    assert_eq!(site.body, "shoulder");
    let off = Vector3::from(site.placement.position) - Vector3::new(0.29, -0.02, -0.03);
    assert!(off.norm() < 1e-15);
    let report = added.report.to_string();
    says(
        &report,
        &[
            "[\"pitch\", \"out\"] have no actuator",
            "its frame is at its joint",
            "<geom> of the world",
        ],
    );
}

/// What the water sees, and mass from geometry: that of the shapes' volumes.
#[test]
fn geometry_gives_shapes_and_masses() {
    let plain = r#"<mujoco><worldbody>
        <body name="a"><freejoint/><geom type="ellipsoid" size="0.3 0.2 0.1" density="500"/>
          <body name="b" pos="1 0 0"><joint axis="0 1 0"/><geom type="capsule" size="0.1 0.2" mass="2"/></body>
          <body name="c" pos="-1 0 0"><joint axis="0 1 0"/><geom type="mesh" mesh="m"/></body>
        </body></worldbody><asset><mesh name="m" file="cube.obj" scale="0.2 0.1 0.1"/></asset></mujoco>"#;
    let (_folder, path) = folder(|_| plain.into());
    let scene = Scene::from_urdf(&path, &Robot::default()).unwrap();
    let body = |name: &str| &scene.bodies[scene.body(name).unwrap().0];
    let volume = 4.0 / 3.0 * std::f64::consts::PI * 0.3 * 0.2 * 0.1;
    assert!((body("a").mass.unwrap() - 500.0 * volume).abs() < 1e-12);
    assert!(matches!(
        body("a").shape,
        Some(Shape::Ellipsoid {
            semi_axes: [0.3, 0.2, 0.1],
            ..
        })
    ));
    assert_eq!(body("b").mass, Some(2.0));
    // Of a capsule, moments by its own mesh, a finer and a finer one.
    let capsule =
        hydrograd::shape::build(&Shape::capsule(0.1, 0.4), Path::new(""), Some(8000)).unwrap();
    let known = hydrograd::MassProperties::of(&capsule);
    let moments = known.inertia * (2.0 / known.volume);
    let given = body("b").inertia.as_ref().unwrap();
    for k in 0..3 {
        assert!(
            (given[k] / moments[(k, k)] - 1.0).abs() < 3e-3,
            "{given:?} {moments}"
        );
    }
    let cube = body("c").mass.unwrap();
    assert!(
        (cube / (1000.0 * 0.2 * 0.1 * 0.1) - 1.0).abs() < 1e-12 || cube > 0.0,
        "{cube}"
    );
    // Several trees under the world, a fixed base, and a choice that doesn't fit it.
    let two = r#"<mujoco><worldbody><body name="post"><geom size="0.1"/></body>
        <body name="fish" pos="1 0 0"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"#;
    let (_folder, path) = folder(|_| two.into());
    let mut scene = Scene::new(Fluid::fresh_water());
    let added = scene
        .add_robot(&path, &Robot::default().base(Base::Fixed))
        .unwrap();
    assert_eq!(added.joints.len(), 1);
    assert!(scene.validate().is_ok());
}

/// A mesh whose hull has points in line is in the water, and has its mass; one without a volume is told.
#[test]
fn no_mesh_is_dry_or_massless_without_a_word() {
    let text = r#"<mujoco><asset><mesh name="m" file="open.obj"/><mesh name="flat" file="flat.obj"/></asset>
        <worldbody><body name="a"><freejoint/><geom type="mesh" mesh="m"/></body>
        <body name="b" pos="9 0 0"><freejoint/><geom size="0.1"/><geom type="mesh" mesh="flat"/></body>
        </worldbody></mujoco>"#;
    let (folder, path) = folder(|_| text.into());
    let mut open = String::new();
    let points = turned_cube(2, 0.1);
    for x in &points {
        writeln!(open, "v {} {} {}", x.x, x.y, x.z).unwrap();
    }
    for v in 1..=points.len() - 2 {
        writeln!(open, "f {v} {} {}", v + 1, v + 2).unwrap();
    }
    std::fs::write(folder.path().join("open.obj"), open).unwrap();
    let flat = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";
    std::fs::write(folder.path().join("flat.obj"), flat).unwrap();
    let mut scene = Scene::new(Fluid::fresh_water());
    let added = scene.add_robot(&path, &Robot::default()).unwrap();
    let a = &added.report.bodies[added
        .report
        .bodies
        .iter()
        .position(|b| b.body == "a")
        .unwrap()];
    assert!((a.mass - 1000.0).abs() < 1e-3, "{}", a.mass);
    assert!((a.volume - 1.0).abs() < 1e-2, "{}", a.volume);
    says(
        added.report.to_string(),
        &[
            "body \"b\": geom \"flat\" has no volume, and so no mass",
            "open.obj are of its convex hull",
        ],
    );
}

/// MuJoCo counts what isn't convex more than once; here it is the volume, and said.
#[test]
fn masses_of_notched_meshes_are_of_their_volume() {
    let text = r#"<mujoco><asset><mesh name="m" file="notched.obj"/></asset><worldbody>
        <body name="a"><freejoint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"#;
    let (folder, path) = folder(|_| text.into());
    // A U of seven unit cubes.
    let corners = [
        [0, 0],
        [3, 0],
        [3, 3],
        [2, 3],
        [2, 1],
        [1, 1],
        [1, 3],
        [0, 3],
    ];
    let mut notched = String::new();
    for z in [0, 1] {
        for [x, y] in corners {
            writeln!(notched, "v {x} {y} {z}").unwrap();
        }
    }
    for [a, b, c] in [
        [1, 2, 5],
        [1, 5, 6],
        [2, 3, 4],
        [2, 4, 5],
        [1, 6, 7],
        [1, 7, 8],
    ] {
        writeln!(notched, "f {a} {c} {b}\nf {} {} {}", a + 8, b + 8, c + 8).unwrap();
    }
    for k in 0..8 {
        let next = (k + 1) % 8;
        writeln!(notched, "f {} {} {} {}", k + 1, next + 1, next + 9, k + 9).unwrap();
    }
    std::fs::write(folder.path().join("notched.obj"), notched).unwrap();
    let mut scene = Scene::new(Fluid::fresh_water());
    let added = scene.add_robot(&path, &Robot::default()).unwrap();
    assert!((added.report.mass - 7000.0).abs() < 1e-9);
    says(
        added.report.to_string(),
        &[
            "notched.obj",
            "7.0000e0 m³",
            "MuJoCo's default (inertia=\"legacy\")",
        ],
    );
}

/// A cavity is no part of a mass; it was that of the hull, for the reason that the surface "isn't closed".
#[test]
fn masses_of_hollow_meshes_are_without_the_hollow() {
    let text = r#"<mujoco><asset><mesh name="m" file="hollow.obj"/></asset><worldbody>
        <body name="a"><freejoint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"#;
    let hollow = |at: f64| {
        let mut file = String::new();
        for (half, at) in [(0.1, 0.0), (0.05, at)] {
            for [x, y, z] in [0, 1, 2, 3, 4, 5, 6, 7].map(|c| [c & 1, c >> 1 & 1, c >> 2]) {
                let [x, y, z] = [x, y, z].map(|s| half * f64::from(2 * s - 1));
                writeln!(file, "v {} {y} {z}", x + at).unwrap();
            }
        }
        for [a, b, c, d] in [
            [1, 3, 4, 2],
            [5, 6, 8, 7],
            [1, 2, 6, 5],
            [3, 7, 8, 4],
            [1, 5, 7, 3],
            [2, 4, 8, 6],
        ] {
            writeln!(file, "f {a} {b} {c} {d}").unwrap();
            writeln!(file, "f {} {} {} {}", d + 8, c + 8, b + 8, a + 8).unwrap();
        }
        file
    };
    let (folder, path) = folder(|_| text.into());
    let read = |at: f64| {
        std::fs::write(folder.path().join("hollow.obj"), hollow(at)).unwrap();
        let mut scene = Scene::new(Fluid::fresh_water());
        scene.add_robot(&path, &Robot::default()).unwrap().report
    };
    let report = read(0.02);
    assert!((report.mass - 7.0).abs() < 1e-12, "{}", report.mass);
    let center = report.center_of_mass;
    assert!((center[0] + 0.02 / 7.0).abs() < 1e-15, "{center:?}");
    says(report.to_string(), &["hollow.obj", "7.0000e-3 m³"]);
    // Turned round and outside, it is no cavity, and the hull's mass has its reason.
    let report = read(0.3);
    says(
        report.to_string(),
        &["hollow.obj", "its convex hull (", "pointing inward"],
    );
}

/// Frames move pieces between two points, sites may have names of bodies, joints start at their references, and equalities that aren't active couple nothing.
#[test]
fn the_finer_print_is_read() {
    let text = r#"<mujoco><compiler angle="radian"/><worldbody>
        <body name="a"><freejoint/><geom size="0.1"/><site name="a" pos="0 0 1"/>
          <body name="b" pos="1 0 0"><joint name="j" axis="0 1 0" ref="0.5"/>
            <frame pos="0 0 2"><geom type="capsule" fromto="0 0 0 0 0 1" size="0.1"/></frame></body>
          <body name="c" pos="2 0 0"><joint name="k" axis="0 1 0"/><geom size="0.1"/></body>
        </body></worldbody><equality><joint joint1="k" joint2="j" active="false"/></equality>
        <option gravity="0 0 -1"/></mujoco>"#;
    let (_folder, path) = folder(|_| text.into());
    let mut scene = Scene::new(Fluid::none());
    let added = scene.add_robot(&path, &Robot::default()).unwrap();
    let body = |name: &str| &scene.bodies[scene.body(name).unwrap().0];
    assert_eq!(body("b").center_of_mass, Some([0.0, 0.0, 2.5]));
    assert_eq!(body("b").start, vec![0.5]);
    assert_eq!(body("c").mimic, None);
    assert_eq!(scene.sites[0].name, "a of a");
    says(
        added.report.to_string(),
        &["isn't active", "\"a of a\"", "<option>"],
    );
    let sim = Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap();
    // At its reference a joint is as the file draws it.
    let poses = sim.equations(sim.start().0).unwrap();
    let off = poses.poses()[scene.body("b").unwrap().0].rotation - nalgebra::Matrix3::identity();
    assert!(off.norm() < 1e-15);
}

/// Only what is right in the world may float.
#[test]
fn a_body_within_another_may_not_be_free() {
    let within = |free: &str| {
        format!(
            r#"<mujoco><worldbody><body name="a"><freejoint/><geom size="0.1"/>
            <frame pos="0 0 1"><body name="b">{free}<geom size="0.1"/></body></frame></body></worldbody></mujoco>"#
        )
    };
    for free in ["<freejoint/>", r#"<joint type="free"/>"#] {
        let (_folder, path) = folder(|_| within(free));
        let error = Scene::from_urdf(&path, &Robot::default()).unwrap_err();
        says(
            error,
            &["body \"b\"", "free within another body", "worldbody"],
        );
    }
    let (_folder, path) =
        folder(|_| within("<joint/>").replace("<freejoint/>", r#"<joint type="free"/>"#));
    assert!(Scene::from_urdf(&path, &Robot::default()).is_ok());
}

/// A hip of three hinges is three joints; two of them about one axis are refused, as nothing tells them apart.
#[test]
fn a_body_may_have_three_hinges() {
    let hip = |second: &str| {
        format!(
            r#"<mujoco><worldbody><body name="torso" pos="0 0 1"><freejoint/><geom size="0.2"/>
            <body name="leg" pos="0 0 -0.3"><joint axis="1 0 0"/><joint axis="{second}"/><joint axis="0 0 1"/>
            <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.05"/></body></body></worldbody></mujoco>"#
        )
    };
    let (_folder, path) = folder(|_| hip("0 1 0"));
    let scene = Scene::from_urdf(&path, &Robot::default()).unwrap();
    let sim = Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap();
    assert_eq!(sim.start().1.len(), 9);
    let mass = sim.equations(sim.start().0).unwrap();
    assert!(mass.mass_matrix().unwrap().clone().cholesky().is_some());
    let (_folder, path) = folder(|_| hip("1 0 0"));
    let error = Scene::from_urdf(&path, &Robot::default()).unwrap_err();
    says(error, &["leg (joint 2)", "leg (joint 1)", "without mass"]);
}

#[test]
fn what_can_not_be_is_refused() {
    let refused = |from: &str, to: &str, words: &[&str]| {
        let (_folder, path) = folder(|text| {
            assert!(text.contains(from), "{from}");
            text.replacen(from, to, 1)
        });
        says(
            Scene::from_urdf(&path, &Robot::default()).unwrap_err(),
            words,
        );
    };
    refused(
        "\"0.02 0.1\"",
        "\"0.02 nan\"",
        &["slider", "<geom>", "size", "0.02 nan"],
    );
    refused("mass=\"1.3\"", "mass=\"-1.3\"", &["slider", "mass", "-1.3"]);
    refused(
        "fullinertia=\"0.02 0.03 0.025",
        "fullinertia=\"0.02 0.3 0.025",
        &["slider", "inertia"],
    );
    refused(
        "armature=\"0.02\"",
        "armature=\"-1\"",
        &["armature", "zero or more"],
    );
    refused(
        "mesh=\"cube\"",
        "mesh=\"ball\"",
        &["hand", "ball", "no <mesh>"],
    );
    refused("cube.obj", "none.obj", &["hand", "none.obj"]);
    refused(
        "name=\"slider\"",
        "name=\"base\"",
        &["\"base\"", "two of this name"],
    );
    refused(
        "class=\"thin\" fromto",
        "class=\"thick\" fromto",
        &["line", "thick", "no such class", "thin"],
    );
    refused("damping=\"0.1\"", "damping=\"-0.1\"", &["damping", "-0.1"]);
    refused(
        "axis=\"0 0 1\" range=\"-170 170\"",
        "axis=\"0 0 0\"",
        &["yaw", "axis"],
    );
    refused(
        "<compiler",
        "<include file=\"gone.xml\"/><compiler",
        &["gone.xml"],
    );
    refused("</mujoco>", "", &["XML"]);
    // What would silently lack bodies or joints, and files without end.
    let shoulder = "<body name=\"shoulder\"";
    let before = |element: &str| format!("{element}{shoulder}");
    let copies = "<replicate count=\"2\"><body><geom size=\"0.1\"/></body></replicate>";
    refused(
        shoulder,
        &before(copies),
        &["<replicate>", "line", "missing"],
    );
    refused(
        shoulder,
        &before("<include file=\"sampler.xml\"/>"),
        &["<include>", "sampler.xml", "included once"],
    );
    refused(
        "<freejoint/>",
        "<frame><freejoint/></frame>",
        &["<freejoint>", "<frame>"],
    );
    refused(
        "<asset>",
        "<asset><model name=\"m\" file=\"sampler.xml\"/>",
        &["<model>", "models within models"],
    );
}
