//! Rays and containment by `parry3d-f64` beside ours, where it is hard: thin plates, sharp edges, rays that meet
//! edges and vertices, points a rounding away from the surface.
//!
//! `cargo test --lib geometry::parry -- --nocapture` prints the figures of [`super::interior`].

use super::interior::Interior;
use super::tests::{ball, cuboid, turned};
use super::tree::MeshTree;
use super::{Faces, TriMesh};
use hydrograd_adjoint::lie::Vec3;
use parry3d_f64::math::Vector;
use parry3d_f64::query::{PointQuery, Ray, RayCast};
use parry3d_f64::shape::{TriMesh as Theirs, TriMeshFlags};

fn vector(x: &Vec3) -> Vector {
    Vector::new(x.x, x.y, x.z)
}

fn theirs(mesh: &TriMesh) -> Theirs {
    let vertices = mesh.vertices().iter().map(vector).collect();
    let faces = mesh.faces().iter().map(|f| f.map(|v| v as u32)).collect();
    Theirs::with_flags(vertices, faces, TriMeshFlags::ORIENTED).unwrap()
}

/// Convex bodies, along the axes and turned.
fn bodies() -> Vec<TriMesh> {
    let wedge = {
        let corner = |k: usize| [[-0.5, 0.0], [0.5, 0.0], [0.5, 0.02]][k % 3];
        let at = |k: usize| Vec3::new(corner(k)[0], if k < 3 { -0.5 } else { 0.5 }, corner(k)[1]);
        let faces = [[0, 1, 2], [3, 5, 4]].into_iter();
        let sides = (0..3).flat_map(|k| {
            let l = (k + 1) % 3;
            [[k, k + 3, l], [l, k + 3, l + 3]]
        });
        TriMesh::new(
            "wedge",
            (0..6).map(at).collect(),
            faces.chain(sides).collect(),
        )
    };
    let plain = [
        cuboid([1.0; 3]),
        cuboid([1.0, 1.0, 1e-2]),
        cuboid([1.0, 1.0, 1e-4]),
        ball(),
        wedge.unwrap().split().split(),
    ];
    let pose = turned([0.3, -0.7, 1.1], [0.2, -3.0, 1.7]);
    let moved: Vec<TriMesh> = plain.iter().map(|m| m.transformed(&pose)).collect();
    plain.into_iter().chain(moved).collect()
}

/// Largest height of a point over the planes of a convex body's faces, m.
fn height(faces: &Faces, x: &Vec3) -> f64 {
    let heights = (0..faces.len()).map(|f| (x - faces.corners[f][0]).dot(&faces.normals[f]));
    heights.fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn rays_inward() {
    for mesh in bodies() {
        let inside = Interior::new(&mesh);
        let (other, size) = (theirs(&mesh), mesh.diameter());
        let vertices = mesh.vertices().iter().zip(&inside.vertex_normals);
        let vertices = vertices
            .enumerate()
            .map(|(v, (x, n))| (*x, *n, v, usize::MAX));
        let faces = inside.faces.centres.iter().zip(&inside.faces.normals);
        let faces = faces.enumerate().map(|(f, (x, n))| (*x, *n, usize::MAX, f));
        let (mut rays, mut missed, mut lost, mut worst) = (0, 0, 0, 0.0_f64);
        for (x, n, vertex, face) in vertices.chain(faces) {
            rays += 1;
            let ours = inside.ray(&x, &-n, vertex, face);
            // Past the faces that it begins on.
            let skip = 1e-6 * inside.ray(&x, &-n, vertex, face).unwrap_or(size);
            let ray = Ray::new(vector(&(x - n * skip)), vector(&-n));
            let found = other.cast_local_ray(&ray, f64::MAX, false);
            match (ours, found) {
                (Some(a), Some(b)) => worst = worst.max((b + skip - a).abs() / a),
                (Some(_), None) => missed += 1,
                (None, _) => lost += 1,
            }
        }
        println!(
            "{} {:.0e}: {rays} rays, {missed} missed, {lost} lost by us, worst {worst:.1e}",
            mesh.name(),
            size
        );
        assert_eq!(lost, 0);
    }
}

#[test]
fn points_inside() {
    for mesh in bodies() {
        let inside = Interior::new(&mesh);
        let tree = MeshTree::new(&mesh);
        let (other, size) = (theirs(&mesh), mesh.diameter());
        let mut places: Vec<Vec3> = mesh.vertices().to_vec();
        places.extend(&inside.faces.centres);
        for e in mesh.edges() {
            let [a, b] = e.vertices.map(|v| mesh.vertices()[v]);
            places.push(0.5 * (a + b));
            places.push(a + 0.1234 * (b - a));
        }
        let mut ways = mesh.vertex_normals();
        ways.truncate(4);
        ways.extend(inside.faces.normals.iter().take(4));
        let (mut points, mut winding, mut normals, mut parry) = (0, 0, 0, 0);
        let mut worst: f64 = 0.0;
        for x in &places {
            for way in &ways {
                for power in [1, 3, 6, 9, 12, 14] {
                    for sign in [-1.0, 1.0] {
                        let p = x + way * (sign * size * 0.1f64.powi(power));
                        let h = height(&inside.faces, &p);
                        if h.abs() < 1e-15 * size {
                            continue;
                        }
                        points += 1;
                        let truth = h < 0.0;
                        winding += usize::from(inside.contains(&p) != truth);
                        let (d, _) = tree.signed(&p).unwrap();
                        normals += usize::from((d < 0.0) != truth);
                        let found = other.project_local_point(vector(&p), false);
                        parry += usize::from(found.is_inside != truth);
                        let far = (found.point - vector(&p)).length();
                        worst = worst.max((far - d.abs()).abs() / size);
                    }
                }
            }
        }
        println!(
            "{} {size:.1}: {points} points, wrong by winding number {winding}, by our normals {normals}, \
             by parry {parry}; distances differ by {worst:.1e}",
            mesh.name()
        );
        // Points nearer than rounding are anybody's guess.
        assert!(normals <= parry && worst < 1e-12);
    }
}
