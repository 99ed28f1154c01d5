//! Added mass of single bodies against exact values.

use hydrograd::adjoint::lie::Vec3;
use hydrograd::boundary::{BodyBoundary, Depth, Method, Settings};

/// Icosphere of unit radius with `20·4^level` faces.
pub fn icosphere(level: u32) -> (Vec<Vec3>, Vec<[usize; 3]>) {
    let g = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut v: Vec<Vec3> = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ]
    .iter()
    .map(|p| Vec3::from_row_slice(p).normalize())
    .collect();
    let mut f: Vec<[usize; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..level {
        let mut middle = std::collections::HashMap::new();
        let mut next = Vec::new();
        for t in &f {
            let m: Vec<usize> = (0..3)
                .map(|k| {
                    let (a, b) = (t[k], t[(k + 1) % 3]);
                    *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                        v.push(((v[a] + v[b]) * 0.5).normalize());
                        v.len() - 1
                    })
                })
                .collect();
            next.push([t[0], m[0], m[2]]);
            next.push([t[1], m[1], m[0]]);
            next.push([t[2], m[2], m[1]]);
            next.push([m[0], m[1], m[2]]);
        }
        f = next;
    }
    (v, f)
}

#[test]
fn sphere_at_fixed_depths() {
    let (v, f) = icosphere(3);
    let exact = 2.0 / 3.0 * std::f64::consts::PI;
    for (method, figures) in [
        (
            Method::MfsFace,
            [(0.02, -69.0), (0.05, -16.0), (0.1, -1.7), (0.2, -0.88)],
        ),
        (
            Method::MfsVertex,
            [(0.02, -3.0), (0.05, -1.1), (0.1, -0.36), (0.2, -0.29)],
        ),
    ] {
        for (depth, percent) in figures {
            let settings = Settings {
                method,
                depth: Depth::Fixed(depth),
                ..Default::default()
            };
            let b = BodyBoundary::new("sphere", &v, &f, &settings).unwrap();
            let error = 100.0 * (b.added_mass[(2, 2)] / exact - 1.0);
            println!(
                "{method:?} {depth} {error:.3} ({percent}) cond {:.2e} asym {:.1e} {:?}",
                b.condition, b.asymmetry, b.warnings
            );
        }
    }
}
