//! Robots in URDF files: what of them is decided by more than one element, what isn't read, and what reports and runs tell.

use crate::robots::{
    INERTIAL, collision, file, joint, link, pair, read, refused, refused_with, robot,
};
use crate::support::says;
use hydrograd::scene::{Base, Motion, Robot, RobotLink, RobotReport, Scene};
use hydrograd::{Fidelity, Fluid, Settings, Simulator};
use nalgebra::{UnitQuaternion, Vector3};

fn told(text: &str, options: &Robot) -> RobotReport {
    let (_folder, path) = file(text);
    options.inspect(&path, &Fluid::fresh_water()).unwrap()
}

fn inertial(mass: f64, moments: [f64; 3]) -> String {
    let [x, y, z] = moments;
    format!(
        "<inertial><mass value=\"{mass}\"/><inertia ixx=\"{x}\" ixy=\"0\" ixz=\"0\" iyy=\"{y}\" iyz=\"0\" izz=\"{z}\"/></inertial>"
    )
}

/// Elements of other namespaces, and colours, are as if they weren't there, whatever is in them.
#[test]
fn what_is_not_read_can_not_be_wrong() {
    let strange =
        |inner: &str| format!("<robot name=\"r\" xmlns:x=\"http://other\">{inner}</robot>");
    let x_joint = joint("j", "revolute", "a", "b", "").replace("<joint", "<x:joint");
    let x_joint = x_joint.replace("</joint", "</x:joint");
    let two = [link("a", ""), link("b", "")].concat();
    refused(
        &strange(&[&two[..], &x_joint].concat()),
        &["no joint", "2 links"],
    );
    let whole = [
        &two[..],
        "<x:link name=\"zz\"/>",
        &joint("j", "continuous", "a", "b", "<x:axis/><x:axis/>"),
    ];
    let report = told(&strange(&whole.concat()), &Robot::default());
    assert_eq!(report.bodies.len(), 2);
    let unused: Vec<&str> = report.unused.iter().map(|u| u.what.as_str()).collect();
    let right = [
        "<axis> of <joint>, of another namespace",
        "<link>, of another namespace",
    ];
    assert_eq!(unused, right);
    let materials = [
        "<material name=\"m\"><texture/></material>",
        "<material/>",
        "<material name=\"m\"><color rgba=\"1 1 1\"/></material>",
    ];
    for material in materials {
        let seen =
            format!("<visual><geometry><sphere radius=\"0.1\"/></geometry>{material}</visual>");
        let report = told(
            &robot(&[&link("a", &seen), material].concat()),
            &Robot::default(),
        );
        says(report.to_string(), &["not used: <material> of <visual>"]);
    }
    // What stands in names stays what it is.
    let report = told(&robot(&link("a &lt;&quot;&amp;", "")), &Robot::default());
    assert_eq!(report.bodies[0].body, "a <\"&");
}

/// A quaternion next to where roll and yaw are one is what it is, and turns once.
#[test]
fn quaternions_are_taken_to_the_last_digits() {
    let with = |turn: &str| {
        let origin = format!("<origin xyz=\"0 0 0\" {turn}/>");
        pair("fixed", &origin).replace("name=\"r\"", "name=\"r\" version=\"1.1\"")
    };
    for angle in [1.5678, 1.570_797, -1.5705, 0.3] {
        let right = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle);
        let [x, y, z, w] = right.coords.into();
        let turn = format!("quat_xyzw=\"{x} {y} {z} {w}\"");
        let scene = read(&with(&turn), &Robot::default()).unwrap();
        let found = UnitQuaternion::from_scaled_axis(scene.sites[0].placement.rotation.into());
        assert!(found.angle_to(&right) < 1e-7, "{angle}: {found}");
        let found = found.inverse() * right;
        assert!(found.imag().norm() < 1e-14, "{angle}: {found}");
    }
    refused(
        &with("quat_xyzw=\"0 0 0 0\""),
        &["joint \"j\"", "quat_xyzw", "zero"],
    );
    let both = with("quat_xyzw=\"0 0 0 1\" rpy=\"0 0 1\"");
    refused(&both, &["joint \"j\"", "rpy and quat_xyzw"]);
}

