//! The pressure on bodies with gaps that films carry: its sum against what the dynamics do to them.

use crate::support::example;
use hydrograd::adjoint::lie::Vec6;
use hydrograd::geometry::Wall;
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::{Method, SurfacePressure};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};

fn parts(w: &Vec6) -> [f64; 2] {
    [0, 3].map(|at| w.fixed_rows::<3>(at).norm())
}

/// Largest difference of the wrenches of pressures and of dynamics over all bodies: of forces in parts of the largest there, of moments
/// in parts of it at the body's farthest point.
fn errors(rollout: &Rollout, n: usize) -> [f64; 2] {
    let loads = rollout.loads(n).unwrap();
    let water = loads.wrenches("water").unwrap();
    let reach = |p: &SurfacePressure| {
        let far = p.centres.iter().map(|x| (x - p.origin).norm());
        far.fold(0.0, f64::max)
    };
    let largest = water.iter().map(|w| parts(w)[0]).fold(0.0, f64::max);
    let pressures = rollout.pressure(n).unwrap();
    pressures.iter().fold([0.0; 2], |worst: [f64; 2], p| {
        let [force, moment] = parts(&(p.wrench() - water[p.body]));
        [
            worst[0].max(force / largest),
            worst[1].max(moment / (largest * reach(p))),
        ]
    })
}

fn at_start(scene: &Scene, settings: Settings) -> Rollout {
    let simulator = Simulator::new(scene, settings).unwrap();
    simulator.rollout(&Controls::zeros(&simulator, 1)).unwrap()
}

fn still() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.1, 0.0, -9.81];
    scene
}

fn spheres(gap: f64, v: f64) -> Scene {
    let mut scene = still();
    for (z, density) in [(0.0, 1500.0), (0.2 + 0.1 * gap, 2700.0)] {
        scene.add(
            Body::new(Shape::sphere(0.1))
                .density(density)
                .at([0.0, 0.0, z]),
        );
    }
    let v = v * gap;
    scene.initial.v = vec![
        0.1 * v,
        0.0,
        0.5 * v,
        0.0,
        0.0,
        0.0,
        0.0,
        0.2 * v,
        -0.5 * v,
        0.0,
        0.0,
        0.0,
    ];
    scene
}

fn over_wall(shape: Shape, height: f64, v: [f64; 6]) -> Scene {
    let mut scene = still();
    scene.add(Body::new(shape).density(2000.0).at([0.0, 0.0, height]));
    scene.walls.push(Wall::rigid([0.0; 3], [0.0, 0.0, 1.0]));
    scene.initial.v = v.to_vec();
    scene
}

/// The coin flat between the fingers.
fn grasp(gap: f64, v: f64) -> Scene {
    let mut scene = example("grasp_open");
    scene.controller = None;
    scene.initial.q = vec![
        0.0,
        -0.05 - gap,
        0.05 + gap,
        1.4,
        0.0,
        std::f64::consts::FRAC_PI_2,
    ];
    scene.initial.v = vec![0.0, v, -v, 0.0, 0.1 * v, 0.0];
    scene.gravity = [0.0, 0.0, -1.0];
    scene
}

