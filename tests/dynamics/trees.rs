//! Trees of every joint type in a current, with gravity, buoyancy and drag: the momentum form against the
//! velocity form, and gradients of rollouts against differences.

use crate::support::INTEGRATORS;
use hydrograd::adjoint::sample::Samples;
use hydrograd::dynamics::{Drive, Integrator, System};
use hydrograd::scene::{
    Body, Controller, Drag, DragPart, Fluid, Joint, Mimic, Motion, Plane, Scene, Shape,
};
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::simulate::{Action, ActionBar, Observation, Policy};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::DVector;

/// How one joint of a tree is moved.
#[derive(Clone, Copy, PartialEq)]
enum Moved {
    Freely,
    ByForces,
    ByMotion,
    Locked,
}

/// Parent, joint, and how it is moved. Together the trees have every joint under a moving parent.
fn links(tree: usize) -> Vec<(Option<usize>, Joint, Moved)> {
    use Moved::{ByForces, ByMotion, Freely, Locked};
    let axis = [0.6, -0.48, 0.64];
    let planar = |plane| Joint::Planar { plane };
    match tree {
        // A free body carries a chain; another free body beside it.
        0 => vec![
            (None, Joint::Free, Freely),
            (Some(0), Joint::Revolute { axis }, ByForces),
            (Some(1), Joint::Spherical, Freely),
            (None, planar(Plane::Zx), ByForces),
        ],
        // A free joint, and a planar one, on moving parents.
        1 => vec![
            (None, planar(Plane::Yz), Freely),
            (Some(0), Joint::Prismatic { axis }, ByMotion),
            (Some(1), planar(Plane::Xy), ByForces),
            (Some(0), Joint::Free, Freely),
        ],
        // On a body at rest; a locked joint and a fixed one in the middle.
        2 => vec![
            (None, Joint::Fixed, Freely),
            (Some(0), Joint::Spherical, ByForces),
            (Some(1), Joint::Revolute { axis }, Locked),
            (Some(2), planar(Plane::Zx), Freely),
        ],
        // Locked free and planar joints against a driven parent; driven planar joint.
        _ => vec![
            (None, Joint::Prismatic { axis }, ByForces),
            (Some(0), planar(Plane::Yz), ByMotion),
            (Some(1), Joint::Fixed, Freely),
            (Some(1), Joint::Free, Freely),
        ],
    }
}

pub(super) const TREES: std::ops::Range<usize> = 0..4;

/// A random scene on the tree; its bodies may meet.
fn attempt(tree: usize, random: &mut Samples) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 998.0,
        current: [0.2, -0.1, 0.15],
    });
    scene.name = format!("tree {tree}");
    scene.gravity = [0.5, -0.3, -9.81];
    let parts = [DragPart::Tangential, DragPart::Normal, DragPart::Total];
    for (b, (parent, joint, moved)) in links(tree).into_iter().enumerate() {
        let axes = random.vector(0.02).map(|x| 0.08 + x);
        let away = random.direction().map(|x| 0.45 * x);
        let mut body = Body::new(Shape::ellipsoid(axes).faces(80))
            .named(format!("{b}"))
            .at(away)
            .rotated(random.vector(1.0))
            .shape_at(random.vector(0.02), random.vector(1.0))
            .center_of_mass(random.vector(0.01))
            .density(998.0 + 200.0 * random.number())
            .joint(joint)
            .drag(Drag {
                part: parts[b % 3],
                linear: 20.0,
                quadratic_part: parts[(b + tree + 1) % 3],
                quadratic: 0.5,
            });
        if let Some(p) = parent {
            body = body.child_of(format!("{p}"));
        }
        match moved {
            Moved::Freely => {}
            Moved::ByForces => body = body.actuated(),
            Moved::Locked => body = body.locked(),
            Moved::ByMotion => {
                let motions: Vec<Motion> = (0..joint.coordinates())
                    .map(|k| Motion::Sine {
                        offset: 0.02 * random.number(),
                        amplitude: 0.1 + 0.05 * random.number(),
                        frequency: 4.0 + k as f64,
                        phase: random.number(),
                    })
                    .collect();
                body = body.driven(motions);
            }
        }
        if b == 3 || b == 1 {
            body = body.thruster();
        }
        scene.add(body);
        let still = matches!(moved, Moved::ByMotion | Moved::Locked);
        let (nq, nv) = (joint.coordinates(), joint.velocities());
        if still {
            scene.initial.q.extend(vec![0.0; nq]);
            scene.initial.v.extend(vec![0.0; nv]);
            continue;
        }
        scene
            .initial
            .v
            .extend((0..nv).map(|_| 0.4 * random.number()));
        let quaternion = |r: &mut Samples| {
            let q: [f64; 4] = std::array::from_fn(|k| if k == 0 { 1.0 } else { 0.4 * r.number() });
            let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
            q.map(|x| x / norm)
        };
        let q = &mut scene.initial.q;
        match joint {
            Joint::Spherical => q.extend(quaternion(random)),
            Joint::Free => {
                q.extend(random.vector(0.05));
                q.extend(quaternion(random));
            }
            _ => q.extend((0..nq).map(|_| 0.1 * random.number())),
        }
    }
    scene.controller = Some(Controller::Constant {
        control: (0..scene.controls())
            .map(|_| 0.3 * random.number())
            .collect(),
    });
    scene
}

