use hydrograd::adjoint::lie::*;
use hydrograd::boundary::PanelBoundary;
use hydrograd::coupling::{Coupling, PanelCoupled, panel::*};
use hydrograd::scene::{Shape, Wall};
use nalgebra::DMatrix;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
type Mesh = (Vec<Vec3>, Vec<[usize; 3]>);
fn mesh(shape: &Shape, faces: usize) -> Mesh {
    let m = hydrograd::shape::build(shape, Path::new("."), Some(faces)).unwrap();
    (m.vertices().to_vec(), m.faces().to_vec())
}
fn ellipsoid(semi_axes: [f64; 3], faces: usize) -> Mesh {
    mesh(
        &Shape::Ellipsoid {
            semi_axes,
            faces: None,
        },
        faces,
    )
}
#[test]
fn probe() {
    for n in [320, 1280] {
        let m = ellipsoid([1.0; 3], n);
        let b = Arc::new(PanelBoundary::new("ball", &m.0, &m.1).unwrap());
        for (d, e) in [
            (
                3.0,
                [
                    2.106704831524129,
                    -0.23339113417708315,
                    2.0978073973851967,
                    0.11646306884048746,
                ],
            ),
            (
                2.2,
                [
                    2.212295759450387,
                    -0.6176388786372325,
                    2.1287968395728725,
                    0.3003675369424352,
                ],
            ),
            (
                2.05,
                [
                    2.32202493143995,
                    -0.8142853669628686,
                    2.1589776041169393,
                    0.3814265072810595,
                ],
            ),
        ] {
            for solver in [Solver::Gmres, Solver::Lu] {
                let c = PanelCoupled::new(
                    vec![b.clone(), b.clone()],
                    &[],
                    SolveSettings {
                        solver,
                        ..Default::default()
                    },
                )
                .unwrap();
                let poses = [
                    Pose::identity(),
                    Pose::new(Mat3::identity(), Vec3::new(0.0, 0.0, d)),
                ];
                let t = Instant::now();
                let r = c
                    .evaluate(&poses, &DMatrix::identity(12, 12), false)
                    .unwrap();
                let m = r.momenta();
                let g = [m[(2, 2)], m[(2, 8)], m[(0, 0)], m[(0, 6)]];
                let err: Vec<f64> = (0..4).map(|i| 100.0 * (g[i] - e[i]) / 2.0944).collect();
                println!(
                    "n {n} d {d} {solver:?} {:?} err% {err:.3?} {:?} sym {:.1e}",
                    t.elapsed(),
                    r.report(),
                    (m - m.transpose()).abs().max()
                );
            }
        }
        for (h, e) in [
            (1.025, [3.1363102984028184, 2.540404111397999]),
            (1.1, [2.82993463808762, 2.4291643765153075]),
            (1.5, [2.340095965701212, 2.2142704662256842]),
            (2.0, [2.1944680370725975, 2.1439821448998875]),
        ] {
            let wall = Wall {
                point: [0.0; 3],
                normal: [0.0, 0.0, 2.0],
            };
            for solver in [Solver::Gmres, Solver::Lu] {
                let c = PanelCoupled::new(
                    vec![b.clone()],
                    &[wall],
                    SolveSettings {
                        solver,
                        ..Default::default()
                    },
                )
                .unwrap();
                let poses = [Pose::new(Mat3::identity(), Vec3::new(0.0, 0.0, h))];
                let t = Instant::now();
                let r = c.evaluate(&poses, &DMatrix::identity(6, 6), false).unwrap();
                let m = r.momenta();
                let g = [m[(2, 2)], m[(0, 0)]];
                let err: Vec<f64> = (0..2).map(|i| 100.0 * (g[i] / e[i] - 1.0)).collect();
                println!(
                    "wall n {n} h {h} {solver:?} {:?} err% {err:.3?} {:?}",
                    t.elapsed(),
                    r.report()
                );
            }
        }
    }
}
