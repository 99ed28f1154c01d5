//! Vertices of mesh files: which number each has, and which are merged.

use crate::files::{CUBE, SIDES, body, ply_header, ply_text, put, stl_text};
use hydrograd::adjoint::lie::Vec3;
use hydrograd::shape::Kind;
use hydrograd::shape::file::{read, read_unchecked, write_obj};
use std::fmt::Write;
use tempfile::TempDir;

#[test]
fn obj_vertices_keep_the_order_of_the_file() {
    let dir = TempDir::new().unwrap();
    let vertices = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., -1.]].map(Vec3::from);
    let written = vertices.map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let (all, three, last) = (written.concat(), written[..3].concat(), &written[3]);
    let rest = "f 1 4 2\nf 1 3 4\nf 2 4 3\n";
    for text in [
        format!("{all}f 3 1 2\n{rest}"),
        // Counted back, from faces below all vertices and between them.
        format!("{all}f -2 -4 -3\n{rest}"),
        format!("{three}f -1 -3 -2\n{last}{rest}"),
        // One that no face uses isn't counted.
        format!("v 9 9 9\n{all}f 4 2 3\nf 2 5 3\nf 2 4 5\nf 3 5 4\n"),
    ] {
        let mesh = read(&put(&dir, "tetrahedron.obj", &text), 1.0).unwrap();
        assert_eq!(mesh.vertices(), vertices, "{text}");
        assert_eq!(mesh.faces()[0], [2, 0, 1], "{text}");
    }
    let mesh = body();
    let path = dir.path().join("body.obj");
    write_obj(&path, &mesh).unwrap();
    let back = read(&path, 1.0).unwrap();
    assert_eq!(back.vertices(), mesh.vertices());
    assert_eq!(back.faces(), mesh.faces());
}

/// Two cubes that touch along an edge, each with vertices of its own: what faces say of normals and textures makes no vertices, which would have to be merged, there too.
#[test]
fn normals_and_textures_leave_vertices_as_they_are() {
    let dir = TempDir::new().unwrap();
    let mut vertices = String::from("vt 0 0\nvn 0 0 1\nvn 0 1 0\n");
    for shift in [0, 1] {
        for [x, y, z] in CUBE {
            writeln!(vertices, "v {} {} {z}", x + shift, y + shift).unwrap();
        }
    }
    let read = |end: fn(usize) -> String| {
        let mut text = vertices.clone();
        for first in [1, 9] {
            for (n, side) in SIDES.iter().enumerate() {
                let corners = side.map(|v| format!("{}{}", v + first, end(n)));
                writeln!(text, "f {}", corners.join(" ")).unwrap();
            }
        }
        read_unchecked(&put(&dir, "cubes.obj", text), 1.0).unwrap()
    };
    let plain = read(|_| String::new());
    for with in [
        read(|n| format!("//{}", 1 + n % 2)),
        read(|n| format!("/1/{}", 1 + n % 2)),
        read(|_| "/1".into()),
    ] {
        assert_eq!(with.repairs.merged_same, 0);
        assert_eq!(with.repairs, plain.repairs);
        assert_eq!(with.vertices, plain.vertices);
        assert_eq!(with.faces, plain.faces);
        let volume = with.into_mesh().unwrap().mass_properties().volume;
        assert!((volume - 2.0).abs() < 1e-14, "{volume}");
    }
}

/// The first sides of a cube, each with vertices of its own, shifted by `shift` from side to side; and some loose vertices.
fn sides(count: usize, shift: f64, loose: &[&str]) -> String {
    let mut ply = ply_header("ascii", "double", 4 * count + loose.len(), count);
    for (k, side) in SIDES[..count].iter().enumerate() {
        for v in side {
            let [x, y, z] = CUBE[*v].map(|c| f64::from(c) + shift * k as f64);
            writeln!(ply, "{x:e} {y:e} {z:e}").unwrap();
        }
    }
    loose.iter().for_each(|x| writeln!(ply, "{x}").unwrap());
    for k in 0..count {
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| 4 * k + i);
        writeln!(ply, "4 {a} {b} {c} {d}").unwrap();
    }
    ply
}

#[test]
fn nearby_vertices_are_merged_where_none_are_the_same() {
    let dir = TempDir::new().unwrap();
    let none: &[&str] = &[];
    for loose in [none, &["1e70 0 0"]] {
        let text = sides(6, 1e-8, loose);
        let raw = read_unchecked(&put(&dir, "rough.ply", text), 1.0).unwrap();
        assert_eq!((raw.repairs.merged_same, raw.repairs.merged_near), (0, 16));
        let mesh = raw.into_mesh().unwrap();
        assert_eq!((mesh.vertices().len(), mesh.faces().len()), (8, 12));
    }
}

/// A box without its last side: the report speaks of that hole, and not of the seams between the others.
#[test]
fn a_hole_is_told_as_merging_leaves_it() {
    let dir = TempDir::new().unwrap();
    let none: &[&str] = &[];
    for (shift, merged, open) in [(0.0, 12, 4), (1e-8, 0, 20)] {
        for loose in [none, &["1e70 0 0"]] {
            let text = sides(5, shift, loose);
            let raw = read_unchecked(&put(&dir, "open.ply", text), 1.0).unwrap();
            let repairs = raw.repairs;
            assert_eq!((repairs.merged_same, repairs.merged_near), (merged, 0));
            let report = raw.check();
            assert_eq!(report.find(Kind::OpenEdge).unwrap().count, open, "{report}");
        }
    }
}

/// What some editors on Windows put before a text.
#[test]
fn a_byte_order_mark_swallows_nothing() {
    let dir = TempDir::new().unwrap();
    let mesh = body();
    let obj = dir.path().join("plain.obj");
    write_obj(&obj, &mesh).unwrap();
    let obj = std::fs::read_to_string(obj).unwrap();
    // Without its comment a vertex comes first.
    let (_, obj) = obj.split_once('\n').unwrap();
    for (name, text) in [
        ("body.obj", obj.to_owned()),
        ("body.ply", ply_text(&mesh)),
        ("body.stl", stl_text(&mesh)),
    ] {
        let marked = format!("\u{feff}{text}");
        let plain = read(&put(&dir, name, text), 1.0).unwrap();
        let marked = read(&put(&dir, name, marked), 1.0).unwrap();
        assert_eq!(marked, plain, "{name}");
    }
}
