//! What a program hands to the simulator is checked: parameters, starts, controllers, steps.

use crate::support::{example, says};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Fluid, Joint, Motion, Preset, Scene, Servo};
use hydrograd::simulate::{Action, ActionBar, Method, Observation, Policy};
use hydrograd::{Controls, Error, Fidelity, Result, Settings, Simulator, objective};
use nalgebra::DVector;
use std::f64::consts::FRAC_PI_2;

fn simulator(name: &str) -> Simulator {
    let settings = Settings::default().faces(80).fidelity(Fidelity::Isolated);
    Simulator::new(&example(name), settings).unwrap()
}

/// A controller whose lists have the lengths that it is told.
#[derive(Clone)]
struct Lengths {
    control: usize,
    hold: usize,
    q: usize,
    gains: usize,
}

impl Policy for Lengths {
    fn act(&self, _: &Observation) -> Result<Action> {
        Ok(Action {
            control: vec![0.0; self.control],
            hold: vec![false; self.hold],
            mode: 0,
        })
    }

    fn act_vjp(&self, _: &Observation, _: &DVector<f64>) -> Result<ActionBar> {
        Ok(ActionBar {
            q: vec![0.0; self.q],
            v: Vec::new(),
            gains: vec![0.0; self.gains],
        })
    }

    fn gains(&self) -> Vec<f64> {
        vec![1.0; 2]
    }

    fn with_gains(&self, _: &[f64]) -> Result<Box<dyn Policy>> {
        Ok(Box::new(self.clone()))
    }
}

#[test]
fn controllers_with_lists_of_wrong_length_are_refused() {
    let mut s = simulator("falling_ball");
    let right = Lengths {
        control: 1,
        hold: 2,
        q: 4,
        gains: 2,
    };
    let cases = [
        (right.clone(), None),
        (
            Lengths {
                control: 3,
                ..right.clone()
            },
            Some("control"),
        ),
        (
            Lengths {
                hold: 9,
                ..right.clone()
            },
            Some("hold"),
        ),
        (
            Lengths {
                q: 3,
                ..right.clone()
            },
            Some("cotangent of q"),
        ),
        (Lengths { gains: 1, ..right }, Some("gains")),
    ];
    for (policy, word) in cases {
        s.set_policy(Box::new(policy));
        let controls = Controls::zeros(&s, 3);
        let outcome = s
            .rollout(&controls)
            .and_then(|r| r.gradient(&objective::final_velocity(0, 1.0, 1.0)));
        match word {
            None => assert!(outcome.is_ok()),
            Some(word) => {
                let message = outcome.unwrap_err().to_string();
                assert!(message.contains(word), "{message}");
            }
        }
    }
}

/// Why [`Unwilling`] doesn't act.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reason(usize);

impl std::fmt::Display for Reason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "not at step {}", self.0)
    }
}

impl std::error::Error for Reason {}

/// A controller that acts until a step, and is differentiated after one.
#[derive(Clone, Copy)]
struct Unwilling {
    acts_until: usize,
    differentiated_from: usize,
}

fn refused<T>(step: usize) -> Result<T> {
    Err(Error::Controller {
        source: Box::new(Reason(step)),
    })
}

impl Policy for Unwilling {
    fn act(&self, o: &Observation) -> Result<Action> {
        match o.step < self.acts_until {
            true => Ok(Action::default()),
            false => refused(o.step),
        }
    }

    fn act_vjp(&self, o: &Observation, _: &DVector<f64>) -> Result<ActionBar> {
        match o.step >= self.differentiated_from {
            true => Ok(ActionBar::default()),
            false => refused(o.step),
        }
    }

    fn with_gains(&self, _: &[f64]) -> Result<Box<dyn Policy>> {
        Ok(Box::new(*self))
    }
}

#[test]
fn errors_of_controllers_come_out_as_what_they_were() {
    let mut s = simulator("falling_ball");
    let reason = |error: Error| match error {
        Error::Controller { source } => *source.downcast::<Reason>().unwrap(),
        error => panic!("{error}"),
    };
    let controls = Controls::zeros(&s, 4);
    s.set_policy(Box::new(Unwilling {
        acts_until: 2,
        differentiated_from: 0,
    }));
    let error = s.rollout(&controls).err().unwrap();
    assert_eq!(error.to_string(), "controller: not at step 2");
    assert_eq!(reason(error), Reason(2));
    s.set_policy(Box::new(Unwilling {
        acts_until: 4,
        differentiated_from: 1,
    }));
    let rollout = s.rollout(&controls).unwrap();
    let error = rollout.gradient(&objective::final_velocity(0, 1.0, 1.0));
    assert_eq!(reason(error.unwrap_err()), Reason(0));
    assert_eq!(reason(rollout.jacobians().unwrap_err()), Reason(0));
}