/// A random scene on the tree whose bodies keep apart.
pub(super) fn scene(tree: usize) -> Scene {
    let mut random = Samples::new(17 + tree as u64);
    for _ in 0..100 {
        let scene = attempt(tree, &mut random);
        let simulator = Simulator::new(&scene, settings(Fidelity::Isolated)).unwrap();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 20)).unwrap();
        let apart = rollout.samples().iter().all(|s| {
            (0..s.poses.len()).all(|a| {
                (0..a).all(|b| (s.poses[a].translation - s.poses[b].translation).norm() > 0.3)
            })
        });
        if apart {
            return scene;
        }
    }
    panic!("no arrangement of tree {tree} keeps its bodies apart");
}

fn settings(fidelity: Fidelity) -> Settings {
    Settings::default().fidelity(fidelity).tolerance(1e-13)
}

/// Free indices; driven velocities and accelerations at time t.
fn driven(system: &System, t: f64) -> (Vec<usize>, DVector<f64>, DVector<f64>) {
    let nv = system.tree.velocities();
    let (mut free, mut v, mut a) = (Vec::new(), DVector::zeros(nv), DVector::zeros(nv));
    for (drive, link) in system.drives.iter().zip(system.tree.links()) {
        for (k, i) in link.v.clone().enumerate() {
            match drive {
                Drive::Free => free.push(i),
                Drive::Locked => {}
                Drive::Motion(m) => {
                    v[i] = m[k].rate(t);
                    a[i] = m[k].acceleration(t);
                }
            }
        }
    }
    (free, v, a)
}

/// RK4 of the velocity form, M_ff v̇_f = G_f − M_fd v̇_d, in a chart of q around each step's start.
fn velocity_form(
    simulator: &Simulator,
    control: &DVector<f64>,
    dt: f64,
    steps: usize,
) -> (DVector<f64>, DVector<f64>) {
    let stepper = simulator.stepper();
    let system = simulator.system();
    let (mut q, mut v) = (simulator.start().0.clone(), simulator.start().1.clone());
    let rate = |q: &DVector<f64>, xi: &DVector<f64>, v: &DVector<f64>, t: f64| {
        let (free, v_driven, a_driven) = driven(system, t);
        let mut v_all = v_driven;
        for &i in &free {
            v_all[i] = v[i];
        }
        let mut q = system.tree.integrate(q, xi);
        stepper.place_motions(&mut q, t);
        let e = stepper.linearise(&q, 0.0).unwrap();
        let right = e.inertial_force(&v_all, control).unwrap() - e.mass_matrix() * &a_driven;
        let m = e.mass_matrix().select_rows(&free).select_columns(&free);
        let a = m.cholesky().unwrap().solve(&right.select_rows(&free));
        let mut out = a_driven;
        for (k, &i) in free.iter().enumerate() {
            out[i] = a[k];
        }
        (system.tree.chart_rate(xi, &v_all), out)
    };
    let zero = DVector::zeros(v.len());
    for n in 0..steps {
        let t = n as f64 * dt;
        let (x1, a1) = rate(&q, &zero, &v, t);
        let (x2, a2) = rate(&q, &(0.5 * dt * &x1), &(&v + 0.5 * dt * &a1), t + 0.5 * dt);
        let (x3, a3) = rate(&q, &(0.5 * dt * &x2), &(&v + 0.5 * dt * &a2), t + 0.5 * dt);
        let (x4, a4) = rate(&q, &(dt * &x3), &(&v + dt * &a3), t + dt);
        q = system
            .tree
            .integrate(&q, &(dt / 6.0 * (x1 + 2.0 * x2 + 2.0 * x3 + x4)));
        v += dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
        stepper.place_motions(&mut q, t + dt);
        let (free, v_driven, _) = driven(system, t + dt);
        for i in 0..v.len() {
            if !free.contains(&i) {
                v[i] = v_driven[i];
            }
        }
    }
    (q, v)
}

