//! What drifts with the water moves as in still water: every integrator's steps are the same in a current and in a frame that moves with it.

use crate::support::INTEGRATORS;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{
    Body, Contact, Controller, Drag, DragPart, Fluid, Joint, Plane, Scene, Shape, Spring,
};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};

/// m/s, in the plane that one of the bodies keeps to.
const CURRENT: [f64; 3] = [2.0, -1.5, 0.0];
pub const STEPS: usize = 50;

/// Heavy bodies on joints that may drift, with every force that the world or bodies put on them.
pub fn mechanism() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.5, 0.3, -9.81];
    let oval = |x, y, z| Shape::ellipsoid([x, y, z]).faces(20);
    let drag = Drag {
        part: DragPart::Total,
        linear: 15.0,
        quadratic_part: DragPart::Tangential,
        quadratic: 0.4,
    };
    scene.add(
        Body::new(oval(0.3, 0.2, 0.15))
            .named("hull")
            .density(3000.0)
            .center_of_mass([0.03, -0.02, -0.04])
            .drag(drag)
            .thruster(),
    );
    scene.add(
        Body::new(oval(0.15, 0.06, 0.1))
            .named("arm")
            .child_of("hull")
            .density(1300.0)
            .at([0.6, 0.0, 0.05])
            .joint(Joint::Revolute {
                axis: [0.3, 0.8, -0.2],
            })
            .drag(drag)
            .actuated(),
    );
    scene.add(
        Body::new(oval(0.12, 0.12, 0.05))
            .named("coin")
            .density(4000.0)
            .center_of_mass([0.02, 0.01, 0.0])
            .at([0.1, 0.9, 0.1])
            .rotated([0.0, 0.0, 0.4])
            .joint(Joint::Planar { plane: Plane::Xy }),
    );
    scene.add(
        Body::dry()
            .named("weight")
            .child_of("coin")
            .mass(0.7)
            .inertia([0.01, 0.02, 0.015])
            .center_of_mass([0.0, 0.05, 0.0])
            .joint(Joint::Prismatic {
                axis: [0.1, 0.2, 1.0],
            }),
    );
    let spring = Spring::new("hull").at([0.1, 0.05, 0.0]);
    let spring = spring.to("coin", [0.0, -0.1, 0.05]).stiffness(400.0);
    scene.add_force(spring.rest_length(0.3).damping(6.0).into());
    scene.initial.v = vec![0.3, -0.2, 0.1, 1.0, -0.5, 0.8, -1.0, 0.2, 0.1, 0.7, 0.05];
    scene.controller = Some(Controller::Constant {
        control: vec![20.0, -10.0, 30.0, 2.0, 1.0, -2.0, 1.0],
    });
    scene
}

/// Two spheres that meet and rub, in free flight.
pub fn collision() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    for (x, y) in [(-0.13, 0.0), (0.13, 0.06)] {
        let ball = Body::new(Shape::sphere(0.1).faces(20)).density(2500.0);
        scene.add(ball.at([x, y, 0.0]));
    }
    scene.initial.v = vec![0.8, 0.0, 0.0, 3.0, 0.0, 5.0, -0.8, 0.0, 0.0, 0.0, 2.0, 5.0];
    scene.contact = Some(Contact::default());
    scene
}

/// The scene as it is seen from the shore: everything drifts besides.
pub fn drifting(mut scene: Scene) -> Scene {
    scene.fluid.current = CURRENT;
    // Contact asks for an integrator that solves it; what the drift is doesn't depend on it.
    let contact = scene.contact.take();
    let simulator = Simulator::new(&scene, settings(Integrator::Rk4)).unwrap();
    let system = simulator.system();
    for (v, w) in scene
        .initial
        .v
        .iter_mut()
        .zip(system.drift.velocity().iter())
    {
        *v += w;
    }
    assert!(system.drift.is_whole());
    scene.contact = contact;
    scene
}

pub fn settings(integrator: Integrator) -> Settings {
    Settings::default()
        .fidelity(Fidelity::Full)
        .tolerance(1e-13)
        .integrator(integrator)
}

fn run(scene: &Scene, integrator: Integrator) -> Rollout {
    let simulator = Simulator::new(scene, settings(integrator)).unwrap();
    let controls = Controls::zeros(&simulator, STEPS);
    simulator.rollout(&controls).unwrap()
}

/// The largest difference of coordinates and velocities, SI units, once the drift is taken off.
fn difference(still: &Rollout, drifting: &Rollout) -> f64 {
    let system = drifting.simulator().system();
    let w = system.drift.velocity();
    let mut worst = 0.0_f64;
    for (a, b) in still.samples().iter().zip(drifting.samples()) {
        let there = system.tree.integrate(&a.q, &(a.time * w));
        worst = worst.max((there - &b.q).amax());
        worst = worst.max((&a.v + w - &b.v).amax());
    }
    worst
}

#[test]
fn a_mechanism_moves_alike_in_a_current_and_in_a_frame_that_drifts_with_it() {
    for integrator in INTEGRATORS {
        let [still, moving] = [mechanism(), drifting(mechanism())].map(|s| run(&s, integrator));
        let apart = difference(&still, &moving);
        let way = (&still.samples()[STEPS].v - &still.samples()[0].v).amax();
        println!("{integrator:?}: {apart:.1e}, velocities change by {way:.2}");
        assert!(way > 0.5 && apart < 1e-10, "{integrator:?}: {apart:.1e}");
    }
}

