//! Scenes that can't be: each gets an error that names body, field, value and remedy.

use crate::support::says;
use hydrograd::scene::{
    Body, Controller, Drag, Fluid, Joint, Mimic, Motion, Plane, Scene, Servo, Shape, Thruster, Wall,
};

/// Two bodies that are right: a ball that slides along z, a coin that hangs on it.
fn good() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    let axis = [0.0, 0.0, 1.0];
    scene.add(
        Body::new(Shape::sphere(0.1))
            .named("ball")
            .density(998.0)
            .joint(Joint::Prismatic { axis })
            .actuated(),
    );
    let coin = Body::new(Shape::ellipsoid([0.1, 0.1, 0.02]));
    scene.add(
        coin.named("coin")
            .mass(1.0)
            .inertia([2.0, 2.0, 3.0])
            .child_of("ball"),
    );
    scene
}

/// `change` must make a good scene bad, with these words in the error.
#[track_caller]
fn refused(change: impl FnOnce(&mut Scene), words: &[&str]) {
    let mut scene = good();
    scene.validate().unwrap();
    change(&mut scene);
    says(scene.validate().unwrap_err().to_string(), words);
}

#[test]
fn world_is_checked() {
    refused(|s| s.time_step = 0.0, &["time_step", "got 0", "above zero"]);
    refused(|s| s.time_step = f64::NAN, &["time_step", "NaN", "finite"]);
    refused(
        |s| s.fluid.density = -1.0,
        &["fluid.density", "-1", "kg/m³"],
    );
    refused(
        |s| s.fluid.density = f64::INFINITY,
        &["fluid.density", "inf", "finite"],
    );
    refused(|s| s.gravity[1] = f64::NAN, &["gravity", "NaN", "finite"]);
    refused(|s| s.bodies.clear(), &["bodies", "none", "add a body"]);
    let wall = |normal| Wall {
        surface: Default::default(),
        point: [0.0; 3],
        normal,
    };
    refused(
        |s| s.walls = vec![wall([0.0; 3])],
        &["walls[0].normal", "direction"],
    );
    refused(
        |s| s.walls = vec![wall([0.0, 0.0, 1.0]), wall([0.0, 0.1, 1.0])],
        &["walls[1].normal", "perpendicular", "walls[0]"],
    );
    refused(
        |s| {
            s.walls = vec![wall([0.0, 0.0, 1.0])];
            s.fluid.current = [1.0, 0.0, 1e-3];
        },
        &["fluid.current", "walls[0]", "parallel"],
    );
    let mut scene = good();
    scene.walls = vec![wall([0.0, 0.0, 3.0]), wall([2.0, 0.0, 0.0])];
    scene.fluid = Fluid {
        density: 0.0,
        current: [0.0, 1e-6, 0.0],
    };
    scene.validate().unwrap();
}

#[test]
fn names_and_parents_are_checked() {
    refused(
        |s| s.bodies[1].name = " ".into(),
        &["bodies[1]: name", "name"],
    );
    refused(
        |s| s.bodies[1].name = "ball".into(),
        &["bodies[1]: name", "bodies[0]"],
    );
    refused(
        |s| s.bodies[1].parent = Some("bal".into()),
        &["body \"coin\": parent", "\"bal\"", "did you mean \"ball\"?"],
    );
    refused(
        |s| s.bodies[1].parent = Some("xyz".into()),
        &["body \"coin\": parent", "\"xyz\"", "ball, coin"],
    );
    refused(
        |s| s.bodies[0].parent = Some("coin".into()),
        &[
            "body \"ball\": parent",
            "circle",
            "\"ball\" on \"coin\" on \"ball\"",
        ],
    );
    refused(
        |s| s.bodies[1].parent = Some("coin".into()),
        &["circle", "\"coin\" on \"coin\""],
    );
    refused(
        |s| s.bodies.swap(0, 1),
        &["body \"coin\": parent", "order \"ball\", \"coin\""],
    );
    // A body that hangs on a circle without being in it.
    refused(
        |s| {
            s.bodies[0].parent = Some("coin".into());
            s.bodies
                .insert(0, Body::dry().mass(0.0).named("tail").child_of("ball"));
        },
        &["circle"],
    );
}

