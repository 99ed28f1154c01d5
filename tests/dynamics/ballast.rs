//! Floats and ballast, buoyancy of one's own, and rotors that lag, against what they do on paper.

use crate::support::says;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Float, Fluid, Joint, Passive, Scene, Shape, Thruster};
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

const GRAVITY: f64 = 9.81;
const DENSITY: f64 = 998.0;

fn simulator(scene: &Scene, integrator: Integrator) -> Simulator {
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    Simulator::new(scene, settings.integrator(integrator)).unwrap()
}

fn gradients(scene: &Scene) {
    assert_eq!(
        Scene::from_toml(&scene.to_toml().unwrap(), "").unwrap(),
        *scene
    );
    for integrator in [
        Integrator::MomentumEuler,
        Integrator::Midpoint,
        Integrator::Rk4,
        Integrator::VelocityEuler,
    ] {
        let mut simulator = simulator(scene, integrator);
        let settings = gradcheck::GradcheckSettings {
            steps: 20,
            directions: 2,
            seed: 1,
            timings: 0,
            enough: Some(1e-7),
        };
        let report = gradcheck(&mut simulator, &settings).unwrap();
        assert!(report.max_rel_error < 1e-7, "{integrator:?}: {report:?}");
    }
}

fn water() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene
}

/// A body with ballast and foam is one with the mass, the centre and the inertia of all together.
#[test]
fn ballast_is_part_of_its_body() {
    let (mass, ballast, foam) = (2.0, 0.5, 0.1);
    let [center, low, high] = [[0.02, 0.0, 0.01], [0.05, -0.1, -0.2], [0.0, 0.1, 0.15]];
    let inertia = [0.2, 0.25, 0.3, 0.01, -0.02, 0.015];
    let mut scene = water();
    let body = Body::dry().named("rov").mass(mass).center_of_mass(center);
    scene.add(body.inertia(inertia));
    scene.add_force(Float::new("rov").at(low).mass(ballast).into());
    scene.add_force(
        Float::new("rov")
            .named("foam")
            .at(high)
            .mass(foam)
            .volume(1e-3)
            .into(),
    );
    let sim = simulator(&scene, Integrator::Rk4);
    let parts = [(mass, center), (ballast, low), (foam, high)].map(|(m, c)| (m, Vector3::from(c)));
    let total: f64 = parts.iter().map(|p| p.0).sum();
    let common: Vector3<f64> = parts.iter().map(|(m, c)| *m * c).sum::<Vector3<f64>>() / total;
    let [xx, yy, zz, xy, xz, yz] = inertia;
    let mut about = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    for (m, c) in parts {
        let d = c - common;
        about += m * (Matrix3::identity() * d.norm_squared() - d * d.transpose());
    }
    let parameters = sim.parameters();
    assert!((parameters.mass(0) - total).abs() < 1e-15);
    assert!((parameters.center_of_mass(0) - common).norm() < 1e-15);
    let six = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|at| about[at]);
    let found = parameters.inertia(0);
    assert!(found.iter().zip(six).all(|(a, b)| (a - b).abs() < 1e-15));
    // The foam holds it where it is, and the rest pulls at the common centre.
    let (q, v) = sim.start();
    let equations = sim.equations(q).unwrap();
    let force = -equations.bias_force(v, &sim.no_control()).unwrap();
    let (weight, lift) = (-total * GRAVITY, DENSITY * 1e-3 * GRAVITY);
    let moment = common.cross(&Vector3::new(0.0, 0.0, weight))
        + Vector3::from(high).cross(&Vector3::new(0.0, 0.0, lift));
    let exact = DVector::from_vec(vec![0.0, 0.0, weight + lift, moment.x, moment.y, moment.z]);
    assert!((force - exact).norm() < 1e-13);
    let (volume, place) = equations.center_of_buoyancy().unwrap();
    assert!((volume - 1e-3).abs() < 1e-18 && (place - Vector3::from(high)).norm() < 1e-15);
    let (_, place) = equations.center_of_mass().unwrap();
    assert!((place - common).norm() < 1e-15);
}

/// Small rolls of a body whose centre of buoyancy stands above its centre of mass, by volume and centre of its own: I θ̈ = −ρ V g h θ.
#[test]
fn a_body_rights_itself_by_its_own_buoyancy() {
    let (mass, height, inertia) = (5.0, 0.04, 0.12);
    let axis = [1.0, 0.0, 0.0];
    let mut scene = water();
    scene.time_step = 2e-3;
    let body = Body::dry()
        .named("rov")
        .mass(mass)
        .inertia([inertia, 0.2, 0.3]);
    let body = body
        .volume(mass / DENSITY)
        .center_of_buoyancy([0.0, 0.0, height]);
    scene.add(body.joint(Joint::Revolute { axis }));
    scene.initial.q = vec![1e-4];
    let sim = simulator(&scene, Integrator::Rk4);
    let rollout = sim.rollout(&Controls::zeros(&sim, 1000)).unwrap();
    let rate = (mass * GRAVITY * height / inertia).sqrt();
    for s in rollout.samples() {
        assert!((s.q[0] / 1e-4 - (rate * s.time).cos()).abs() < 1e-7);
    }
    let energies = rollout.samples().iter().map(|s| s.energy());
    let first = rollout.samples()[0].energy();
    assert!(
        energies
            .into_iter()
            .all(|e| (e - first).abs() < 1e-12 * first.abs())
    );
}

