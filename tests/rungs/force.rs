//! Rungs of every force by itself: bodies are displaced, and their twists changed, one by one, as no joint would let them.

use super::contact;
use super::dynamics::{self, directions};
use super::tools::{Group, groups, vector_along, wavy};
use hydrograd::adjoint::check::{Outcome, Rung};
use hydrograd::adjoint::lie::{Pose, Vec6, angular, exp_matrix, linear};
use hydrograd::dynamics::force::{ForceModel, LoadBars, Loads, Moving, Place, Velocity};
use hydrograd::dynamics::{Parameters, System};
use hydrograd::scene::{Body, Drag, DragPart, Fluid, Joint, Scene, Servo, Shape};
use hydrograd::{Fidelity, Settings, Simulator};
use nalgebra::DVector;
use std::sync::OnceLock;

pub fn rungs() -> Vec<Rung> {
    macro_rules! rungs {
        ($($name:literal => $check:expr),* $(,)?) => {
            vec![$(Rung { name: $name, check: $check }),*]
        };
    }
    rungs![
        "dynamics::force::weight::Weight::vjp" => |c| vjp("gravity", c),
        "dynamics::force::weight::Weight::vjp" => |c| vjp("buoyancy", c),
        "dynamics::force::weight::Weight::vjp" => |c| vjp("float", c),
        "dynamics::force::drag::Drag::jvp" => |c| jvp("linear drag", c),
        "dynamics::force::drag::Drag::vjp" => |c| vjp("linear drag", c),
        "dynamics::force::waterline::Floating::vjp" => |c| vjp("buoyancy at the surface", c),
        "dynamics::force::waterline::wrench_vjp" => |c| vjp("buoyancy at the surface", c),
        "dynamics::force::drag::Dragged::cut_vjp" => |c| vjp("linear drag at the surface", c),
        "dynamics::force::drag::Dragged::cut_vjp" => |c| vjp("quadratic drag at the surface", c),
        "dynamics::force::drag::Drag::jvp" => |c| jvp("quadratic drag", c),
        "dynamics::force::drag::Drag::vjp" => |c| vjp("quadratic drag", c),
        "dynamics::force::thruster::Thrusters::vjp" => |c| vjp("thruster", c),
        "dynamics::force::actuation::Actuation::vjp" => |c| vjp("actuation", c),
        "dynamics::force::passive::Passives::jvp" => |c| jvp("passive joint", c),
        "dynamics::force::passive::Passives::vjp" => |c| vjp("passive joint", c),
        "dynamics::force::servo::Servos::jvp" => |c| jvp("servo", c),
        "dynamics::force::servo::Servos::vjp" => |c| vjp("servo", c),
        "dynamics::force::spring::Springs::jvp" => |c| jvp("spring", c),
        "dynamics::force::spring::Springs::vjp" => |c| vjp("spring", c),
        "dynamics::force::local::Local::jvp" => |c| jvp("damping", c),
        "dynamics::force::local::Local::vjp" => |c| vjp("damping", c),
        "dynamics::force::damping::Damping::inputs_vjp" => |c| vjp("damping", c),
        "dynamics::force::local::Local::jvp" => |c| jvp("thrust", c),
        "dynamics::force::local::Local::vjp" => |c| vjp("thrust", c),
        "dynamics::force::thrust::Thruster::inputs_vjp" => |c| vjp("thrust", c),
        "dynamics::force::rotor::Rotors::jvp" => |c| jvp("rotor", c),
        "dynamics::force::rotor::Rotors::vjp" => |c| vjp("rotor", c),
        "dynamics::force::local::Local::jvp" => |c| jvp("fin", c),
        "dynamics::force::local::Local::vjp" => |c| vjp("fin", c),
        "dynamics::force::fin::Fin::inputs_vjp" => |c| vjp("fin", c),
        "dynamics::force::local::Local::jvp" => |c| jvp("edge", c),
        "dynamics::force::local::Local::vjp" => |c| vjp("edge", c),
        "dynamics::force::edge::Edge::inputs_vjp" => |c| vjp("edge", c),
        "dynamics::force::tendon::Tendons::jvp" => |c| jvp("tendon", c),
        "dynamics::force::tendon::Tendons::vjp" => |c| vjp("tendon", c),
        "dynamics::force::current::Carried::jvp" => |c| jvp("current", c),
        "dynamics::force::current::Carried::vjp" => |c| vjp("current", c),
        "dynamics::force::stream::Streams::at_body_vjp" => |c| vjp("current", c),
        "dynamics::force::Moving::relative_vjp" => |c| vjp("fin", c),
        "dynamics::force::lubrication::Lubrication::jvp" => |c| jvp("lubrication", c),
        "dynamics::force::lubrication::Lubrication::vjp" => |c| vjp("lubrication", c),
    ]
}