#[test]
fn overlaps_parent_needs_a_parent_and_two_shapes() {
    let coin = ["body \"coin\": overlaps_parent", "true"];
    let mut scene = good();
    scene.bodies[1].overlaps_parent = true;
    scene.validate().unwrap();
    refused(
        |s| {
            s.bodies[1].overlaps_parent = true;
            s.bodies[1].parent = None;
        },
        &[coin[0], coin[1], "no parent"],
    );
    refused(
        |s| {
            s.bodies[1].overlaps_parent = true;
            s.bodies[1].shape = None;
        },
        &[coin[0], coin[1], "no shape that could overlap"],
    );
    refused(
        |s| {
            s.bodies[1].overlaps_parent = true;
            s.bodies[0] = Body::dry().named("ball").mass(1.0).inertia([1.0; 3]);
        },
        &[coin[0], coin[1], "none of the bodies that carry this one"],
    );
}

#[test]
fn masses_are_checked() {
    let coin = "body \"coin\": ";
    refused(
        |s| s.bodies[1].mass = Some(-1.0),
        &[coin, "mass", "-1", "zero"],
    );
    refused(
        |s| s.bodies[0].density = Some(-1.0),
        &["body \"ball\": density", "-1"],
    );
    refused(
        |s| s.bodies[1].mass = Some(f64::NAN),
        &[coin, "mass", "NaN", "finite"],
    );
    refused(
        |s| s.bodies[1].density = Some(1.0),
        &[coin, "mass", "not both"],
    );
    refused(
        |s| s.bodies[1].mass = None,
        &[coin, "neither mass nor density", "massless"],
    );
    refused(
        |s| s.bodies[0].shape = None,
        &["body \"ball\": density", "shape"],
    );
    refused(
        |s| {
            s.bodies[1].shape = None;
            s.bodies[1].inertia = None;
        },
        &[coin, "inertia", "xx, yy, zz"],
    );
    let inertia = |values: &[f64], words: &[&str]| {
        let words = [&["body \"coin\": inertia"], words].concat();
        refused(|s| s.bodies[1].inertia = Some(values.to_vec()), &words);
    };
    inertia(&[1.0, 1.0], &["2 numbers", "3", "6"]);
    inertia(&[1.0, 1.0, -1.0], &["negative principal moment"]);
    inertia(
        &[1.0, 1.0, 1.0, 2.0, 0.0, 0.0],
        &["negative principal moment", "-1.0"],
    );
    inertia(&[1.0, 1.0, 2.1], &["sum of the other two", "2.1"]);
    inertia(&[1.0, 1.0, f64::NAN], &["NaN", "finite"]);

    let mut scene = good();
    scene.add(Body::dry().mass(0.0).named("massless"));
    scene.add(Body::dry().mass(1.0).inertia([0.0; 3]).named("point"));
    scene.add(Body::new(Shape::cuboid([1.0; 3])).fixed().named("floor"));
    scene.validate().unwrap();
}

