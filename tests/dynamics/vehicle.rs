//! Forces that vehicles and swimmers need, against what they do on paper: damping matrices, thrusters, fins, trailing edges.

use crate::support::says;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{
    Body, Controller, Damping, Edge, Fin, Fluid, Force, Joint, Scene, Servo, Shape, Spring, Tendon,
    Thruster,
};
use hydrograd::simulate::Sample;
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Rotation3, Vector3, Vector6};

const MASS: f64 = 2.0;
const DENSITY: f64 = 998.0;

/// A dry body without a centre of mass off its origin.
fn dry(name: &str, joint: Joint) -> Body {
    let body = Body::dry().named(name).mass(MASS);
    body.inertia([0.2, 0.25, 0.3]).joint(joint)
}

fn with(force: impl Into<Force>, joint: Joint, current: [f64; 3]) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: DENSITY,
        current,
    });
    scene.time_step = 1e-3;
    scene.add(dry("rov", joint));
    scene.add_force(force.into());
    scene
}

fn simulator(scene: &Scene, integrator: Integrator) -> Simulator {
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    Simulator::new(scene, settings.integrator(integrator)).unwrap()
}

/// The wrench of the scene's forces on its only body, a free one, turned by `rotation`, at the velocity v (of its origin, and about it; world axes): world axes, about the
/// body's origin.
fn wrench(scene: &Scene, rotation: Vector3<f64>, v: Vector6<f64>, u: &[f64]) -> Vector6<f64> {
    let mut bare = scene.clone();
    bare.forces.clear();
    let turn = nalgebra::UnitQuaternion::from_scaled_axis(rotation);
    let q = DVector::from_vec(vec![0.3, -0.2, 0.5, turn.w, turn.i, turn.j, turn.k]);
    let v = DVector::from_column_slice(v.as_slice());
    let force = |scene: &Scene, u: DVector<f64>| {
        let sim = simulator(scene, Integrator::Rk4);
        let equations = sim.equations(&q).unwrap();
        -equations.bias_force(&v, &u).unwrap()
    };
    let with = force(scene, DVector::from_column_slice(u));
    let found = with - force(&bare, DVector::zeros(0));
    Vector6::from_column_slice(found.as_slice())
}

fn turned(rotation: Vector3<f64>) -> Matrix6<f64> {
    let r: Matrix3<f64> = Rotation3::new(rotation).into_inner();
    let mut out = Matrix6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&r);
    out
}

fn close(found: Vector6<f64>, expected: Vector6<f64>) {
    let error = (found - expected).norm() / expected.norm();
    assert!(error < 1e-12, "{found:?} is not {expected:?}: {error:.1e}");
}

/// Every group of the gradient against differences, and the scene as a file and back.
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

/// A vehicle of two links with everything on it, tumbling in a current.
fn everything() -> Scene {
    let mut scene = Scene::new(Fluid {
        density: DENSITY,
        current: [0.2, -0.1, 0.05],
    });
    scene.gravity = [0.0, 0.0, -9.81];
    let body = Body::new(Shape::ellipsoid([0.2, 0.1, 0.08]).faces(20));
    scene.add(body.named("rov").density(1000.0).rotated([0.3, -0.2, 0.5]));
    let body = Body::new(Shape::ellipsoid([0.08, 0.02, 0.05]).faces(20));
    let joint = Joint::Revolute {
        axis: [0.1, 0.0, 1.0],
    };
    let rudder = body.named("rudder").density(1200.0).child_of("rov");
    scene.add(rudder.at([-0.35, 0.0, 0.0]).joint(joint).actuated());
    scene.initial.v = vec![0.6, -0.2, 0.3, 0.5, -0.4, 0.3, 0.8];
    let mut rows = [[0.0; 6]; 6];
    for (i, row) in rows.iter_mut().enumerate() {
        row[i] = [2.0, 3.0, 2.5, 0.05, 0.06, 0.07][i];
    }
    (rows[0][1], rows[1][5], rows[5][1], rows[2][0]) = (0.4, 0.1, -0.05, -0.7);
    let damping = Damping::new("rov").named("hull").at([0.02, 0.0, -0.01]);
    scene.add_force(
        damping
            .linear(rows)
            .quadratic([9.0, 12.0, 14.0, 0.1, 0.1, 0.2])
            .into(),
    );
    let jet = Thruster::new("rov").named("jet").at([-0.2, 0.05, 0.0]);
    let jet = jet.polynomial([0.5, 20.0]).dead_band(0.1).torque(0.02);
    scene.add_force(jet.loss(4.0).into());
    let lift = Thruster::new("rov")
        .at([0.05, -0.05, 0.02])
        .direction([0.0, 0.2, 1.0]);
    let table = [
        [-1.0, -30.0],
        [-0.3, -5.0],
        [-0.1, -0.5],
        [0.2, 1.0],
        [0.5, 12.0],
        [1.0, 40.0],
    ];
    scene.add_force(lift.table(table).loss(2.0).into());
    let blade = Fin::new("rudder")
        .chord([1.0, 0.0, 0.0], 0.1)
        .normal([0.0, 1.0, 0.0]);
    scene.add_force(
        blade
            .area(0.02)
            .lift_slope(4.0)
            .drag(0.02)
            .induced_drag(1.3)
            .into(),
    );
    scene
}

