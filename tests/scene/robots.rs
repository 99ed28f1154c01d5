//! Robots in URDF files: what they become, what is said of them, and what is refused.

use crate::support::says;
use hydrograd::scene::{
    BadMeshes, Base, Followers, Joint, Motion, Plane, Robot, RobotLink, Scene, Shape, Wet,
};
use hydrograd::{Controls, Fidelity, Fluid, Settings, Simulator};
use nalgebra::{DVector, Isometry3, Translation3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

pub const INERTIAL: &str = r#"<inertial><mass value="2"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.04"/></inertial>"#;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A file in a folder of its own.
pub fn file(text: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.urdf");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

pub fn robot(inner: &str) -> String {
    format!("<robot name=\"r\">\n{inner}\n</robot>\n")
}

pub fn link(name: &str, inner: &str) -> String {
    format!("<link name=\"{name}\">{INERTIAL}{inner}</link>\n")
}

pub fn joint(name: &str, kind: &str, parent: &str, child: &str, inner: &str) -> String {
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{inner}</joint>\n"
    )
}

pub fn collision(geometry: &str, origin: &str) -> String {
    format!("<collision>{origin}<geometry>{geometry}</geometry></collision>")
}

pub fn read(text: &str, options: &Robot) -> hydrograd::Result<Scene> {
    let (_folder, path) = file(text);
    let scene = Scene::from_urdf(path, options)?;
    scene.validate().map(|()| scene)
}

/// Two links at a joint.
pub fn pair(kind: &str, inner: &str) -> String {
    robot(
        &[
            link("a", ""),
            link("b", ""),
            joint("j", kind, "a", "b", inner),
        ]
        .concat(),
    )
}

#[track_caller]
pub fn refused(text: &str, words: &[&str]) {
    refused_with(text, &Robot::default(), words);
}

#[track_caller]
pub fn refused_with(text: &str, options: &Robot, words: &[&str]) {
    let error = read(text, options).unwrap_err().to_string();
    says(error, &[&["robot.urdf"], words].concat());
}

#[test]
fn joints_become_joints() {
    let axis = "<axis xyz=\"0 0 2\"/>";
    let limit = "<limit lower=\"-1\" upper=\"2\" effort=\"1\" velocity=\"1\"/>";
    let both = format!("{axis}{limit}");
    let kinds = [
        (
            "revolute",
            both.as_str(),
            Joint::Revolute {
                axis: [0.0, 0.0, 2.0],
            },
            Some([-1.0, 2.0]),
        ),
        (
            "continuous",
            both.as_str(),
            Joint::Revolute {
                axis: [0.0, 0.0, 2.0],
            },
            None,
        ),
        (
            "prismatic",
            both.as_str(),
            Joint::Prismatic {
                axis: [0.0, 0.0, 2.0],
            },
            Some([-1.0, 2.0]),
        ),
        (
            "revolute",
            "",
            Joint::Revolute {
                axis: [1.0, 0.0, 0.0],
            },
            None,
        ),
        ("planar", axis, Joint::Planar { plane: Plane::Xy }, None),
        (
            "planar",
            "<axis xyz=\"0 -1 0\"/>",
            Joint::Planar { plane: Plane::Zx },
            None,
        ),
        ("floating", "", Joint::Free, None),
    ];
    for (kind, inner, becomes, limits) in kinds {
        let scene = read(&pair(kind, inner), &Robot::default()).unwrap();
        let body = &scene.bodies[1];
        assert_eq!(
            (body.name.as_str(), body.parent.as_deref()),
            ("b", Some("a")),
            "{kind}"
        );
        assert_eq!((body.joint, body.limits), (becomes, limits), "{kind}");
        assert_eq!(body.actuated, becomes.coordinates() == 1, "{kind}");
        assert_eq!(scene.bodies[0].joint, Joint::Free);
        assert_eq!(scene.gravity, [0.0, 0.0, -9.81]);
    }
    let fixed = read(
        &pair("revolute", limit),
        &Robot::default().base(Base::Fixed),
    )
    .unwrap();
    assert_eq!(fixed.bodies[0].joint, Joint::Fixed);
    let loose = Robot {
        limits: Some(false),
        actuated: Some(false),
        ..Robot::default()
    };
    let body = &read(&pair("revolute", limit), &loose).unwrap().bodies[1];
    assert_eq!((body.limits, body.actuated), (None, false));
}

/// What is folded has the mass, centre and inertia of its links; those are sites.
#[test]
fn fixed_links_fold() {
    let turned = "<origin xyz=\"0.1 0.2 0.3\" rpy=\"0.4 -0.5 0.6\"/>";
    let tip = "<origin xyz=\"0 0 0.5\" rpy=\"0 1.2 0\"/>";
    let text = robot(
        &[
            link("a", ""),
            link("b", ""),
            "<link name=\"tip\"/>".into(),
            joint("ab", "fixed", "a", "b", turned),
            joint("bt", "fixed", "b", "tip", tip),
        ]
        .concat(),
    );
    let scene = read(&text, &Robot::default()).unwrap();
    assert_eq!(scene.bodies.len(), 1);
    let names: Vec<&str> = scene.sites.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["b", "tip"]);
    let at = |x: [f64; 3], rpy: [f64; 3]| {
        let turn = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
        Isometry3::from_parts(Translation3::from(x), turn)
    };
    let first = at([0.1, 0.2, 0.3], [0.4, -0.5, 0.6]);
    let second = first * at([0.0, 0.0, 0.5], [0.0, 1.2, 0.0]);
    for (site, right) in scene.sites.iter().zip([first, second]) {
        let place = &site.placement;
        assert!((Vector3::from(place.position) - right.translation.vector).norm() < 1e-15);
        assert!((Vector3::from(place.rotation) - right.rotation.scaled_axis()).norm() < 1e-15);
    }
    // Two equal masses: the centre lies midway, and each adds its offset.
    let body = &scene.bodies[0];
    assert_eq!(body.mass, Some(4.0));
    let center = Vector3::from(body.center_of_mass.unwrap());
    let offset = first.translation.vector / 2.0;
    assert!((center - offset).norm() < 1e-15);
    let own = nalgebra::Matrix3::from_diagonal(&Vector3::new(0.02, 0.03, 0.04));
    let turn = first.rotation.to_rotation_matrix().into_inner();
    let away = nalgebra::Matrix3::identity() * offset.norm_squared() - offset * offset.transpose();
    let right = own + turn * own * turn.transpose() + 4.0 * away;
    let found = body.inertia.clone().unwrap();
    for (k, (i, j)) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
        .into_iter()
        .enumerate()
    {
        assert!((found[k] - right[(i, j)]).abs() < 1e-15);
    }
    // A link that is kept is a body at a fixed joint.
    let kept = RobotLink {
        keep: true,
        ..RobotLink::default()
    };
    let scene = read(&text, &Robot::default().link("b", kept)).unwrap();
    let kinds: Vec<_> = scene
        .bodies
        .iter()
        .map(|b| (b.name.as_str(), b.joint))
        .collect();
    assert_eq!(kinds, [("a", Joint::Free), ("b", Joint::Fixed)]);
    assert_eq!(scene.sites[0].body, "b");
}

