//! Bodies at the surface of the water: displaced volume, stiffness, energy, drag, gradients.

use crate::support::bodies::sided_cylinder;
use crate::support::{check_gradient, says};
use hydrograd::adjoint::lie::Vec3;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Drag, DragPart, Fin, Fluid, Force, Joint, Scene, Shape};
use hydrograd::simulate::gradcheck::{GradcheckSettings, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::DVector;
use std::f64::consts::PI;

const GRAVITY: f64 = 9.81;
const DENSITY: f64 = 998.0;
const HEIGHT: f64 = 0.7;

/// A body of half the water's density, its centre at the surface.
fn floating(shape: Shape) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene.waterline = Some(HEIGHT);
    let body = Body::new(shape).density(0.5 * DENSITY);
    scene.add(body.at([0.2, -0.1, HEIGHT]));
    scene
}

fn simulator(scene: &Scene, fidelity: Fidelity, integrator: Integrator) -> Simulator {
    let settings = Settings::default().fidelity(fidelity);
    Simulator::new(scene, settings.integrator(integrator)).unwrap()
}

/// Generalised force at rest where the body is moved by `xi`.
fn force(sim: &Simulator, xi: [f64; 6]) -> DVector<f64> {
    let q = sim.start().0;
    let q = sim.integrate(q, &DVector::from_row_slice(&xi)).unwrap();
    let still = DVector::zeros(6);
    let e = sim.equations(&q).unwrap();
    -e.bias_force(&still, &DVector::zeros(0)).unwrap()
}

/// −∂F/∂ξ along one coordinate.
fn stiffness(sim: &Simulator, k: usize) -> f64 {
    let h = 1e-4;
    let at = |h: f64| {
        let mut xi = [0.0; 6];
        xi[k] = h;
        force(sim, xi)[k]
    };
    -(at(h) - at(-h)) / (2.0 * h)
}

/// Heave: ρ g A. Roll and pitch: ρ g (I − V · distance of the centroid below the centre of mass), I the second moment of the waterplane.
#[test]
fn hydrostatic_stiffness_is_the_waterplanes() {
    let [a, b, c] = [0.6, 0.4, 0.2];
    let (radius, length) = (0.3, 0.25);
    let disc = PI * radius * radius;
    let cases = [
        (
            Shape::cuboid([a, b, c]),
            a * b,
            [a * b.powi(3) / 12.0, b * a.powi(3) / 12.0],
            c,
        ),
        (
            // A thousandth of the disc's area is missing from meshes of a cylinder with a thousand faces.
            sided_cylinder(4000, radius, length),
            disc,
            [0.25 * disc * radius * radius; 2],
            length,
        ),
    ];
    for (shape, area, moments, height) in cases {
        let mut scene = floating(shape);
        // The inertia of the water has no part in this.
        let mut added = [[0.0; 6]; 6];
        (0..6).for_each(|k| added[k][k] = 0.1);
        scene.bodies[0] = scene.bodies[0].clone().added_mass(added);
        let sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
        let rest = force(&sim, [0.0; 6]);
        let weight = 0.5 * DENSITY * GRAVITY * area * height;
        assert!(rest.amax() < 1e-12 * weight, "{rest}");
        let heave = stiffness(&sim, 2) / (DENSITY * GRAVITY * area) - 1.0;
        assert!(heave.abs() < 1e-6, "heave {heave:.1e}");
        for (k, moment) in [(3, moments[0]), (4, moments[1])] {
            let volume = 0.5 * area * height;
            let exact = DENSITY * GRAVITY * (moment - volume * 0.25 * height);
            let error = stiffness(&sim, k) / exact - 1.0;
            assert!(error.abs() < 2e-6, "tilt {k}: {error:.1e}");
        }
    }
}

