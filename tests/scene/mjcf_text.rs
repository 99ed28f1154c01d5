//! The text of MJCF files: files that include others, classes of defaults, and attributes.

use crate::support::says;
use hydrograd::Fluid;
use hydrograd::scene::{Robot, RobotReport, Scene, Shape};
use nalgebra::{UnitQuaternion, Vector3};
use tempfile::TempDir;

/// Files in a folder; the first one is read.
fn read(files: &[(&str, &str)]) -> hydrograd::Result<(Scene, RobotReport, TempDir)> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    let mut scene = Scene::new(Fluid::fresh_water());
    let added = scene.add_robot(folder.path().join(files[0].0), &Robot::default())?;
    scene.validate()?;
    Ok((scene, added.report, folder))
}

fn one(inner: &str) -> hydrograd::Result<(Scene, RobotReport)> {
    let text = format!("<mujoco>\n{inner}\n</mujoco>");
    read(&[("robot.xml", &text)]).map(|(scene, report, _)| (scene, report))
}

#[track_caller]
fn refused(inner: &str, words: &[&str]) {
    says(one(inner).unwrap_err(), words);
}

#[track_caller]
fn body<'s>(scene: &'s Scene, name: &str) -> &'s hydrograd::scene::Body {
    &scene.bodies[scene.body(name).unwrap_or_else(|| panic!("no {name:?}")).0]
}

#[track_caller]
fn same(scene: &Scene, other: &Scene) {
    assert_eq!(scene.bodies, other.bodies);
    assert_eq!(scene.sites, other.sites);
}

/// What is included stands where it is included: within bodies, classes and assets, whatever the included file's outermost element is called, in files within files, and before the
/// compiler and the classes that it needs.
#[test]
fn files_are_included_where_they_stand() {
    let whole = r#"<mujoco model="r"><compiler angle="radian"/>
        <default><joint damping="0.3"/><default class="thick"><geom size="0.2"/></default></default>
        <asset><mesh name="m" file="cube.obj" scale="0.1 0.1 0.1"/></asset>
        <worldbody><body name="a"><freejoint/><geom class="thick"/>
          <body name="b" pos="1 0 0" euler="0 0 1.5"><joint name="j" axis="0 1 0" range="-1 1"/><geom type="mesh" mesh="m"/><site name="s" pos="0 0 1"/></body>
          <body name="c" pos="-1 0 0"><joint name="k" axis="0 1 0"/><geom class="thick"/></body>
        </body></worldbody></mujoco>"#;
    let cube = include_str!("../fuzz/corpus/mesh/cube.obj");
    let (scene, ..) = read(&[("r.xml", whole), ("cube.obj", cube)]).unwrap();
    let main = r#"<mujoco model="r">
        <worldbody><body name="a"><freejoint/><geom class="thick"/><include file="parts/arms.xml"/></body></worldbody>
        <include file="parts/settings.xml"/>
        <asset><include file="parts/assets.xml"/></asset></mujoco>"#;
    let arms = r#"<arms><include file="b.xml"/>
        <body name="c" pos="-1 0 0"><joint name="k" axis="0 1 0"/><geom class="thick"/></body></arms>"#;
    let b = r#"<mujocoinclude><body name="b" pos="1 0 0" euler="0 0 1.5"><joint name="j" axis="0 1 0" range="-1 1"/>
        <geom type="mesh" mesh="m"/><site name="s" pos="0 0 1"/></body></mujocoinclude>"#;
    let settings = r#"<mujoco><compiler angle="radian"/>
        <default><include file="parts/classes.xml"/></default></mujoco>"#;
    let classes =
        r#"<x><joint damping="0.3"/><default class="thick"><geom size="0.2"/></default></x>"#;
    let assets = r#"<x><mesh name="m" file="cube.obj" scale="0.1 0.1 0.1"/></x>"#;
    let files = [
        ("r.xml", main),
        ("cube.obj", cube),
        ("parts/arms.xml", arms),
        // Beside the file that includes it, or from the main file's folder.
        ("parts/b.xml", b),
        ("parts/settings.xml", settings),
        ("parts/classes.xml", classes),
        ("parts/assets.xml", assets),
    ];
    let (included, report, _folder) = read(&files).unwrap();
    same(&included, &scene);
    assert_eq!(report.robot, "r");
    assert_eq!(body(&scene, "b").limits, Some([-1.0, 1.0]));
    assert_eq!(body(&scene, "b").passive.unwrap().damping, 0.3);
}