#[test]
fn primitives_stay_what_they_are() {
    let at = "<origin xyz=\"0 0 1\" rpy=\"1.5 0 0\"/>";
    let kinds = [
        ("<box size=\"1 2 3\"/>", Shape::cuboid([1.0, 2.0, 3.0])),
        ("<sphere radius=\"0.5\"/>", Shape::sphere(0.5)),
        (
            "<cylinder radius=\"0.5\" length=\"2\"/>",
            Shape::cylinder(0.5, 2.0),
        ),
        (
            "<capsule radius=\"0.5\" length=\"2\"/>",
            Shape::capsule(0.5, 2.0),
        ),
    ];
    for (geometry, shape) in kinds {
        let text = robot(&link("a", &collision(geometry, at)));
        let body = &read(&text, &Robot::default()).unwrap().bodies[0];
        assert_eq!(body.shape, Some(shape), "{geometry}");
        assert!((Vector3::from(body.shape_at.rotation) - Vector3::x() * 1.5).norm() < 1e-15);
        assert_eq!(body.shape_at.position, [0.0, 0.0, 1.0]);
        assert!(body.collision.is_empty());
    }
}

fn volume(shape: &Shape) -> f64 {
    let mesh = hydrograd::shape::build(shape, Path::new(""), None).unwrap();
    mesh.mass_properties().volume
}

/// Several pieces: their hull for the water, each of them for contact.
#[test]
fn several_pieces_become_their_hull() {
    let piece = |x: f64| {
        let origin = format!("<origin xyz=\"{x} 0 0\"/>");
        collision("<box size=\"0.2 0.2 0.2\"/>", &origin)
    };
    let text = robot(&link("a", &[piece(-0.4), piece(0.4)].concat()));
    let (_folder, path) = file(&text);
    let mut scene = Scene::new(Fluid::fresh_water());
    let added = scene.add_robot(&path, &Robot::default()).unwrap();
    let body = &scene.bodies[0];
    let shape = body.shape.as_ref().unwrap();
    // Few faces are made more and even, and the volume stays.
    assert!(
        (volume(shape) / 0.04 - 1.0).abs() < 1e-9,
        "{}",
        volume(shape)
    );
    assert!(matches!(shape, Shape::Triangles { faces, .. } if (200..=400).contains(&faces.len())));
    let pieces: Vec<&Shape> = body.collision.iter().map(|p| &p.shape).collect();
    assert_eq!(pieces, [&Shape::cuboid([0.2; 3]); 2]);
    assert!(added.report.bodies[0].shape.contains("hull of 2 pieces"));
    assert!((added.report.volume / 0.04 - 1.0).abs() < 1e-9);

    // Wet as chosen: nothing, for one link.
    let dry = RobotLink {
        shape: Some(Wet::None),
        ..RobotLink::default()
    };
    let scene = read(&text, &Robot::default().link("a", dry)).unwrap();
    assert_eq!(scene.bodies[0].shape, None);
}

/// The hull of a primitive and of a tiny box within it is the primitive: its volume to half a percent, with the faces asked for.
#[test]
fn hulls_have_the_volume_and_the_faces() {
    let pi = std::f64::consts::PI;
    let shapes = [
        ("<sphere radius=\"0.1\"/>", 4.0 / 3.0 * pi * 1e-3),
        (
            "<capsule radius=\"0.05\" length=\"0.3\"/>",
            pi * 2.5e-3 * (0.3 + 4.0 / 3.0 * 0.05),
        ),
        (
            "<cylinder radius=\"0.05\" length=\"0.3\"/>",
            pi * 2.5e-3 * 0.3,
        ),
        (
            "<cylinder radius=\"0.1\" length=\"0.02\"/>",
            pi * 1e-2 * 0.02,
        ),
    ];
    for (geometry, right) in shapes {
        let tiny = collision("<box size=\"0.01 0.01 0.01\"/>", "");
        let text = robot(&link("a", &[collision(geometry, ""), tiny].concat()));
        let (_folder, path) = file(&text);
        for asked in [None, Some(80), Some(1000)] {
            let options = Robot {
                faces: asked,
                ..Robot::default()
            };
            let mut scene = Scene::new(Fluid::fresh_water());
            let report = scene.add_robot(&path, &options).unwrap().report;
            let shape = scene.bodies[0].shape.as_ref().unwrap();
            let Shape::Triangles { faces, .. } = shape else {
                panic!("{shape:?}")
            };
            let off = volume(shape) / right - 1.0;
            assert!(off.abs() < 5e-3, "{geometry}, {asked:?}: {off:.2e}");
            assert!((report.volume / volume(shape) - 1.0).abs() < 1e-12);
            let ratio = faces.len() as f64 / asked.unwrap_or(320) as f64;
            assert!(
                (0.8..1.25).contains(&ratio),
                "{geometry}, {asked:?}: {} faces; {:?}",
                faces.len(),
                report.notes
            );
            // For contact they are what they are.
            assert_eq!(scene.bodies[0].collision.len(), 2);
        }
    }
}

