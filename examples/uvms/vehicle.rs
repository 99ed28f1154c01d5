//! The vehicle with its arm, and recordings of our own.

use crate::recording::{JOINTS, Recording, STEP};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Base, Damping, Float, Motion, Robot, RobotLink, Wet};
use hydrograd::{Controls, Fidelity, Fluid, Scene, Settings, Simulator};
use nalgebra::{DVector, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Normal, Uniform};
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

pub const VEHICLE: &str = "vehicle_frame";
/// Joints whose zero isn't sure.
pub const ZEROS: [&str; 2] = ["joint5", "joint4"];
const DENSITY: f64 = 997.0;
pub const GRAVITY: f64 = 9.81;
/// Of the vehicle: kg, kg of water, m, kg m² with the water's, kg, N s/m and N m s, N s²/m² and N m s².
const MASS: f64 = 13.17;
pub const LIFT: f64 = 13.082;
pub const CENTER: [f64; 3] = [0.0074, 0.0, 0.02];
pub const INERTIA: [f64; 3] = [0.45, 0.60, 0.60];
const ADDED: [f64; 3] = [5.5, 12.7, 14.57];
pub const LINEAR: [f64; 6] = [4.03, 6.22, 5.18, 0.07, 0.07, 0.07];
const QUADRATIC: [f64; 6] = [18.18, 21.66, 36.99, 1.55, 1.55, 1.55];
/// s between points of a joint's motion.
const KNOTS: f64 = 0.2;