#[test]
fn files_that_can_not_be_included_are_refused() {
    let main = r#"<mujoco><worldbody><body name="a"><geom size="0.1"/>
        <include file="b.xml"/>
        <include file="c.xml"/></body></worldbody></mujoco>"#;
    let wrong = |b: &str, c: &str, words: &[&str]| {
        let error = read(&[("r.xml", main), ("b.xml", b), ("c.xml", c)]).unwrap_err();
        says(error, words);
    };
    let again = "<x>\n<include file=\"b.xml\"/></x>";
    wrong(
        "<x/>",
        again,
        &[
            "c.xml",
            "line 2",
            "b.xml",
            "first in",
            "r.xml, line 2",
            "once",
        ],
    );
    wrong(
        "<x><include file=\"r.xml\"/></x>",
        "<x/>",
        &["b.xml", "r.xml", "the file that is read"],
    );
    wrong(
        "<x><include file=\"d.xml\"/></x>",
        "<x/>",
        &["b.xml", "line 1", "d.xml", "tried"],
    );
    wrong("<x>", "<x/>", &["b.xml", "XML"]);
    wrong("<x><include/></x>", "<x/>", &["b.xml", "path of a file"]);
    wrong(
        "<x><include file=\"c.xml\" prefix=\"p\"/></x>",
        "<x/>",
        &["prefix"],
    );
    // What is said of an included file's elements names that file.
    wrong(
        "<x>\n\n<geom size=\"0.1 x\"/></x>",
        "<x/>",
        &[
            "b.xml",
            "line 3",
            "<geom> of body \"a\"",
            "size",
            "0.1 x",
            "1 to 3 finite numbers",
        ],
    );
    wrong(
        "<x><replicate count=\"2\"/></x>",
        "<x/>",
        &["b.xml", "<replicate>", "missing"],
    );
    let (_, report, _folder) = read(&[
        ("r.xml", main),
        ("b.xml", "<x><geom size=\"0.1\" rgba=\"1 0 0 1\"/></x>"),
        ("c.xml", "<x/>"),
    ])
    .unwrap();
    let unused = report.unused.iter().find(|u| u.what.contains("rgba"));
    says(&unused.unwrap().what, &["rgba of <geom>", "b.xml"]);
}

