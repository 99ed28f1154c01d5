//! What drives the joints of robots: as MJCF files have it, and as it is chosen.

use super::robots::{collision, joint, link, read, refused_with, robot};
use crate::support::says;
use hydrograd::scene::{
    Added, Body, Drag, Followers, Joint, Motion, Passive, Robot, RobotJoint, RobotLink, Scene,
    Servo, Thruster,
};
use hydrograd::{Controls, Fidelity, Fluid, Settings, Simulator};
use nalgebra::{DMatrix, Quaternion, UnitQuaternion, Vector3, Vector6};

/// An arm of four links in a row, each with a mass at its end, and what drives it.
fn arm(of: &str) -> hydrograd::Result<(Scene, Added)> {
    arm_with(of, &Robot::default())
}

fn arm_with(of: &str, options: &Robot) -> hydrograd::Result<(Scene, Added)> {
    let text = format!(
        r#"<mujoco><compiler angle="radian"/>
        <default><position kp="40" kv="3"/><default class="weak"><position kp="8"/></default><default class="affine"><general biastype="affine" gainprm="50" biasprm="0 -50 -2"/></default></default>
        <worldbody><body name="a"><joint name="one" axis="0 1 0"/><geom type="sphere" size="0.05" pos="0.3 0 0" mass="0.2"/>
        <body name="b" pos="0.3 0 0"><joint name="two" axis="0 1 0"/><geom type="sphere" size="0.05" pos="0.3 0 0" mass="0.2"/>
        <body name="c" pos="0.3 0 0"><joint name="three" axis="0 1 0" damping="0.1"/><geom type="sphere" size="0.05" pos="0.3 0 0" mass="0.2"/>
        <body name="d" pos="0.3 0 0"><joint name="four" type="slide" axis="1 0 0" damping="0.1"/><geom type="sphere" size="0.05" mass="0.2"/>
        <body name="e" pos="0.3 0 0"><joint name="round" type="ball"/><geom type="sphere" size="0.05" mass="0.2"/></body>
        </body></body></body></body></worldbody>{of}</mujoco>"#
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.xml");
    std::fs::write(&path, text).unwrap();
    let mut scene = Scene::new(Fluid::none());
    let options = Robot {
        base: Some(hydrograd::scene::Base::Fixed),
        ..options.clone()
    };
    let added = scene.add_robot(&path, &options)?;
    Ok((scene, added))
}

/// Of each body with a joint of one coordinate: whether it is a control, and the gains that hold it.
fn drives(scene: &Scene) -> Vec<(bool, Option<[f64; 2]>)> {
    let bodies = scene.bodies.iter();
    let one = bodies.filter(|b| b.joint.coordinates() == 1);
    one.map(|b| (b.actuated, b.servo.map(|s| [s.stiffness, s.damping])))
        .collect()
}

/// Actuators that hold a joint at a target are servos, with gains by class and gear; those that push are controls, and what nothing drives is none.
#[test]
fn actuators_drive_joints() {
    let (scene, added) = arm(
        r#"<actuator><position joint="one"/><position joint="two" class="weak" gear="2"/><general class="affine" jointinparent="three" ctrlrange="-1 1"/></actuator>"#,
    )
    .unwrap();
    assert_eq!(
        drives(&scene),
        [
            (true, Some([40.0, 3.0])),
            (true, Some([32.0, 12.0])),
            (true, Some([50.0, 2.0])),
            (false, None),
        ]
    );
    says(
        added.report.to_string(),
        &[
            "joint \"two\" is a servo (stiffness 32, damping 12)",
            "[\"four\"] have no actuator",
            "ctrlrange of <general>",
        ],
    );
    let (scene, added) = arm(
        r#"<actuator><motor joint="one" gear="5"/><velocity joint="two" kv="2"/><general joint="three" gainprm="3" biastype="none"/><general joint="four" biastype="muscle"/>
        <position joint="one"/><motor joint="round"/><motor body="a"/></actuator>"#,
    )
    .unwrap();
    assert_eq!(drives(&scene), [(true, None); 4]);
    says(
        added.report.to_string(),
        &[
            "how the actuator of joint \"two\" makes a force",
            "how the actuator of joint \"four\" makes a force",
            "a second actuator of joint \"one\"",
            "joint \"round\" isn't read",
            "body of <motor>",
        ],
    );
}

/// Actuators of all kinds have the defaults of one another: what each sets is an attribute of them all.
#[test]
fn kinds_of_actuators_share_defaults() {
    let of = |default: &str, element: &str| {
        let text = format!(
            r#"<mujoco><default>{default}</default><worldbody><body><joint name="j" axis="0 1 0"/><geom size="0.1"/></body></worldbody>
            <actuator>{element}</actuator></mujoco>"#
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.xml");
        std::fs::write(&path, text).unwrap();
        drives(&Scene::from_urdf(&path, &Robot::default()).unwrap())[0]
    };
    let servo = |stiffness, damping| (true, Some([stiffness, damping]));
    let affine = r#"<general biastype="affine" gainprm="60" biasprm="0 -60 -4"/>"#;
    for (default, element, right) in [
        (
            r#"<general gear="10"/>"#,
            r#"<position joint="j" kp="5" kv="1"/>"#,
            servo(500.0, 100.0),
        ),
        (
            r#"<motor gear="10"/>"#,
            r#"<position joint="j" kp="5"/>"#,
            servo(500.0, 0.0),
        ),
        (affine, r#"<position joint="j"/>"#, servo(60.0, 4.0)),
        (affine, r#"<position joint="j" kp="7"/>"#, servo(7.0, 4.0)),
        (affine, r#"<motor joint="j"/>"#, (true, None)),
        (
            r#"<position kp="50" kv="3"/>"#,
            r#"<general joint="j"/>"#,
            servo(50.0, 3.0),
        ),
        (
            r#"<velocity kv="3"/>"#,
            r#"<position joint="j" kp="2"/>"#,
            servo(2.0, 3.0),
        ),
        ("", r#"<position joint="j"/>"#, servo(1.0, 0.0)),
    ] {
        assert_eq!(of(default, element), right, "{default} {element}");
    }
}

/// All are controls where a file has no actuators, or tendons that drive who knows what; so they are as that is chosen.
#[test]
fn joints_are_controls_where_nothing_is_known() {
    assert_eq!(drives(&arm("").unwrap().0), [(true, None); 4]);
    let tendon = r#"<tendon><fixed name="t"><joint joint="one" coef="1"/></fixed></tendon>
        <actuator><motor tendon="t"/><position joint="two"/></actuator>"#;
    let (scene, added) = arm(tendon).unwrap();
    let two = (true, Some([40.0, 3.0]));
    let all = [(true, None), two, (true, None), (true, None)];
    assert_eq!(drives(&scene), all);
    says(
        added.report.to_string(),
        &["[\"one\", \"three\", \"four\"] are controls", "tendons"],
    );
    let position = r#"<actuator><position joint="two"/></actuator>"#;
    let actuated = Robot {
        actuated: Some(true),
        ..Robot::default()
    };
    assert_eq!(drives(&arm_with(position, &actuated).unwrap().0), all);
    let none = Robot {
        actuated: Some(false),
        ..Robot::default()
    };
    assert_eq!(
        drives(&arm_with(position, &none).unwrap().0),
        [(false, None); 4]
    );
    // What is chosen for one joint, for all, and by the file, in this order.
    let own = RobotJoint {
        servo: Some(Servo::new(7.0, 0.5)),
        ..RobotJoint::default()
    };
    let forced = RobotJoint {
        actuated: Some(true),
        ..RobotJoint::default()
    };
    let chosen = Robot::default()
        .servo(Servo::new(5.0, 0.0))
        .joint("one", own)
        .joint("four", forced);
    let of = r#"<actuator><motor joint="one"/><position joint="two"/></actuator>"#;
    assert_eq!(
        drives(&arm_with(of, &chosen).unwrap().0),
        [
            (true, Some([7.0, 0.5])),
            (true, Some([5.0, 0.0])),
            (false, None),
            (true, Some([5.0, 0.0]))
        ]
    );
}

/// A vehicle with sites that are turned, one on a part that is welded on, and actuators of them.
fn vehicle(of: &str, options: &Robot) -> hydrograd::Result<(Scene, Added)> {
    let text = format!(
        r#"<mujoco><compiler angle="degree"/><default><motor gear="0 0 3 0 0 0.6"/></default>
        <worldbody><site name="nowhere"/><body name="hull" quat="0.5 0.5 0.5 0.5"><freejoint/><geom type="ellipsoid" size="0.3 0.2 0.1" mass="20"/>
        <site name="port" pos="-0.2 0.1 0.05" euler="0 90 0"/><site name="up" pos="0 0 0.1"/>
        <body name="wing" pos="0 0.2 0" euler="90 0 0"><geom type="sphere" size="0.02" mass="0.1"/><site name="tip" pos="0 0 0.1"/></body>
        </body></worldbody><actuator>{of}</actuator></mujoco>"#
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("vehicle.xml");
    std::fs::write(&path, text).unwrap();
    let mut scene = Scene::new(Fluid::none());
    let added = scene.add_robot(&path, options)?;
    Ok((scene, added))
}

/// Actuators of sites push where the file has them: wrenches by hand, in the world.
#[test]
fn actuators_of_sites_are_thrusters() {
    let of = r#"<motor name="aft" site="port"/><general site="tip" gainprm="5" gear="2 0 0"/><motor site="up" gear="0 -1 0 0 0.25 0"/>"#;
    let (mut scene, added) = vehicle(of, &Robot::default()).unwrap();
    assert_eq!(added.thrusters, ["aft", "tip thruster", "up thruster"]);
    assert_eq!(scene.control_labels(), added.thrusters);
    says(
        added.report.to_string(),
        &["site \"tip\" is the thruster \"tip thruster\", 10 N a unit"],
    );
    let mut wrong = scene.clone();
    wrong.add_force(Thruster::new("port").into());
    let error = wrong.validate().unwrap_err().to_string();
    says(
        error,
        &["\"port\"", "it is a site", "\"hull\"", "[-0.2, 0.1, 0.05]"],
    );
    scene.gravity = [0.0; 3];
    let sim = Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap();
    let hull = scene.body("hull").unwrap().0;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(0.5, 0.5, 0.5, 0.5));
    // Where each is, force and moment there, in the hull's frame: "port" is turned by 90° about y, and the wing, by 90° about x, has z along −y.
    let three = [
        ([-0.2, 0.1, 0.05], [3.0, 0.0, 0.0], [0.6, 0.0, 0.0]),
        ([0.0, 0.1, 0.0], [10.0, 0.0, 0.0], [0.0; 3]),
        ([0.0, 0.0, 0.1], [0.0, -1.0, 0.0], [0.0, 0.25, 0.0]),
    ];
    for (k, (at, force, moment)) in three.into_iter().enumerate() {
        let [at, force, moment] = [at, force, moment].map(Vector3::from);
        let command = DMatrix::from_fn(3, 1, |i, _| f64::from(i == k));
        let controls = Controls::from_matrix(&sim, command).unwrap();
        let loads = sim.rollout(&controls).unwrap().loads(0).unwrap();
        let found: Vector6<f64> = loads
            .kinds()
            .map(|kind| loads.wrenches(kind).unwrap()[hull])
            .sum();
        let [force, moment] = [force, moment + at.cross(&force)].map(|x| rotation * x);
        let right = Vector6::from_row_slice(&[force.as_slice(), moment.as_slice()].concat());
        assert!((found - right).norm() < 1e-12, "{k}: {found} for {right}");
    }
}

/// What isn't a thruster is told, or refused where the file is wrong.
#[test]
fn actuators_of_sites_that_are_no_thrusters_are_told() {
    let none = |of: &str, why: &str| {
        let (scene, added) = vehicle(of, &Robot::default()).unwrap();
        assert!(
            scene.forces.is_empty() && added.thrusters.is_empty(),
            "{of}"
        );
        says(added.report.to_string(), &[why]);
    };
    none(r#"<motor site="nowhere"/>"#, "sites of the world");
    none(r#"<motor site="up" gear="0 0 0 0 0 1"/>"#, "has no force");
    none(
        r#"<motor site="up" gear="1 0 0 0 1 0"/>"#,
        "isn't about the axis",
    );
    none(
        r#"<position site="up" kp="3"/>"#,
        "isn't a multiple of its control",
    );
    none(r#"<motor site="up" refsite="tip"/>"#, "refsite of <motor>");
    let error = vehicle(r#"<motor site="where"/>"#, &Robot::default()).unwrap_err();
    says(
        error.to_string(),
        &["no such site", "where", "the actuators"],
    );
    let mut scene = Scene::new(Fluid::none());
    scene.add(
        Body::dry()
            .named("old")
            .mass(1.0)
            .inertia([1.0; 3])
            .joint(Joint::Free),
    );
    scene.add_force(Thruster::new("old").named("one").into());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.xml");
    let text = r#"<mujoco><worldbody><body name="other"><freejoint/><geom size="0.1"/><site name="s"/></body></worldbody><actuator><motor name="one" site="s"/></actuator></mujoco>"#;
    std::fs::write(&path, text).unwrap();
    let error = scene.add_robot(&path, &Robot::default()).unwrap_err();
    says(error.to_string(), &["one", "prefix"]);
    let apart = Robot::default().prefix("b ");
    let added = scene.add_robot(&path, &apart).unwrap();
    assert_eq!(added.thrusters, ["b one"]);
    scene.validate().unwrap();
}

/// What drives a follower drives its leader, at the lever that it has there.
#[test]
fn actuators_of_followers_are_their_leaders() {
    let equality =
        r#"<equality><joint joint1="two" joint2="one" polycoef="0 3 0 0 0"/></equality>"#;
    let (scene, added) = arm(&format!(
        r#"{equality}<actuator><position joint="two"/></actuator>"#
    ))
    .unwrap();
    assert_eq!(
        drives(&scene)[..2],
        [(true, Some([360.0, 27.0])), (false, None)]
    );
    says(
        added.report.to_string(),
        &["joint \"two\", which follows \"one\", has an actuator: it is the leader's"],
    );
    let both = r#"<actuator><position joint="two"/><motor joint="one"/></actuator>"#;
    let (scene, added) = arm(&format!("{equality}{both}")).unwrap();
    assert_eq!(drives(&scene)[..2], [(true, None), (false, None)]);
    says(
        added.report.to_string(),
        &["which isn't read: the leader has its own"],
    );
}

#[test]
fn actuators_that_can_not_be_are_refused() {
    let refused = |of: &str, words: &[&str]| says(arm(of).unwrap_err(), words);
    refused(
        r#"<actuator><position joint="six"/></actuator>"#,
        &[
            "<position>",
            "the actuators",
            "joint = \"six\"",
            "no such joint",
        ],
    );
    refused(
        r#"<actuator><position joint="one" kp="stiff"/></actuator>"#,
        &["kp = \"stiff\"", "one finite number"],
    );
    refused(
        r#"<actuator><motor joint="one" class="strong"/></actuator>"#,
        &["\"strong\"", "no such class"],
    );
    let (scene, added) = arm(r#"<actuator><position joint="one" kp="-5"/></actuator>"#).unwrap();
    assert_eq!(drives(&scene)[0], (true, None));
    says(
        added.report.to_string(),
        &[
            "joint \"one\" isn't read",
            "stiffness -5",
            "push the joint on",
        ],
    );
}

/// A joint that a file's actuator holds sags under its load by what its stiffness says: k (u − q) = m g l cos q for an arm that is level at zero.
#[test]
fn a_position_actuator_holds() {
    let text = r#"<mujoco><compiler angle="radian"/><worldbody><body name="a"><joint name="one" axis="0 1 0"/>
        <geom type="sphere" size="0.05" pos="0.3 0 0" mass="0.2"/></body></worldbody>
        <actuator><position joint="one" kp="4" kv="0.4"/></actuator></mujoco>"#;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.xml");
    std::fs::write(&path, text).unwrap();
    let mut scene = Scene::from_urdf(
        &path,
        &Robot {
            base: Some(hydrograd::scene::Base::Fixed),
            ..Robot::default()
        },
    )
    .unwrap();
    scene.fluid = Fluid::none();
    let sim = Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap();
    let target = -0.2;
    let controls =
        Controls::from_matrix(&sim, nalgebra::DMatrix::from_element(1, 500, target)).unwrap();
    let rollout = sim.rollout(&controls).unwrap();
    let q = rollout.states().last().unwrap().q[0];
    // About +y a positive angle turns x downward: gravity's moment is m g l cos q.
    let off = 4.0 * (target - q) + 0.2 * 9.81 * 0.3 * q.cos();
    println!("rests at {q:.6} rad, out of balance by {off:.1e} N m");
    assert!(q > target + 0.1 && off.abs() < 1e-9, "{q} {off}");
}

/// Choices for joints and links of a URDF file, from a scene file.
#[test]
fn joints_are_as_chosen() {
    let limit = "<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/><dynamics damping=\"0.2\" friction=\"0.1\"/>";
    let mimic = "<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/><mimic joint=\"lead\"/>";
    let ball = |x: f64| {
        collision(
            "<sphere radius=\"0.05\"/>",
            &format!("<origin xyz=\"{x} 0 0\"/>"),
        )
    };
    let text = robot(
        &[
            link("base", ""),
            link("a", &ball(0.3)),
            link("b", &ball(0.6)),
            link("c", &ball(0.9)),
            link("d", &ball(1.2)),
            joint("lead", "revolute", "base", "a", limit),
            joint("led", "revolute", "base", "b", mimic),
            joint("turns", "continuous", "base", "c", "<axis xyz=\"0 0 1\"/>"),
            joint("flat", "planar", "base", "d", "<axis xyz=\"0 0 1\"/>"),
        ]
        .concat(),
    );
    let chosen: Robot = toml::from_str(
        r#"drag = { linear = 2.0 }
        servo = { stiffness = 9.0 }
        joints.lead = { passive = { damping = 0.7 }, limits = [-0.5, 0.25], limit_stiffness = 80.0 }
        joints.turns = { actuated = false, limits = [-2.0, 2.0] }
        links.c = { drag = { quadratic = 0.5 } }"#,
    )
    .unwrap();
    let chosen = Robot {
        limits: Some(false),
        ..chosen
    };
    let scene = read(&text, &chosen).unwrap();
    let body = |name: &str| &scene.bodies[scene.body(name).unwrap().0];
    let lead = body("a");
    assert_eq!(lead.passive, Some(Passive::default().damping(0.7)));
    assert_eq!(
        (lead.limits, lead.limit_stiffness),
        (Some([-0.5, 0.25]), Some(80.0))
    );
    assert_eq!(
        (lead.actuated, lead.servo),
        (true, Some(Servo::new(9.0, 0.0)))
    );
    let led = body("b");
    assert_eq!((led.actuated, led.servo, led.passive), (false, None, None));
    let turns = body("c");
    assert_eq!(
        (turns.actuated, turns.servo, turns.limits),
        (false, None, Some([-2.0, 2.0]))
    );
    let drags = ["a", "c"].map(|name| body(name).drag.unwrap());
    assert_eq!(
        drags[0],
        Drag {
            linear: 2.0,
            ..Drag::default()
        }
    );
    assert_eq!(
        drags[1],
        Drag {
            quadratic: 0.5,
            ..Drag::default()
        }
    );
    scene.validate().unwrap();

    let of = |name: &str, joint: RobotJoint| Robot::default().joint(name, joint);
    let servo = || RobotJoint {
        servo: Some(Servo::new(1.0, 0.0)),
        ..RobotJoint::default()
    };
    refused_with(
        &text,
        &of("led", servo()),
        &["joint \"led\"", "servo, as chosen", "follows \"lead\""],
    );
    refused_with(
        &text,
        &of("flat", servo()),
        &["joint \"flat\"", "servo, as chosen", "one coordinate"],
    );
    refused_with(
        &text,
        &of("arm", servo()),
        &["joints", "\"arm\"", "\"turns\""],
    );
    let still = [Motion::Linear {
        offset: 0.0,
        rate: 0.0,
    }];
    refused_with(
        &text,
        &of("turns", servo()).driven("turns", still),
        &["joint \"turns\"", "servo, as chosen", "driven"],
    );
    let crossed = RobotJoint {
        limits: Some([1.0, -1.0]),
        ..RobotJoint::default()
    };
    refused_with(
        &text,
        &of("lead", crossed),
        &["joint \"lead\"", "limits, as chosen", "1 to -1"],
    );
    let idle = RobotJoint {
        actuated: Some(false),
        ..servo()
    };
    let error = read(&text, &of("lead", idle)).unwrap_err();
    says(error, &["body \"a\": servo", "isn't actuated"]);
    // A follower with a coordinate of its own has what is chosen for it.
    let alone = Robot {
        mimic: Followers::Independent,
        ..of("led", servo())
    };
    let scene = read(&text, &alone).unwrap();
    assert_eq!(
        scene.bodies[scene.body("b").unwrap().0].servo,
        Some(Servo::new(1.0, 0.0))
    );
    // What folds into another body has no drag of its own.
    let folded = robot(
        &[
            link("base", &ball(0.0)),
            link("e", &ball(2.0)),
            joint("still", "fixed", "base", "e", ""),
        ]
        .concat(),
    );
    let link = RobotLink {
        drag: Some(Drag::default()),
        ..RobotLink::default()
    };
    refused_with(
        &folded,
        &Robot::default().link("e", link),
        &["drag, as chosen", "part of body \"base\""],
    );
}