#[test]
fn added_mass_is_checked() {
    let mut right = [[0.0; 6]; 6];
    (0..6).for_each(|i| right[i][i] = [1e-3, 2e-3, 3e-3, 1e-6, 2e-6, 0.0][i]);
    let with = |change: &dyn Fn(&mut Vec<Vec<f64>>), words: &[&str]| {
        refused(
            |s| {
                let coin = s.bodies.remove(1).added_mass(right);
                s.bodies.push(coin);
                s.validate().unwrap();
                change(s.bodies[1].added_mass.as_mut().unwrap());
            },
            words,
        );
    };
    with(&|m| m.truncate(5), &["body \"coin\": added_mass", "6 rows"]);
    with(
        &|m| m[1].truncate(5),
        &["body \"coin\": added_mass", "6 rows"],
    );
    with(&|m| m[2][2] = -1.0, &["added_mass[2][2]", "negative"]);
    with(&|m| m[2][2] = f64::NAN, &["added_mass[2]", "finite"]);
    with(&|m| m[3][0] = 1e-6, &["added_mass[3][0]", "symmetric"]);
    with(
        &|m| {
            m[3][0] = 4e-5;
            m[0][3] = 4e-5;
        },
        &[
            "body \"coin\": added_mass",
            "positive semi-definite",
            "eigenvalue",
        ],
    );
    with(
        &|m| {
            m[5][0] = 1e-9;
            m[0][5] = 1e-9;
        },
        &["body \"coin\": added_mass", "positive semi-definite"],
    );
}

#[test]
fn shapes_and_drag_are_checked() {
    refused(
        |s| s.bodies[0].shape = Some(Shape::sphere(-1.0)),
        &["body \"ball\": shape", "radius", "-1", "positive"],
    );
    refused(
        |s| s.bodies[0].shape = Some(Shape::cuboid([1.0, f64::NAN, 1.0])),
        &["body \"ball\": shape", "size[1]", "NaN"],
    );
    refused(
        |s| s.bodies[0].shape = Some(Shape::sphere(1.0).faces(0)),
        &["body \"ball\": shape", "faces", "got 0"],
    );
    let dented = [[0.0, 0.0], [1.0, 0.0], [0.5, 0.2], [0.0, 1.0]];
    refused(
        |s| s.bodies[0].shape = Some(Shape::prism([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], 0.0)),
        &["body \"ball\": shape", "length", "positive"],
    );
    refused(
        |s| s.bodies[0].shape = Some(Shape::prism(dented, 1.0)),
        &["body \"ball\": shape", "profile[2]", "[0.5, 0.2]", "convex"],
    );
    refused(
        |s| s.bodies[0].shape = Some(Shape::prism(&dented[..2], 1.0)),
        &["body \"ball\": shape", "profile", "2 corners", "three"],
    );
    refused(
        |s| s.bodies[0].shape = Some(Shape::mesh("")),
        &["body \"ball\": shape.path"],
    );
    refused(
        |s| s.bodies[1].shape_at.rotation[0] = f64::NAN,
        &["body \"coin\": shape_at.rotation", "finite"],
    );
    // Its square has no number.
    refused(
        |s| s.bodies[1].placement.rotation[0] = 1e155,
        &["body \"coin\": placement.rotation", "1e155", "at most 1e6"],
    );
    refused(
        |s| s.bodies[1].shape_at.rotation = [6e5, 6e5, -6e5],
        &["body \"coin\": shape_at.rotation", "at most 1e6"],
    );
    let drag = |linear, quadratic| Drag {
        linear,
        quadratic,
        ..Drag::default()
    };
    refused(
        |s| s.bodies[1].drag = Some(drag(-1.0, 0.0)),
        &["drag.linear", "-1"],
    );
    refused(
        |s| s.bodies[1].drag = Some(drag(0.0, f64::NAN)),
        &["drag.quadratic", "finite"],
    );
    refused(
        |s| {
            s.bodies[1].shape = None;
            s.bodies[1].drag = Some(drag(1.0, 0.0));
        },
        &["body \"coin\": drag", "surface"],
    );
}

