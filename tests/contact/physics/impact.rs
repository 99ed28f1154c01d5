//! A ball that lands, against the equation of its height, and two balls that meet.

use super::{GRAVITY, RAIL, above_floor, contact, isolated, run, simulator, touching};
use hydrograd::scene::{Body, Joint, Scene, Shape};
use hydrograd::{Fidelity, Rollout, Simulator};
use nalgebra::{DVector, Matrix2};
use std::f64::consts::PI;

const RADIUS: f64 = 0.1;
const VOLUME: f64 = 4.0 / 3.0 * PI * RADIUS * RADIUS * RADIUS;
const DENSITY: f64 = 3000.0;
const MASS: f64 = DENSITY * VOLUME;
const WATER: f64 = 1000.0;
const GAP: f64 = 0.03;
const STIFFNESS: f64 = 1e5;
const WIDTH: f64 = 4e-4;
const START: f64 = 0.25;
const END: f64 = 0.45;

/// A ball on a vertical rail above a floor; contact acts over centimetres, and so over many steps.
fn ball(density: f64, dissipation: f64, dt: f64) -> Scene {
    let mut scene = above_floor(density);
    scene.time_step = dt;
    scene.add(
        Body::new(Shape::sphere(RADIUS))
            .density(DENSITY)
            .at([0.0, 0.0, START])
            .joint(RAIL),
    );
    let c = contact(&mut scene);
    (c.stiffness, c.gap, c.width) = (Some(STIFFNESS), Some(GAP), Some(WIDTH));
    c.dissipation = dissipation;
    scene
}

/// The law of contact without a horizon, as it is at Δt = 0, written once more.
fn pressure(height: f64, speed: f64, dissipation: f64) -> f64 {
    let positive = |x: f64, w: f64| match x {
        x if x <= -w => 0.0,
        x if x >= w => x,
        x => (x + w) * (x + w) / (4.0 * w),
    };
    STIFFNESS * positive(GAP + RADIUS - height, WIDTH) * positive(1.0 - dissipation * speed, 0.1)
}

/// When the ball touches down and leaves, how fast it leaves, and when and where it turns at the top.
#[derive(Debug)]
struct Bounce {
    down: f64,
    up: f64,
    speed: f64,
    top_time: f64,
    top: f64,
}

impl Bounce {
    fn numbers(&self) -> [f64; 5] {
        [self.down, self.up, self.speed, self.top_time, self.top]
    }

    /// From heights and speeds at equal times.
    fn of(z: &[f64], v: &[f64], dt: f64) -> Self {
        let touch = RADIUS + GAP;
        let cross = |n: usize| (z[n] - touch) / (z[n] - z[n + 1]);
        let down = (0..z.len() - 1).find(|&n| z[n] > touch && z[n + 1] <= touch);
        let down = down.expect("it touches down");
        let up = (down + 1..z.len() - 1).find(|&n| z[n] <= touch && z[n + 1] > touch);
        let up = up.expect("it leaves");
        // Past the width over which the force fades, where the speed changes by gravity alone.
        let free = (up..z.len()).find(|&n| z[n] > touch + 2.0 * WIDTH);
        let free = free.expect("it comes free");
        let top = (free..z.len() - 1).max_by(|&a, &b| z[a].total_cmp(&z[b]));
        let top = top.expect("it turns");
        let (a, b, c) = (z[top - 1], z[top], z[top + 1]);
        let bend = a - 2.0 * b + c;
        let shift = 0.5 * (a - c) / bend;
        Self {
            down: (down as f64 + cross(down)) * dt,
            up: (up as f64 + cross(up)) * dt,
            speed: (v[free].powi(2) + 2.0 * GRAVITY * (z[free] - touch)).sqrt(),
            top_time: (top as f64 + shift) * dt,
            top: b - 0.125 * (a - c).powi(2) / bend,
        }
    }

    fn of_rollout(rollout: &Rollout) -> Self {
        let samples = rollout.samples();
        let z: Vec<f64> = samples.iter().map(|s| s.poses[0].translation.z).collect();
        let v: Vec<f64> = samples.iter().map(|s| s.v[0]).collect();
        Self::of(&z, &v, samples[1].time)
    }
}