/// A thin plate of two boxes keeps its volume, however many faces it gets, and where that isn't about the number asked for it is said.
#[test]
fn hulls_of_plates_keep_their_volume() {
    let plate = |x: f64| {
        let origin = format!("<origin xyz=\"{x} 0 0\"/>");
        collision("<box size=\"0.2 0.3 0.002\"/>", &origin)
    };
    let text = robot(&link("a", &[plate(-0.1), plate(0.1)].concat()));
    let (_folder, path) = file(&text);
    let mut scene = Scene::new(Fluid::fresh_water());
    let report = scene.add_robot(&path, &Robot::default()).unwrap().report;
    let shape = scene.bodies[0].shape.as_ref().unwrap();
    let right = 0.4 * 0.3 * 0.002;
    assert!((volume(shape) / right - 1.0).abs() < 1e-9);
    let Shape::Triangles { faces, .. } = shape else {
        panic!("{shape:?}")
    };
    let near = (256..=400).contains(&faces.len());
    let said = report
        .notes
        .iter()
        .any(|note| note.contains(&format!("{} faces", faces.len())) && note.contains("320"));
    assert_eq!(said, !near, "{} faces: {:?}", faces.len(), report.notes);
}

/// A cube of edge 1.
const CUBE: &str = include_str!("../fuzz/corpus/mesh/cube.obj");

#[test]
fn meshes_are_found_scaled_and_replaced() {
    let (folder, path) = file("");
    let mesh = |name: &str, scale: &str| {
        let geometry = format!("<mesh filename=\"{name}\"{scale}/>");
        robot(&link("a", &collision(&geometry, "")))
    };
    let set = |text: &str| std::fs::write(&path, text).unwrap();
    let meshes = folder.path().join("pack/meshes");
    std::fs::create_dir_all(&meshes).unwrap();
    std::fs::write(meshes.join("cube.obj"), CUBE).unwrap();
    let made = |options: &Robot| Scene::from_urdf(&path, options).map(|s| s.bodies[0].clone());

    let one = volume(&Shape::mesh(meshes.join("cube.obj")));
    let beside = Robot::default();
    for name in [
        "package://pack/meshes/cube.obj",
        "model://pack/meshes/cube.obj",
        "pack/meshes/cube.obj",
        &format!("file://{}", meshes.join("cube.obj").display()),
    ] {
        set(&mesh(name, " scale=\"1 2 -0.5\""));
        let body = made(&beside).unwrap();
        let found = volume(body.shape.as_ref().unwrap());
        assert!((found / one - 1.0).abs() < 1e-4, "{name}: {found} {one}");
    }

    // Elsewhere: the folder that holds the package is given.
    let (_other, away) = file(&mesh("package://pack/meshes/cube.obj", ""));
    let lost = Scene::from_urdf(&away, &beside).unwrap_err().to_string();
    says(
        lost,
        &[
            "link \"a\"",
            "pack/meshes/cube.obj",
            "tried",
            "package_path",
        ],
    );
    let given = Robot::default().package_path([folder.path().to_path_buf()]);
    Scene::from_urdf(&away, &given).unwrap();
    // The folder may be the package itself.
    let given = Robot::default().package_path([folder.path().join("pack")]);
    Scene::from_urdf(&away, &given).unwrap();

    // Without its last face a cube isn't closed: its hull stands for it, and says so, or it is refused.
    let open: String = {
        let lines: Vec<&str> = CUBE.trim_end().lines().collect();
        lines[..lines.len() - 1].join("\n")
    };
    std::fs::write(meshes.join("cube.obj"), open).unwrap();
    set(&mesh("pack/meshes/cube.obj", ""));
    let mut scene = Scene::new(Fluid::fresh_water());
    let report = scene.add_robot(&path, &beside).unwrap().report;
    let found = volume(scene.bodies[0].shape.as_ref().unwrap());
    assert!((found / one - 1.0).abs() < 1e-4, "{found} {one}");
    says(
        report.to_string(),
        &["body \"a\"", "convex hull", "closed surface"],
    );
    let strict = Robot {
        bad_meshes: BadMeshes::Refuse,
        ..Robot::default()
    };
    says(
        made(&strict).unwrap_err().to_string(),
        &["link \"a\"", "cube.obj"],
    );
    set(&mesh("pack/meshes/cube.obj", " scale=\"1 0 1\""));
    says(
        made(&beside).unwrap_err().to_string(),
        &["link \"a\"", "scale", "0.001"],
    );
    set(&mesh("pack/meshes/none.obj", ""));
    says(
        made(&beside).unwrap_err().to_string(),
        &["link \"a\"", "none.obj", "tried"],
    );
    set(&mesh("http://pack/none.obj", ""));
    says(
        made(&beside).unwrap_err().to_string(),
        &["link \"a\"", "package://"],
    );
}

/// Bodies that overlap beyond the rule are parted at the start, and the scene runs.
#[test]
fn what_overlaps_is_parted_and_said() {
    // The grandchild lies in the root by a third of its own.
    let cube = |x: f64| {
        let origin = format!("<origin xyz=\"{x} 0 0\"/>");
        collision("<box size=\"0.2 0.2 0.2\"/>", &origin)
    };
    let limit = "<axis xyz=\"0 0 1\"/>";
    let text = robot(
        &[
            link("root", &cube(0.0)),
            link(
                "middle",
                &collision("<sphere radius=\"0.06\"/>", "<origin xyz=\"0 0.14 0\"/>"),
            ),
            link("last", &cube(0.13)),
            joint("one", "revolute", "root", "middle", limit),
            joint("two", "revolute", "middle", "last", limit),
        ]
        .concat(),
    );
    let (_folder, path) = file(&text);
    let mut scene = Scene::new(Fluid::fresh_water());
    let report = scene.add_robot(&path, &Robot::default()).unwrap().report;
    let said = report.to_string();
    says(
        said,
        &[
            "body \"root\"",
            "body \"last\"",
            "cut off by a plane",
            "overlaps_parent",
        ],
    );
    assert!(scene.bodies[1].overlaps_parent);
    let wet = |b: usize| volume(scene.bodies[b].shape.as_ref().unwrap());
    // 0.07 of 0.2 lie in each other: each loses half of that and a little.
    for b in [0, 2] {
        let left = wet(b) / 0.008;
        assert!((0.75..0.83).contains(&left), "{left}");
    }
    let settings = Settings::default().fidelity(Fidelity::Reduced).faces(80);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 2)).unwrap();
    assert!(rollout.samples()[2].kinetic_energy.is_finite());

    // One within the other: no plane will do.
    let text = robot(
        &[
            link("root", &cube(0.0)),
            link("middle", ""),
            link("last", &collision("<sphere radius=\"0.03\"/>", "")),
            joint("one", "revolute", "root", "middle", limit),
            joint("two", "revolute", "middle", "last", limit),
        ]
        .concat(),
    );
    let (_folder, path) = file(&text);
    let mut scene = Scene::new(Fluid::fresh_water());
    let report = scene.add_robot(&path, &Robot::default()).unwrap().report;
    says(report.to_string(), &["\"last\" is dry", "\"root\""]);
    assert_eq!(scene.bodies[2].shape, None);
}

