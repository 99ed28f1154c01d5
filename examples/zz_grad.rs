use hydrograd::simulate::Cotangents;
use hydrograd::{Controls, Fidelity, Scene, Settings, Simulator};
use std::path::Path;
fn h(i: usize, s: u64) -> f64 {
    let mut z = (i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(s.wrapping_mul(0xD1B5_4A32_D192_ED03));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}
fn main() {
    let scenes = ["clown_fish","coins","cube","falling_ball","falling_ball_box","fish","fish_near_tail","grasp","grasp_open","kirchhoff_ellipsoid","two_spheres"];
    for name in scenes {
        let scene = Scene::load(Path::new(&format!("examples/scenes/{name}.toml"))).unwrap();
        for (f, faces, steps) in [(Fidelity::Isolated, 320, 30), (Fidelity::Reduced, 320, 12), (Fidelity::Auto, 320, 12), (Fidelity::Full, 80, 4)] {
            let faces = if name == "falling_ball_box" && f == Fidelity::Full { 320 } else { faces };
            let settings = Settings::default().fidelity(f).faces(faces);
            let line = (|| -> hydrograd::Result<String> {
                let sim = Simulator::new(&scene, settings)?;
                let rollout = sim.rollout(&Controls::zeros(&sim, steps))?;
                let mut c: Cotangents = rollout.zero_cotangents();
                for (k, x) in c.q.iter_mut().enumerate() { *x = h(k, 1); }
                for (k, x) in c.v.iter_mut().enumerate() { *x = h(k, 2); }
                for (k, x) in c.positions.iter_mut().enumerate() { *x = h(k, 3); } for (k, x) in c.rotations.iter_mut().enumerate() { *x = h(k, 4); }
                let g = rollout.vjp(&c)?;
                let list = |x: Vec<f64>| x.iter().map(|v| format!("{v:e}")).collect::<Vec<_>>().join(" ");
                let last = &rollout.samples()[steps];
                Ok(format!("q {}\nv {}\ncontrols {}\nq0 {}\nv0 {}\nparameters {}\ngains {}",
                    list(last.q.iter().copied().collect()), list(last.v.iter().copied().collect()),
                    list(g.controls.iter().copied().collect()), list(g.initial.q.iter().copied().collect()),
                    list(g.initial.v.iter().copied().collect()), list(g.parameters.to_vec()), list(g.gains.clone())))
            })();
            println!("== {name} {f:?}\n{}", line.unwrap_or_else(|e| format!("error {e}")));
        }
    }
}