#[test]
fn joints_are_checked() {
    let linear = || Motion::Linear {
        offset: 0.0,
        rate: 1.0,
    };
    refused(
        |s| s.bodies[0].joint = Joint::Revolute { axis: [0.0; 3] },
        &["body \"ball\": joint.axis", "direction"],
    );
    let axis = [0.0, 0.0, f64::NAN];
    refused(
        |s| s.bodies[0].joint = Joint::Screw { axis, pitch: 0.1 },
        &["body \"ball\": joint.axis", "finite"],
    );
    let (axis, pitch) = ([0.0, 0.0, 1.0], f64::INFINITY);
    refused(
        |s| s.bodies[0].joint = Joint::Screw { axis, pitch },
        &["body \"ball\": joint.pitch", "inf", "one revolution"],
    );
    refused(
        |s| s.bodies[1].motion = Some(vec![linear()]),
        &[
            "body \"coin\": motion",
            "free joint",
            "prismatic, revolute and planar",
        ],
    );
    refused(
        |s| {
            s.bodies[1].joint = Joint::Planar { plane: Plane::Xy };
            s.bodies[1].motion = Some(vec![linear()]);
        },
        &["body \"coin\": motion", "1 motions", "needs 3"],
    );
    refused(
        |s| {
            s.bodies[0].motion = Some(vec![linear()]);
            s.bodies[0].locked = true;
        },
        &["body \"ball\": locked", "motion"],
    );
    refused(
        |s| s.bodies[0].motion = Some(vec![linear()]),
        &["body \"ball\": actuated", "driven", "`motion`"],
    );
    refused(
        |s| s.bodies[0].locked = true,
        &["body \"ball\": actuated", "locked"],
    );
    refused(
        |s| s.bodies[0].joint = Joint::Fixed,
        &["body \"ball\": actuated", "fixed"],
    );
    refused(
        |s| {
            let floor = Body::new(Shape::sphere(1.0)).fixed().named("floor");
            s.add(floor.thruster());
        },
        &["body \"floor\": thruster", "can't move"],
    );
    refused(
        |s| {
            s.bodies[0].actuated = false;
            s.bodies[0].motion = Some(vec![Motion::Sine {
                offset: 0.0,
                amplitude: 1.0,
                frequency: f64::NAN,
                phase: 0.0,
            }]);
        },
        &["body \"ball\": motion[0].frequency", "finite"],
    );
    refused(
        |s| {
            s.bodies[0].actuated = false;
            s.bodies[0].motion = Some(vec![Motion::Sine {
                offset: 0.0,
                amplitude: 1.0,
                frequency: 1.0,
                phase: -1e300,
            }]);
        },
        &["body \"ball\": motion[0].phase", "-1", "±2π"],
    );
}

#[test]
fn start_is_checked() {
    refused(
        |s| s.initial.q = vec![0.0; 7],
        &[
            "initial.q",
            "7 numbers",
            "give 8",
            "\"ball\" prismatic 1, \"coin\" free 7",
        ],
    );
    refused(
        |s| s.initial.v = vec![0.0; 8],
        &["initial.v", "8 numbers", "give 7", "\"coin\" free 6"],
    );
    refused(
        |s| s.initial.momentum = vec![0.0; 3],
        &["initial.momentum", "3 numbers", "give 7"],
    );
    refused(
        |s| {
            s.initial.v = vec![0.0; 7];
            s.initial.momentum = vec![0.0; 7];
        },
        &["initial.momentum", "either v or momentum"],
    );
    refused(
        |s| s.initial.v = vec![f64::NAN; 7],
        &["initial.v", "finite"],
    );
    refused(
        |s| s.initial.q = vec![0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0],
        &[
            "body \"coin\": initial.q[4..8]",
            "length 2",
            "[1.0, 0.0, 0.0, 0.0]",
        ],
    );
    refused(
        |s| s.initial.q = vec![0.0; 8],
        &["body \"coin\": initial.q[4..8]", "no rotation is"],
    );

    let driven = |s: &mut Scene| {
        s.bodies[0].actuated = false;
        s.bodies[0].motion = Some(vec![Motion::Linear {
            offset: 0.5,
            rate: 2.0,
        }]);
    };
    let start = |first, size| {
        let mut values = vec![0.0; size];
        values[0] = first;
        values
    };
    refused(
        |s| {
            driven(s);
            s.initial.v = start(1.0, 7);
        },
        &["body \"ball\": initial.v[0]", "starts at 2"],
    );
    refused(
        |s| {
            driven(s);
            s.initial.momentum = start(1.0, 7);
        },
        &["body \"ball\": initial.momentum[0]", "write 0"],
    );
    refused(
        |s| {
            s.bodies[0].actuated = false;
            s.bodies[0].locked = true;
            s.initial.v = start(1.0, 7);
        },
        &["body \"ball\": initial.v[0]", "locked"],
    );
    for first in [0.0, 0.5] {
        let mut scene = good();
        driven(&mut scene);
        scene.initial.q = start(first, 8);
        scene.initial.q[4] = 1.0 + 1e-8;
        scene.initial.v = start(4.0 * first, 7);
        scene.validate().unwrap();
    }
}