/// Fixed joints that follow each other end no search for a leader.
#[test]
fn circles_of_followers_are_refused() {
    let follow = |joint: &str| format!("<mimic joint=\"{joint}\"/>");
    let text = [
        link("a", ""),
        link("b", ""),
        "<link name=\"c\"/><link name=\"d\"/>".into(),
        joint("j1", "revolute", "a", "b", &follow("j2")),
        joint("j2", "fixed", "a", "c", &follow("j3")),
        joint("j3", "fixed", "a", "d", &follow("j2")),
    ];
    refused(
        &robot(&text.concat()),
        &["joint \"j1\"", "mimic", "circle", "[\"j2\", \"j3\"]"],
    );
}

/// An inertia that can't be counts where it is a body's; beside what it folds with it may be nothing.
#[test]
fn inertias_are_those_of_bodies() {
    let dummy = format!(
        "<link name=\"base\">{}</link>",
        inertial(1e-6, [1e-6, 0.0, 0.0])
    );
    refused(
        &robot(&dummy),
        &["link \"base\"", "inertia", "sum of the other two"],
    );
    let whole = [
        &dummy[..],
        &link("trunk", ""),
        &joint("j", "fixed", "base", "trunk", ""),
    ];
    let whole = robot(&whole.concat());
    says(
        told(&whole, &Robot::default()).to_string(),
        &[
            "note: link \"base\"",
            "no distribution of mass",
            "body \"base\"",
        ],
    );
    read(&whole, &Robot::default()).unwrap();
    let bad = format!(
        "<link name=\"trunk\">{}</link>",
        inertial(1.0, [3.0, 1.0, 1.0])
    );
    let both = [&dummy[..], &bad, &joint("j", "fixed", "base", "trunk", "")];
    refused(&robot(&both.concat()), &["link \"base\"", "inertia"]);
}

/// What stands in the world at fixed joints are bodies of their own, which swallow nothing between them, and float nobody.
#[test]
fn static_links_are_no_one_body() {
    let pillar = |name: &str, x: f64| {
        let shape = collision("<box size=\"0.2 0.2 1\"/>", "");
        let origin = format!("<origin xyz=\"{x} 0 0\"/>");
        format!(
            "<link name=\"{name}\">{shape}</link>{}",
            joint(&format!("to {name}"), "fixed", "world", name, &origin)
        )
    };
    let gantry = link("gantry", &collision("<sphere radius=\"0.1\"/>", ""));
    let slide = "<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" velocity=\"1\"/>";
    let text = [
        "<link name=\"world\"/>".to_string(),
        pillar("pillar", 1.0),
        pillar("rack", -1.0),
        gantry,
        joint("slide", "prismatic", "world", "gantry", slide),
    ];
    let text = robot(&text.concat());
    let scene = read(&text, &Robot::default()).unwrap();
    let wet: Vec<&str> = (scene.bodies.iter())
        .filter(|b| b.shape.is_some())
        .map(|b| b.name.as_str())
        .collect();
    assert_eq!(wet, ["pillar", "rack", "gantry"]);
    let report = told(&text, &Robot::default());
    assert!((report.bodies[1].volume - 0.04).abs() < 1e-12);
    assert!(!report.to_string().contains("is dry"), "{report}");
    // 4.18 kg of water beside 2 kg.
    says(
        report.to_string(),
        &["what isn't fixed to the world rises by 21.38"],
    );
    Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap();
    // A base without mass that floats with what is fixed to it is one body with that.
    let floats = [
        "<link name=\"base\"/>",
        &link("trunk", &collision("<sphere radius=\"0.1\"/>", "")),
        &joint("j", "fixed", "base", "trunk", ""),
    ];
    let scene = read(&robot(&floats.concat()), &Robot::default()).unwrap();
    assert_eq!(scene.bodies.len(), 1);
}