/// An element's own attribute, then its class, then what the class hangs on; the class is its own, or that of the nearest body or frame that gives one.
#[test]
fn classes_give_what_elements_lack() {
    let (scene, _) = one(r#"<compiler angle="radian"/>
        <worldbody><body name="a"><freejoint/><geom/>
          <body name="b" childclass="arm" pos="2 0 0"><joint name="jb"/><geom/>
            <frame childclass="hand" pos="0 0 1"><body name="c"><joint name="jc" axis="1 0 0"/><geom/></body></frame>
            <body name="d" pos="0 2 0"><joint name="jd" class="main" type="hinge"/><geom class="hand" size="0.3 0.3 0.3"/></body>
          </body></body></worldbody>
        <default class="main"><geom size="0.1" type="sphere"/><joint damping="0.5"/></default>
        <default><joint armature="0.25"/>
          <default class="arm"><joint type="slide" damping="0.25"/><geom type="box" size="0.1 0.2 0.3"/>
            <default class="hand"><geom size="0.4 0.2 0.3"/></default></default></default>"#)
    .unwrap();
    assert_eq!(body(&scene, "a").shape, Some(Shape::sphere(0.1)));
    assert_eq!(
        body(&scene, "b").shape,
        Some(Shape::cuboid([0.2, 0.4, 0.6]))
    );
    assert_eq!(
        body(&scene, "c").shape,
        Some(Shape::cuboid([0.8, 0.4, 0.6]))
    );
    let passive = |name: &str| {
        let passive = body(&scene, name).passive.unwrap();
        [passive.damping, passive.armature]
    };
    assert_eq!(passive("b"), [0.25, 0.25]);
    assert_eq!(passive("c"), [0.25, 0.25]);
    assert_eq!(passive("d"), [0.5, 0.25]);
    let kinds: Vec<&str> = ["b", "c", "d"].map(|n| body(&scene, n).joint.kind()).into();
    assert_eq!(kinds[0], kinds[1]);
    assert_ne!(kinds[0], kinds[2]);

    let geom = |class: &str| {
        format!("<worldbody><body name=\"a\">\n<geom {class} size=\"1\"/></body></worldbody>")
    };
    refused(
        &(geom("class=\"hnd\"") + "<default><default class=\"hand\"/></default>"),
        &[
            "line 3",
            "<geom>",
            "class = \"hnd\"",
            "no such class",
            "hand",
            "main",
        ],
    );
    refused(
        "<worldbody><body name=\"a\" childclass=\"hnd\"><geom size=\"1\"/></body></worldbody>",
        &["<body>", "childclass = \"hnd\""],
    );
    refused(
        "<default><default/></default>",
        &["<default>", "needs a name"],
    );
    refused(
        "<default>\n<default class=\"x\"/>\n<default class=\"x\"/></default>",
        &["line 4", "class \"x\"", "twice", "line 3"],
    );
}

/// Position and orientation come from classes each by itself; an orientation of any kind stands for one of another; between two points neither counts.
#[test]
fn places_come_from_classes() {
    let (scene, _) = one(r#"<compiler angle="radian"/><default><geom type="capsule" size="0.1 0.2"/><site pos="0 0 3"/>
          <default class="p"><geom pos="1 0 0" quat="0 1 0 0"/><site quat="0 1 0 0"/></default>
          <default class="q"><geom fromto="0 0 0 0 1 0" euler="1 0 0"/></default></default>
        <worldbody><body name="a"><freejoint/><geom class="p" euler="0 0.5 0"/>
          <site name="s" class="p"/><site name="t" fromto="0 0 0 2 0 0"/></body>
          <body name="b"><freejoint/><geom class="p" pos="0 5 0"/></body>
          <body name="c"><freejoint/><geom class="q" pos="9 9 9"/></body></worldbody>"#)
    .unwrap();
    let at = |name: &str| body(&scene, name).shape_at;
    let off = |rotation: [f64; 3], axis: Vector3<f64>, angle: f64| {
        let found = UnitQuaternion::from_scaled_axis(Vector3::from(rotation));
        let right = UnitQuaternion::from_scaled_axis(axis * angle);
        found.angle_to(&right)
    };
    assert_eq!(at("a").position, [1.0, 0.0, 0.0]);
    assert!(off(at("a").rotation, Vector3::y(), 0.5) < 1e-6);
    assert_eq!(at("b").position, [0.0, 5.0, 0.0]);
    assert!(off(at("b").rotation, Vector3::x(), std::f64::consts::PI) < 1e-6);
    assert_eq!(at("c").position, [0.0, 0.5, 0.0]);
    let axis = UnitQuaternion::from_scaled_axis(Vector3::from(at("c").rotation)) * Vector3::z();
    assert!((axis.y.abs() - 1.0).abs() < 1e-12, "{axis}");
    let site = |name: &str| {
        scene
            .sites
            .iter()
            .find(|s| s.name == name)
            .unwrap()
            .placement
    };
    assert_eq!(site("s").position, [0.0, 0.0, 3.0]);
    assert!(off(site("s").rotation, Vector3::x(), std::f64::consts::PI) < 1e-6);
    assert_eq!(site("t").position, [1.0, 0.0, 0.0]);
    let axis = UnitQuaternion::from_scaled_axis(Vector3::from(site("t").rotation)) * Vector3::z();
    assert!((axis.x + 1.0).abs() < 1e-12, "{axis}");
    refused(
        "<worldbody><body name=\"a\"><geom fromto=\"0 0 0 1 0 0\" size=\"1\"/></body></worldbody>",
        &["<geom>", "sphere", "fromto", "capsule"],
    );
}

/// The z axis turned to its opposite is turned about x, wherever an element says so.
#[test]
fn opposite_z_axes_turn_about_x() {
    let places = |turn: &str| {
        let text = format!(
            r#"<worldbody><body name="a"><freejoint/><geom size="0.1"/><geom type="box" size="0.1 0.2 0.3" pos="0.5 1 0" {turn}/>
            <site name="s" pos="1 2 3" {turn}/><frame {turn}><geom size="0.1" pos="0.3 0.4 0.5"/><site name="t" pos="0.1 0.2 0.3"/></frame>
            <body name="b" pos="3 0 0" {turn}><joint axis="0 1 0"/><inertial pos="0.1 0.2 0.3" mass="1" diaginertia="0.02 0.03 0.04" {turn}/>
            <site name="u" pos="0.1 0.2 0.3"/><geom size="0.1" pos="0.1 0.2 0.3"/></body></body></worldbody>"#
        );
        one(&text).unwrap().0
    };
    for (zaxis, quat) in [
        ("0 0 -1", "0 1 0 0"),
        ("0 0 -1e-200", "0 1 0 0"),
        ("0 0 2", "1 0 0 0"),
        ("0 3 0", "1 -1 0 0"),
    ] {
        let [found, right] = [
            places(&format!("zaxis=\"{zaxis}\"")),
            places(&format!("quat=\"{quat}\"")),
        ];
        let numbers = |scene: &Scene| -> Vec<f64> {
            let placed = scene.sites.iter().map(|s| s.placement);
            let placed = placed.chain(scene.bodies.iter().map(|b| b.placement));
            // Where a point is that is on no axis.
            let points = placed.flat_map(|p| {
                let turn = UnitQuaternion::from_scaled_axis(Vector3::from(p.rotation));
                let x: [f64; 3] = (turn * Vector3::new(1.0, 2.0, 3.0)).into();
                x.into_iter().chain(p.position)
            });
            let masses = scene.bodies.iter().flat_map(|b| {
                let inertia = b.inertia.clone().unwrap();
                b.center_of_mass.unwrap().into_iter().chain(inertia)
            });
            points.chain(masses).collect()
        };
        let (found, right) = (numbers(&found), numbers(&right));
        assert_eq!(found.len(), right.len());
        for (x, y) in found.iter().zip(&right) {
            assert!((x - y).abs() < 1e-6, "{zaxis}: {x} {y}");
        }
    }
}

/// Fewer numbers than a class has leave its others what they are; what would have no length is refused.
#[test]
fn sizes_keep_what_their_class_gives() {
    let (scene, _) = one(r#"<default><geom type="capsule" size="0.05 0.2"/>
          <default class="x"><geom type="box" size="0.1 0.2 0.3"/><default class="y"><geom size="0.4"/></default></default></default>
        <worldbody><body name="a"><freejoint/><geom size="0.06"/></body>
        <body name="b" pos="5 0 0"><freejoint/><geom class="y"/></body>
        <body name="c" pos="9 0 0"><freejoint/><geom class="y" size="0.5 0.6"/></body></worldbody>"#)
    .unwrap();
    assert_eq!(body(&scene, "a").shape, Some(Shape::capsule(0.06, 0.4)));
    assert_eq!(
        body(&scene, "b").shape,
        Some(Shape::cuboid([0.8, 0.4, 0.6]))
    );
    assert_eq!(
        body(&scene, "c").shape,
        Some(Shape::cuboid([1.0, 1.2, 0.6]))
    );
    for kind in ["capsule", "cylinder"] {
        for size in ["size=\"0.06\"", "size=\"0.06\" fromto=\"1 1 1 1 1 1\""] {
            refused(
                &format!(
                    "<worldbody><body name=\"a\"><geom type=\"{kind}\" {size}/></body></worldbody>"
                ),
                &["body \"a\"", kind, "no length", "half its length"],
            );
        }
    }
}

/// Two bodies with a joint each, and what couples them.
fn pair(first: &str, second: &str, coupling: &str) -> String {
    format!(
        "<compiler angle=\"radian\"/><worldbody><body name=\"a\"><joint name=\"j\" {first}/><geom size=\"0.1\"/></body>\n\
         <body name=\"b\" pos=\"2 0 0\"><joint name=\"k\" {second}/><geom size=\"0.1\"/></body></worldbody>\n\
         <equality>\n{coupling}</equality>"
    )
}

/// Limits need a range that rises; without being asked for, others are told.
#[test]
fn ranges_rise() {
    let (scene, report) = one(&pair("range=\"1 -1\"", "range=\"-1 1\"", "")).unwrap();
    assert_eq!(body(&scene, "a").limits, None);
    assert_eq!(body(&scene, "b").limits, Some([-1.0, 1.0]));
    says(
        report.to_string(),
        &["joint \"j\"", "no limits", "from 1 to -1"],
    );
    let (_, report) = one(&pair("range=\"0 0\"", "limited=\"false\"", "")).unwrap();
    assert!(!report.to_string().contains("no limits"));
    for (joint, told) in [
        ("limited=\"true\"", "no range"),
        ("limited=\"true\" range=\"1 -1\"", "from 1 to -1"),
        ("limited=\"true\" range=\"1 1\"", "from 1 to 1"),
    ] {
        refused(
            &pair("", joint, ""),
            &["joint \"k\"", "range", told, "larger"],
        );
    }
}

/// Joints that aren't there, or have no single coordinate, are refused where they are named; what couples nothing is told by its joint.
#[test]
fn equalities_name_joints() {
    let coupled = |coupling: &str| pair("", "", coupling);
    refused(
        &coupled("<joint joint1=\"j\" joint2=\"kk\"/>"),
        &[
            "line 5",
            "<joint> of the equalities",
            "joint2 = \"kk\"",
            "no such joint",
        ],
    );
    refused(
        &coupled("<joint joint1=\"jj\"/>"),
        &["line 5", "joint1 = \"jj\"", "no such joint"],
    );
    refused(
        &pair("type=\"ball\"", "", "<joint joint1=\"k\" joint2=\"j\"/>"),
        &["line 5", "joint2 = \"j\"", "ball joint", "<equality>"],
    );
    let circle = "<joint joint1=\"j\" joint2=\"k\"/><joint joint1=\"k\" joint2=\"j\"/>";
    refused(&coupled(circle), &["<equality>", "follows this one"]);
    for (coupling, why) in [
        ("<joint joint1=\"j\"/>", "holds it in one place"),
        (
            "<joint joint1=\"j\" joint2=\"k\" polycoef=\"0 1 2\"/>",
            "straight line",
        ),
        (
            "<joint joint1=\"j\" joint2=\"k\" active=\"false\"/>",
            "isn't active",
        ),
    ] {
        let (scene, report) = one(&coupled(coupling)).unwrap();
        assert_eq!(body(&scene, "a").mimic, None);
        says(report.to_string(), &["<equality> of joint \"j\"", why]);
    }
    let shifted = "<joint joint1=\"j\" joint2=\"k\" polycoef=\"0.5\"/>";
    let (scene, _) = one(&coupled(shifted)).unwrap();
    let mimic = body(&scene, "a").mimic.clone().unwrap();
    assert_eq!((mimic.ratio, mimic.offset), (1.0, 0.5));
}

/// Of damping and springs the linear coefficient is read, and no other may count.
#[test]
fn damping_and_springs_are_linear() {
    let (scene, _) = one(&pair("damping=\"0.2 0\"", "stiffness=\"3 0 0\"", "")).unwrap();
    assert_eq!(body(&scene, "a").passive.unwrap().damping, 0.2);
    assert_eq!(body(&scene, "b").passive.unwrap().stiffness, 3.0);
    let curved = |joint: &str, words: &[&str]| refused(&pair(joint, "", ""), words);
    curved(
        "damping=\"0.2 0.1\"",
        &["<joint> of body \"a\"", "0.2 0.1", "only the linear"],
    );
    curved(
        "stiffness=\"1 0 2\"",
        &["stiffness", "1 0 2", "only the linear"],
    );
    curved("damping=\"1 0 0 0\"", &["damping", "one finite number"]);
}

/// A file with a document type is told what isn't read of it, not that it is no XML.
#[test]
fn document_types_are_not_read() {
    let text = "<!DOCTYPE mujoco [<!ENTITY r \"0.1\">]><mujoco/>";
    let error = read(&[("r.xml", text)]).unwrap_err();
    says(&error, &["r.xml", "<!DOCTYPE", "aren't read"]);
    assert!(!error.to_string().contains("XML yet"));
}

/// Values that are read are checked where they stand, in classes too; what isn't read is told, and whatever it is harms nothing.
#[test]
fn attributes_are_checked_and_told() {
    let within = |inner: &str| {
        format!("<worldbody><body name=\"a\"><freejoint/>\n{inner}</body></worldbody>")
    };
    let wrong = |inner: &str, words: &[&str]| refused(&within(inner), words);
    let three = "3 finite numbers between blanks";
    wrong(
        "<geom size=\"1\" pos=\"0 0\"/>",
        &[
            "robot.xml",
            "line 3",
            "<geom> of body \"a\"",
            "pos = \"0 0\"",
            three,
        ],
    );
    wrong("<geom size=\"1\" pos=\"0 0 nan\"/>", &["pos", three]);
    wrong("<geom size=\"1\" pos=\"0,0,1\"/>", &["pos", three]);
    wrong(
        "<geom size=\"1\" pos=\"0 0 1e40\"/>",
        &["pos", three, "of at most 1e30 in size"],
    );
    wrong(
        "<geom size=\"1\" density=\"inf\"/>",
        &["density", "one finite number"],
    );
    wrong(
        "<geom size=\"1\" type=\"cone\"/>",
        &["type", "cone", "capsule"],
    );
    wrong(
        "<geom size=\"1\" contype=\"x\"/>",
        &["contype", "whole number"],
    );
    wrong(
        "<geom size=\"1\" quat=\"0 0 0 0\"/>",
        &["quat", "isn't zero"],
    );
    wrong(
        "<geom size=\"1\" xyaxes=\"1 0 0 2 0 0\"/>",
        &["xyaxes", "one line"],
    );
    wrong(
        "<geom size=\"1\" quat=\"1 0 0 0\" euler=\"0 0 0\"/>",
        &["quat and euler", "leave one"],
    );
    wrong(
        "<geom size=\"1\"/><body name=\"b\"><joint damping=\"nan\"/></body>",
        &["<joint> of body \"b\"", "damping"],
    );
    wrong(
        "<inertial pos=\"0 0 0\" diaginertia=\"1 1 1\"/>",
        &["<inertial>", "mass"],
    );
    wrong(
        "<inertial mass=\"1\" fullinertia=\"1 1 1 0 0 0\" euler=\"0 0 1\"/>",
        &["fullinertia", "body's axes"],
    );
    refused(
        "<compiler eulerseq=\"xyzz\"/>",
        &["<compiler>", "eulerseq", "xyzz", "three of"],
    );
    refused(
        "<compiler autolimits=\"yes\"/>",
        &["autolimits", "true, false"],
    );
    refused(
        "<compiler coordinate=\"global\"/>",
        &["coordinate", "local"],
    );
    refused(
        "<default><default class=\"x\"><joint range=\"1\"/></default></default>",
        &["<joint> of class \"x\"", "range", "2 finite numbers"],
    );
    refused(
        "<asset><mesh name=\"m\" file=\"x\" scale=\"1\"/></asset>",
        &["<mesh>", "\"m\"", "scale"],
    );
    refused("<equality><joint joint2=\"x\"/></equality>", &["joint1"]);

    let odd = r#"<compiler balanceinertia="true"/><default><geom rgba="1 0" shellinertia="true" sise="3"/></default>
        <asset><material name="m" rgba="x"/></asset>"#;
    let inner = r#"<geom size="0.1" rgba="none" solref="?" material="gone"/><site size="x"/><camera pos="x"/>"#;
    let (_, report) = one(&(odd.to_string() + &within(inner))).unwrap();
    let told: Vec<&str> = report.unused.iter().map(|u| u.what.as_str()).collect();
    let right = [
        "<camera> of bodies",
        "<material> of <asset>",
        "balanceinertia of <compiler>, which tells of masses",
        "material of <geom>",
        "rgba of <geom>",
        "shellinertia of <geom>, which tells of masses",
        "sise of <geom>, which isn't one of its attributes",
        "size of <site>",
        "solref of <geom>",
    ];
    assert_eq!(told, right);
    let rgba = report
        .unused
        .iter()
        .find(|u| u.what == "rgba of <geom>")
        .unwrap();
    assert_eq!((rgba.count, rgba.line), (2, 2));
}

/// Masses where geometry gives none, and the least that the file asks for.
#[test]
fn masses_are_as_the_file_asks() {
    let made = |compiler: &str, inner: &str| {
        let text = format!(
            "<compiler {compiler}/><worldbody><body name=\"a\"><freejoint/>{inner}</body></worldbody>"
        );
        let (scene, _) = one(&text).unwrap();
        let a = body(&scene, "a");
        (a.mass.unwrap(), a.inertia.clone().unwrap())
    };
    let given = r#"<inertial pos="0 0 0" mass="2" diaginertia="0.02 0.03 0.04"/>"#;
    let geoms = r#"inertiafromgeom="true""#;
    assert_eq!(made(geoms, given).0, 2.0);
    let (mass, _) = made(geoms, &format!("{given}<geom size=\"0.1\" mass=\"5\"/>"));
    assert!((mass - 5.0).abs() < 1e-12);
    let (mass, inertia) = made(r#"boundmass="3" boundinertia="0.5""#, "");
    assert_eq!((mass, &inertia[..3]), (3.0, &[0.5; 3][..]));
    assert_eq!(made(r#"boundmass="3""#, given).0, 3.0);
    // Moments 0.01, 0.03 and 0.03 about axes turned by an eighth about z: the bound is of the least one, not of the entries.
    let turned = r#"<inertial pos="0 0 0" mass="2" fullinertia="0.02 0.02 0.03 0.01 0 0"/>"#;
    let (_, inertia) = made(r#"boundinertia="0.02""#, turned);
    for (found, right) in inertia.iter().zip([0.025, 0.025, 0.03, 0.005, 0.0, 0.0]) {
        assert!((found - right).abs() < 1e-15, "{inertia:?}");
    }
    // The massless links of a body with several joints stay so.
    let (scene, _) = one(r#"<compiler boundmass="0.5" boundinertia="0.5"/><worldbody><body name="a"><geom size="0.1"/>
        <body name="b" pos="1 0 0"><joint axis="1 0 0"/><joint axis="0 1 0"/><geom size="0.1"/></body></body></worldbody>"#)
    .unwrap();
    assert_eq!(body(&scene, "b (joint 1)").mass, Some(0.0));
}

/// Bodies have their names, whatever sites before them are called.
#[test]
fn bodies_are_named_before_sites() {
    let (scene, report) = one(
        r#"<worldbody><body name="a"><freejoint/><geom size="0.1"/><site name="b" pos="0 0 1"/><site name="body 3"/>
        <body name="b" pos="1 0 0"><joint/><geom size="0.1"/></body>
        <body pos="2 0 0"><joint/><geom size="0.1"/></body></body></worldbody>"#,
    )
    .unwrap();
    body(&scene, "b");
    body(&scene, "body 3");
    assert_eq!(scene.sites[0].name, "b of a");
    says(report.to_string(), &["\"b of a\"", "\"body 3 of a\""]);
}