#[test]
fn parameters_and_starts_that_can_not_be_are_refused() {
    let mut s = simulator("kirchhoff_ellipsoid");
    let good = s.parameters().clone();
    let other = simulator("two_spheres").parameters().clone();
    assert!(
        s.set_parameters(other)
            .unwrap_err()
            .to_string()
            .contains("linear")
    );
    let mut negative = good.clone();
    negative.set("ellipsoid.inertia.xx", -1.0).unwrap();
    assert!(
        s.set_parameters(negative)
            .unwrap_err()
            .to_string()
            .contains("inertia.xx")
    );
    let mut impossible = good.clone();
    let moments = ["xx", "yy", "zz"].map(|m| good.get(&format!("ellipsoid.inertia.{m}")).unwrap());
    let sum = moments.iter().sum::<f64>();
    impossible.set("ellipsoid.inertia.xx", sum).unwrap();
    let message = s.set_parameters(impossible).unwrap_err().to_string();
    for part in ["parameters ellipsoid.inertia", "sum of the other two"] {
        assert!(message.contains(part), "{message}");
    }
    let mut quadratic = good.clone();
    quadratic.set("ellipsoid.drag.quadratic", 1.0).unwrap();
    assert!(
        s.set_parameters(quadratic)
            .unwrap_err()
            .to_string()
            .contains("quadratic")
    );
    s.set_parameters(good).unwrap();
    let v = s.start().1.clone();
    for q in [[0.0; 7], [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0]] {
        let message = s
            .set_start(DVector::from_row_slice(&q), v.clone())
            .unwrap_err()
            .to_string();
        assert!(message.contains("quaternion"), "{message}");
    }
}

/// A coefficient of zero has a derivative, and a coefficient set later drags.
#[test]
fn drag_works_where_the_scene_gives_none() {
    let mut s = simulator("kirchhoff_ellipsoid");
    let controls = Controls::zeros(&s, 20);
    let goal = objective::final_velocity(0, 0.0, 1.0);
    let (slope, free) = {
        let r = s.rollout(&controls).unwrap();
        let slope = r.gradient(&goal).unwrap().parameters;
        let slope = slope.get("ellipsoid.drag.linear").unwrap();
        (slope, r.value(&goal).unwrap())
    };
    assert!(slope < 0.0, "{slope}");
    let mut p = s.parameters().clone();
    p.set("ellipsoid.drag.linear", 1e-3).unwrap();
    s.set_parameters(p).unwrap();
    let dragged = s.rollout(&controls).unwrap().value(&goal).unwrap();
    let difference = (dragged - free) / 1e-3;
    assert!(
        (difference / slope - 1.0).abs() < 1e-2,
        "{difference} {slope}"
    );
}

/// Explicit steps of stiff drag blow up: the run says so, with the numbers.
#[test]
fn energy_from_nowhere_is_told() {
    let mut stiff = example("kirchhoff_ellipsoid");
    let settings = Settings::default().faces(80).fidelity(Fidelity::Isolated);
    let calm = Simulator::new(&stiff, settings.clone()).unwrap();
    let controls = Controls::zeros(&calm, 20);
    assert!(calm.rollout(&controls).unwrap().warnings().is_empty());
    // Past the stability limit: a warning, and where nothing can be computed any more, an error.
    let mut told = [0, 0];
    for linear in [1e4, 3e4, 1e5, 1e6] {
        stiff.bodies[0].drag = Some(hydrograd::scene::Drag {
            linear,
            ..Default::default()
        });
        let explicit = Simulator::new(&stiff, settings.integrator(Integrator::Rk2)).unwrap();
        match explicit.rollout(&controls) {
            Ok(r) => {
                let stable = r.samples()[20].energy() < r.samples()[0].energy();
                let warned = r.warnings().iter().any(|w| w.contains("time step"));
                println!("{linear}: stable {stable}, warned {warned}");
                assert!(stable || warned, "{linear}");
                told[0] += usize::from(warned);
            }
            Err(e) => {
                println!("{linear}: {e}");
                assert!(e.to_string().contains("time step"), "{e}");
                told[1] += 1;
            }
        }
    }
    assert!(told[0] > 0 && told[1] > 0, "{told:?}");
    let implicit = Simulator::new(&stiff, settings.integrator(Integrator::MomentumEuler)).unwrap();
    assert!(implicit.rollout(&controls).unwrap().warnings().is_empty());
}

/// What a motion gives is no energy from nowhere, of a dry body in or far off its axis as well.
#[test]
fn energy_of_a_given_motion_is_told_of_nobody() {
    for center in [0.0, 0.3] {
        let mut scene = Scene::new(Fluid::fresh_water());
        let axis = [1.0, 0.0, 0.0];
        let crank = Body::dry().mass(1.0).inertia([0.03, 0.001, 0.03]);
        let crank = crank.center_of_mass([0.0, center, 0.0]);
        let from_rest = Motion::Sine {
            offset: 0.0,
            amplitude: 0.5,
            frequency: 6.0,
            phase: FRAC_PI_2,
        };
        scene.add(crank.joint(Joint::Revolute { axis }).driven([from_rest]));
        let simulator = Simulator::new(&scene, Settings::default()).unwrap();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 50)).unwrap();
        assert!(rollout.samples()[50].kinetic_energy > 0.0);
        assert_eq!(rollout.warnings(), Vec::<String>::new());
    }
}

