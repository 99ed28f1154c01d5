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
        scene.add(Body::new(Shape::sphere(0.1)).density(density).at([0.0, 0.0, z]));
    }
    let v = v * gap;
    scene.initial.v = vec![0.1 * v, 0.0, 0.5 * v, 0.0, 0.0, 0.0, 0.0, 0.2 * v, -0.5 * v, 0.0, 0.0, 0.0];
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
    scene.initial.q = vec![0.0, -0.05 - gap, 0.05 + gap, 1.4, 0.0, std::f64::consts::FRAC_PI_2];
    scene.initial.v = vec![0.0, v, -v, 0.0, 0.1 * v, 0.0];
    scene.gravity = [0.0, 0.0, -1.0];
    scene
}

#[test]
fn table() {
    let mut scenes: Vec<(String, Scene)> = Vec::new();
    for v in [0.0, 30.0] {
        for gap in [0.2, 0.05, 0.02] {
            scenes.push((format!("spheres {gap} v{v}"), spheres(gap, v)));
            scenes.push((
                format!("sphere wall {gap} v{v}"),
                over_wall(Shape::sphere(0.1), 0.1 + 0.1 * gap, [0.1 * v * gap, 0.0, -0.5 * v * gap, 0.0, 0.1 * v * gap, 0.0]),
            ));
            let disc = Shape::cylinder(0.1, 0.04);
            scenes.push((
                format!("disc wall {gap} v{v}"),
                over_wall(disc, 0.02 + 0.1 * gap, [0.05 * v * gap, 0.0, -0.1 * v * gap, 0.0, 0.0, 0.0]),
            ));
            let plate = Shape::cuboid([0.1, 0.1, 0.02]);
            scenes.push((
                format!("plate wall {gap} v{v}"),
                over_wall(plate, 0.02 + 0.1 * gap, [0.05 * v * gap, 0.0, -0.1 * v * gap, 0.1 * v * gap, 0.0, 0.0]),
            ));
        }
        for gap in [0.1, 0.05, 0.024, 0.012] {
            scenes.push((format!("grasp {gap} v{v}"), grasp(gap, v * gap * 0.3)));
        }
    }
    let only = std::env::var("HG_ONLY").unwrap_or_default();
    for (name, scene) in scenes.iter().filter(|(n, _)| n.contains(&only)) {
        for (fidelity, method) in [
            (Fidelity::Reduced, Method::Auto),
            (Fidelity::Full, Method::Panel),
        ] {
            for faces in [320, 1280] {
                if name.starts_with("grasp") && fidelity == Fidelity::Full && faces > 320 {
                    continue;
                }
                let settings = Settings::default().fidelity(fidelity).method(method);
                let run = at_start(scene, settings.time_step(1e-5).faces(faces));
                let p = run.pressure(0).unwrap();
                let film: Vec<String> = p.iter().map(|p| format!("{:.2}", p.at_films.iter().sum::<f64>())).collect();
                let [f, m] = errors(&run, 0);
                println!("{name:24} {fidelity} {faces:5}: force {:6.2} % moment {:6.2} %   film faces {film:?}", 100.0 * f, 100.0 * m);
                if std::env::var("HG_WRENCH").is_ok() {
                    let loads = run.loads(0).unwrap();
                    let water = loads.wrenches("water").unwrap();
                    for p in &p {
                        println!("    {} p {:.5?}\n      w {:.5?}", p.name, p.wrench().as_slice(), water[p.body].as_slice());
                    }
                }
            }
        }
    }
}