/// What is documented of a link of the arm: kg, L, m, m, N s²/m² along its axes.
struct Link(&'static str, f64, f64, [f64; 3], [f64; 3], [f64; 3]);

const LINKS: [Link; 5] = [
    Link(
        "r5m_base_link",
        0.341,
        0.202,
        [-0.075, -0.006, -0.003],
        [-0.075, -0.006, -0.003],
        [0.0; 3],
    ),
    Link(
        "r5m_shoulder_link",
        0.194,
        0.018,
        [0.005, -0.001, 0.016],
        [-0.001, -0.003, 0.032],
        [0.26, 0.26, 0.3],
    ),
    Link(
        "r5m_upper_arm_link",
        0.429,
        0.203,
        [0.073, 0.0, 0.0],
        [0.073, 0.0, -0.002],
        [0.3, 1.6, 1.6],
    ),
    Link(
        "r5m_forearm_link",
        0.115,
        0.025,
        [0.017, -0.026, -0.002],
        [0.003, 0.001, -0.017],
        [0.26, 0.3, 0.26],
    ),
    Link(
        "r5m_wrist_link",
        0.333,
        0.155,
        [0.0, 0.0, -0.098],
        [0.0, 0.0, -0.098],
        [1.8, 1.8, 0.3],
    ),
];
/// kg, L, m, in the wrist's frame.
const JAW: (f64, f64, [f64; 3]) = (0.05, 0.02, [0.0, 0.0, -0.19]);
/// Force in water, N, and place of weights and foams.
const ITEMS: [(f64, [f64; 3]); 7] = [
    (-3.24, [-0.20, 0.165, -0.075]),
    (-1.62, [-0.0975, 0.1275, -0.1325]),
    (-1.62, [-0.0975, -0.1275, -0.1325]),
    (-0.69, [-0.1887, 0.0439, -0.0595]),
    (-1.01, [-0.1542, 0.0439, -0.0795]),
    (8.46, [0.0, 0.11, 0.027]),
    (8.86, [0.0, -0.11, 0.027]),
];

/// What recordings of our own are made with, in the order of the unknowns.
pub const TRUTH: [f64; 9] = [0.0045, -0.004, 0.027, 0.05, -0.03, 0.55, 0.75, 0.3, 0.45];

/// What was found from the five training runs: for folders that lack them.
pub const FOUND: [f64; 9] = [
    0.007544, 0.000332, 0.0244, -0.02623, 0.02108, 0.59, 0.5271, 0.2222, 0.182,
];

/// A joint's motion through points that parabolas through 0.4 s of the recording say: its own noise would be acceleration.
fn motion(run: &Recording, joint: &str) -> hydrograd::Result<Motion> {
    let (t, x) = (run.column("t"), run.column(joint));
    let length = t[t.len() - 1] - t[0];
    let count = ((length / KNOTS).round() as usize + 1).max(2);
    let times: Vec<f64> = (0..count)
        .map(|k| length * k as f64 / (count - 1) as f64)
        .collect();
    let value = |at: &f64| {
        let near: Vec<usize> = (0..t.len())
            .filter(|n| (t[*n] - t[0] - at).abs() < 1.01 * KNOTS)
            .collect();
        let a = nalgebra::DMatrix::from_fn(near.len(), 3, |i, k| {
            (t[near[i]] - t[0] - at).powi(k as i32)
        });
        let b = DVector::from_fn(near.len(), |i, _| x[near[i]]);
        a.svd(true, true)
            .solve(&b, 1e-12)
            .map_or(b.mean(), |c| c[0])
    };
    let values = times.iter().map(value).collect();
    Motion::through(times, values)
}

fn scene(run: &Recording, urdf: &Path) -> Result<Scene, Box<dyn Error>> {
    let mut scene = Scene::new(Fluid {
        density: DENSITY,
        ..Fluid::fresh_water()
    });
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene.time_step = STEP;
    scene.steps = run.steps();
    let mut robot = Robot::default().base(Base::Free).shape(Wet::Visual);
    (robot.faces, robot.limits, robot.actuated) = (Some(160), Some(false), Some(false));
    for joint in JOINTS {
        robot = robot.driven(format!("r5m_{joint}"), [motion(run, joint)?]);
    }
    robot.zeros = ZEROS.map(|joint| (format!("r5m_{joint}"), 0.0)).into();
    let mut added = vec![vec![0.0; 6]; 6];
    (0..3).for_each(|k| added[k][k] = ADDED[k] / DENSITY);
    robot = robot.link(
        VEHICLE,
        RobotLink {
            shape: Some(Wet::None),
            mass: Some(MASS),
            center_of_mass: Some([0.0; 3]),
            inertia: Some(INERTIA.to_vec()),
            volume: Some(LIFT / DENSITY),
            center_of_buoyancy: Some(CENTER),
            added_mass: Some(added),
            ..RobotLink::default()
        },
    );
    for Link(name, mass, volume, center, buoyancy, _) in LINKS {
        robot = robot.link(
            name,
            RobotLink {
                mass: Some(mass),
                center_of_mass: Some(center),
                volume: Some(1e-3 * volume),
                center_of_buoyancy: Some(buoyancy),
                keep: true,
                ..RobotLink::default()
            },
        );
    }
    let text = std::fs::read_to_string(urdf)?;
    let has = |name: &str| text.contains(&format!("link name=\"{name}\""));
    for name in ["vehicle_ballast", "vehicle_cans"]
        .into_iter()
        .filter(|n| has(n))
    {
        let dry = RobotLink {
            shape: Some(Wet::None),
            ..RobotLink::default()
        };
        robot = robot.link(name, dry);
    }
    // Weighed together, as the jaw.
    for name in ["r5m_jaw", "r5m_jaw1", "r5m_jaw2"]
        .into_iter()
        .filter(|n| has(n))
    {
        let none = RobotLink {
            mass: Some(1e-9),
            ..RobotLink::default()
        };
        robot = robot.link(name, none);
    }
    scene.add_robot(urdf, &robot)?;
    for Link(name, _, _, _, buoyancy, drag) in LINKS {
        if drag != [0.0; 3] {
            let [x, y, z] = drag;
            let damping = Damping::new(name)
                .named(format!("{name} drag"))
                .at(buoyancy);
            scene.add_force(damping.quadratic([x, y, z, 0.0, 0.0, 0.0]).into());
        }
    }
    let jaw = Float::new("r5m_wrist_link").named("jaw").at(JAW.2);
    scene.add_force(jaw.mass(JAW.0).volume(1e-3 * JAW.1).into());
    for (i, (force, at)) in ITEMS.into_iter().enumerate() {
        let item = Float::new(VEHICLE).named(format!("item {}", i + 1)).at(at);
        let (mass, volume) = (
            f64::max(-force, 0.0) / GRAVITY,
            f64::max(force, 0.0) / (DENSITY * GRAVITY),
        );
        scene.add_force(item.mass(mass).volume(volume).into());
    }
    let water = Damping::new(VEHICLE).named("water");
    scene.add_force(water.linear(LINEAR).quadratic(QUADRATIC).into());
    Ok(scene)
}

/// A simulator that starts as the recording does, or level and at rest, as it floats, if `still`.
fn started(
    run: &Recording,
    urdf: &Path,
    start: ([f64; 2], [f64; 3], [f64; 3]),
) -> Result<Simulator, Box<dyn Error>> {
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    let mut out = Simulator::new(&scene(run, urdf)?, settings.integrator(Integrator::Rk4))?;
    let ([roll, pitch], rates, velocity) = start;
    let turn = UnitQuaternion::from_euler_angles(roll, pitch, 0.0);
    let (mut q, mut v) = (out.start().0.clone(), out.start().1.clone());
    q.rows_mut(0, 7)
        .copy_from_slice(&[0.0, 0.0, 0.0, turn.w, turn.i, turn.j, turn.k]);
    let rates = turn * Vector3::from(rates);
    v.rows_mut(0, 3).copy_from_slice(&velocity);
    v.rows_mut(3, 3).copy_from_slice(rates.as_slice());
    out.set_start(q, v)?;
    Ok(out)
}

pub fn prepare(run: &Recording, urdf: &Path) -> Result<Simulator, Box<dyn Error>> {
    started(run, urdf, run.start())
}

/// Roll and pitch at which weight and buoyancy balance with the joints as in `q`: their moment about the vehicle's origin, with it upright and on its side, says where.
pub fn equilibrium(simulator: &Simulator, q: &DVector<f64>) -> hydrograd::Result<[f64; 2]> {
    let moment = |attitude: [f64; 4]| {
        let mut q = q.clone();
        q.rows_mut(3, 4).copy_from_slice(&attitude);
        let still = DVector::zeros(simulator.system().tree.velocities());
        let force = -simulator
            .equations(&q)?
            .bias_force(&still, &simulator.no_control())?;
        Ok::<_, hydrograd::Error>([force[3], force[4]])
    };
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let (upright, aside) = (
        moment([1.0, 0.0, 0.0, 0.0])?,
        moment([half, half, 0.0, 0.0])?,
    );
    let [x, y, z] = [-upright[1], upright[0], -aside[0]];
    Ok([y.atan2(z), (-x).atan2(y.hypot(z))])
}

/// Joint, kind, parent, place and turn in it, length and turn of the cylinder that its link is.
const CHAIN: [(&str, &str, &str, &str, &str, f64, &str); 5] = [
    (
        "arm_to_vehicle",
        "fixed",
        VEHICLE,
        "0.25 -0.11 0.005",
        "0 0 0",
        0.14,
        "0 1.5708 0",
    ),
    (
        "r5m_joint5",
        "revolute",
        "r5m_base_link",
        "0 0 0",
        "0 0 0",
        0.05,
        "0 0 0",
    ),
    (
        "r5m_joint4",
        "revolute",
        "r5m_shoulder_link",
        "0.02 0 0.046",
        "1.5708 1.3 0",
        0.14,
        "0 1.5708 0",
    ),
    (
        "r5m_joint3",
        "revolute",
        "r5m_upper_arm_link",
        "0.15 0 0",
        "3.1416 0 1.3",
        0.04,
        "1.5708 0 0",
    ),
    (
        "r5m_joint2",
        "revolute",
        "r5m_forearm_link",
        "0.02 0 0",
        "-1.5708 0 0",
        0.16,
        "0 0 0",
    ),
];

fn urdf() -> String {
    let inertial = |mass: f64, at: &str| {
        format!(
            "<inertial><mass value=\"{mass}\"/><origin xyz=\"{at}\"/><inertia ixx=\"0.001\" ixy=\"0\" ixz=\"0\" iyy=\"0.001\" iyz=\"0\" izz=\"0.001\"/></inertial>"
        )
    };
    let mut out = format!(
        "<robot name=\"made\">\n<link name=\"{VEHICLE}\"><visual><geometry><box size=\"0.46 0.34 0.25\"/></geometry></visual>{}</link>\n",
        inertial(MASS, "0 0 0")
    );
    for (Link(name, mass, _, [x, y, z], ..), (joint, kind, parent, at, rpy, length, turn)) in
        LINKS.iter().zip(CHAIN)
    {
        let center = format!("{x} {y} {z}");
        // Writing to a string doesn't fail.
        let _ = writeln!(
            out,
            "<link name=\"{name}\"><visual><origin xyz=\"{center}\" rpy=\"{turn}\"/><geometry><cylinder radius=\"0.02\" length=\"{length}\"/></geometry></visual>{}</link>\n\
             <joint name=\"{joint}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{name}\"/><origin xyz=\"{at}\" rpy=\"{rpy}\"/><axis xyz=\"0 0 1\"/>\
             <limit lower=\"-7\" upper=\"7\" effort=\"9\" velocity=\"1\"/></joint>",
            inertial(*mass, &center)
        );
    }
    out + "</robot>\n"
}

/// Writes recordings of 10 s that are made here with the truth, and noise.
pub fn make(folder: &Path, names: &[&str]) -> Result<(), Box<dyn Error>> {
    let runs = folder.join("runs");
    std::fs::create_dir_all(&runs)?;
    let path = folder.join("blue_rov_hardware_fixedjaw.urdf");
    std::fs::write(&path, urdf())?;
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let (to, noise) = (Uniform::new(-1.2, 1.2)?, Normal::new(0.0, 1.0)?);
    let (home, steps) = ([1.2, 0.4, 0.6, -1.0], 500);
    for name in names {
        let goal: [f64; 4] = std::array::from_fn(|k| home[k] + to.sample(&mut random));
        let joints = |n: usize| -> [f64; 4] {
            let s = ((STEP * n as f64 - 1.0) / 5.5).clamp(0.0, 1.0);
            let part = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            std::array::from_fn(|k| home[k] + part * (goal[k] - home[k]))
        };
        let line = |n: usize, seen: [f64; 4], joints: [f64; 4]| {
            let [roll, pitch, x, y] = seen;
            let [a, b, c, d] = joints;
            format!(
                "{:.2},0,0,0,0,1,{roll:.6},{pitch:.6},{x:.6},{y:.6},0,{a:.6},{b:.6},{c:.6},{d:.6},1\n",
                STEP * n as f64
            )
        };
        let header = "t,x,y,z,yaw,mocap_ok,imu_roll,imu_pitch,gyro_x,gyro_y,gyro_z,joint5,joint4,joint3,joint2,free\n";
        let file = runs.join(format!("{name}.csv"));
        let write = |seen: &dyn Fn(usize) -> [f64; 4]| {
            let lines = (0..=steps).map(|n| line(n, seen(n), joints(n)));
            std::fs::write(&file, header.to_string() + &lines.collect::<String>())
        };
        // A run that knows the joints alone says where it floats still.
        write(&|_| [0.0; 4])?;
        let of = |(mut runs, urdf): (Vec<Recording>, _)| {
            let at = runs
                .iter()
                .position(|r| r.name == *name)
                .ok_or("it was written")?;
            Ok::<_, Box<dyn Error>>((runs.swap_remove(at), urdf))
        };
        let (run, urdf) = of(crate::recording::folder(folder)?)?;
        let level = crate::with_values(&prepare(&run, &urdf)?, &TRUTH)?;
        let still = equilibrium(&level, level.start().0)?;
        let truth = started(&run, &urdf, (still, [0.0; 3], [0.0; 3]))?;
        let truth = crate::with_values(&truth, &TRUTH)?;
        let rollout = truth.rollout(&Controls::zeros(&truth, steps))?;
        let (attitudes, gyros) = (rollout.observe("attitudes")?, rollout.observe("gyros")?);
        let sizes = [3e-4, 3e-4, 3e-3, 3e-3];
        let noises: Vec<[f64; 4]> = (0..=steps)
            .map(|_| std::array::from_fn(|k| sizes[k] * noise.sample(&mut random)))
            .collect();
        write(&|n| {
            let exact = [
                attitudes[(0, n)],
                attitudes[(1, n)],
                gyros[(0, n)],
                gyros[(1, n)],
            ];
            std::array::from_fn(|k| exact[k] + noises[n][k])
        })?;
    }
    Ok(())
}