#[test]
fn what_is_not_used_is_said() {
    let text = robot(
        &[
            link("a", "<contact><friction value=\"1\"/></contact>"),
            link("b", ""),
            joint(
                "j",
                "revolute",
                "a",
                "b",
                "<limit lower=\"1\" upper=\"2\" effort=\"3\" velocity=\"4\"/><dynamics damping=\"0.5\" friction=\"0.1\" K=\"7\"/>",
            ),
            "<gazebo reference=\"a\"/><gazebo reference=\"b\"/>".into(),
        ]
        .concat(),
    );
    let (_folder, path) = file(&text);
    let report = Robot::default()
        .inspect(&path, &Fluid::fresh_water())
        .unwrap();
    let unused: Vec<(&str, usize)> = report
        .unused
        .iter()
        .map(|u| (u.what.as_str(), u.count))
        .collect();
    let right = [
        ("<contact> of <link>", 1),
        ("<gazebo>", 2),
        ("K of <dynamics>", 1),
        ("effort of <limit>", 1),
        ("velocity of <limit>", 1),
    ];
    assert_eq!(unused, right);
    // Where zero is outside of its limits a joint starts just inside them.
    says(report.to_string(), &["joint \"j\" starts at 1.01"]);
    let start = Robot {
        start: [("j".to_string(), 1.5)].into(),
        ..Robot::default()
    };
    assert_eq!(read(&text, &start).unwrap().bodies[1].start, [1.5]);
    let start = Robot {
        start: [("j".to_string(), 0.5)].into(),
        ..Robot::default()
    };
    refused_with(&text, &start, &["joint \"j\"", "start", "from 1 to 2"]);
}