/// What is below the surface displaces, at the centre at which its buoyancy acts.
#[test]
fn the_center_of_buoyancy_is_that_of_what_is_below() {
    let [a, b, c] = [0.6, 0.4, 0.2];
    let sim = simulator(
        &floating(Shape::cuboid([a, b, c])),
        Fidelity::Isolated,
        Integrator::Rk4,
    );
    let at = |xi: [f64; 6]| {
        let q = sim.start().0;
        let q = sim.integrate(q, &DVector::from_row_slice(&xi)).unwrap();
        sim.equations(&q).unwrap().center_of_buoyancy()
    };
    let (volume, center) = at([0.0; 6]).unwrap();
    assert!((volume / (0.5 * a * b * c) - 1.0).abs() < 1e-12);
    assert!((center - Vec3::new(0.2, -0.1, HEIGHT - 0.25 * c)).norm() < 1e-12);
    // Tilted, its moment about the body's origin, where the weight has none, is what turns the body; the frame has not turned about x.
    let tilt = [0.0, 0.0, 0.03, 0.0, 0.2, 0.0];
    let (volume, center) = at(tilt).unwrap();
    let arm = center - Vec3::new(0.2, -0.1, HEIGHT + 0.03);
    let turning = -DENSITY * GRAVITY * volume * arm.x;
    let found = force(&sim, tilt)[4];
    assert!((found / turning - 1.0).abs() < 1e-10, "{found} {turning}");
    assert!(at([0.0, 0.0, 0.2, 0.0, 0.0, 0.0]).is_none());
    let (deep, _) = at([0.0, 0.0, -0.5, 0.3, 0.0, 0.0]).unwrap();
    assert!((deep / (a * b * c) - 1.0).abs() < 1e-12);
    // What can't move is buoyant as well.
    let mut scene = floating(Shape::cuboid([a, b, c]));
    let anchor = Body::new(Shape::cuboid([a, b, c])).density(DENSITY);
    scene.add(anchor.joint(Joint::Fixed).at([0.2, -0.1, HEIGHT - 2.0]));
    let sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let both = sim.equations(sim.start().0).unwrap().center_of_buoyancy();
    let (volume, center) = both.unwrap();
    assert!((volume / (1.5 * a * b * c) - 1.0).abs() < 1e-12);
    let height = HEIGHT - (0.5 * 0.25 * c + 2.0) / 1.5;
    assert!((center.z - height).abs() < 1e-12, "{center}");
}

/// Far below the surface it is as if there were none, and above there is no force but weight.
#[test]
fn deep_water_has_no_surface_and_air_no_water() {
    let mut scene = floating(Shape::ellipsoid([0.2, 0.15, 0.1]).faces(320));
    scene.bodies[0].drag = Some(Drag {
        linear: 3.0,
        quadratic: 0.4,
        ..Drag::default()
    });
    scene.bodies[0].placement.position[2] = HEIGHT - 5.0;
    scene.initial.v = vec![0.1, 0.2, -0.3, 0.4, -0.5, 0.6];
    let bias = |scene: &Scene| {
        let sim = simulator(scene, Fidelity::Isolated, Integrator::Rk4);
        let e = sim.equations(sim.start().0).unwrap();
        e.bias_force(
            &DVector::from_vec(scene.initial.v.clone()),
            &DVector::zeros(0),
        )
        .unwrap()
    };
    let deep = bias(&scene);
    scene.waterline = None;
    let endless = bias(&scene);
    assert!((&deep - &endless).amax() < 1e-12 * endless.amax());
    scene.waterline = Some(HEIGHT);
    scene.bodies[0].placement.position[2] = HEIGHT + 0.2;
    let sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let e = sim.equations(sim.start().0).unwrap();
    let v = DVector::zeros(6);
    let air = e.bias_force(&v, &DVector::zeros(0)).unwrap();
    let weight = sim.parameters().mass(0) * GRAVITY;
    assert!((air[2] / weight - 1.0).abs() < 1e-12);
}