#[test]
fn runs_too_long_to_be_kept_are_refused() {
    let mut long = example("kirchhoff_ellipsoid");
    long.steps = 1_000_000_000;
    let settings = Settings::default().faces(80).fidelity(Fidelity::Isolated);
    let s = Simulator::new(&long, settings).unwrap();
    let message = s
        .rollout(&Controls::zeros(&s, s.steps()))
        .map(|_| ())
        .unwrap_err()
        .to_string();
    assert!(message.contains("steps"), "{message}");
}

/// What a scene says counts for whoever simulates it, unless other settings are asked for.
#[test]
fn a_scenes_own_choices_count() {
    let mut scene = example("kirchhoff_ellipsoid");
    scene.preset = Preset::Paper;
    scene.time_step = 0.02;
    scene.set_faces(80);
    let asked = Settings::default().fidelity(Fidelity::Isolated);
    let simulator = Simulator::new(&scene, asked.clone()).unwrap();
    assert_eq!(simulator.choices().integrator, Integrator::VelocityEuler);
    assert_eq!(simulator.choices().water.method, Method::MfsFace);
    assert_eq!((simulator.time_step(), simulator.faces()), (0.02, 80));
    let other = Settings {
        preset: Some(Preset::Default),
        ..asked
    };
    let simulator = Simulator::new(&scene, other.time_step(0.01).faces(320)).unwrap();
    assert_eq!(simulator.choices().integrator, Integrator::default());
    assert_eq!(simulator.choices().water.method, Method::Auto);
    let surface = simulator.meshes().unwrap()[0]
        .as_ref()
        .unwrap()
        .faces()
        .len();
    assert_eq!((simulator.time_step(), surface), (0.01, 320));
}

/// Steps are counted from where the run began, in whatever piece of it something is wrong.
#[test]
fn errors_name_the_step_of_the_run() {
    #[derive(Clone)]
    struct Broken;
    impl Policy for Broken {
        fn act(&self, o: &Observation) -> Result<Action> {
            let control = if o.step == 1002 { f64::NAN } else { 0.0 };
            Ok(Action {
                control: vec![control; 6],
                ..Action::default()
            })
        }
        fn act_vjp(&self, _: &Observation, _: &DVector<f64>) -> Result<ActionBar> {
            Ok(ActionBar::default())
        }
        fn with_gains(&self, _: &[f64]) -> Result<Box<dyn Policy>> {
            Ok(Box::new(self.clone()))
        }
    }
    let mut scene = Scene::new(Fluid::none());
    let body = Body::dry().named("cart").mass(1.0).inertia([0.1; 3]);
    scene.add(body.joint(Joint::Free).actuated());
    let mut simulator = Simulator::new(&scene, Settings::default()).unwrap();
    simulator.set_policy(Box::new(Broken));
    let (q, v) = simulator.start();
    let state = simulator.state(1000, q, v).unwrap();
    let run = simulator.rollout_from(&state, &Controls::zeros(&simulator, 5), |_| {
        std::ops::ControlFlow::Continue(())
    });
    says(run.err().unwrap(), &["at step 1002"]);
}

/// Numbers of the wrong length are errors of the equations of motion, not of what they are made of.
#[test]
fn equations_of_motion_check_lengths() {
    let simulator = simulator("kirchhoff_ellipsoid");
    let (q, _) = simulator.start();
    let equations = simulator.equations(q).unwrap();
    let (none, short) = (simulator.no_control(), DVector::zeros(5));
    says(
        equations.force(&short, &short, &none).unwrap_err(),
        &["velocity v"],
    );
    let right = DVector::zeros(6);
    says(
        equations.force(&right, &short, &none).unwrap_err(),
        &["acceleration"],
    );
    assert!(equations.force(&right, &right, &none).is_ok());
}

/// A servo looks ahead by a step in steps; what acts at an instant knows of none.
#[test]
fn equations_of_motion_know_no_time_step() {
    let axis = [0.0, 0.0, 1.0];
    for time_step in [1e-6, 0.01, 0.05] {
        let mut scene = Scene::new(Fluid::none());
        scene.time_step = time_step;
        let arm = Body::dry().named("arm").mass(1.0).inertia([0.02; 3]);
        let arm = arm.joint(Joint::Revolute { axis }).actuated();
        scene.add(arm.servo(Servo::new(10.0, 0.5)));
        let simulator = Simulator::new(&scene, Settings::default()).unwrap();
        let equations = simulator.equations(&DVector::from_element(1, 0.2)).unwrap();
        let one = |x| DVector::from_element(1, x);
        let found = equations.acceleration(&one(1.5), &one(0.3), &one(0.0), &one(0.0));
        let exact = (10.0 * (0.3 - 0.2) - 0.5 * 1.5) / 0.02;
        assert!(
            (found.unwrap()[0] / exact - 1.0).abs() < 1e-12,
            "{time_step}"
        );
        let force = equations.force(&one(1.5), &one(exact), &one(0.3)).unwrap();
        assert!(force[0].abs() < 1e-12, "{time_step}: {force}");
    }
}