/// Largest difference of q and v between the two forms at the end.
fn difference(scene: &Scene, fidelity: Fidelity, dt: f64, steps: usize) -> f64 {
    let chosen = settings(fidelity).integrator(Integrator::Rk4).time_step(dt);
    let simulator = Simulator::new(scene, chosen).unwrap();
    let rollout = simulator
        .rollout(&Controls::zeros(&simulator, steps))
        .unwrap();
    let Some(Controller::Constant { control }) = &scene.controller else {
        panic!("constant controls expected");
    };
    let control = DVector::from_vec(control.clone());
    let (q, v) = velocity_form(&simulator, &control, dt, steps);
    let last = rollout.samples().last().unwrap();
    (&last.q - q).amax().max((&last.v - v).amax())
}

fn forms_agree(fidelity: Fidelity, duration: f64, steps: [usize; 3]) {
    for tree in TREES {
        let scene = scene(tree);
        let d = steps.map(|n| difference(&scene, fidelity, duration / n as f64, n));
        let orders = [(d[0] / d[1]).log2(), (d[1] / d[2]).log2()];
        println!("{} {fidelity:?}: {d:?}, orders {orders:.2?}", scene.name);
        assert!(d[2] <= 1e-9, "{}: {d:?}", scene.name);
        // Rounding ends the fall.
        assert!(
            orders[0] >= 3.5 && (orders[1] >= 3.5 || d[1] < 1e-11),
            "{}: {d:?} {orders:?}",
            scene.name
        );
    }
}

#[test]
fn momentum_form_is_the_velocity_form_isolated() {
    forms_agree(Fidelity::Isolated, 0.04, [16, 32, 64]);
}

#[test]
fn momentum_form_is_the_velocity_form_coupled() {
    forms_agree(Fidelity::Full, 0.016, [4, 8, 16]);
}

fn check(simulator: &mut Simulator, name: &str, steps: usize) {
    let (fidelity, integrator) = (
        simulator.choices().water.fidelity,
        simulator.choices().integrator,
    );
    let report = gradcheck(
        simulator,
        &gradcheck::GradcheckSettings {
            steps,
            directions: 1,
            seed: 11,
            timings: 0,
            enough: Some(1e-7),
        },
    )
    .unwrap();
    println!(
        "{name} {fidelity:?} {integrator:?}: {:.1e}",
        report.max_rel_error
    );
    assert!(report.rel_error_controls.is_some() && report.rel_error_parameters.is_some());
    assert!(
        report.max_rel_error <= 1e-7,
        "{name} {fidelity:?} {integrator:?}: {:#?}",
        report.directions
    );
}

fn gradients(fidelity: Fidelity, steps: usize, faces: usize) {
    for tree in TREES {
        let mut scene = scene(tree);
        scene.set_faces(faces);
        for integrator in INTEGRATORS {
            let chosen = settings(fidelity).integrator(integrator);
            let mut simulator = Simulator::new(&scene, chosen).unwrap();
            check(&mut simulator, &scene.name, steps);
        }
    }
}

#[test]
fn gradients_isolated() {
    gradients(Fidelity::Isolated, 5, 80);
}

#[test]
fn gradients_coupled() {
    // Derivatives are exact at any resolution.
    gradients(Fidelity::Reduced, 3, 40);
    // What an integrator makes of a coupling doesn't depend on which it is: all bodies solved together take long.
    for (tree, integrator) in TREES.zip(INTEGRATORS.into_iter().cycle()) {
        let mut scene = scene(tree);
        scene.set_faces(20);
        let chosen = settings(Fidelity::Full).integrator(integrator);
        check(&mut Simulator::new(&scene, chosen).unwrap(), &scene.name, 3);
    }
}

/// Pushes always, holds one body's joint during some steps, then lets it go.
#[derive(Clone)]
struct HoldAndRelease {
    control: Vec<f64>,
    bodies: usize,
    body: usize,
    steps: std::ops::Range<usize>,
}