/// A simulator tells what the import took out of the water.
#[test]
fn runs_tell_what_is_dry() {
    let within = [
        link("a", &collision("<box size=\"0.4 0.4 0.4\"/>", "")),
        link("b", ""),
        link("c", &collision("<sphere radius=\"0.03\"/>", "")),
        joint("j", "continuous", "a", "b", ""),
        joint("k", "continuous", "b", "c", ""),
    ];
    let (folder, _) = file(&robot(&within.concat()));
    let text =
        "time_step = 0.01\nsteps = 1\n[fluid]\ndensity = 998.0\n[[robot]]\nurdf = \"robot.urdf\"\n";
    let scene = Scene::from_toml(text, folder.path()).unwrap();
    assert_eq!(scene.imports.reports().len(), 1);
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    let simulator = Simulator::new(&scene, settings.clone()).unwrap();
    says(
        simulator.warnings().join("\n"),
        &["robot \"r\"", "body \"c\" is dry", "lies in body \"a\""],
    );
    let dry = Scene::from_toml(&text.replace("998.0", "0.0"), folder.path()).unwrap();
    let simulator = Simulator::new(&dry, settings).unwrap();
    assert!(!simulator.warnings().join("\n").contains("is dry"));
}

/// An arm that its motion or its zero swings away from another link at the start isn't cut by it.
#[test]
fn what_overlaps_is_told_where_the_robot_starts() {
    let ball = |x: f64| {
        collision(
            "<sphere radius=\"0.1\"/>",
            &format!("<origin xyz=\"{x} 0 0\"/>"),
        )
    };
    let text = [
        link("base", &ball(0.0)),
        link("arm", &ball(0.5)),
        link("post", &ball(0.5)),
        joint("j", "continuous", "base", "arm", "<axis xyz=\"0 0 1\"/>"),
        joint("k", "continuous", "base", "post", "<axis xyz=\"1 0 0\"/>"),
    ];
    let text = robot(&text.concat());
    let is_told = |options: &Robot| told(&text, options).to_string().contains("is dry");
    assert!(is_told(&Robot::default()));
    let away = Motion::Sine {
        offset: 1.5,
        amplitude: 0.02,
        frequency: 6.0,
        phase: 0.0,
    };
    assert!(!is_told(&Robot::default().driven("j", [away])));
    let zero = Robot {
        zeros: [("j".to_string(), 1.5)].into(),
        ..Robot::default()
    };
    assert!(!is_told(&zero));
    let start = Robot {
        start: [("j".to_string(), 1.5)].into(),
        ..Robot::default()
    };
    assert!(!is_told(&start));
}

/// The report is of the bodies that the scene gets: what is chosen for them counts.
#[test]
fn reports_are_of_what_is_chosen() {
    let text = robot(&link("a", &collision("<sphere radius=\"0.1\"/>", "")));
    let weighed = RobotLink {
        mass: Some(3.0),
        center_of_mass: Some([0.0, 0.0, -0.1]),
        volume: Some(2.5e-3),
        center_of_buoyancy: Some([0.0, 0.01, 0.0]),
        ..RobotLink::default()
    };
    let report = told(&text, &Robot::default().link("a", weighed));
    let body = &report.bodies[0];
    assert_eq!((report.volume, body.volume), (2.5e-3, 2.5e-3));
    assert_eq!(body.center_of_mass, [0.0, 0.0, -0.1]);
    assert_eq!(body.center_of_buoyancy, Some([0.0, 0.01, 0.0]));
    assert!((report.center_of_mass[2] + 0.1).abs() < 1e-15);
    assert!((report.center_of_buoyancy.unwrap()[1] - 0.01).abs() < 1e-15);
    assert!((report.buoyancy - 998.0 * 9.81 * 2.5e-3).abs() < 1e-9);
    says(report.to_string(), &["sinks by 4.95"]);
    // A dry one is buoyant by what is chosen, where its mass is.
    let buoyant = RobotLink {
        volume: Some(1e-3),
        ..RobotLink::default()
    };
    let report = told(&robot(&link("a", "")), &Robot::default().link("a", buoyant));
    assert_eq!(report.volume, 1e-3);
    assert_eq!(report.center_of_buoyancy, Some([0.0; 3]));
}