#[test]
fn a_vehicle_with_everything_has_its_gradients() {
    let scene = everything();
    let sim = simulator(&scene, Integrator::Rk4);
    let names: Vec<&str> = sim.parameters().names().collect();
    for name in [
        "hull.linear.x.x",
        "hull.linear.wz.y",
        "hull.quadratic.wx",
        "jet.coefficient.1",
        "jet.coefficient.2",
        "jet.dead_band",
        "jet.loss",
        "jet.torque",
        "thruster 3.thrust.0",
        "thruster 3.thrust.5",
        "fin 4.area",
        "fin 4.lift_slope",
        "fin 4.drag",
        "fin 4.induced_drag",
    ] {
        assert!(names.contains(&name), "no {name} in {names:?}");
    }
    assert_eq!(
        sim.control_names(),
        ["rudder.force.rate", "jet", "thruster 3"]
    );
    // Those of the jet's polynomial and of the table are no newtons.
    assert_eq!(sim.control_units(), ["N m", "1", "1"]);
    gradients(&scene);
}

/// Controls of all kinds, with their units.
#[test]
fn controls_have_names_and_units() {
    let mut scene = Scene::new(Fluid::fresh_water());
    let body = |name: &str| {
        Body::new(Shape::sphere(0.1).faces(20))
            .named(name)
            .density(1000.0)
    };
    let axis = [0.0, 0.0, 1.0];
    let (turns, slides) = (Joint::Revolute { axis }, Joint::Prismatic { axis });
    let servo = Servo::new(10.0, 1.0);
    scene.add(body("hull").thruster());
    scene.add(body("arm").joint(turns).actuated().servo(servo));
    scene.add(body("rail").joint(slides).actuated().servo(servo));
    scene.add(body("cart").joint(slides).actuated());
    scene.add(body("screw").joint(turns).child_of("hull"));
    scene.add(body("tail").joint(turns));
    scene.add(body("slide").joint(slides));
    let jet = || Thruster::new("hull").direction([1.0, 0.0, 0.0]);
    scene.add_force(jet().named("plain").into());
    scene.add_force(jet().named("square").polynomial([0.0, 2.0]).into());
    scene.add_force(jet().named("spun").rotor("screw", 0.1).into());
    scene.add_force(
        Tendon::new([("tail", 0.04)])
            .named("rope")
            .stiffness(9.0)
            .into(),
    );
    let crank = Tendon::new([("slide", 1.0)]).named("crank");
    scene.add_force(crank.stiffness(9.0).gain(0.1).into());
    let found: Vec<_> = scene
        .control_labels()
        .into_iter()
        .zip(scene.control_units())
        .collect();
    let found: Vec<_> = found
        .iter()
        .map(|(name, unit)| (&name[..], *unit))
        .collect();
    let wrench = ["fx", "fy", "fz", "mx", "my", "mz"].map(|x| format!("hull.wrench.{x}"));
    for (k, name) in wrench.iter().enumerate() {
        assert_eq!(found[k], (&name[..], if k < 3 { "N" } else { "N m" }));
    }
    assert_eq!(
        found[6..],
        [
            ("arm.target.angle", "rad"),
            ("rail.target.position", "m"),
            ("cart.force.velocity", "N"),
            ("plain", "N"),
            ("square", "1"),
            ("spun", "rad/s"),
            ("rope", "m"),
            ("crank", "1"),
        ]
    );
    assert_eq!(scene.controls(), found.len());
}