#[test]
fn so_do_bodies_that_collide() {
    for integrator in INTEGRATORS.into_iter().filter(|i| i.solves_contact()) {
        let scene = collision();
        let still = run(&scene, integrator);
        let pressed = |r: &Rollout| (0..STEPS).any(|n| !r.contacts(n, 0.0).unwrap().is_empty());
        assert!(pressed(&still), "{integrator:?}");
        let moving = run(&drifting(scene), integrator);
        let apart = difference(&still, &moving);
        println!("{integrator:?}: {apart:.1e}");
        assert!(apart < 1e-9, "{integrator:?}: {apart:.1e}");
    }
}

/// The heavy body of a report: its error of rotation is the same in a current as in still water.
#[test]
fn a_current_costs_no_accuracy() {
    let error = |current: f64, integrator| {
        let mut scene = Scene::new(Fluid::fresh_water());
        scene.fluid.current = [current, 0.0, 0.0];
        scene.gravity = [0.0, 0.0, -9.81];
        let body = Body::new(Shape::ellipsoid([0.3, 0.2, 0.1]).faces(80)).density(8000.0);
        scene.add(body);
        scene.initial.v = vec![current, 0.0, 0.0, 0.5, 1.0, -0.3];
        let end = |integrator, parts: usize| {
            let settings = Settings::default().fidelity(Fidelity::Isolated);
            let settings = settings.integrator(integrator);
            let settings = settings.time_step(0.01 / parts as f64);
            let simulator = Simulator::new(&scene, settings).unwrap();
            let controls = Controls::zeros(&simulator, 100 * parts);
            let q = simulator.rollout(&controls).unwrap().samples()[100 * parts]
                .q
                .clone();
            q.rows(3, 4).into_owned()
        };
        (end(integrator, 1) - end(Integrator::Rk4, 4)).norm()
    };
    for integrator in [Integrator::Rk2, Integrator::Midpoint] {
        let errors = [0.0, 1.0, 3.0].map(|current| error(current, integrator));
        println!("{integrator:?}: {errors:?}");
        let [still, slow, fast] = errors;
        assert!(still < 5e-3);
        assert!((slow / still - 1.0).abs() < 1e-6 && (fast / still - 1.0).abs() < 1e-6);
    }
}

/// In vacuum, a hinge on a body that flies at `speed`, m/s, with limits that it doesn't reach.
fn flying_hinge(speed: f64) -> Scene {
    let mut scene = Scene::new(Fluid::none());
    let heavy = Body::dry()
        .named("hull")
        .mass(1.6)
        .center_of_mass([0.0, 0.0, -0.13])
        .inertia([0.0099, 0.0099, 0.002]);
    scene.add(heavy);
    let axis = [-0.065, -1.02, -2.43];
    let mut arm = Body::dry()
        .named("arm")
        .child_of("hull")
        .mass(1.1)
        .center_of_mass([0.0, 0.0, -0.054])
        .inertia([0.0011, 0.0011, 0.00022])
        .at([0.0, 0.0, -0.27])
        .joint(Joint::Revolute { axis });
    arm.limits = Some([-100.0, 100.0]);
    scene.add(arm);
    scene.initial.v = vec![speed, 0.22, -0.27, 4.5, 4.0, -4.7, -2.8];
    scene
}

/// How a body swings on one that moves doesn't depend on how fast that is: the integrator that such a scene gets sees little of it.
#[test]
fn a_hinge_swings_on_a_moving_body_as_on_one_at_rest() {
    let angle = |scene: &Scene, integrator: Option<Integrator>, dt: f64| {
        let settings = Settings::default().time_step(dt);
        let settings = match integrator {
            Some(integrator) => settings.integrator(integrator),
            None => settings,
        };
        let simulator = Simulator::new(scene, settings).unwrap();
        let steps = (1.0 / dt).round() as usize;
        let rollout = simulator
            .rollout(&Controls::zeros(&simulator, steps))
            .unwrap();
        let chosen = simulator.choices().integrator;
        (rollout.samples()[steps].q[7], chosen)
    };
    let mut still = flying_hinge(0.0);
    still.bodies[1].limits = None;
    let exact = angle(&still, Some(Integrator::Rk4), 1e-3).0;
    for speed in [0.0, 3.0, 10.0] {
        let scene = flying_hinge(speed);
        let (found, chosen) = angle(&scene, None, 0.01);
        let (first, _) = angle(&scene, Some(Integrator::MomentumEuler), 0.01);
        println!(
            "{speed} m/s: off by {:.1e} rad ({chosen:?}), by momentum Euler {:.1e}",
            (found - exact).abs(),
            (first - exact).abs()
        );
        assert_eq!(chosen, Integrator::Midpoint);
        assert!((found - exact).abs() < 0.2, "{speed}: {found} for {exact}");
    }
    // With contact what rests is to read as at rest.
    let mut touching = flying_hinge(3.0);
    touching.contact = Some(Contact::default());
    let (_, chosen) = angle(&touching, None, 0.01);
    assert_eq!(chosen, Integrator::MomentumEuler);
}