#[test]
fn controllers_are_checked() {
    refused(
        |s| s.controller = Some(Controller::Constant { control: vec![] }),
        &["controller.control", "0 numbers", "1 in all", "\"ball\" 1"],
    );
    let pd = |target: Vec<f64>| Controller::Pd {
        target,
        stiffness: vec![1.0],
        damping: vec![1.0],
    };
    refused(
        |s| s.controller = Some(pd(vec![1.0; 2])),
        &["controller.target", "1 in all"],
    );
    refused(
        |s| s.controller = Some(pd(vec![f64::NAN])),
        &["controller.target", "finite"],
    );
    refused(
        |s| {
            s.bodies[1].actuated = true;
            s.controller = Some(pd(vec![1.0]));
        },
        &["controller.kind", "\"coin\"", "free joint", "constant"],
    );
    let push = |body: &str| Controller::PushThenLock {
        body: body.into(),
        force: -1.0,
        stop_at: -1.0,
    };
    refused(
        |s| s.controller = Some(push("bal")),
        &["controller.body", "\"bal\"", "did you mean \"ball\"?"],
    );
    refused(
        |s| s.controller = Some(push("coin")),
        &["controller.body", "\"coin\"", "free joint"],
    );
    refused(
        |s| {
            s.bodies[0].actuated = false;
            s.controller = Some(push("ball"));
        },
        &["controller.body", "actuated"],
    );
}

#[test]
fn waves_that_can_not_be_are_refused() {
    /// Its bodies, places, amplitude, length and rise.
    type Given<'a> = (&'a [&'a str], &'a [f64], f64, f64, f64);
    let wave = |(bodies, places, amplitude, length, rise): Given| Controller::Wave {
        bodies: bodies.iter().map(|b| (*b).to_string()).collect(),
        places: places.to_vec(),
        amplitude: [amplitude, 0.0, 0.0],
        frequency: 1.0,
        length,
        bias: 0.0,
        stiffness: 1.0,
        damping: 1.0,
        rise,
    };
    let bends = |s: &mut Scene| {
        s.bodies[0].joint = Joint::Revolute {
            axis: [0.0, 0.0, 1.0],
        };
    };
    let cases: [(Given, &[&str]); 9] = [
        (
            (&["bal"], &[], 0.1, 1.0, 0.0),
            &["controller.bodies", "did you mean \"ball\"?"],
        ),
        (
            (&["coin"], &[], 0.1, 1.0, 0.0),
            &["controller.bodies", "\"coin\"", "free joint"],
        ),
        ((&[], &[], 0.1, 1.0, 0.0), &["controller.bodies", "none"]),
        (
            (&["ball"], &[0.1, 0.2], 0.1, 1.0, 0.0),
            &["controller.places", "2 numbers"],
        ),
        (
            (&["ball"], &[f64::NAN], 0.1, 1.0, 0.0),
            &["controller.places", "finite"],
        ),
        (
            (&["ball"], &[], f64::INFINITY, 1.0, 0.0),
            &["controller.amplitude", "finite"],
        ),
        (
            (&["ball"], &[], 0.1, 0.0, 0.0),
            &["controller.length", "isn't zero"],
        ),
        (
            (&["ball"], &[], 0.1, 1.0, -1.0),
            &["controller.rise", "not negative"],
        ),
        (
            (&["ball"], &[], 0.1, 1.0, f64::NAN),
            &["controller.rise", "not negative"],
        ),
    ];
    for (given, says) in cases {
        refused(
            |s| {
                bends(s);
                s.controller = Some(wave(given));
            },
            says,
        );
    }
    let twice = |s: &mut Scene| {
        bends(s);
        s.controller = Some(wave((&["ball", "ball"], &[], 0.1, 1.0, 0.0)));
    };
    refused(twice, &["controller.bodies[1]", "\"ball\"", "once"]);
    let served = |s: &mut Scene| {
        bends(s);
        s.bodies[0].servo = Some(Servo::new(2.0, 0.1));
        s.controller = Some(wave((&["ball"], &[], 0.1, 1.0, 0.0)));
    };
    refused(served, &["controller.bodies", "\"ball\"", "servo"]);
    let slides = |s: &mut Scene| s.controller = Some(wave((&["ball"], &[], 0.1, 1.0, 0.0)));
    refused(slides, &["controller.bodies", "\"ball\"", "revolute"]);
}