/// Scene by scene: its name, its gaps, what it is at a gap, and the largest error of reduced and of coupled panels, with 1,280 faces a body.
type Case = (&'static str, [f64; 3], fn(f64) -> Scene, [f64; 2]);

const CASES: [Case; 4] = [
    (
        "spheres",
        [0.2, 0.05, 0.02],
        |gap| spheres(gap, 10.0),
        [0.03, 0.01],
    ),
    (
        "sphere over a wall",
        [0.2, 0.05, 0.02],
        |gap| over_wall(Shape::sphere(0.1), 0.1 + 0.1 * gap, moving(gap)),
        [0.02, 0.01],
    ),
    (
        "disc over a wall",
        [0.2, 0.05, 0.02],
        |gap| over_wall(Shape::cylinder(0.1, 0.04), 0.02 + 0.1 * gap, moving(gap)),
        [0.02, 0.03],
    ),
    (
        "plate over a wall",
        [0.2, 0.05, 0.02],
        |gap| {
            over_wall(
                Shape::cuboid([0.1, 0.1, 0.02]),
                0.02 + 0.1 * gap,
                moving(gap),
            )
        },
        [0.02, 0.02],
    ),
];

/// Sliding, closing and tilting.
fn moving(gap: f64) -> [f64; 6] {
    [0.5 * gap, 0.0, -gap, gap, 0.0, 0.0]
}

fn found(scene: &Scene, fidelity: Fidelity, faces: usize) -> [f64; 2] {
    let settings = Settings::default().fidelity(fidelity).time_step(1e-5);
    errors(
        &at_start(scene, settings.method(Method::Auto).faces(faces)),
        0,
    )
}

#[test]
fn pressures_in_gaps_add_up_to_what_the_dynamics_do() {
    for (name, gaps, scene, limits) in CASES {
        for gap in gaps {
            let scene = scene(gap);
            for (fidelity, limit) in [Fidelity::Reduced, Fidelity::Full].into_iter().zip(limits) {
                let [force, moment] = found(&scene, fidelity, 1280);
                let told = format!(
                    "{name} at {gap}, {fidelity}: {:.2} %, moments {:.2} %",
                    100.0 * force,
                    100.0 * moment
                );
                println!("{told}");
                assert!(force.max(moment) < limit, "{told}");
            }
        }
    }
}

/// A coin flat between two fingers, from an eighth of their width down to a seventieth.
#[test]
fn pressures_in_a_closing_grasp_add_up_to_what_the_dynamics_do() {
    let mut missed = Vec::new();
    for gap in [0.1, 0.05, 0.024, 0.012] {
        let scene = grasp(gap, gap);
        for (fidelity, faces, limit) in [
            (Fidelity::Reduced, 320, 0.08),
            (Fidelity::Reduced, 1280, 0.03),
            (Fidelity::Full, 320, 0.08),
        ] {
            let [force, moment] = found(&scene, fidelity, faces);
            let told = format!(
                "grasp at {gap}, {fidelity}, {faces}: {:.2} %, moments {:.2} %",
                100.0 * force,
                100.0 * moment
            );
            println!("{told}");
            if force.max(moment) > limit {
                missed.push(told);
            }
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}

#[test]
fn the_pressure_across_a_film_is_one_and_its_faces_are_told() {
    let mut scene = still();
    for (z, density) in [(0.0, 900.0), (0.204, 2000.0)] {
        let block = Body::new(Shape::cuboid([0.2; 3])).density(density);
        scene.add(block.at([0.0, 0.0, z]));
    }
    scene.add(
        Body::new(Shape::sphere(0.1))
            .at([1.0, 0.0, 0.0])
            .density(900.0),
    );
    let settings = Settings::default().fidelity(Fidelity::Reduced);
    let all = at_start(&scene, settings).pressure(0).unwrap();
    for p in &all {
        assert!(p.pressures.iter().all(|x| x.is_finite()));
        assert!(p.at_films.iter().all(|x| (0.0..=1.0).contains(x)));
    }
    assert!(all[2].at_films.iter().all(|at| *at == 0.0));
    // On the two sides of the gap.
    let beside = |p: &SurfacePressure, facing: f64| {
        let faces = (0..p.areas.len()).filter(|i| facing * p.normals[*i].z > 0.9);
        faces.fold([0.0; 2], |[area, force], i| {
            let at = p.at_films[i] * p.areas[i];
            [area + at, force + at * p.pressures[i]]
        })
    };
    let (lower, upper) = (beside(&all[0], 1.0), beside(&all[1], -1.0));
    println!("areas at the film, and forces: {lower:.5?} and {upper:.5?}");
    for [area, _] in [lower, upper] {
        assert!((area / 0.04 - 1.0).abs() < 0.05, "{area}");
    }
    // The gap is as wide as a fiftieth of the blocks, and the water in it falls as well.
    assert!(
        (lower[1] / upper[1] - 1.0).abs() < 0.1,
        "{lower:?} {upper:?}"
    );
}