/// A box whose top is level stays where it is put under water: by rounding its top is no waterplane.
#[test]
fn a_level_top_under_water_has_no_stiffness() {
    for k in 0..8 {
        let mut scene = floating(Shape::cuboid([1.0, 0.6, 0.4]).faces(48));
        let body = &mut scene.bodies[0];
        let turn = 0.1 + 0.2 * f64::from(k);
        body.shape_at.rotation = [-turn, 0.0, 0.0];
        body.placement.rotation = [turn, 0.0, 0.0];
        body.placement.position[2] -= 5.0;
        body.density = Some(DENSITY);
        body.joint = Joint::Prismatic {
            axis: [0.0, 0.0, 1.0],
        };
        let sim = simulator(&scene, Fidelity::Isolated, Integrator::VelocityEuler);
        let rollout = sim.rollout(&Controls::zeros(&sim, 20)).unwrap();
        let mut seed = rollout.zero_cotangents();
        seed.v[(0, 20)] = 1.0;
        let found = rollout.vjp(&seed).unwrap().initial;
        let off = found.q[0].abs().max((found.v[0] - 1.0).abs());
        assert!(off < 1e-9, "turned by {turn}: {found:?}");
    }
}

/// Over 1000 steps without controls, of the largest kinetic energy.
#[track_caller]
fn keeps_energy(sim: &Simulator, limit: f64) {
    let rollout = sim.rollout(&Controls::zeros(sim, 1000)).unwrap();
    let samples = rollout.samples();
    let kinetic = samples.iter().map(|s| s.kinetic_energy);
    let (scale, first) = (kinetic.fold(0.0, f64::max), samples[0].energy());
    for s in samples {
        let error = (s.energy() - first) / scale;
        assert!(error.abs() < limit, "{error:.1e} at {} s", s.time);
    }
}

/// A box bobs and rolls through the surface: what gravity and water give and take is their energy.
#[test]
fn bobbing_keeps_energy() {
    for shape in [
        Shape::cuboid([0.5, 0.3, 0.2]),
        Shape::ellipsoid([0.3, 0.2, 0.15]).faces(320),
    ] {
        let mut scene = floating(shape);
        scene.bodies[0].placement.position[2] += 0.18;
        scene.initial.v = vec![0.0, 0.0, 0.0, 0.6, 0.3, 0.1];
        scene.time_step = 2e-3;
        let sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
        keeps_energy(&sim, 2e-5);
    }
}

/// Rollouts through the surface have gradients, with both drags on what is wet.
#[test]
fn rollouts_through_the_surface_have_gradients() {
    let mut scene = floating(Shape::cuboid([0.5, 0.3, 0.2]).faces(80));
    scene.bodies[0].drag = Some(Drag {
        part: DragPart::Total,
        linear: 20.0,
        quadratic_part: DragPart::Normal,
        quadratic: 1.1,
    });
    scene.bodies[0].placement.rotation = [0.3, 0.2, 0.1];
    scene.initial.v = vec![0.2, -0.1, 0.4, 0.5, -0.3, 0.2];
    for integrator in [
        Integrator::Rk4,
        Integrator::MomentumEuler,
        Integrator::Midpoint,
    ] {
        let mut sim = simulator(&scene, Fidelity::Auto, integrator);
        let settings = GradcheckSettings {
            steps: 30,
            directions: 3,
            seed: 5,
            timings: 0,
            enough: Some(1e-6),
        };
        let report = gradcheck(&mut sim, &settings).unwrap();
        assert!(report.max_rel_error < 1e-6, "{integrator:?}: {report:?}");
    }
}