/// A shape's volume and centroid are what a body is buoyant by unless it says otherwise, and all of it has gradients.
#[test]
fn buoyancy_and_ballast_have_their_gradients() {
    let mut scene = water();
    let body = || Body::new(Shape::ellipsoid([0.2, 0.1, 0.08]).faces(20));
    let rov = body()
        .named("rov")
        .density(1050.0)
        .rotated([0.3, -0.2, 0.5]);
    scene.add(rov.shape_at([0.01, 0.0, 0.02], [0.1, 0.0, 0.0]));
    let arm = body()
        .named("arm")
        .density(1500.0)
        .child_of("rov")
        .at([0.5, 0.0, 0.0]);
    let arm = arm.volume(9e-3).center_of_buoyancy([0.02, 0.03, -0.01]);
    let axis = [0.2, 0.9, -0.1];
    scene.add(arm.joint(Joint::Revolute { axis }));
    scene.add_force(
        Float::new("arm")
            .at([0.1, 0.02, 0.05])
            .volume(1e-3)
            .mass(0.3)
            .into(),
    );
    scene.initial.v = vec![0.2, -0.1, 0.3, 0.5, -0.4, 0.3, 0.8];
    let sim = simulator(&scene, Integrator::Rk4);
    let parameters = sim.parameters();
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 0.2 * 0.1 * 0.08;
    assert!((parameters.volume(0) / exact - 1.0).abs() < 1e-12);
    let centroid = nalgebra::Vector3::new(0.01, 0.0, 0.02);
    assert!((parameters.center_of_buoyancy(0) - centroid).norm() < 1e-12);
    assert_eq!(parameters.volume(1), 9e-3);
    for name in [
        "rov.center_of_mass.y",
        "rov.volume",
        "arm.center_of_buoyancy.z",
        "float 1.volume",
    ] {
        assert!(parameters.get(name).is_ok(), "{name}");
    }
    gradients(&scene);
}

#[test]
fn buoyancies_that_can_not_be_are_refused() {
    let refused = |change: &dyn Fn(&mut Scene), words: &[&str]| {
        let mut scene = water();
        scene.add(Body::dry().named("rov").mass(1.0).inertia([0.1; 3]));
        change(&mut scene);
        says(scene.validate().unwrap_err(), words);
    };
    let add = |float: Float| move |s: &mut Scene| s.add_force(float.clone().into());
    refused(&add(Float::new("auv")), &["forces[0].body", "\"auv\""]);
    refused(
        &add(Float::new("rov").volume(-1.0)),
        &["forces[0].volume", "-1", "m³"],
    );
    refused(
        &add(Float::new("rov").mass(f64::NAN)),
        &["forces[0].mass", "NaN", "kg"],
    );
    refused(
        &|s| s.bodies[0].volume = Some(-0.1),
        &["body \"rov\": volume", "-0.1"],
    );
    refused(
        &|s| s.bodies[0].center_of_buoyancy = Some([0.0; 3]),
        &["body \"rov\": center_of_buoyancy", "`volume`"],
    );
    // Under a surface no float, by a parameter neither.
    let mut scene = water();
    scene.gravity = [0.0, 0.0, -9.81];
    scene.waterline = Some(10.0);
    scene.add(Body::dry().named("rov").mass(1.0).inertia([0.1; 3]));
    let mut floating = scene.clone();
    add(Float::new("rov").volume(1e-3))(&mut floating);
    let words = ["volume", "0.001", "buoyant at any height", "waterline"];
    says(floating.validate().unwrap_err(), &words);
    add(Float::new("rov").mass(0.1).named("ballast"))(&mut scene);
    let mut sim = simulator(&scene, Integrator::Rk4);
    let mut parameters = sim.parameters().clone();
    parameters.set("ballast.volume", 1e-3).unwrap();
    says(sim.set_parameters(parameters).unwrap_err(), &words);
    // A parameter of a body that the scene gives no volume.
    let mut scene = water();
    scene.add(Body::dry().named("rov").mass(1.0).inertia([0.1; 3]));
    let mut sim = simulator(&scene, Integrator::Rk4);
    let mut parameters = sim.parameters().clone();
    parameters.set("rov.volume", 0.1).unwrap();
    let error = sim.set_parameters(parameters).unwrap_err();
    says(error, &["rov.volume", "give it `volume`"]);
}