/// p = M(z) ż, ṗ = ½ M′ ż² − weight + N(z, ż), by Runge and Kutta in steps of 10 μs.
fn reference(inertia: &dyn Fn(f64) -> f64, weight: f64, dissipation: f64) -> Bounce {
    let dt = 1e-5;
    let rate = |z: f64, p: f64| {
        let h = 1e-5;
        let speed = p / inertia(z);
        let slope = (inertia(z + h) - inertia(z - h)) / (2.0 * h);
        let force = 0.5 * slope * speed * speed - weight + pressure(z, speed, dissipation);
        (speed, force)
    };
    let (mut z, mut p) = (START, 0.0);
    let (mut heights, mut speeds) = (vec![z], vec![0.0]);
    for _ in 0..(END / dt) as usize {
        let a = rate(z, p);
        let b = rate(z + 0.5 * dt * a.0, p + 0.5 * dt * a.1);
        let c = rate(z + 0.5 * dt * b.0, p + 0.5 * dt * b.1);
        let d = rate(z + dt * c.0, p + dt * c.1);
        z += dt / 6.0 * (a.0 + 2.0 * b.0 + 2.0 * c.0 + d.0);
        p += dt / 6.0 * (a.1 + 2.0 * b.1 + 2.0 * c.1 + d.1);
        heights.push(z);
        speeds.push(p / inertia(z));
    }
    Bounce::of(&heights, &speeds, dt)
}

/// A smooth function on [low, high] by its values at Chebyshev's points.
fn interpolant(low: f64, high: f64, f: impl FnMut(f64) -> f64) -> impl Fn(f64) -> f64 {
    let n = 40;
    let angle = |k: usize| (2 * k + 1) as f64 * PI / (2 * n) as f64;
    let points: Vec<f64> = (0..n)
        .map(|k| 0.5 * (low + high) + 0.5 * (high - low) * angle(k).cos())
        .collect();
    let values: Vec<f64> = points.iter().copied().map(f).collect();
    let weights: Vec<f64> = (0..n)
        .map(|k| angle(k).sin() * if k % 2 == 0 { 1.0 } else { -1.0 })
        .collect();
    move |x| {
        let (mut up, mut down) = (0.0, 0.0);
        for k in 0..n {
            if x == points[k] {
                return values[k];
            }
            let w = weights[k] / (x - points[k]);
            up += w * values[k];
            down += w;
        }
        up / down
    }
}

/// Errors against the reference fall in proportion to the step.
fn converges(
    name: &str,
    fidelity: Fidelity,
    density: f64,
    dissipation: f64,
    inertia: &dyn Fn(f64) -> f64,
) {
    let exact = reference(inertia, (MASS - density * VOLUME) * GRAVITY, dissipation);
    let mut errors: Vec<[f64; 5]> = Vec::new();
    for k in 2..=5 {
        let dt = 1e-3 / f64::from(1 << k);
        let simulator = simulator(&ball(density, dissipation, dt), fidelity);
        let rollout = run(&simulator, (END / dt).round() as usize);
        let found = Bounce::of_rollout(&rollout).numbers();
        errors.push(std::array::from_fn(|i| {
            (found[i] - exact.numbers()[i]).abs()
        }));
    }
    let names = ["touch-down", "leaving", "speed", "time of the top", "top"];
    for (i, what) in names.iter().enumerate() {
        let order = (errors[2][i] / errors[3][i]).log2();
        println!(
            "{name}: {what} {:.5}, errors {:.1e} … {:.1e}, order {order:.3}",
            exact.numbers()[i],
            errors[0][i],
            errors[3][i]
        );
        assert!((0.9..=1.1).contains(&order), "{name}, {what}: {errors:?}");
    }
}