/// Along one axis, in a current: m v̇ = −d (v − U), and m v̇ = −c |v − U| (v − U).
#[test]
fn damping_slows_a_body_to_the_current() {
    let (d, c, fast, current) = (1.7, 2.4, 1.5, 0.3);
    for (linear, quadratic) in [(d, 0.0), (0.0, c)] {
        let damping = Damping::new("rov").linear([linear, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let damping = damping.quadratic([quadratic, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let axis = [1.0, 0.0, 0.0];
        let mut scene = with(damping, Joint::Prismatic { axis }, [current, 0.0, 0.0]);
        scene.initial.v = vec![current + fast];
        let sim = simulator(&scene, Integrator::Rk4);
        let rollout = sim.rollout(&Controls::zeros(&sim, 500)).unwrap();
        for s in rollout.samples() {
            let t = s.time;
            let exact = match linear > 0.0 {
                true => fast * (-d * t / MASS).exp(),
                false => fast / (1.0 + c / MASS * fast * t),
            };
            assert!((s.v[0] - current - exact).abs() < 1e-12, "{}", s.v[0]);
        }
    }
}

/// −Tᵀ (D_L ν + D_Q |ν| ν) in the body's frame, T taking twists from the origin to the point.
#[test]
fn damping_turns_with_its_body() {
    let number = |i: usize, j: usize| (0.7 + 1.3 * (6 * i + j) as f64).sin();
    let linear: [[f64; 6]; 6] =
        std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 7.0 } else { number(i, j) }));
    let quadratic: [[f64; 6]; 6] =
        std::array::from_fn(|i| std::array::from_fn(|j| number(j, i).abs()));
    let point = Vector3::new(0.2, -0.1, 0.3);
    let current = [0.3, 0.1, -0.2];
    let damping = Damping::new("rov").at(point.into());
    let scene = with(
        damping.linear(linear).quadratic(quadratic),
        Joint::Free,
        current,
    );
    let v = Vector6::new(0.7, -0.4, 0.2, 0.9, -1.1, 0.6);
    let rotation = Vector3::new(0.4, -0.9, 0.3);
    let turn = turned(rotation);
    let water = Vector6::new(current[0], current[1], current[2], 0.0, 0.0, 0.0);
    let mut about = Matrix6::identity();
    let arm = -point.cross_matrix();
    about.fixed_view_mut::<3, 3>(0, 3).copy_from(&arm);
    let nu = about * turn.transpose() * (v - water);
    let local = Matrix6::from_fn(|i, j| linear[i][j]) * nu
        + Matrix6::from_fn(|i, j| quadratic[i][j]) * nu.map(|x| x.abs() * x);
    close(
        wrench(&scene, rotation, v, &[]),
        -(turn * about.transpose() * local),
    );
}

#[test]
fn dampings_that_can_not_be_are_refused() {
    let refused = |damping: Damping, words: &[&str]| {
        let scene = with(damping, Joint::Free, [0.0; 3]);
        says(scene.validate().unwrap_err(), words);
    };
    let good = [1.0, 2.0, 3.0, 0.1, 0.2, 0.3];
    let rows = |i: usize, j: usize, x: f64| {
        let mut rows = [[0.0; 6]; 6];
        for k in 0..6 {
            rows[k][k] = good[k];
        }
        rows[i][j] = x;
        rows
    };
    refused(
        Damping::new("auv").linear(good),
        &["forces[0].body", "\"auv\""],
    );
    refused(Damping::new("rov"), &["forces[0].linear", "neither"]);
    let mut bad = good;
    bad[4] = -0.1;
    refused(
        Damping::new("rov").linear(bad),
        &["forces[0].linear[4]", "-0.1"],
    );
    refused(
        Damping::new("rov").quadratic(bad),
        &["forces[0].quadratic[4]"],
    );
    let damping = Damping::new("rov").linear(rows(1, 1, -2.0));
    refused(damping, &["forces[0].linear[1][1]", "-2"]);
    // Symmetric part: 4 between x and y against √(1 · 2).
    let damping = Damping::new("rov").linear(rows(0, 1, 8.0));
    refused(
        damping,
        &["forces[0].linear", "-1.828e0", "positive semi-definite"],
    );
    let mut none = rows(0, 1, 1.0);
    none[0][0] = 0.0;
    refused(Damping::new("rov").linear(none), &["0.5 between x and y"]);
    let damping = Damping::new("rov").linear(rows(0, 1, f64::NAN));
    refused(damping, &["forces[0].linear[0][1]", "NaN"]);
    // Gyroscopic entries do no work, and a strong one is right.
    let mut gyroscopic = rows(0, 1, 50.0);
    gyroscopic[1][0] = -50.0;
    let scene = with(
        Damping::new("rov").linear(gyroscopic),
        Joint::Free,
        [0.0; 3],
    );
    let mut sim = simulator(&scene, Integrator::Rk4);
    // And of parameters.
    let mut parameters = sim.parameters().clone();
    parameters.set("damping 1.linear.y.x", 50.0).unwrap();
    let error = sim.set_parameters(parameters).unwrap_err();
    says(
        error,
        &["parameters damping 1.linear", "positive semi-definite"],
    );
    let text = "time_step = 0.01\nsteps = 1\nfluid = { density = 0 }\nbodies = []\n\
                [[forces]]\nkind = \"damping\"\nbody = \"rov\"\nlinear = [1, 2, 3]\n";
    let error = Scene::from_toml(text, "").unwrap_err();
    says(error, &["linear", "six numbers"]);
}

/// Energy falls by damping at every step of a tumbling body.
#[test]
fn damping_takes_energy() {
    let damping = Damping::new("rov")
        .at([0.1, 0.0, 0.05])
        .linear([0.5, 0.7, 0.6, 0.02, 0.03, 0.02]);
    let damping = damping.quadratic([3.0, 2.0, 4.0, 0.1, 0.2, 0.1]);
    let mut scene = with(damping, Joint::Free, [0.0; 3]);
    scene.initial.v = vec![0.6, -0.2, 0.3, 1.5, -0.4, 0.9];
    let sim = simulator(&scene, Integrator::Rk4);
    let rollout = sim.rollout(&Controls::zeros(&sim, 300)).unwrap();
    let energies: Vec<f64> = rollout.samples().iter().map(Sample::energy).collect();
    assert!(energies.windows(2).all(|e| e[1] < e[0]));
}

/// A thruster's wrench turns with its body, and the allocation matrix is that of unit thrusts.
#[test]
fn thrusters_turn_with_their_body() {
    let place = Vector3::new(-0.2, 0.3, 0.1);
    let direction = Vector3::new(1.0, 2.0, -2.0);
    let thruster = Thruster::new("rov").named("port").at(place.into());
    let thruster = thruster.direction(direction.into()).torque(-0.07);
    let mut scene = with(thruster.polynomial([2.0, 3.0]), Joint::Free, [0.0; 3]);
    scene.add_force(
        Thruster::new("rov")
            .named("bow")
            .direction([0.0, 0.0, 5.0])
            .into(),
    );
    let unit = direction / 3.0;
    let moment = place.cross(&unit) - 0.07 * unit;
    let column = Vector6::new(unit.x, unit.y, unit.z, moment.x, moment.y, moment.z);
    let sim = simulator(&scene, Integrator::Rk4);
    let allocation = sim.allocation(0).unwrap();
    assert_eq!(
        (allocation.matrix.ncols(), allocation.controls),
        (2, vec![0, 1])
    );
    assert!((allocation.matrix.column(0) - column).norm() < 1e-15);
    let up = Vector6::new(0.0, 0.0, 1.0, 0.0, 0.0, 0.0);
    assert!((allocation.matrix.column(1) - up).norm() < 1e-15);
    let rotation = Vector3::new(0.4, -0.9, 0.3);
    let turn = turned(rotation);
    // 2 u + 3 |u| u, and the command itself.
    for (u, thrust) in [(0.5, 1.75), (-1.0, -5.0)] {
        let found = wrench(&scene, rotation, Vector6::zeros(), &[u, 4.0]);
        close(found, turn * (thrust * column + 4.0 * up));
    }
    let error = sim.allocation(1).unwrap_err();
    says(error, &["allocation: body", "under 1"]);
}

/// A body on a rail behind a thruster: m v̇ = T − k |u| v, up to the rounding of |u|.
#[test]
fn thrust_falls_with_speed() {
    let (u, k): (f64, f64) = (0.8, 5.0);
    let thruster = Thruster::new("rov")
        .polynomial([0.0, 30.0])
        .loss(k)
        .smoothing(1e-9);
    let axis = [1.0, 0.0, 0.0];
    let scene = with(thruster, Joint::Prismatic { axis }, [0.2, 0.0, 0.0]);
    for u in [u, -u] {
        let sim = simulator(&scene, Integrator::Rk4);
        let controls = DMatrix::from_element(1, 400, u);
        let rollout = sim.rollout(&Controls::from_matrix(&sim, controls).unwrap());
        let last = rollout.unwrap().samples().last().unwrap().clone();
        let (rate, end) = (k * u.abs() / MASS, 30.0 * u / k);
        let exact = 0.2 + end + (-0.2 - end) * (-rate * last.time).exp();
        assert!((last.v[0] - exact).abs() < 1e-8, "{} {exact}", last.v[0]);
    }
}

/// Far above its dead band a thruster does what it would without, far below it nothing, and half of it there.
#[test]
fn a_dead_band_is_smooth() {
    let thruster = Thruster::new("rov").polynomial([10.0]).dead_band(0.1);
    let scene = with(thruster, Joint::Free, [0.0; 3]);
    let thrust = |u: f64| wrench(&scene, Vector3::zeros(), Vector6::zeros(), &[u])[0];
    assert!((thrust(0.1) / 0.5 - 1.0).abs() < 1e-12);
    assert!((thrust(-10.0) / -100.0 - 1.0).abs() < 1.1e-4);
    assert!(thrust(0.01).abs() < 1.1e-3 && thrust(0.0) == 0.0);
}

/// At rest without a command nothing acts, and no derivative is anything but a number.
#[test]
fn vehicles_at_rest_have_finite_gradients() {
    let mut scene = everything();
    scene.gravity = [0.0; 3];
    scene.fluid.current = [0.0; 3];
    scene.initial = Default::default();
    for force in &mut scene.forces {
        if let Force::Thruster(thruster) = force {
            (thruster.dead_band, thruster.table) = (0.0, Vec::new());
        }
    }
    for integrator in [Integrator::Rk4, Integrator::MomentumEuler] {
        let sim = simulator(&scene, integrator);
        let rollout = sim.rollout(&Controls::zeros(&sim, 5)).unwrap();
        let last = rollout.samples().last().unwrap();
        assert_eq!(last.v.norm(), 0.0);
        let mut seed = rollout.zero_cotangents();
        seed.q.fill(1.0);
        let g = rollout.vjp(&seed).unwrap();
        assert!(g.controls.iter().all(|x| x.is_finite()));
        assert!(g.controls.row(2).norm() > 0.0);
        assert!(g.parameters.to_vec().iter().all(|x| x.is_finite()));
    }
}

/// Commands stand behind the controls of bodies: a controller of joints leaves them alone.
#[test]
fn controllers_and_thrusters_share_the_controls() {
    let mut scene = everything();
    let pd = |n: usize| Controller::Pd {
        target: vec![0.2; n],
        stiffness: vec![3.0; n],
        damping: vec![0.4; n],
    };
    scene.controller = Some(pd(1));
    let sim = simulator(&scene, Integrator::MomentumEuler);
    let mut controls = DMatrix::zeros(3, 4);
    controls.row_mut(1).fill(0.7);
    let rollout = sim.rollout(&Controls::from_matrix(&sim, controls).unwrap());
    let sample = rollout.unwrap().samples()[0].clone();
    assert_eq!((sample.control[1], sample.control[2]), (0.7, 0.0));
    assert!((sample.control[0] - (3.0 * 0.2 - 0.4 * 0.8)).abs() < 1e-12);
    scene.controller = Some(pd(3));
    says(
        scene.validate().unwrap_err(),
        &["controller.target", "1 in all"],
    );
    scene.controller = Some(Controller::Constant {
        control: vec![0.0, 0.5],
    });
    says(
        scene.validate().unwrap_err(),
        &["controller.control", "3 in all", "thrusters 2"],
    );
}

#[test]
fn thrusters_that_can_not_be_are_refused() {
    let refused = |thruster: Thruster, words: &[&str]| {
        let scene = with(thruster, Joint::Free, [0.0; 3]);
        says(scene.validate().unwrap_err(), words);
    };
    let good = || Thruster::new("rov");
    refused(Thruster::new("auv"), &["forces[0].body", "\"auv\""]);
    refused(
        good().direction([0.0; 3]),
        &["forces[0].direction", "not all zero"],
    );
    refused(
        good().at([0.0, f64::INFINITY, 0.0]),
        &["forces[0].at", "inf"],
    );
    refused(
        good().polynomial([1.0, f64::NAN]),
        &["forces[0].polynomial[1]"],
    );
    refused(good().table([[0.0, 1.0]]), &["forces[0].table", "1 point"]);
    let points = [[0.0, 0.0], [1.0, 3.0], [1.0, 4.0]];
    refused(
        good().table(points),
        &["forces[0].table[2][0]", "1 after 1", "rise"],
    );
    let both = good().polynomial([1.0]).table([[0.0, 0.0], [1.0, 3.0]]);
    refused(both, &["forces[0].table", "polynomial"]);
    refused(good().dead_band(-0.1), &["forces[0].dead_band", "-0.1"]);
    refused(good().loss(-1.0), &["forces[0].loss", "-1", "N s/m"]);
    refused(good().torque(f64::NAN), &["forces[0].torque", "NaN"]);
    refused(
        good().smoothing(0.0),
        &["forces[0].smoothing", "above zero"],
    );
}

/// In the plane of chord and normal, at a speed far above the smoothing, against the formulas; then turned.
#[test]
fn a_fin_lifts_and_drags() {
    let (area, slope, drag, across, length) = (0.05, 4.5, 0.03, 1.1, 0.16);
    let place = Vector3::new(-0.3, 0.1, 0.05);
    let (chord, normal) = (Vector3::new(0.8, 0.6, 0.0), Vector3::new(-0.6, 0.8, 0.0));
    let fin = Fin::new("rov")
        .at(place.into())
        .chord((chord * 2.0).into(), length);
    let fin = fin
        .normal((normal * 3.0).into())
        .area(area)
        .lift_slope(slope);
    let fin = fin.drag(drag).induced_drag(across).smoothing(1e-9);
    let scene = with(fin, Joint::Free, [0.0; 3]);
    for (u, v, span) in [
        (1.5, 0.2, 0.0),
        (-0.9, 0.4, 0.3),
        (1e-3, -0.7, 0.2),
        (0.4, -0.1, -0.8),
    ] {
        let (u, v): (f64, f64) = (u, v);
        let w = u.hypot(v);
        let pressure = 0.5 * DENSITY * area;
        let lift = pressure * slope * u * v / w * Vector3::new(v, -u, 0.0);
        let resistance = -pressure * (drag + across * v * v / (w * w)) * w;
        let along = lift.x + resistance * u;
        let up = lift.y + resistance * v;
        // Lift against the motion across, drag against all of it.
        assert!(-u * u * v * v <= 0.0 && lift.y * v <= 0.0);
        assert!(along * u + up * v < 0.0);
        let force = along * chord + up * normal;
        let arm = place + 0.25 * length * u / w * chord;
        let moment = arm.cross(&force);
        let velocity = u * chord + v * normal + Vector3::z() * span - Vector3::zeros().cross(&arm);
        let body = Vector6::new(velocity.x, velocity.y, velocity.z, 0.0, 0.0, 0.0);
        let expected = Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
        let rotation = Vector3::new(0.4, -0.9, 0.3);
        let turn = turned(rotation);
        close(wrench(&scene, rotation, turn * body, &[]), turn * expected);
    }
}

/// A fin driven backwards is one whose leading edge is the other: the same at every twist with the chord reversed.
#[test]
fn a_fin_is_the_same_backwards() {
    let fin = |chord: [f64; 3]| {
        let fin = Fin::new("rov").at([0.1, 0.2, -0.1]).chord(chord, 0.2);
        let fin = fin.area(0.03).lift_slope(5.0).drag(0.02).induced_drag(1.0);
        with(fin, Joint::Free, [0.1, 0.0, 0.2])
    };
    let scenes = [fin([1.0, 0.0, 0.0]), fin([-1.0, 0.0, 0.0])];
    for k in 0..8 {
        let v = Vector6::from_fn(|i, _| (0.4 + 1.7 * (6 * k + i) as f64).sin());
        let [one, other] = scenes
            .each_ref()
            .map(|s| wrench(s, Vector3::new(0.2, 0.1, 0.4), v, &[]));
        assert!(one.norm() > 0.1);
        close(one, other);
    }
    // Backwards at an angle of attack, lift still opposes the motion across, and acts nearer to the edge that comes first.
    let mut still = fin([1.0, 0.0, 0.0]);
    still.fluid.current = [0.0; 3];
    let at = |u: f64| {
        wrench(
            &still,
            Vector3::zeros(),
            Vector6::new(u, 0.0, 0.3, 0.0, 0.0, 0.0),
            &[],
        )
    };
    let (forward, back) = (at(2.0), at(-2.0));
    assert!(forward[2] < 0.0 && (forward[2] - back[2]).abs() < 1e-12);
    assert!((forward[0] + back[0]).abs() < 1e-12);
    let place = |w: Vector6<f64>| -(w[4] - (-0.1) * w[0]) / w[2];
    assert!(
        place(forward) > 0.145 && place(back) < 0.055,
        "{} {}",
        place(forward),
        place(back)
    );
}

/// A rudder on a hinge turns a hull that moves forward to its side, and the fin takes energy.
#[test]
fn a_deflected_rudder_turns_the_hull() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add(dry("hull", Joint::Free));
    let axis = [0.0, 0.0, 1.0];
    let rudder = Body::dry().named("rudder").mass(0.1).inertia([1e-3; 3]);
    scene.add(
        rudder
            .child_of("hull")
            .at([-0.5, 0.0, 0.0])
            .joint(Joint::Revolute { axis }),
    );
    let fin = Fin::new("rudder")
        .chord([1.0, 0.0, 0.0], 0.1)
        .normal([0.0, 1.0, 0.0]);
    scene.add_force(
        fin.area(0.02)
            .lift_slope(4.0)
            .drag(0.02)
            .induced_drag(1.0)
            .into(),
    );
    let rate = |angle: f64| {
        let mut scene = scene.clone();
        scene.bodies[1].locked = true;
        scene.initial.q = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, angle];
        scene.initial.v = vec![1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let sim = simulator(&scene, Integrator::Rk4);
        let rollout = sim.rollout(&Controls::zeros(&sim, 20)).unwrap();
        let energies: Vec<f64> = rollout.samples().iter().map(Sample::energy).collect();
        assert!(energies.windows(2).all(|e| e[1] < e[0]));
        rollout.samples()[20].v[5]
    };
    // Its trailing edge to port turns the bow to port.
    let (port, starboard) = (rate(-0.2), rate(0.2));
    assert!(
        port > 0.01 && (port + starboard).abs() < 1e-12 * port,
        "{port} {starboard}"
    );
    assert!(rate(0.0).abs() < 1e-15);
}