/// What a force is a function of.
#[derive(Clone)]
struct At {
    system: &'static System,
    poses: Vec<Pose>,
    q: DVector<f64>,
    twists: Vec<Vec6>,
    v: DVector<f64>,
    control: DVector<f64>,
    parameters: Parameters,
}

impl At {
    /// Where the force of this name acts: what is solved with contact where bodies touch.
    fn new(name: &str) -> Self {
        if name == "lubrication" {
            let (p, control) = (contact::point(), DVector::zeros(0));
            return Self::placed(contact::system(), p.q, p.v, control, p.parameters);
        }
        if name == "servo" {
            let (sim, q) = (servo(), DVector::from_vec(vec![0.2, -0.4]));
            let (v, control) = (wavy(2, 0.8, 0.5), DVector::from_vec(vec![0.3, 0.1]));
            return Self::placed(sim.system(), q, v, control, sim.parameters().clone());
        }
        if name.ends_with(SURFACE) {
            let sim = surface();
            let (system, q) = (sim.system(), sim.start().0.clone());
            let v = wavy(system.tree.velocities(), 0.8, 0.5);
            let control = DVector::zeros(0);
            return Self::placed(system, q, v, control, sim.parameters().clone());
        }
        let p = dynamics::point();
        Self::placed(dynamics::system(), p.q, p.v, p.u, p.parameters)
    }

    fn placed(
        system: &'static System,
        q: DVector<f64>,
        v: DVector<f64>,
        control: DVector<f64>,
        parameters: Parameters,
    ) -> Self {
        let kinematics = system.tree.kinematics(&q);
        Self {
            system,
            twists: system.tree.twists(&kinematics, &v),
            poses: kinematics.poses,
            q,
            v,
            control,
            parameters,
        }
    }

    fn moving(&self) -> Moving<'_> {
        let place = Place {
            poses: &self.poses,
            q: &self.q,
            time: dynamics::TIME,
            parameters: &self.parameters,
        };
        (self.system).moving(place, &self.twists, &self.v, &self.control)
    }

    fn loads(&self, force: &dyn ForceModel) -> Loads {
        let mut out = Loads::zeros(self.poses.len(), self.v.len());
        force.add(&self.moving(), &mut out);
        out
    }
}

/// What a force in water with a surface is called by here.
const SURFACE: &str = " at the surface";

/// Two driven joints.
fn servo() -> &'static Simulator {
    static MADE: OnceLock<Simulator> = OnceLock::new();
    MADE.get_or_init(|| {
        let mut scene = Scene::new(Fluid::none());
        let link = |name: &str, joint| {
            let link = Body::dry().named(name).mass(1.0).joint(joint);
            link.inertia([0.1, 0.2, 0.15]).actuated()
        };
        let axis = [0.3, 0.8, -0.2];
        let slide = link("slide", Joint::Prismatic { axis });
        scene.add(slide.servo(Servo::new(20.0, 2.0)));
        let turn = link("turn", Joint::Revolute { axis }).child_of("slide");
        scene.add(turn.servo(Servo::new(8.0, 0.7)));
        Simulator::new(&scene, Settings::default()).expect("the scene is right")
    })
}

/// Bodies that reach through the surface of the water, aslant.
fn surface() -> &'static Simulator {
    static MADE: OnceLock<Simulator> = OnceLock::new();
    MADE.get_or_init(|| {
        let mut scene = Scene::new(Fluid {
            density: 998.0,
            current: [0.2, -0.1, 0.0],
        });
        scene.gravity = [1.0, -2.0, -9.0];
        scene.waterline = Some(0.05);
        for (name, x) in [("ship", 0.0), ("buoy", 1.0)] {
            let body = Body::new(Shape::ellipsoid([0.3, 0.2, 0.25]).faces(80)).named(name);
            let body = body.density(700.0).at([x, 0.3 * x, 0.05]);
            scene.add(body.rotated([0.3, 0.2, 0.1 + x]).drag(Drag {
                part: DragPart::Total,
                linear: 15.0,
                quadratic_part: DragPart::Normal,
                quadratic: 0.8,
            }));
        }
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        Simulator::new(&scene, settings).expect("the scene is right")
    })
}

fn force(at: &At, name: &str) -> &'static dyn ForceModel {
    let name = name.strip_suffix(SURFACE).unwrap_or(name);
    let mut all = at.system.forces.iter();
    all.find(|f| f.name() == name)
        .expect("the scene has every force")
        .as_ref()
}

/// A six-vector for each of so many bodies.
fn field(n: usize, phase: f64, size: f64) -> Vec<Vec6> {
    let all = wavy(6 * n, phase, size);
    (0..n)
        .map(|b| all.fixed_rows::<6>(6 * b).into_owned())
        .collect()
}