#[test]
fn the_observed_contact_force_is_what_changes_the_momentum() {
    let scene = ball(0.0, 0.0, 1e-3);
    let rollout = run(&isolated(&scene), 300);
    let forces = rollout.observe("contact_forces").unwrap();
    assert_eq!(forces.shape(), (3, 301));
    let largest = forces.row(2).max();
    assert!(largest > 10.0 * MASS * GRAVITY, "{largest}");
    for n in 0..300 {
        let [before, after] = [n, n + 1].map(|n| rollout.samples()[n].v[0]);
        let force = MASS * ((after - before) / 1e-3 + GRAVITY);
        assert!((forces[(2, n + 1)] - force).abs() < 1e-6 * largest, "{n}");
    }
    assert_eq!(forces.column(0).norm(), 0.0);
}

#[test]
fn a_landing_converges_to_its_equation_in_vacuum() {
    for dissipation in [0.0, 0.3] {
        converges("vacuum", Fidelity::Isolated, 0.0, dissipation, &|_| MASS);
    }
}

/// Alone in water a ball carries half of the water it displaces.
#[test]
fn a_landing_converges_to_its_equation_with_added_mass() {
    for dissipation in [0.0, 0.3] {
        let inertia = |_: f64| MASS + 0.5 * WATER * VOLUME;
        converges("isolated", Fidelity::Isolated, WATER, dissipation, &inertia);
    }
}

/// Near the floor the added mass grows, and its slope is a force.
#[test]
fn a_landing_converges_to_its_equation_above_a_floor_in_water() {
    let mut probe: Simulator = simulator(&ball(WATER, 0.0, 1e-3), Fidelity::Reduced);
    let inertia = interpolant(RADIUS + 0.004, START + 0.01, |z| {
        let q = DVector::from_element(1, z - START);
        probe.set_start(q, DVector::zeros(1)).unwrap();
        MASS + probe.added_mass().unwrap().matrix[(2, 2)]
    });
    let (near, far) = (inertia(RADIUS + 0.01) - MASS, inertia(START) - MASS);
    assert!(
        near > 1.1 * far && far > 0.5 * WATER * VOLUME,
        "{near} {far}"
    );
    converges("reduced", Fidelity::Reduced, WATER, 0.3, &inertia);
}

/// A ball thrown at the floor without weight or dissipation: the duration of contact goes with √(m + m_a), its impulse with m + m_a.
#[test]
fn added_mass_lengthens_the_impact() {
    let measure = |density: f64, dt: f64| {
        let mut scene = ball(density, 0.0, dt);
        scene.gravity = [0.0; 3];
        scene.initial.v = vec![-1.5];
        contact(&mut scene).width = Some(1e-5);
        let simulator = isolated(&scene);
        let rollout = run(&simulator, (0.14 / dt) as usize);
        let samples = rollout.samples();
        let z = |n: usize| samples[n].poses[0].translation.z - RADIUS - GAP;
        let cross = |n: &usize| z(*n).signum() != z(*n + 1).signum();
        let times: Vec<f64> = (0..rollout.steps())
            .filter(cross)
            .map(|n| (n as f64 + z(n) / (z(n) - z(n + 1))) * dt)
            .collect();
        assert_eq!(times.len(), 2);
        let impulse = samples[rollout.steps()].momentum[2] - samples[0].momentum[2];
        (times[1] - times[0], impulse)
    };
    let heavy = 1.0 + 0.5 * WATER / DENSITY;
    let (dt, exact) = (2e-5, PI * (MASS / STIFFNESS).sqrt());
    let ((dry, dry_impulse), (submerged, submerged_impulse)) =
        (measure(0.0, dt), measure(WATER, dt));
    println!(
        "contact {:.4} ms dry, {:.4} ms submerged: {:.5} times, √((m + m_a)/m) = {:.5}; impulse {:.5} times, (m + m_a)/m = {heavy:.5}",
        1e3 * dry,
        1e3 * submerged,
        submerged / dry,
        heavy.sqrt(),
        submerged_impulse / dry_impulse
    );
    assert!((dry / exact - 1.0).abs() < 1e-3, "{dry} is not {exact}");
    assert!((submerged / dry / heavy.sqrt() - 1.0).abs() < 2e-4);
    assert!((submerged_impulse / dry_impulse / heavy - 1.0).abs() < 2e-4);
    // It comes back as fast as it went, but for Euler's loss, which falls with the step.
    let lost = |impulse: f64| 1.0 - impulse / (2.0 * MASS * 1.5);
    let coarse = measure(0.0, 4.0 * dt).1;
    assert!(lost(dry_impulse) < 2e-3 && lost(dry_impulse) < 0.3 * lost(coarse));
}