#[test]
fn files_that_are_no_robots_are_refused() {
    refused("", &["this is not XML yet"]);
    refused("<robot", &["this is not XML yet"]);
    refused("<sdf/>", &["line 1", "SDF", "URDF"]);
    refused("<house/>", &["<robot>"]);
    refused("<robot name=\"r\"/>", &["no <link>"]);
    let macros = "<robot xmlns:xacro=\"http://ros.org/wiki/xacro\"><xacro:arm/></robot>";
    refused(macros, &["<xacro:arm>", "expanded"]);
    let deep = format!("<robot>{}{}</robot>", "<a>".repeat(400), "</a>".repeat(400));
    refused(&deep, &["line 1", "nested"]);
    let missing = Scene::from_urdf("no/such.urdf", &Robot::default()).unwrap_err();
    says(missing.to_string(), &["no/such.urdf", "read failed"]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("r.urdf");
    std::fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
    let bytes = Scene::from_urdf(&path, &Robot::default()).unwrap_err();
    says(bytes.to_string(), &["line 1", "UTF-8"]);
}

#[test]
fn elements_that_can_not_be_are_refused() {
    let inertial = |text: &str| {
        robot(&format!(
            "<link name=\"a\"><inertial>{text}</inertial></link>"
        ))
    };
    refused(
        &inertial("<mass value=\"1\"/>"),
        &["line 2", "link \"a\"", "<inertia>"],
    );
    refused(
        &inertial("<mass/>"),
        &["link \"a\"", "<inertial> needs an element <inertia>"],
    );
    let half =
        "<mass value=\"x\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/>";
    refused(
        &inertial(half),
        &["link \"a\"", "<mass>", "\"x\"", "one finite number"],
    );
    let nan = half.replace('x', "nan");
    refused(&inertial(&nan.replace("inan", "ix")), &["link \"a\""]);
    let geometry = |text: &str| robot(&link("a", &collision(text, "")));
    refused(&geometry(""), &["link \"a\"", "<geometry> is empty"]);
    refused(&geometry("<cone/>"), &["<cone> is no geometry", "capsule"]);
    refused(&geometry("<box/>"), &["<box> needs the attribute size"]);
    refused(
        &geometry("<box size=\"1 2\"/>"),
        &["size", "3 finite numbers"],
    );
    refused(
        &geometry("<box size=\"1 2 1e40\"/>"),
        &["size", "3 finite numbers", "of at most 1e30 in size"],
    );
    refused(
        &geometry("<box size=\"1 2 -3\"/>"),
        &["link \"a\"", "size[2]", "positive"],
    );
    refused(
        &geometry("<sphere radius=\"1\"/><sphere radius=\"1\"/>"),
        &["one too many"],
    );
    refused(
        &robot("<link/>"),
        &["line 2", "<link> needs the attribute name"],
    );
    refused(
        &pair("helical", ""),
        &["joint \"j\"", "\"helical\"", "known are fixed, revolute"],
    );
    refused(
        &pair("revolute", "<axis xyz=\"0 0 0\"/>"),
        &["joint \"j\"", "axis", "direction"],
    );
    refused(
        &pair("revolute", "<limit lower=\"1\" upper=\"2\" effort=\"1\"/>"),
        &["joint \"j\"", "velocity"],
    );
    refused(
        &pair(
            "revolute",
            "<limit lower=\"2\" upper=\"1\" effort=\"1\" velocity=\"1\"/>",
        ),
        &["joint \"j\"", "limit", "above"],
    );
    refused(
        &pair("planar", "<axis xyz=\"1 1 0\"/>"),
        &["joint \"j\"", "normal"],
    );
    refused(
        &pair("revolute", "<dynamics damping=\"-1\"/>"),
        &["joint \"j\"", "damping", "-1"],
    );
    refused(
        &pair("revolute", "<dynamics friction=\"-2\"/>"),
        &["joint \"j\"", "friction", "-2"],
    );
}

#[test]
fn trees_that_can_not_be_are_refused() {
    let links = |names: &[&str]| -> String { names.iter().map(|n| link(n, "")).collect() };
    let tree = |names: &[&str], joints: &[(&str, &str)]| {
        let made = joints.iter().enumerate();
        let made = made.map(|(k, (p, c))| joint(&format!("j{k}"), "revolute", p, c, ""));
        robot(&(links(names) + &made.collect::<String>()))
    };
    refused(
        &tree(&["a", "b"], &[]),
        &["2 links", "[\"a\", \"b\"]", "one tree"],
    );
    refused(
        &tree(&["a", "b"], &[("a", "b"), ("b", "a")]),
        &["loop", "\"a\"", "\"b\""],
    );
    let side = tree(&["a", "b", "c"], &[("b", "c"), ("c", "b")]);
    refused(&side, &["loop", "\"b\"", "\"c\""]);
    refused(
        &tree(&["a"], &[("a", "a")]),
        &["joint \"j0\"", "parent and child"],
    );
    let two = tree(&["a", "b", "c"], &[("a", "b"), ("a", "c"), ("b", "c")]);
    refused(&two, &["joint \"j2\"", "\"c\"", "\"j1\"", "no loops"]);
    refused(
        &tree(&["arm", "b"], &[("arn", "b")]),
        &["joint \"j0\"", "\"arn\"", "did you mean \"arm\"?"],
    );
    refused(&robot(&links(&["a", "a"])), &["link \"a\"", "two links"]);
    let twice = robot(
        &[
            links(&["a", "b", "c"]),
            joint("j", "revolute", "a", "b", ""),
            joint("j", "revolute", "a", "c", ""),
        ]
        .concat(),
    );
    refused(&twice, &["joint \"j\"", "two joints"]);
}

#[test]
fn inertias_that_can_not_be_are_refused() {
    let with = |mass: f64, moments: [f64; 3]| {
        let [x, y, z] = moments;
        format!(
            "<inertial><mass value=\"{mass}\"/><inertia ixx=\"{x}\" ixy=\"0\" ixz=\"0\" iyy=\"{y}\" iyz=\"0\" izz=\"{z}\"/></inertial>"
        )
    };
    let one = |inertial: String| robot(&format!("<link name=\"a\">{inertial}</link>"));
    refused(&one(with(-1.0, [1.0; 3])), &["link \"a\"", "mass", "-1"]);
    refused(
        &one(with(1.0, [-1.0, 1.0, 1.0])),
        &[
            "link \"a\"",
            "inertia",
            "negative principal moment",
            "density",
        ],
    );
    refused(
        &one(with(1.0, [1.0, 1.0, 3.0])),
        &["link \"a\"", "sum of the other two"],
    );
    let free = Robot::default().base(Base::Free);
    refused_with(
        &one(with(1.0, [0.0; 3])),
        &free,
        &["link \"a\"", "inertia", "zero"],
    );
    refused_with(
        &robot("<link name=\"a\"/>"),
        &free,
        &["link \"a\"", "without mass"],
    );
    // What rounding does is mended, and said.
    let (_folder, path) = file(&one(with(1.0, [1.0, 1.0, 2.01])));
    let mut scene = Scene::new(Fluid::fresh_water());
    let report = scene.add_robot(&path, &free).unwrap().report;
    scene.validate().unwrap();
    says(report.to_string(), &["link \"a\"", "was added"]);

    // Links without mass: one on the way to a mass may move, two in a row and one at the end may not.
    let chain = |massless: &[&str], names: &[&str]| {
        let mut text = String::new();
        for (k, name) in names.iter().enumerate() {
            text += &match massless.contains(name) {
                true => format!("<link name=\"{name}\"/>"),
                false => link(name, ""),
            };
            if k > 0 {
                text += &joint(&format!("to_{name}"), "revolute", names[k - 1], name, "");
            }
        }
        robot(&text)
    };
    let across = "<child link=\"c\"/><axis xyz=\"0 1 0\"/>";
    let taken = chain(&["b"], &["a", "b", "c"]).replace("<child link=\"c\"/>", across);
    read(&taken, &Robot::default()).unwrap();
    refused(
        &chain(&["c"], &["a", "b", "c"]),
        &["joint \"to_c\"", "\"c\" without mass"],
    );
    refused(
        &chain(&["b", "c"], &["a", "b", "c", "d"]),
        &["joint \"to_c\"", "\"b\" without mass"],
    );
    // A density makes up for it.
    let ball = robot(&format!(
        "<link name=\"a\">{}</link>",
        collision("<sphere radius=\"0.1\"/>", "")
    ));
    let dense = RobotLink {
        density: Some(500.0),
        ..RobotLink::default()
    };
    let scene = read(&ball, &free.clone().link("a", dense)).unwrap();
    assert_eq!(
        (scene.bodies[0].density, scene.bodies[0].mass),
        (Some(500.0), None)
    );
    let heavy = RobotLink {
        mass: Some(6.0),
        ..RobotLink::default()
    };
    let scene = read(&one(with(2.0, [1.0; 3])), &free.link("a", heavy)).unwrap();
    assert_eq!(scene.bodies[0].mass, Some(6.0));
    assert_eq!(scene.bodies[0].inertia.as_ref().unwrap()[0], 3.0);
}

/// What the error of an inertia recommends makes it go away.
#[test]
fn choices_stand_for_what_can_not_be() {
    let one = |mass: f64, moments: &str| {
        let sphere = collision("<sphere radius=\"0.1\"/>", "");
        robot(&format!(
            "<link name=\"a\"><inertial><mass value=\"{mass}\"/><inertia {moments} ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>{sphere}</link>"
        ))
    };
    let bad = one(1.0, "ixx=\"1\" iyy=\"1\" izz=\"3\"");
    refused(&bad, &["link \"a\"", "inertia", "`density`"]);
    let dense = RobotLink {
        density: Some(500.0),
        ..RobotLink::default()
    };
    let scene = read(&bad, &Robot::default().link("a", dense.clone())).unwrap();
    assert_eq!(scene.bodies[0].density, Some(500.0));
    let negative = one(-1.0, "ixx=\"-1\" iyy=\"1\" izz=\"1\"");
    refused(&negative, &["mass", "-1"]);
    read(&negative, &Robot::default().link("a", dense)).unwrap();
    let turned = RobotLink {
        inertia: Some(vec![0.01, 0.01, 0.01]),
        ..RobotLink::default()
    };
    let scene = read(&bad, &Robot::default().link("a", turned)).unwrap();
    assert_eq!(scene.bodies[0].inertia, Some(vec![0.01; 3]));
}

/// Choices that would have no effect are refused: starts of joints without a coordinate of their own, and what is a body's for a link that isn't one.
#[test]
fn choices_without_effect_are_refused() {
    let limit =
        "<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/>";
    let mimic = "<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"0.5\" effort=\"1\" velocity=\"1\"/><mimic joint=\"lead\"/>";
    let text = robot(
        &[
            link("a", ""),
            link("b", ""),
            link("c", ""),
            link("d", &collision("<sphere radius=\"0.1\"/>", "")),
            joint("lead", "revolute", "a", "b", limit),
            joint("led", "revolute", "a", "c", mimic),
            joint("still", "fixed", "a", "d", ""),
        ]
        .concat(),
    );
    let start = |joint: &str, q: f64| Robot {
        start: [(joint.to_string(), q)].into(),
        ..Robot::default()
    };
    refused_with(
        &text,
        &start("still", 0.0),
        &["joint \"still\": start", "fixed"],
    );
    refused_with(
        &text,
        &start("led", 0.1),
        &["joint \"led\": start", "\"lead\"", "independent"],
    );
    let free = start("led", 0.1).mimic(Followers::Independent);
    assert!(read(&text, &free).is_ok());
    let still = Motion::Linear {
        offset: 0.0,
        rate: 1.0,
    };
    let driven = start("lead", 0.1).driven("lead", [still]);
    refused_with(&text, &driven, &["joint \"lead\": start", "driven"]);
    // Within its own limits, not within the follower's.
    let words = ["joint \"lead\": start", "0.7", "from -1 to 0.5"];
    refused_with(&text, &start("lead", 0.7), &words);
    assert!(read(&text, &start("lead", 0.4)).is_ok());

    let choices = [
        (
            "density",
            RobotLink {
                density: Some(500.0),
                ..RobotLink::default()
            },
        ),
        (
            "center_of_mass",
            RobotLink {
                center_of_mass: Some([0.0; 3]),
                ..RobotLink::default()
            },
        ),
        (
            "inertia",
            RobotLink {
                inertia: Some(vec![1.0; 3]),
                ..RobotLink::default()
            },
        ),
        (
            "volume",
            RobotLink {
                volume: Some(1.0),
                ..RobotLink::default()
            },
        ),
        (
            "center_of_buoyancy",
            RobotLink {
                center_of_buoyancy: Some([0.0; 3]),
                ..RobotLink::default()
            },
        ),
        (
            "added_mass",
            RobotLink {
                added_mass: Some(vec![vec![0.0; 6]; 6]),
                ..RobotLink::default()
            },
        ),
    ];
    for (key, choice) in choices {
        let options = Robot::default().link("d", choice.clone());
        refused_with(&text, &options, &["link \"d\"", key, "body \"a\"", "keep"]);
        if key == "density" {
            let kept = RobotLink {
                keep: true,
                ..choice.clone()
            };
            assert!(read(&text, &Robot::default().link("d", kept)).is_ok());
            let both = Robot::default().link("a", choice);
            let mass = RobotLink {
                mass: Some(1.0),
                ..RobotLink::default()
            };
            refused_with(
                &text,
                &both.link("d", mass),
                &["link \"d\"", "mass", "density"],
            );
        }
    }
}

/// Limits with one end aren't kept, and said; versions of the format differ in what a file must say.
#[test]
fn versions_and_namespaces_are_heeded() {
    let with = |head: &str, inner: &str| {
        let joints = joint("j", "revolute", "a", "b", inner);
        format!(
            "<robot name=\"r\" {head}>\n{}{}{joints}</robot>",
            link("a", ""),
            link("b", "")
        )
    };
    let report = |text: &str| {
        let (_folder, path) = file(text);
        Robot::default()
            .inspect(&path, &Fluid::fresh_water())
            .unwrap()
    };
    let open =
        "<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"inf\" effort=\"1\" velocity=\"1\"/>";
    let said = report(&with("", open)).to_string();
    says(
        said,
        &["joint \"j\"", "lower limit alone, -1", "isn't kept"],
    );
    let newer = "version=\"1.2\"";
    let said = report(&with(newer, "<axis xyz=\"0 0 1\"/><limit upper=\"2\"/>")).to_string();
    says(said, &["joint \"j\"", "upper limit alone, 2"]);
    let turned = "<origin xyz=\"0 0 0\" quat_xyzw=\"0 0 1 0\"/>";
    let told = |head: &str| {
        let found = report(&with(head, turned));
        found
            .unused
            .iter()
            .any(|u| u.what.contains("quat_xyzw of <origin>"))
    };
    assert!(told("") && told("version=\"1.0\""));
    assert!(!told("version=\"1.1\"") && !told(newer));
    // A namespace for the whole file hides nothing from the checks.
    let spaced = with(
        "xmlns=\"http://www.ros.org\"",
        "<axis xyz=\"0 0 1\"/><dynamics damping=\"nan\"/>",
    );
    refused(&spaced, &["joint \"j\"", "damping", "nan"]);
    let spaced = with(
        "xmlns=\"http://www.ros.org\" xmlns:x=\"other\"",
        "<axis xyz=\"0 0 1\"/><x:hint/><gizmo/>",
    );
    let unused = report(&spaced).unused;
    let told: Vec<&str> = unused.iter().map(|u| u.what.as_str()).collect();
    assert_eq!(told, ["<gizmo> of <joint>", "<hint> of <joint>"]);
}

#[test]
fn joints_that_follow_have_their_leaders_coordinate_or_their_own() {
    let mimics = |of: &str, other: &str| {
        robot(
            &[
                link("a", ""),
                link("b", ""),
                link("c", ""),
                joint("one", "revolute", "a", "b", other),
                joint(
                    "two",
                    "revolute",
                    "a",
                    "c",
                    &format!("<mimic joint=\"{of}\"/>"),
                ),
            ]
            .concat(),
        )
    };
    let own = Robot::default().mimic(Followers::Independent);
    let led = read(&mimics("one", ""), &Robot::default()).unwrap();
    assert_eq!((led.coordinates(), led.controls()), (8, 1));
    let mimic = led.bodies[2].mimic.as_ref().unwrap();
    assert_eq!(
        (mimic.body.as_str(), mimic.ratio, mimic.offset),
        ("b", 1.0, 0.0)
    );
    assert_eq!(read(&mimics("one", ""), &own).unwrap().coordinates(), 9);
    for options in [Robot::default(), own] {
        refused_with(&mimics("two", ""), &options, &["joint \"two\"", "itself"]);
        refused_with(
            &mimics("six", ""),
            &options,
            &["joint \"two\"", "no such joint"],
        );
        let circle = mimics("one", "<mimic joint=\"two\"/>");
        refused_with(&circle, &options, &["mimic", "follows this one"]);
    }
}

#[test]
fn choices_of_what_is_not_there_are_refused() {
    let text = pair("revolute", "");
    let options = Robot::default().link("z", RobotLink::default());
    refused_with(&text, &options, &["links", "\"z\"", "\"b\""]);
    let options = Robot {
        start: [("z".to_string(), 0.0)].into(),
        ..Robot::default()
    };
    refused_with(&text, &options, &["start", "\"z\"", "\"j\""]);
    let options = Robot::default().at([f64::NAN, 0.0, 0.0]);
    refused_with(&text, &options, &["position", "finite"]);
    let options = Robot {
        faces: Some(3),
        ..Robot::default()
    };
    refused_with(&text, &options, &["faces", "320"]);
    let (_folder, path) = file(&text);
    let mut scene = Scene::from_urdf(&path, &Robot::default()).unwrap();
    let again = scene.add_robot(&path, &Robot::default()).unwrap_err();
    says(again.to_string(), &["\"a\"", "prefix"]);
    scene
        .add_robot(
            &path,
            &Robot::default().prefix("second_").at([1.0, 0.0, 0.0]),
        )
        .unwrap();
    scene.validate().unwrap();
    assert_eq!(scene.bodies[3].name, "second_b");
    assert_eq!(scene.bodies[2].placement.position, [1.0, 0.0, 0.0]);
}

/// Robots of a scene file mix with bodies, and what is read is written as bodies.
#[test]
fn scene_files_have_robots() {
    let (folder, _) = file(&pair(
        "prismatic",
        "<limit lower=\"1\" upper=\"2\" effort=\"1\" velocity=\"1\"/>",
    ));
    let text = r#"
        time_step = 0.01
        steps = 2
        [fluid]
        density = 998.0
        [[bodies]]
        name = "ball"
        shape = { kind = "sphere", radius = 0.1 }
        density = 500.0
        [[robot]]
        urdf = "robot.urdf"
        base = "fixed"
        position = [0.0, 1.0, 0.0]
        prefix = "r/"
        start = { j = 1.25 }
        links = { b = { mass = 3.0 } }
        [[sites]]
        name = "eye"
        body = "r/b"
    "#;
    let scene = Scene::from_toml(text, folder.path()).unwrap();
    scene.validate().unwrap();
    let names: Vec<&str> = scene.bodies.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["ball", "r/a", "r/b"]);
    assert_eq!(scene.bodies[2].mass, Some(3.0));
    let again = Scene::from_toml(&scene.to_toml().unwrap(), ".").unwrap();
    assert_eq!(again, scene);
    let simulator =
        Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap();
    assert_eq!(simulator.start().0[7], 1.25);

    let wrong = |from: &str, to: &str, words: &[&str]| {
        let scene = Scene::from_toml(&text.replace(from, to), folder.path());
        says(scene.unwrap_err().to_string(), words);
    };
    wrong(
        "prefix",
        "prefox",
        &["line 14", "robot", "prefox", "prefix"],
    );
    wrong("\"fixed\"", "\"tied\"", &["base", "tied", "free"]);
    wrong("urdf = \"robot.urdf\"", "", &["robot[0]", "urdf"]);
    wrong("robot.urdf", "rabat.urdf", &["rabat.urdf", "read failed"]);
    let mut unread = Scene::new(Fluid::fresh_water());
    unread.robots.push(Robot::default());
    says(
        unread.validate().unwrap_err().to_string(),
        &["robots", "add_robot"],
    );
}