/// Ranges and losses that a kind of joint has no use for are told.
#[test]
fn joints_tell_what_they_have_no_use_for() {
    let limit = "<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" velocity=\"1\"/>";
    let both = format!("{limit}<dynamics damping=\"3\"/>");
    for kind in ["planar", "floating"] {
        let said = told(&pair(kind, &both), &Robot::default()).to_string();
        says(
            said,
            &[&format!("joint \"j\" is {kind}"), "<limit>", "<dynamics>"],
        );
    }
    let said = told(&pair("continuous", &both), &Robot::default()).to_string();
    says(&said, &["joint \"j\" is continuous", "range (<limit>)"]);
    assert!(!said.contains("<dynamics>"));
    let said = told(&pair("planar", "<axis xyz=\"0 0 1\"/>"), &Robot::default());
    assert!(!said.to_string().contains("is planar"));
}

#[test]
fn packages_may_be_named_after_three_slashes() {
    let text = robot(&link(
        "a",
        &collision("<mesh filename=\"package:///robots/cube.obj\"/>", ""),
    ));
    let (folder, path) = file(&text);
    let package = folder.path().join("robots");
    std::fs::create_dir(&package).unwrap();
    let cube = include_str!("../fuzz/corpus/mesh/cube.obj");
    std::fs::write(package.join("cube.obj"), cube).unwrap();
    let report = Robot::default()
        .inspect(&path, &Fluid::fresh_water())
        .unwrap();
    assert!((report.volume - 1.0).abs() < 1e-9);
}

/// What would leave a mass matrix without an inverse is refused, with what helps.
#[test]
fn motions_that_nothing_tells_apart_are_refused() {
    let about = |axis: &str, x: f64| format!("<origin xyz=\"{x} 0 0\"/><axis xyz=\"{axis}\"/>");
    let arm = |x: f64| {
        let arm = [
            "<link name=\"root\"/>",
            &link("arm", ""),
            &joint("j", "continuous", "root", "arm", &about("0 0 1", x)),
        ];
        robot(&arm.concat())
    };
    read(&arm(0.0), &Robot::default()).unwrap();
    let free = Robot::default().base(Base::Free);
    refused_with(
        &arm(0.0),
        &free,
        &["link \"root\"", "joint \"j\"", "base = \"fixed\""],
    );
    let chain = |axis: &str, x: f64| {
        let chain = [
            &link("root", "")[..],
            "<link name=\"mid\"/>",
            &format!("<link name=\"arm\">{INERTIAL}</link>"),
            &joint("j0", "continuous", "root", "mid", &about("0 0 1", 0.0)),
            &joint("j", "continuous", "mid", "arm", &about(axis, x)),
        ];
        robot(&chain.concat())
    };
    refused(
        &chain("0 0 1", 0.0),
        &["joint \"j0\"", "\"mid\"", "joint \"j\""],
    );
    let end = "</joint>\n\n</robot>";
    let led = chain("0 0 1", 0.0).replace(end, &format!("<mimic joint=\"j0\"/>{end}"));
    assert!(led.contains("mimic"));
    read(&led, &Robot::default()).unwrap();
    // Axes beside each other, or across, are two motions.
    for text in [chain("0 0 1", 0.3), chain("0 1 0", 0.0)] {
        let scene = read(&text, &Robot::default()).unwrap();
        Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap();
    }
    let floats = chain("0 0 1", 0.3).replacen("continuous", "floating", 1);
    refused(&floats, &["joint \"j0\"", "\"mid\"", "joint \"j\""]);
}

/// A bowl, its inside so wide as part of its outside: closed, and with few faces inside and outside cross.
fn bowl(inner: f64) -> String {
    bowl_of(24, 16, inner)
}

fn bowl_of(around: usize, along: usize, inner: f64) -> String {
    let inwards = (1..=along).map(|k| (1.0, k));
    let back = (1..=along).rev().map(|k| (inner, k));
    let mut text = String::from("v 0 0 1\n");
    for (radius, k) in inwards.chain(back) {
        let angle = 1.9 * k as f64 / along as f64;
        for j in 0..around {
            let turn = std::f64::consts::TAU * j as f64 / around as f64;
            let r = radius * angle.sin();
            let (x, y, z) = (r * turn.cos(), r * turn.sin(), radius * angle.cos());
            text += &format!("v {x} {y} {z}\n");
        }
    }
    text += &format!("v 0 0 {inner}\n");
    let (rings, last) = (2 * along, 2 * along * around + 2);
    let at = |ring: usize, j: usize| 2 + ring * around + j % around;
    for j in 0..around {
        text += &format!("f 1 {} {}\n", at(0, j), at(0, j + 1));
        for ring in 0..rings - 1 {
            let [a, b] = [at(ring, j), at(ring, j + 1)];
            let [c, d] = [at(ring + 1, j), at(ring + 1, j + 1)];
            text += &format!("f {a} {c} {d}\nf {a} {d} {b}\n");
        }
        text += &format!("f {} {last} {}\n", at(rings - 1, j), at(rings - 1, j + 1));
    }
    text
}