/// What a scene says a body is buoyant by, and where, holds under a surface too, of a body without a shape as well.
#[test]
fn given_volumes_and_centres_are_buoyant_below_a_surface() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene.waterline = Some(HEIGHT);
    let (volume, center) = (0.05, [0.01, -0.02, 0.06]);
    for (k, body) in [
        Body::dry(),
        Body::new(Shape::cuboid([0.5, 0.4, 0.3]).faces(80)),
    ]
    .into_iter()
    .enumerate()
    {
        let body = body.named(format!("body {k}")).mass(DENSITY * volume);
        let body = body.inertia([1.0, 1.2, 0.8]).center_of_mass([0.0; 3]);
        let mut body = body.at([2.0 * k as f64, 0.0, HEIGHT - 5.0]);
        (body.volume, body.center_of_buoyancy) = (Some(volume), Some(center));
        scene.add(body);
    }
    let deep = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let mut endless = scene.clone();
    endless.waterline = None;
    let endless = simulator(&endless, Fidelity::Isolated, Integrator::Rk4);
    let force = |sim: &Simulator| {
        let e = sim.equations(sim.start().0).unwrap();
        let still = DVector::zeros(12);
        -e.bias_force(&still, &DVector::zeros(0)).unwrap()
    };
    let (found, right) = (force(&deep), force(&endless));
    let weight = DENSITY * volume * GRAVITY;
    assert!(
        (&found - &right).amax() < 1e-12 * weight,
        "{found} for {right}"
    );
    assert!(found[0].abs().max(found[2].abs()) < 1e-12 * weight);
    assert!((found[3] / (weight * center[1]) - 1.0).abs() < 1e-9);
    // Through the surface with energy kept, and gradients with all parameters.
    for body in &mut scene.bodies {
        body.placement.position[2] = HEIGHT;
        body.placement.rotation = [0.2, -0.1, 0.3];
        body.mass = Some(0.6 * DENSITY * volume);
    }
    scene.time_step = 2e-3;
    let mut sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    keeps_energy(&sim, 2e-4);
    check_gradient("given volumes", &mut sim, 30, 3, 1e-6);
}

/// What of the water a surface doesn't end is told of bodies that are above it, once a body, with the time and the height.
#[test]
fn bodies_above_the_surface_are_told() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene.waterline = Some(HEIGHT);
    scene.time_step = 1e-3;
    let ball = || Body::new(Shape::sphere(0.1)).density(DENSITY);
    let at = |x: f64, height: f64| [x, 0.0, HEIGHT + height];
    scene.add(ball().named("high").at(at(0.0, 10.0)));
    scene.add(ball().named("deep").at(at(1.0, -10.0)));
    scene.add(ball().named("floating").at(at(2.0, 0.0)));
    scene.add(
        ball()
            .named("weightless")
            .added_mass([[0.0; 6]; 6])
            .at(at(3.0, 10.0)),
    );
    let mast = Body::dry().mass(1.0).inertia([0.1; 3]);
    scene.add(mast.clone().named("mast").at(at(4.0, 1.0)));
    scene.add(mast.named("wing").at(at(5.0, 1.0)));
    let fin = Fin {
        area: 0.01,
        lift_slope: 3.0,
        ..Fin::new("wing")
    };
    scene.add_force(Force::Fin(fin));
    scene.add(ball().named("thrown").at(at(6.0, -0.2)));
    let mut sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let told = |sim: &Simulator| {
        let controls = Controls::zeros(sim, 100);
        sim.rollout(&controls).unwrap().warnings()
    };
    let found = told(&sim);
    assert_eq!(found.len(), 2, "{found:?}");
    says(
        &found[0],
        &["\"high\"", "t = 0 s", "by 9.", "its added mass"],
    );
    says(&found[1], &["\"wing\"", "t = 0 s", "1.000e0 m", "fin 1"]);
    // Up through the surface at 5 m/s: out of it 0.3 m later.
    let velocities = sim.start().1.len();
    scene.initial.v = vec![0.0; velocities];
    scene.initial.v[velocities - 4] = 5.0;
    sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let found = told(&sim);
    assert_eq!(found.len(), 3, "{found:?}");
    says(&found[2], &["\"thrown\"", "t = 0.06"]);
}

/// A surface needs gravity.
#[test]
fn a_surface_without_gravity_is_refused() {
    let mut scene = floating(Shape::sphere(0.1));
    scene.gravity = [0.0; 3];
    let told = scene.validate().unwrap_err().to_string();
    assert!(
        told.contains("waterline") && told.contains("gravity"),
        "{told}"
    );
}
