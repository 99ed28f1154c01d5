use hydrograd::adjoint::lie::*;
use hydrograd::boundary::{BodyBoundary, Response};
use hydrograd::coupling::reduced::{Reduced, compress};
use hydrograd::coupling::Coupling;
use hydrograd::scene::Shape;
use hydrograd::shape;
use nalgebra::DMatrix;
use std::sync::Arc;
use std::time::Instant;
fn main() {
    let args: Vec<f64> = std::env::args().skip(1).map(|a| a.parse().unwrap()).collect();
    let (gap, tol, rank) = (args[0], args[1], args[2] as usize);
    let mesh = shape::build(&Shape::Sphere { radius: 1.0, faces: Some(1280) }, std::path::Path::new(""), None).unwrap();
    let b = BodyBoundary::new("s", mesh.vertices(), mesh.faces(), &Default::default()).unwrap();
    let t = Instant::now();
    let body = compress::compress("s", mesh.vertices(), mesh.faces(), &b as &dyn Response,
        &compress::Settings { rank: if rank > 0 { Some(rank) } else { None }, tolerance: tol, resolved_gap: Some(gap) }).unwrap();
    println!("compress {:?} points {} modes {} fit {:?}", t.elapsed(), body.points(), body.modes(), body.parts().fit);
    let body = Arc::new(body);
    let r = Reduced::new(vec![body.clone(), body.clone()], &[], |_, _| None).unwrap();
    let basis = DMatrix::<f64>::identity(12, 12);
    for (d, ex) in [(6.0, 0.0), (3.0, 0.0), (2.5, 0.0), (2.2, 0.0), (2.1, 0.0), (2.02,0.0)] {
        let poses = [Pose::identity(), Pose::new(Mat3::identity(), Vec3::new(0.0, 0.0, d))];
        match r.evaluate(&poses, &basis, true) {
            Ok(rec) => {
                let m = rec.momenta();
                println!("d {d} M11z {:.6} M12z {:.6} M11x {:.6} M12x {:.6} cond {:.2} {ex}", m[(2, 2)], m[(2, 8)], m[(0, 0)], m[(0, 6)], rec.report().condition);
            }
            Err(e) => println!("d {d} {e}"),
        }
    }
    let poses = [Pose::identity(), Pose::new(Mat3::identity(), Vec3::new(0.0, 0.0, 2.5))];
    let basis = DMatrix::<f64>::identity(12, 2);
    let t = Instant::now();
    for _ in 0..100 { r.evaluate(&poses, &basis, true).unwrap(); }
    println!("evaluate {:?}", t.elapsed() / 100);
}
