//! The panel method against exact values.

use hydrograd::adjoint::lie::{Mat6, Vec3};
use hydrograd::boundary::{PanelBoundary, Response};
use hydrograd::scene::Shape;
use std::path::Path;
use std::time::Instant;

type Mesh = (Vec<Vec3>, Vec<[usize; 3]>);

fn mesh(shape: &Shape, faces: usize) -> Mesh {
    let m = hydrograd::shape::build(shape, Path::new("."), Some(faces)).unwrap();
    (m.vertices().to_vec(), m.faces().to_vec())
}

fn ellipsoid(semi_axes: [f64; 3], faces: usize) -> Mesh {
    let shape = Shape::Ellipsoid {
        semi_axes,
        faces: None,
    };
    mesh(&shape, faces)
}

fn build(mesh: &Mesh) -> PanelBoundary {
    PanelBoundary::new("body", &mesh.0, &mesh.1).unwrap()
}

#[test]
fn probe() {
    for (s, n) in [
        ([1.0; 3], 320),
        ([1.0; 3], 1280),
        ([1.0; 3], 5120),
        ([1.0, 0.2, 1.0], 1280),
        ([1.0, 1.0, 0.1], 1280),
        ([1.0, 1.0, 0.03], 1280),
    ] {
        let t = Instant::now();
        let m = ellipsoid(s, n);
        let b = build(&m);
        println!(
            "{s:?} {n} {:?} diag {:?} asym {:.2e} cond {:.2}",
            t.elapsed(),
            b.added_mass.diagonal().as_slice(),
            b.asymmetry,
            b.condition
        );
        if s == [1.0; 3] {
            println!(
                "   error {:.4}%",
                100.0 * (b.added_mass[(0, 0)] / 2.0943951023931957 - 1.0)
            );
        }
        if n > 2000 {
            continue;
        }
        let p = [
            Vec3::new(0.3, -1.8, 1.5),
            Vec3::new(1.7, 0.4, 0.9),
            Vec3::new(0.2, 1.4, 0.6),
        ];
        let r = b.radiated(&p).unwrap();
        for i in 0..3 {
            let d = p[i][0] / (2.0 * p[i].norm().powi(3));
            println!("   radiated {} dipole {}", r[(i, 0)], d);
        }
        let s = b.scattered(&p, &p).unwrap();
        println!("   scattered {s:?}");
    }
}