/// Joints that follow others have no coordinate of their own: what asks for one says whose there is, and how numbers become the leader's.
#[test]
fn followers_have_nothing_of_their_own() {
    let axis = [0.0, 0.0, 1.0];
    let with = |s: &mut Scene, change: &dyn Fn(&mut Body)| {
        let follower = Body::dry().named("finger").mass(1.0).inertia([1.0; 3]);
        s.add(
            follower
                .joint(Joint::Prismatic { axis })
                .mimic(Mimic::new("ball").ratio(0.5)),
        );
        change(&mut s.bodies[2]);
    };
    type Change = fn(&mut Body);
    let changes: [(Change, &[&str]); 4] = [
        (
            |b| b.limits = Some([0.0, 0.04]),
            &["limits", "less the offset and over the ratio"],
        ),
        (
            |b| b.start = vec![0.1],
            &["start", "less the offset and over the ratio"],
        ),
        (
            |b| b.servo = Some(Servo::new(1.0, 0.0)),
            &["servo", "ratio's square"],
        ),
        (|b| b.actuated = true, &["actuated", "\"ball\""]),
    ];
    for (change, words) in changes {
        refused(|s| with(s, &change), words);
    }
    let nothing: Change = |_| ();
    refused(
        |s| {
            with(s, &nothing);
            s.controller = Some(Controller::SpeedStages {
                bodies: vec!["finger".into()],
                stages: vec![],
            });
        },
        &["controller.bodies", "\"finger\"", "\"ball\""],
    );
    let thruster = |name: &str| {
        let thruster = Thruster::new("ball").named(name).direction([0.0, 0.0, 1.0]);
        thruster.rotor("finger", 0.1)
    };
    refused(
        |s| {
            with(s, &nothing);
            s.add_force(thruster("port").into());
        },
        &["rotor", "\"finger\"", "follows another joint"],
    );
    refused(
        |s| {
            with(s, &|b| b.mimic = None);
            s.add_force(thruster("port").into());
            s.add_force(thruster("starboard").into());
        },
        &["rotor", "\"finger\"", "another thruster"],
    );
}

/// A servo's control is a target: controllers that give forces don't take it.
#[test]
fn forces_are_not_given_to_servos() {
    let servo = |s: &mut Scene| s.bodies[0].servo = Some(Servo::new(50.0, 1.0));
    refused(
        |s| {
            servo(s);
            s.controller = Some(Controller::Pd {
                target: vec![0.5],
                stiffness: vec![20.0],
                damping: vec![0.0],
            });
        },
        &["pd", "\"ball\"", "servo", "target"],
    );
    refused(
        |s| {
            servo(s);
            s.controller = Some(Controller::PushThenLock {
                body: "ball".into(),
                force: 5.0,
                stop_at: 0.1,
            });
        },
        &["controller.body", "\"ball\"", "servo"],
    );
}