#[test]
fn bodies_start_where_they_say() {
    let mut scene = read(&pair("revolute", ""), &Robot::default()).unwrap();
    scene.bodies[1].start = vec![0.5];
    scene.bodies[0].start = vec![1.0, 2.0, 3.0, 0.0, 1.0, 0.0, 0.0];
    let start = |scene: &Scene| {
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let simulator = Simulator::new(scene, settings).unwrap();
        simulator.start().0.clone()
    };
    let right = [1.0, 2.0, 3.0, 0.0, 1.0, 0.0, 0.0, 0.5];
    assert_eq!(start(&scene), DVector::from_row_slice(&right));
    // `initial.q` is for all.
    scene.initial.q = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.25];
    assert_eq!(start(&scene)[7], 0.25);
    scene.initial.q.clear();
    let refused = |change: &dyn Fn(&mut Scene), words: &[&str]| {
        let mut scene = scene.clone();
        change(&mut scene);
        says(scene.validate().unwrap_err().to_string(), words);
    };
    refused(
        &|s| s.bodies[1].start.push(1.0),
        &["body \"b\": start", "needs 1"],
    );
    refused(
        &|s| s.bodies[1].start[0] = f64::NAN,
        &["body \"b\": start", "finite"],
    );
    refused(
        &|s| s.bodies[0].start[4] = 2.0,
        &["body \"a\": start", "unit quaternion"],
    );
    refused(
        &|s| s.bodies[1].limits = Some([0.6, 1.0]),
        &["body \"b\": start", "from 0.6 to 1"],
    );
}