fn displaced(poses: &[Pose], by: &[Vec6], h: f64) -> Vec<Pose> {
    let one = |(pose, x): (&Pose, &Vec6)| {
        let rotation = exp_matrix(&(h * angular(x)));
        Pose::new(
            rotation * pose.rotation,
            rotation * pose.translation + h * linear(x),
        )
    };
    poses.iter().zip(by).map(one).collect()
}

fn along(twists: &[Vec6], by: &[Vec6], h: f64) -> Vec<Vec6> {
    twists.iter().zip(by).map(|(t, d)| t + h * d).collect()
}

fn row(loads: &Loads) -> Vec<f64> {
    let wrenches = loads.wrenches.iter().flat_map(|w| w.iter().copied());
    wrenches.chain(loads.joints.iter().copied()).collect()
}

fn jvp(name: &str, c: f64) -> Outcome {
    let at = At::new(name);
    let force = force(&at, name);
    let (dtwists, dv) = (field(at.poses.len(), 3.1, 0.2), wavy(at.v.len(), 3.7, 0.2));
    let mut tangent = Loads::zeros(at.poses.len(), at.v.len());
    let change = Velocity {
        twists: &dtwists,
        v: &dv,
    };
    force.jvp(&at.moving(), &change, &mut tangent);
    let tangent: Vec<f64> = row(&tangent).iter().map(|x| c * x).collect();
    let value = |h: f64| {
        let twists = along(&at.twists, &dtwists, h);
        let v = &at.v + h * &dv;
        row(&At {
            twists,
            v,
            ..at.clone()
        }
        .loads(force))
    };
    vector_along(value, &tangent)
}

fn vjp(name: &str, c: f64) -> Outcome {
    let at = At::new(name);
    let force = force(&at, name);
    let (n, nv) = (at.poses.len(), at.v.len());
    let (z, z_joints) = (field(n, 5.1, 1.0), wavy(nv, 5.7, 1.0));
    let power = |at: &At| {
        let loads = at.loads(force);
        let wrenches: f64 = loads.wrenches.iter().zip(&z).map(|(w, z)| w.dot(z)).sum();
        wrenches + loads.joints.dot(&z_joints)
    };
    let (mut pose, mut twist) = (vec![Vec6::zeros(); n], vec![Vec6::zeros(); n]);
    let (mut q, mut v) = (DVector::zeros(nv), DVector::zeros(nv));
    let mut control = DVector::zeros(at.control.len());
    let mut parameters = at.parameters.zeros();
    let mut bars = LoadBars {
        pose: &mut pose,
        twist: &mut twist,
        q: &mut q,
        v: &mut v,
        control: &mut control,
        parameters: &mut parameters,
    };
    let on = Velocity {
        twists: &z,
        v: &z_joints,
    };
    force.vjp(&at.moving(), &on, &mut bars);

    let (at, power) = (&at, &power);
    let work = |field: &[Vec6], by: &[Vec6]| field.iter().zip(by).map(|(a, b)| a.dot(b)).sum();
    let (dpose, dtwist) = (field(n, 2.1, 0.05), field(n, 3.1, 0.2));
    let (dq, dv) = (wavy(nv, 2.7, 0.05), wavy(nv, 3.7, 0.2));
    let du = wavy(at.control.len(), 4.1, 1.0);
    let mut list: Vec<Group> = vec![
        Group {
            name: "pose",
            slope: work(&pose, &dpose),
            value: Box::new(move |h| {
                let poses = displaced(&at.poses, &dpose, h);
                power(&At {
                    poses,
                    ..at.clone()
                })
            }),
        },
        Group {
            name: "twist",
            slope: work(&twist, &dtwist),
            value: Box::new(move |h| {
                let twists = along(&at.twists, &dtwist, h);
                power(&At {
                    twists,
                    ..at.clone()
                })
            }),
        },
        Group {
            name: "q",
            slope: q.dot(&dq),
            value: Box::new(move |h| {
                let q = at.system.tree.integrate(&at.q, &(h * &dq));
                power(&At { q, ..at.clone() })
            }),
        },
        Group {
            name: "v",
            slope: v.dot(&dv),
            value: Box::new(move |h| {
                let v = &at.v + h * &dv;
                power(&At { v, ..at.clone() })
            }),
        },
        Group {
            name: "control",
            slope: control.dot(&du),
            value: Box::new(move |h| {
                let control = &at.control + h * &du;
                power(&At {
                    control,
                    ..at.clone()
                })
            }),
        },
    ];
    let bars = DVector::from_vec(parameters.to_vec());
    for (name, d) in directions(&at.parameters) {
        list.push(Group {
            name,
            slope: bars.dot(&d),
            value: Box::new(move |h| {
                let values = DVector::from_vec(at.parameters.to_vec()) + h * &d;
                let parameters = at.parameters.with_values(values.as_slice()).unwrap();
                power(&At {
                    parameters,
                    ..at.clone()
                })
            }),
        });
    }
    groups(list, c)
}
