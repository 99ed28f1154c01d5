//! Bodies and scenes that more than one measurement uses.

use hydrograd::TriMesh;
use hydrograd::adjoint::lie::{Mat3, Pose, Vec3};
use hydrograd::boundary::BodyBoundary;
use hydrograd::coupling::full::{Full, Preconditioner, SolveSettings};
use hydrograd::coupling::{Coupling, Exclusions};
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape};
use nalgebra::{DMatrix, Rotation3};
use std::collections::HashMap;
use std::sync::Arc;

/// A mesh whose vertices are moved.
pub fn mapped(mesh: &TriMesh, to: impl Fn(&Vec3) -> Vec3) -> TriMesh {
    let vertices = mesh.vertices().iter().map(to).collect();
    TriMesh::new(mesh.name(), vertices, mesh.faces().to_vec()).unwrap()
}

/// A cylinder along z of so many flat sides, each of two triangles from end to end; the ends are fans.
pub fn sided_cylinder(sides: usize, radius: f64, length: f64) -> Shape {
    let ring = |z: f64| {
        (0..sides).map(move |k| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / sides as f64).sin_cos();
            [radius * cos, radius * sin, z]
        })
    };
    let ends = [-0.5 * length, 0.5 * length];
    let mut vertices: Vec<[f64; 3]> = ends.into_iter().flat_map(ring).collect();
    vertices.extend(ends.map(|z| [0.0, 0.0, z]));
    let faces = (0..sides).flat_map(|k| {
        let (a, b) = (k, (k + 1) % sides);
        let (c, d) = (sides + a, sides + b);
        let [low, high] = [2 * sides, 2 * sides + 1];
        [[a, b, d], [a, d, c], [low, b, a], [high, c, d]]
    });
    Shape::triangles(vertices, faces.collect::<Vec<_>>())
}

/// A box whose cells shrink towards the edges with the square of the distance, `cells` along each
/// axis; diagonals mirror each other.
pub fn graded_box(size: [f64; 3], cells: [usize; 3]) -> TriMesh {
    let place = |axis: usize, i: usize| {
        let t = 2.0 * i as f64 / cells[axis] as f64 - 1.0;
        0.5 * size[axis] * t.signum() * (1.0 - (1.0 - t.abs()).powi(2))
    };
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    let mut known = HashMap::new();
    for a in 0..3 {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        for side in [0, cells[a]] {
            for (i, j) in (0..cells[b]).flat_map(|i| (0..cells[c]).map(move |j| (i, j))) {
                let q = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| {
                    let mut at = [side; 3];
                    (at[b], at[c]) = (i, j);
                    *known.entry(at).or_insert_with(|| {
                        vertices.push(Vec3::from(std::array::from_fn(|k| place(k, at[k]))));
                        vertices.len() - 1
                    })
                });
                let k = usize::from((2 * i < cells[b]) != (2 * j < cells[c]));
                for t in [[k, k + 1, k + 2], [k, k + 2, (k + 3) % 4]] {
                    let [x, y, z] = t.map(|i| q[i]);
                    faces.push(if side == 0 { [x, z, y] } else { [x, y, z] });
                }
            }
        }
    }
    TriMesh::new("box", vertices, faces).unwrap()
}

/// A coin flat over a fixed box, with regions around the points where they are nearest.
pub fn coin_over_box(regions: Option<(f64, f64)>, faces: [usize; 2]) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 1.0,
        current: [0.0; 3],
    });
    let axis = [0.0, 0.0, 1.0];
    let mut plate = Body::new(Shape::cuboid([1.0, 1.0, 0.4]).faces(faces[0])).fixed();
    let mut coin = Body::new(Shape::ellipsoid([0.2, 0.2, 0.1]).faces(faces[1]))
        .density(1.0)
        .at([0.0, 0.0, 0.3])
        .joint(Joint::Prismatic { axis });
    if let Some((radius, edge)) = regions {
        plate = plate.refine([0.0, 0.0, 0.2], radius, edge);
        coin = coin.refine([0.0, 0.0, -0.1], radius, edge);
    }
    scene.add(plate);
    scene.add(coin);
    scene.initial.q = vec![COIN_GAP];
    scene
}

/// Between coin and box at the start, m.
pub const COIN_GAP: f64 = 0.002;
/// About where that gap is twice as wide, m.
pub const COIN_RADIUS: f64 = 0.04;

/// Points at a distance off the ellipsoid, spread over it.
pub fn off_ellipsoid(semi_axes: [f64; 3], gap: f64, count: usize) -> Vec<Vec3> {
    let axes = Vec3::from(semi_axes);
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let turn = 2.399_963 * i as f64;
            let s = (1.0 - z * z).sqrt();
            let unit = Vec3::new(s * turn.cos(), s * turn.sin(), z);
            unit.component_mul(&axes) + unit.component_div(&axes).normalize() * gap
        })
        .collect()
}

/// Iterations of CGLS for two bodies at unit density, the second one `gap` above the first: a unit sphere and a coin of
/// thickness 0.4 flat side on, all twelve twists, cold start.
pub fn coin_iterations(
    bodies: &[Arc<BodyBoundary>],
    gap: f64,
    preconditioner: Preconditioner,
    tolerance: f64,
) -> usize {
    let settings = SolveSettings {
        preconditioner,
        tolerance,
        max_iterations: 50_000,
        ..SolveSettings::default()
    };
    let poses = [
        Pose::identity(),
        Pose::new(Mat3::identity(), Vec3::new(0.0, 1.2 + gap, 0.0)),
    ];
    let coupled = Full::new(bodies.to_vec(), &[], Exclusions::none(), settings).unwrap();
    let basis = DMatrix::identity(12, 12);
    coupled
        .evaluate(&poses, &basis)
        .unwrap()
        .report()
        .iterations
}

/// Corners of a cube of side 1 m, and points that cut its edges into so many parts; turned by this angle about two axes, and in single precision, as in an STL file.
pub fn turned_cube(parts: u32, angle: f64) -> Vec<Vec3> {
    let turn = Rotation3::from_euler_angles(angle, 0.0, angle);
    let grid = (0..(parts + 1).pow(3)).map(|k| {
        let row = parts + 1;
        [k % row, k / row % row, k / row / row]
    });
    let on_edges = grid.filter(|at| at.iter().filter(|k| **k % parts == 0).count() >= 2);
    let points = on_edges.map(|at| turn * Vec3::from(at.map(f64::from)) / f64::from(parts));
    points.map(|x| x.map(|x| f64::from(x as f32))).collect()
}
