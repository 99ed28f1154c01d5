use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::Exchange;
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use std::time::Instant;
fn scene(n: usize, gap: f64, seed: u64) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    let side = (n as f64).cbrt().ceil() as usize;
    let r = 0.1;
    let d = (2.0 + gap) * r;
    let mut s = seed;
    let mut rnd = || {
        s = s
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((s >> 33) as f64 / (1u64 << 31) as f64) - 0.5
    };
    let mut v = Vec::new();
    for k in 0..n {
        let (i, j, l) = (k % side, (k / side) % side, k / side / side);
        let jit = 0.15 * gap * r;
        let at = [
            d * i as f64 + jit * rnd(),
            d * j as f64 + jit * rnd(),
            d * l as f64 + jit * rnd(),
        ];
        let body = if std::env::args().any(|a| a == "--ell") {
            Body::new(Shape::ellipsoid([0.1, 0.07, 0.05]).faces(320))
        } else {
            Body::new(Shape::sphere(r).faces(320))
        };
        scene.add(body.density(1200.0).at(at));
        for _ in 0..6 {
            v.push(0.2 * rnd());
        }
    }
    scene.initial.v = v;
    scene
}
fn main() -> hydrograd::Result<()> {
    let a: Vec<f64> = std::env::args()
        .skip(1)
        .filter_map(|x| x.parse().ok())
        .collect();
    let (n, gap, steps) = (a[0] as usize, a[1], a[2] as usize);
    let sc = scene(n, gap, 7);
    let mut last = Vec::new();
    for ex in [Exchange::Products, Exchange::Factor] {
        if ex == Exchange::Factor && n > 130 {
            continue;
        }
        let settings = Settings::default()
            .fidelity(Fidelity::Reduced)
            .exchange(ex)
            .films(false)
            .integrator(Integrator::Rk2)
            .accuracy(a.get(3).copied().unwrap_or(0.01))
            .time_step(0.01);
        let t = Instant::now();
        let sim = Simulator::new(&sc, settings)?;
        let prep = t.elapsed().as_secs_f64();
        let controls = Controls::zeros(&sim, steps);
        let t = Instant::now();
        let r = sim.rollout(&controls)?;
        let f = t.elapsed().as_secs_f64() / steps as f64;
        let t = Instant::now();
        let g = r.gradient(&objective::final_velocity(0, 0.0, 1.0))?;
        let b = t.elapsed().as_secs_f64() / steps as f64;
        let v = r.samples().last().unwrap().v.clone();
        let v0 = r.samples().first().unwrap().v.clone();
        let acc = (&v - &v0) / (0.01 * steps as f64);
        println!(
            "{n} {:?} prep {prep:.2} step {:.1} ms grad {:.1} ms  acc {:.3e} g {:.6e}",
            ex,
            1e3 * f,
            1e3 * b,
            acc.norm(),
            g.initial.v.norm()
        );
        last.push((acc, g));
    }
    if last.len() == 2 {
        println!(
            "acc err {:.3e} max {:.3e} grad err {:.3e}",
            (&last[0].0 - &last[1].0).norm() / last[1].0.norm(),
            (&last[0].0 - &last[1].0).amax() / last[1].0.amax(),
            (&last[0].1.initial.v - &last[1].1.initial.v).norm() / last[1].1.initial.v.norm()
        );
    }
    Ok(())
}