/// A vehicle on a rail with a thruster whose rotor hangs on the world: the rotor goes to its command with its time constant.
fn lagging(time_constant: f64) -> Scene {
    let axis = [1.0, 0.0, 0.0];
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.time_step = 2e-3;
    let hull = Body::dry().named("hull").mass(4.0).inertia([0.1; 3]);
    scene.add(hull.joint(Joint::Prismatic { axis }));
    let rotor = Body::dry()
        .named("rotor")
        .mass(0.1)
        .inertia([2e-3, 1e-3, 1e-3]);
    scene.add(rotor.joint(Joint::Revolute { axis }));
    let thruster = Thruster::new("hull").named("jet").polynomial([0.2]);
    scene.add_force(thruster.rotor("rotor", time_constant).into());
    scene
}

/// n = u (1 − e^(−t/T)) and m v = c u (t − T (1 − e^(−t/T))).
#[test]
fn a_rotor_lags() {
    a_rotor_lags_in(lagging(0.15), 0.15);
    // What its gear adds to its inertia makes it no slower.
    let mut geared = lagging(0.15);
    geared.bodies[1].passive = Some(Passive::default().armature(0.1));
    a_rotor_lags_in(geared, 0.15);
}

fn a_rotor_lags_in(scene: Scene, time_constant: f64) {
    let u = 30.0;
    let sim = simulator(&scene, Integrator::Rk4);
    assert_eq!(sim.control_names(), ["jet"]);
    let controls = DMatrix::from_element(1, 300, u);
    let rollout = sim.rollout(&Controls::from_matrix(&sim, controls).unwrap());
    for s in rollout.unwrap().samples() {
        let gone = 1.0 - (-s.time / time_constant).exp();
        let speed = 0.2 * u * (s.time - time_constant * gone) / 4.0;
        assert!((s.v[1] - u * gone).abs() < 1e-8, "{} {}", s.v[1], u * gone);
        assert!((s.v[0] - speed).abs() < 1e-9, "{} {speed}", s.v[0]);
    }
    gradients(&scene);
}

/// One carried by the vehicle, which feels it come up to speed; and that what can't be a rotor is refused.
#[test]
fn a_rotor_on_its_vehicle_turns_it_back() {
    let axis = [1.0, 0.0, 0.0];
    let mut scene = Scene::new(Fluid::fresh_water());
    let hull = Body::dry().named("hull").mass(4.0).inertia([0.1, 0.2, 0.3]);
    scene.add(hull);
    let rotor = Body::dry()
        .named("rotor")
        .mass(0.1)
        .inertia([2e-3, 1e-3, 1e-3]);
    let rotor = rotor.child_of("hull").at([-0.3, 0.0, 0.0]);
    scene.add(rotor.joint(Joint::Revolute { axis }));
    let thruster = Thruster::new("hull")
        .at([-0.3, 0.0, 0.0])
        .polynomial([0.0, 1e-2]);
    scene.add_force(thruster.rotor("rotor", 0.2).torque(0.01).loss(1e-3).into());
    let sim = simulator(&scene, Integrator::Rk4);
    let controls = DMatrix::from_element(1, 20, 40.0);
    let rollout = sim
        .rollout(&Controls::from_matrix(&sim, controls).unwrap())
        .unwrap();
    let last = rollout.samples().last().unwrap();
    // Thrust forward, and the rotor's spin against the hull's.
    assert!(
        last.v[0] > 0.0 && last.v[6] > 0.0 && last.v[3] < 0.0,
        "{}",
        last.v
    );
    gradients(&scene);
    let refused = |change: &dyn Fn(&mut Thruster), words: &[&str]| {
        let mut scene = scene.clone();
        scene.forces.clear();
        let mut thruster = Thruster::new("hull").rotor("rotor", 0.2);
        change(&mut thruster);
        scene.add_force(thruster.into());
        says(scene.validate().unwrap_err(), words);
    };
    refused(
        &|t| t.rotor = Some("screw".into()),
        &["forces[0].rotor", "\"screw\""],
    );
    refused(
        &|t| t.rotor = Some("hull".into()),
        &["forces[0].rotor", "pushes"],
    );
    refused(
        &|t| t.rotor = None,
        &["forces[0].time_constant", "give `rotor`"],
    );
    refused(
        &|t| t.time_constant = None,
        &["forces[0].rotor", "time_constant"],
    );
    refused(
        &|t| t.time_constant = Some(0.0),
        &["forces[0].time_constant", "above zero"],
    );
}
