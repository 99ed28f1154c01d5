//! Convex hulls of what files hold.

use crate::support::bodies::turned_cube;
use hydrograd::Error;
use hydrograd::adjoint::lie::Vec3;
use hydrograd::shape::file::{FileMesh, Repairs};

/// A surface of these points that is nowhere closed.
fn loose(vertices: Vec<Vec3>) -> FileMesh {
    let last = vertices.len() - 1;
    let faces = (0..=last).step_by(3);
    FileMesh {
        name: "loose".into(),
        faces: faces
            .map(|v| [v, (v + 1).min(last), (v + 2).min(last)])
            .collect(),
        vertices,
        repairs: Repairs::default(),
    }
}

/// Of points in line some are a little outside of the others' edge, by rounding: faces with them have no area, and they are left out.
#[test]
fn points_on_edges_are_no_faces() {
    for parts in 2..6 {
        for turn in 1..8 {
            let hull = loose(turned_cube(parts, f64::from(turn) * 0.1)).hull();
            let hull = hull.unwrap_or_else(|e| panic!("{parts} parts, turn {turn}: {e}"));
            let volume = hull.mass_properties().volume;
            assert!((volume - 1.0).abs() < 1e-6, "{parts} {turn}: {volume}");
        }
    }
}

/// Points in a plane, to single precision, and points in line have no hull, and it says so.
#[test]
fn flat_points_have_no_hull() {
    let in_line = (0..9).map(|k| Vec3::new(0.1, -0.2, 0.7) * f64::from(k));
    let in_plane = turned_cube(4, 0.3).into_iter().map(|x| x - Vec3::z() * x.z);
    for points in [in_line.collect(), in_plane.collect::<Vec<_>>()] {
        let error = loose(points).hull().unwrap_err();
        assert!(matches!(error, Error::Input { .. }), "{error}");
        assert!(
            error.to_string().contains("no hull with a volume"),
            "{error}"
        );
    }
}