/// Two equal balls on one line, of which the first moves.
fn collision(stiffness: f64, dt: f64) -> Simulator {
    let mut scene = touching(0.0);
    scene.gravity = [0.0; 3];
    scene.time_step = dt;
    let line = Joint::Prismatic {
        axis: [1.0, 0.0, 0.0],
    };
    for x in [-0.12, 0.12] {
        scene.add(
            Body::new(Shape::sphere(RADIUS))
                .density(1000.0)
                .at([x, 0.0, 0.0])
                .joint(line),
        );
    }
    scene.initial.v = vec![1.0, 0.0];
    let c = contact(&mut scene);
    (c.stiffness, c.dissipation, c.friction) = (Some(stiffness), 0.0, 0.0);
    isolated(&scene)
}

fn end_velocity(simulator: &Simulator, steps: usize) -> DVector<f64> {
    run(simulator, steps).samples()[steps].v.clone()
}

/// ∂(end velocities)/∂(start velocities), a row per reverse sweep.
fn jacobian(simulator: &Simulator, steps: usize) -> Matrix2<f64> {
    let rollout = run(simulator, steps);
    let mut out = Matrix2::zeros();
    for i in 0..2 {
        let mut seed = rollout.zero_cotangents();
        seed.v[(i, steps)] = 1.0;
        let row = rollout.vjp(&seed).unwrap().initial.v;
        out.set_row(i, &row.transpose().fixed_columns::<2>(0));
    }
    out
}

/// Velocities change places and so do their derivatives, the better the finer contact is resolved in time, at whatever stiffness.
#[test]
fn velocities_and_their_derivatives_change_places() {
    let swapped = Matrix2::new(0.0, 1.0, 1.0, 0.0);
    let mut errors = Vec::new();
    for k in 0..5 {
        // Four times as stiff: half as long in contact, and a step a quarter as long takes half as much of that.
        let (stiffness, dt) = (1e4 * 4_f64.powi(k), 2e-3 / 4_f64.powi(k));
        let steps = (0.2 / dt).round() as usize;
        let mut simulator = collision(stiffness, dt);
        let end = end_velocity(&simulator, steps);
        assert!((end.sum() - 1.0).abs() < 1e-12, "{end}");
        let found = jacobian(&simulator, steps);
        // Momentum, differentiated.
        for column in found.column_iter() {
            assert!((column.sum() - 1.0).abs() < 1e-12, "{found}");
        }
        let (q, v) = simulator.start();
        let (q, v) = (q.clone(), v.clone());
        let mut differences = Matrix2::zeros();
        for j in 0..2 {
            let h = 1e-5;
            let mut at = |x: f64| {
                let mut moved = v.clone();
                moved[j] += x;
                simulator.set_start(q.clone(), moved).unwrap();
                end_velocity(&simulator, steps)
            };
            let slope = (at(h) - at(-h)) / (2.0 * h);
            differences.set_column(j, &slope.fixed_rows::<2>(0));
        }
        let error = (found - swapped).amax();
        let against = (found - differences).amax();
        println!(
            "stiffness {stiffness:.0e} N/m, Δt {dt:.1e} s: velocities off by {:.1e}, their derivatives by {error:.1e}; against differences {against:.1e}",
            (end[1] - 1.0).abs()
        );
        assert!(against < 1e-5, "{found} {differences}");
        errors.push(error);
    }
    for pair in errors.windows(2) {
        assert!(pair[1] < 0.7 * pair[0], "{errors:?}");
    }
    assert!(errors[4] < 0.05, "{errors:?}");
}