/// The example: neutral to a tenth of a newton, its sites in place, and its gradient right.
#[test]
fn the_example_is_nearly_neutral() {
    let path = root().join("examples/rov.urdf");
    let report = Robot::default()
        .inspect(&path, &Fluid::fresh_water())
        .unwrap();
    assert_eq!(report.bodies.len(), 5);
    assert!((report.buoyancy - report.weight).abs() < 0.2, "{report}");
    assert_eq!(report.sites.len(), 9);
    assert!(report.implausible.is_empty(), "{report}");
    assert!(report.meshes.is_empty());
    let shapes: Vec<&str> = report.bodies.iter().map(|b| b.shape.as_str()).collect();
    assert_eq!(shapes, ["box", "cylinder", "capsule", "capsule", "box"]);
}

/// Through a chain: q = −2 (3 q' + 0.1) + 0.5; what followers lose and may not pass, their leader does.
#[test]
fn chains_of_followers_lead_to_one_joint() {
    let range = |lower: f64, upper: f64, more: &str| {
        format!("<limit lower=\"{lower}\" upper=\"{upper}\" effort=\"1\" velocity=\"1\"/>{more}")
    };
    let damped = "<dynamics damping=\"0.5\" friction=\"0.1\"/>";
    let text = robot(
        &[
            link("a", ""),
            link("b", ""),
            link("c", ""),
            link("d", ""),
            joint(
                "last",
                "revolute",
                "a",
                "d",
                &range(
                    -1.0,
                    1.0,
                    &format!("<mimic joint=\"middle\" multiplier=\"-2\" offset=\"0.5\"/>{damped}"),
                ),
            ),
            joint(
                "middle",
                "revolute",
                "a",
                "c",
                &range(
                    -9.0,
                    9.0,
                    "<mimic joint=\"first\" multiplier=\"3\" offset=\"0.1\"/>",
                ),
            ),
            joint("first", "revolute", "a", "b", &range(-0.3, 2.0, damped)),
        ]
        .concat(),
    );
    let scene = read(&text, &Robot::default()).unwrap();
    let body = |name: &str| &scene.bodies[scene.body(name).unwrap().0];
    let mimic = body("d").mimic.as_ref().unwrap();
    assert_eq!(mimic.body, "b");
    assert!((mimic.ratio + 6.0).abs() < 1e-12 && (mimic.offset - 0.3).abs() < 1e-12);
    let passive = body("b").passive.unwrap();
    assert!((passive.damping - 0.5 * 37.0).abs() < 1e-12);
    assert!((passive.friction - 0.7).abs() < 1e-12);
    let [lower, upper] = body("b").limits.unwrap();
    assert!((lower + 0.7 / 6.0).abs() < 1e-12 && (upper - 1.3 / 6.0).abs() < 1e-12);
}