impl Policy for HoldAndRelease {
    fn act(&self, observed: &Observation) -> hydrograd::Result<Action> {
        let held = self.steps.contains(&observed.step);
        Ok(Action {
            control: self.control.clone(),
            hold: (0..self.bodies).map(|b| held && b == self.body).collect(),
            mode: 0,
        })
    }

    fn act_vjp(&self, _: &Observation, control_bar: &DVector<f64>) -> hydrograd::Result<ActionBar> {
        Ok(ActionBar {
            gains: control_bar.as_slice().to_vec(),
            ..ActionBar::default()
        })
    }

    fn gains(&self) -> Vec<f64> {
        self.control.clone()
    }

    fn with_gains(&self, gains: &[f64]) -> hydrograd::Result<Box<dyn Policy>> {
        Ok(Box::new(Self {
            control: gains.to_vec(),
            ..self.clone()
        }))
    }
}

fn held(tree: usize, body: usize, fidelity: Fidelity, integrator: Integrator) -> Simulator {
    let mut scene = scene(tree);
    scene.set_faces(40);
    let mut simulator = Simulator::new(&scene, settings(fidelity).integrator(integrator)).unwrap();
    let control = simulator.policy().gains();
    simulator.set_policy(Box::new(HoldAndRelease {
        control,
        bodies: 4,
        body,
        steps: 2..4,
    }));
    simulator
}

#[test]
fn gradients_through_hold_and_release() {
    // A revolute joint on a free body, a planar one on a driven parent, a free root.
    for (tree, body) in [(0, 1), (1, 2), (0, 0)] {
        for integrator in INTEGRATORS {
            let name = format!("tree {tree}, body {body} held");
            let mut simulator = held(tree, body, Fidelity::Isolated, integrator);
            check(&mut simulator, &name, 5);
        }
    }
    for integrator in INTEGRATORS {
        check(
            &mut held(0, 1, Fidelity::Reduced, integrator),
            "tree 0, body 1 held",
            5,
        );
    }
}

#[test]
fn held_joint_stands_still_and_moves_again() {
    for integrator in INTEGRATORS {
        let simulator = held(0, 1, Fidelity::Isolated, integrator);
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 7)).unwrap();
        let link = &simulator.system().tree.links()[1];
        let (iq, iv) = (link.q.start, link.v.start);
        let s = rollout.samples();
        // The steps from states 2 and 3 hold it.
        assert_eq!(s[2].q[iq], s[3].q[iq], "{integrator:?}");
        assert_eq!(s[2].q[iq], s[4].q[iq], "{integrator:?}");
        assert_eq!((s[3].v[iv], s[4].v[iv]), (0.0, 0.0), "{integrator:?}");
        assert!(s[2].v[iv] != 0.0 && s[5].v[iv] != 0.0, "{integrator:?}");
        assert!(s[1].q[iq] != s[2].q[iq] && s[4].q[iq] != s[6].q[iq]);
    }
}

/// Holding a joint that follows another holds that one, whose motion it is.
#[test]
fn a_follower_that_is_held_holds_its_leader() {
    let slide = |name: &str| {
        let body = Body::dry().named(name).mass(1.0).inertia([0.1; 3]);
        body.joint(Joint::Prismatic {
            axis: [1.0, 0.0, 0.0],
        })
    };
    let mut scene = Scene::new(Fluid::none());
    scene.add(slide("left").actuated());
    scene.add(slide("right").mimic(Mimic::new("left").ratio(-1.0)));
    for integrator in INTEGRATORS {
        let settings = Settings::default().integrator(integrator);
        let mut simulator = Simulator::new(&scene, settings).unwrap();
        simulator.set_policy(Box::new(HoldAndRelease {
            control: vec![1.0],
            bodies: 2,
            body: 1,
            steps: 2..4,
        }));
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 6)).unwrap();
        let s = rollout.samples();
        assert_eq!(s[2].q[0], s[4].q[0], "{integrator:?}");
        assert!(s[1].q[0] != s[2].q[0] && s[4].q[0] != s[6].q[0]);
        // What is told of a state of the run holds it as well: 1 N moves both masses before, and neither then.
        let told = |n: usize| rollout.loads(n).unwrap().acceleration()[0];
        assert!((told(1) - 0.5).abs() < 1e-12, "{integrator:?}: {}", told(1));
        assert_eq!(told(2), 0.0, "{integrator:?}");
    }
}
