//! Rays and containment by `parry3d-f64` beside ours, where it is hard: thin plates, sharp edges, rays that meet
//! edges and vertices, points a rounding away from the surface.
//!
//! `cargo test --lib geometry::queries -- --nocapture` prints the figures of [`super::interior`].

use super::TriMesh;
use super::interior::Interior;
use super::tests::{ball, cuboid, turned};
use super::tree::MeshTree;
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

/// Rays from vertices and face centres against the normal: none of ours is lost.
#[test]
fn rays_inward() {
    let (mut rays, mut missed, mut worst) = (0, 0, 0.0_f64);
    for mesh in bodies() {
        let inside = Interior::new(&mesh);
        let other = theirs(&mesh);
        let vertices = mesh.vertices().iter().zip(&inside.vertex_normals);
        let vertices = vertices
            .enumerate()
            .map(|(v, (x, n))| (*x, *n, v, usize::MAX));
        let faces = inside.faces.centres.iter().zip(&inside.faces.normals);
        let faces = faces.enumerate().map(|(f, (x, n))| (*x, *n, usize::MAX, f));
        for (x, n, vertex, face) in vertices.chain(faces) {
            rays += 1;
            let ours = inside.ray(&x, &-n, vertex, face).unwrap();
            // Past the faces that it begins on.
            let skip = 1e-6 * ours;
            let ray = Ray::new(vector(&(x - n * skip)), vector(&-n));
            match other.cast_local_ray(&ray, f64::MAX, false) {
                Some(theirs) => worst = worst.max((theirs + skip - ours).abs() / ours),
                None => missed += 1,
            }
        }
    }
    println!("{rays} rays: the library misses {missed}, the others differ by {worst:.1e}");
    assert!(worst < 1e-11, "{worst:e}");
    // If it missed none any more, it could cast ours.
    assert!(missed > 0);
}

/// Containment by the library against the winding number, and against the signed distance of gaps, above and below
/// vertices, edges and faces. Counted by the distance from the surface: the winding number of a point far nearer than
/// rounding allows is no whole number.
#[test]
fn points_inside() {
    const BINS: usize = 16;
    let mut of_winding = [(0, 0); BINS];
    let (mut of_gaps, mut worst, mut count) = (0, 0.0_f64, 0);
    for mesh in bodies() {
        let inside = Interior::new(&mesh);
        let tree = MeshTree::new(&mesh);
        let (other, size) = (theirs(&mesh), mesh.diameter());
        let mut places: Vec<Vec3> = mesh.vertices().iter().step_by(4).copied().collect();
        places.extend(inside.faces.centres.iter().step_by(9));
        for e in mesh.edges().iter().step_by(9) {
            let [a, b] = e.vertices.map(|v| mesh.vertices()[v]);
            places.extend([0.5, 0.1234].map(|s| a + s * (b - a)));
        }
        let normals = inside.vertex_normals.iter().step_by(9);
        let ways: Vec<Vec3> = (normals
            .chain(inside.faces.normals.iter().step_by(29))
            .copied())
        .collect();
        for (x, way) in places.iter().flat_map(|x| ways.iter().map(move |w| (x, w))) {
            for power in [1, 2, 4, 6, 8, 9, 10, 12, 14] {
                for sign in [-1.0, 1.0] {
                    let p = x + way * (sign * size * 0.1f64.powi(power));
                    let (d, _) = tree.signed(&p).unwrap();
                    let found = other.project_local_point(vector(&p), false);
                    let far = (found.point - vector(&p)).length();
                    worst = worst.max((far - d.abs()).abs() / size);
                    let bin = (-(far / size).log10()).clamp(0.0, BINS as f64 - 1.0) as usize;
                    let turns = inside.winding(&p);
                    of_winding[bin].0 += 1;
                    of_winding[bin].1 += usize::from(found.is_inside != (turns > 0.5));
                    count += 1;
                    if far > 1e-12 * size {
                        of_gaps += usize::from(found.is_inside != (d < 0.0));
                        assert_eq!(inside.contains(&p), found.is_inside);
                    }
                }
            }
        }
    }
    println!(
        "{count} points; distances differ by {worst:.1e} of the size; signs from those of gaps at {of_gaps}"
    );
    for (bin, (all, wrong)) in of_winding.iter().enumerate() {
        println!(
            "10^-{bin} of the size: {all} points, {wrong} signs from those of winding numbers"
        );
        assert!(bin > 5 || *wrong == 0, "{bin}: {wrong} of {all}");
    }
    assert!(worst < 1e-12 && of_gaps == 0, "{worst:e} {of_gaps}");
}