#[test]
fn fins_that_can_not_be_are_refused() {
    let refused = |fin: Fin, words: &[&str]| {
        let scene = with(fin, Joint::Free, [0.0; 3]);
        says(scene.validate().unwrap_err(), words);
    };
    let good = || Fin::new("rov").area(0.1).lift_slope(4.0);
    refused(Fin::new("auv"), &["forces[0].body", "\"auv\""]);
    refused(
        good().chord([0.0; 3], 0.1),
        &["forces[0].chord", "not all zero"],
    );
    let fin = good().normal([0.1, 0.0, 1.0]);
    refused(fin, &["forces[0].normal", "9.950e-2", "right angle"]);
    refused(good().area(-1.0), &["forces[0].area", "-1", "m²"]);
    refused(good().drag(f64::NAN), &["forces[0].drag", "NaN"]);
    refused(
        good().chord([1.0, 0.0, 0.0], -0.1),
        &["forces[0].length", "-0.1"],
    );
    refused(
        good().smoothing(0.0),
        &["forces[0].smoothing", "above zero"],
    );
    // Other kinds have other keys.
    let mut scene = with(good(), Joint::Free, [0.0; 3]);
    scene.add_force(Spring::new("rov").named("fin 1").stiffness(1.0).into());
    says(
        scene.validate().unwrap_err(),
        &["forces[1].name", "\"fin 1\""],
    );
}