/// What is told of a link of such a mesh, of which 20 faces are asked for.
fn bowl_told(bowl: &str) -> String {
    let mesh = collision("<mesh filename=\"bowl.obj\"/>", "");
    let (folder, path) = file(&robot(&link("a", &mesh)));
    std::fs::write(folder.path().join("bowl.obj"), bowl).unwrap();
    let options = Robot {
        faces: Some(20),
        ..Robot::default()
    };
    let said = options.inspect(&path, &Fluid::fresh_water()).unwrap();
    said.to_string()
}

/// A closed mesh that can't be had with few faces has more, and that is said.
#[test]
fn closed_meshes_are_told_as_that() {
    let said = bowl_told(&bowl(0.9));
    says(
        &said,
        &[
            "closed: used itself",
            "closed mesh, 160 faces",
            "its surface has 160 faces, where 20 are asked for (`faces`)",
            "lose its form",
        ],
    );
}

/// A closed mesh keeps its volume with the faces that it is given; where its form isn't kept, that is said.
#[test]
fn closed_meshes_keep_their_volume() {
    let mesh = collision("<mesh filename=\"bowl.obj\"/>", "");
    let (folder, path) = file(&robot(&link("a", &mesh)));
    std::fs::write(folder.path().join("bowl.obj"), bowl(0.9)).unwrap();
    let with = |faces: usize| {
        let options = Robot {
            faces: Some(faces),
            ..Robot::default()
        };
        options.inspect(&path, &Fluid::fresh_water()).unwrap()
    };
    let whole = with(1536).volume;
    for faces in [60, 100, 160, 320, 640] {
        let report = with(faces);
        let said = report.to_string();
        println!(
            "{faces}: {} of it, {}",
            report.volume / whole,
            report.bodies[0].shape
        );
        if report.bodies[0].shape.contains("closed mesh") {
            assert!(
                (report.volume / whole - 1.0).abs() < 1e-9,
                "{faces}: {said}"
            );
        } else {
            says(&said, &["convex hull of its mesh"]);
        }
    }
}

/// A closed mesh whose faces all point inward is turned round, not laid in its hull.
#[test]
fn meshes_inside_out_are_turned_round() {
    let mesh = collision("<mesh filename=\"bowl.obj\"/>", "");
    let (folder, path) = file(&robot(&link("a", &mesh)));
    let with = |text: String| {
        std::fs::write(folder.path().join("bowl.obj"), text).unwrap();
        let report = Robot::default().inspect(&path, &Fluid::fresh_water());
        report.unwrap()
    };
    let right = with(bowl(0.9));
    let turn = |line: &str| match line.split(' ').collect::<Vec<_>>()[..] {
        ["f", a, b, c] => format!("f {a} {c} {b}\n"),
        _ => format!("{line}\n"),
    };
    let turned = with(bowl(0.9).lines().map(turn).collect());
    assert!((turned.volume / right.volume - 1.0).abs() < 1e-9);
    says(turned.to_string(), &["turned right side out"]);
    assert!(!right.to_string().contains("turned right side out"));
}

/// Of a closed mesh of very many faces that can't be had with few the hull stands for it, and that isn't laid to its not being closed.
#[test]
fn closed_meshes_too_fine_to_keep_are_told_as_that() {
    let said = bowl_told(&bowl_of(96, 60, 0.9995));
    says(
        &said,
        &[
            "convex hull of its mesh",
            "it is closed, but has 23040 faces",
            "with about 20 (`faces`)",
            "pass through each other",
        ],
    );
    assert!(!said.contains("closed surface"), "{said}");
}