/// Joints that motions drive are no controls, and stop nowhere; what is known of a link's body takes the place of what the file and its surface say.
#[test]
fn joints_are_driven_and_bodies_are_as_they_are_weighed() {
    let limits = r#"<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/><dynamics damping="0.2"/>"#;
    let text = pair("revolute", limits);
    let motion = Motion::through(vec![0.0, 1.0, 2.0], vec![0.1, 0.5, 0.2]).unwrap();
    let added: Vec<Vec<f64>> = (0..6)
        .map(|i| (0..6).map(|j| f64::from(u8::from(i == j)) * 0.01).collect())
        .collect();
    let weighed = RobotLink {
        mass: Some(3.0),
        center_of_mass: Some([0.0, 0.0, -0.1]),
        inertia: Some(vec![0.1, 0.2, 0.2]),
        volume: Some(2.5e-3),
        center_of_buoyancy: Some([0.0, 0.01, 0.0]),
        added_mass: Some(added.clone()),
        ..RobotLink::default()
    };
    let options = Robot::default().driven("j", [motion.clone()]);
    let options = options.link("a", weighed);
    let scene = read(&text, &options).unwrap();
    let [a, b] = [&scene.bodies[0], &scene.bodies[1]];
    assert_eq!(b.motion, Some(vec![motion]));
    assert!(!b.actuated && b.limits.is_none() && b.passive.is_none());
    assert_eq!(
        (a.mass, a.center_of_mass),
        (Some(3.0), Some([0.0, 0.0, -0.1]))
    );
    assert_eq!(a.inertia, Some(vec![0.1, 0.2, 0.2]));
    assert_eq!(
        (a.volume, a.center_of_buoyancy),
        (Some(2.5e-3), Some([0.0, 0.01, 0.0]))
    );
    assert_eq!(a.added_mass, Some(added));
    let settings = Settings::default()
        .fidelity(Fidelity::Isolated)
        .time_step(0.01);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let rollout = simulator
        .rollout(&Controls::zeros(&simulator, 100))
        .unwrap();
    assert!((rollout.q()[(7, 100)] - 0.5).abs() < 1e-12);
    let wrong = Robot::default().driven(
        "k",
        [Motion::Linear {
            offset: 0.0,
            rate: 1.0,
        }],
    );
    says(read(&text, &wrong).unwrap_err(), &["motions", "k", "j"]);
    let zeros = |joint: &str| Robot {
        zeros: [(joint.to_string(), 0.1)].into(),
        ..Robot::default()
    };
    says(read(&text, &zeros("k")).unwrap_err(), &["zeros", "k", "j"]);
    // Joints that don't move, or follow others, can't be driven: nothing is passed over.
    let still = pair("fixed", "");
    let linear = || Motion::Linear {
        offset: 0.0,
        rate: 1.0,
    };
    let driven = |joint: &str| Robot::default().driven(joint, [linear()]);
    says(read(&still, &driven("j")).unwrap_err(), &["motions", "j"]);
    says(read(&still, &zeros("j")).unwrap_err(), &["zeros", "j"]);
    let axis = r#"<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>"#;
    let follower = format!(r#"{axis}<mimic joint="j"/>"#);
    let chain = [
        link("a", ""),
        link("b", ""),
        link("c", ""),
        joint("j", "revolute", "a", "b", axis),
        joint("k", "revolute", "b", "c", &follower),
    ];
    let chain = robot(&chain.concat());
    says(
        read(&chain, &driven("k")).unwrap_err(),
        &["motions", "k", "follows another"],
    );
    says(
        read(&chain, &zeros("k")).unwrap_err(),
        &["zeros", "k", "follows another"],
    );
    assert!(read(&chain, &driven("j")).is_ok());
    // What is refused leaves nothing of the robot behind: the next one needs no other names.
    let (_folder, path) = file(&chain);
    let mut scene = Scene::new(Fluid::fresh_water());
    assert!(scene.add_robot(&path, &driven("k")).is_err() && scene.bodies.is_empty());
    assert_eq!(
        scene.add_robot(&path, &driven("j")).unwrap().bodies.len(),
        3
    );
}