/// At small amplitude a trailing edge's force along the way is Lighthill's ½ m (ḣ² − U² h_x²), to 1e-3 of its larger term; it takes energy away, and nothing is left of it backwards.
#[test]
fn a_trailing_edge_is_lighthills() {
    let (span, speed) = (0.1, 1.0);
    let water = 0.25 * std::f64::consts::PI * DENSITY * span * span;
    let edge = |smoothing: f64| Edge::new("rov").span(span).smoothing(smoothing);
    let still = [0.0; 3];
    for (across, slope) in [(0.015, 0.005), (0.01, -0.01), (-0.005, 0.015), (0.01, 0.01)] {
        // The fin's slope over the way toward the tail is that of a turn the other way.
        let turn = Vector3::new(0.0, 0.0, -slope);
        let v = Vector6::new(speed, across, 0.0, 0.0, 0.0, 0.0);
        let scene = with(edge(0.01), Joint::Free, still);
        let found = wrench(&scene, turn, v, &[]);
        let [first, second] = [across * across, (speed * slope).powi(2)];
        let theory = 0.5 * water * (first - second);
        let size = 0.5 * water * f64::max(first, second);
        assert!(
            (found[0] - theory).abs() < 1e-3 * size,
            "{} {theory}",
            found[0]
        );
        let w = across + speed * slope;
        let power = found[0] * speed + found[1] * across;
        let taken = 0.5 * water * speed * w * w;
        assert!(
            (power + taken).abs() < 3e-3 * size * speed,
            "{power} {taken}"
        );
        let back = wrench(&scene, turn, -v, &[]);
        assert!(back.norm() < 1e-4 * found.norm());
        // Without smoothing the law is a polynomial: the same both ways but for the push across.
        let scene = with(edge(0.0), Joint::Free, still);
        let (there, back) = (wrench(&scene, turn, v, &[]), wrench(&scene, turn, -v, &[]));
        assert!((there - back).norm() < 1e-12 * there.norm());
    }
}

#[test]
fn bad_edges_are_refused() {
    let refused = |edge: Edge, said: &[&str]| {
        let scene = with(edge, Joint::Free, [0.0; 3]);
        says(scene.validate().unwrap_err(), said);
    };
    let edge = || Edge::new("rov").span(0.1);
    refused(Edge::new("rov"), &["forces[0].span", "above zero"]);
    refused(edge().span(-0.1), &["forces[0].span", "-0.1"]);
    refused(edge().span(f64::NAN), &["forces[0].span", "NaN"]);
    refused(Edge::new("fish").span(0.1), &["fish", "rov"]);
    refused(edge().normal([1.0, 1.0, 0.0]), &["normal", "right angle"]);
    refused(edge().forward([0.0; 3]), &["forward", "direction"]);
    refused(edge().factor(-1.0), &["factor"]);
    refused(edge().smoothing(-1.0), &["smoothing"]);
}
