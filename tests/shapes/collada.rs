//! Shapes in COLLADA files: where nodes place them, and what their polygons become.

use crate::files::{CUBE, SIDES, put};
use crate::support::says;
use hydrograd::adjoint::lie::Vec3;
use hydrograd::shape::file::{FileMesh, read_unchecked};

/// Reads a file with a geometry `part`, given by its vertices and what is between them.
fn read(
    vertices: &[[f64; 3]],
    primitives: &str,
    scene: &str,
    unit: f64,
) -> hydrograd::Result<FileMesh> {
    let numbers: Vec<String> = vertices.iter().flatten().map(f64::to_string).collect();
    let (count, all, numbers) = (vertices.len(), numbers.len(), numbers.join(" "));
    let text = format!(
        r##"<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="{unit}"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="part"><mesh>
<source id="p"><float_array id="pa" count="{all}">{numbers}</float_array>
<technique_common><accessor source="#pa" count="{count}" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
{primitives}
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">{scene}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"##
    );
    let folder = tempfile::tempdir().unwrap();
    read_unchecked(&put(&folder, "part.dae", text), 1.0)
}

const SHOWN: &str = r##"<instance_geometry url="#part"/>"##;
const INPUT: &str = r##"<input semantic="VERTEX" source="#v" offset="0"/>"##;
const TETRAHEDRON: [[f64; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];

/// A tetrahedron in a scene.
fn tetrahedron(scene: &str, unit: f64) -> hydrograd::Result<FileMesh> {
    let faces = format!("<triangles count=\"4\">{INPUT}<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>");
    read(&TETRAHEDRON, &faces, scene, unit)
}

/// Vertices with these primitives between them, as they stand.
fn part(vertices: &[[f64; 3]], primitives: &str) -> hydrograd::Result<FileMesh> {
    read(vertices, primitives, &format!("<node>{SHOWN}</node>"), 1.0)
}

/// Numbers of vertices in a row.
fn row(numbers: &[usize]) -> String {
    let words: Vec<String> = numbers.iter().map(usize::to_string).collect();
    words.join(" ")
}

#[test]
fn nodes_of_collada_are_placed() {
    // Moved, then turned by a quarter about z, then twice as large: in that order from outside.
    let inner = format!(
        "<node><translate>10 0 0</translate><node><rotate>0 0 1 90</rotate><node><scale>2 2 2</scale>{SHOWN}</node></node></node>"
    );
    let mesh = tetrahedron(&inner, 0.1).unwrap().into_mesh().unwrap();
    let [low, high] = mesh.bounds();
    assert!((low - Vec3::new(0.8, 0.0, 0.0)).norm() < 1e-6, "{low}");
    assert!((high - Vec3::new(1.0, 0.2, 0.2)).norm() < 1e-6, "{high}");
    // A mirrored one is turned outward again, and one geometry may be shown twice.
    let twice = format!(
        "<node>{SHOWN}</node><node><matrix>-1 0 0 -3 0 1 0 0 0 0 1 0 0 0 0 1</matrix>{SHOWN}</node>"
    );
    let mesh = tetrahedron(&twice, 1.0).unwrap().into_mesh().unwrap();
    assert_eq!(mesh.faces().len(), 8);
    assert!((mesh.mass_properties().volume - 1.0 / 3.0).abs() < 1e-6);
    for (bad, words) in [
        (
            "<node><instance_geometry url=\"#no\"/></node>",
            "leads nowhere",
        ),
        ("<node><matrix>1 2 3</matrix></node>", "16 finite numbers"),
        ("<node><skew>1 2 3 4 5 6 7</skew></node>", "isn't read"),
        (
            "<node><instance_controller url=\"#skin\"/></node>",
            "instance_controller",
        ),
    ] {
        let error = tetrahedron(bad, 1.0).unwrap_err();
        says(error.to_string(), &["part.dae", words]);
    }
}

/// An L: from most of its corners a fan of triangles leaves it.
#[test]
fn notched_polygons_keep_their_form() {
    let outline = [[0., 0.], [2., 0.], [2., 1.], [1., 1.], [1., 3.], [0., 3.]];
    let level = |z: f64| outline.map(|[x, y]| [x, y, z]);
    let vertices = [level(0.0), level(1.0)].concat();
    for start in 0..6 {
        let top: Vec<usize> = (0..6).map(|i| 6 + (i + start) % 6).collect();
        let bottom: Vec<usize> = top.iter().rev().map(|v| v - 6).collect();
        let sides = (0..6).map(|i| vec![i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i]);
        let polygons: Vec<Vec<usize>> = [top, bottom].into_iter().chain(sides).collect();
        let sizes: Vec<usize> = polygons.iter().map(Vec::len).collect();
        let list = format!(
            "<polylist count=\"8\">{INPUT}<vcount>{}</vcount><p>{}</p></polylist>",
            row(&sizes),
            row(&polygons.concat())
        );
        // With normals, whose numbers stand between those of the vertices.
        let normals: Vec<String> = polygons
            .iter()
            .map(|p| p.iter().map(|v| format!("{v} 0 ")).collect())
            .collect();
        let separate = format!(
            "<polygons count=\"8\">{INPUT}<input semantic=\"NORMAL\" source=\"#n\" offset=\"1\"/><p>{}</p></polygons>",
            normals.join("</p><p>")
        );
        for primitives in [list, separate] {
            let raw = part(&vertices, &primitives).unwrap();
            assert_eq!(raw.repairs.polygons_split, 8);
            let mesh = raw.into_mesh().unwrap();
            let volume = mesh.mass_properties().volume;
            assert!((volume - 4.0).abs() < 1e-12, "{start}: {volume}");
        }
    }
}

#[test]
fn strips_and_fans_are_read_as_such() {
    // The sides in one strip, the ends in another, joined by triangles without area.
    let around = [4, 0, 5, 1, 6, 2, 7, 3, 4, 0];
    let ends = [3, 2, 0, 1, 1, 4, 4, 5, 7, 6];
    let strips = format!(
        "<tristrips count=\"2\">{INPUT}<p>{}</p><p>{}</p></tristrips>",
        row(&around),
        row(&ends)
    );
    let fans = SIDES.map(|side| format!("<p>{}</p>", row(&side))).concat();
    let fans = format!("<trifans count=\"6\">{INPUT}{fans}</trifans>");
    for primitives in [strips, fans] {
        let raw = part(&CUBE.map(|x| x.map(f64::from)), &primitives).unwrap();
        assert_eq!(raw.repairs.collapsed, 0, "{primitives}");
        let mesh = raw.into_mesh().unwrap();
        assert_eq!((mesh.vertices().len(), mesh.faces().len()), (8, 12));
        assert!((mesh.mass_properties().volume - 1.0).abs() < 1e-15);
    }
}

#[test]
fn what_can_not_be_read_of_polygons_is_told() {
    let cases: [(String, &[&str]); 6] = [
        (
            format!("<polygons count=\"1\">{INPUT}<ph><p>0 1 2</p><h>0 1 2</h></ph></polygons>"),
            &["holes", "triangles"],
        ),
        (
            format!("<triangles count=\"1\">{INPUT}<p>0 1 9</p></triangles>"),
            &["vertex 9", "of 4"],
        ),
        (
            format!("<triangles count=\"1\">{INPUT}<p>0 1 -2</p></triangles>"),
            &["-2", "whole number"],
        ),
        (
            format!("<triangles count=\"1\">{INPUT}<p>0 1</p></triangles>"),
            &["2 corners"],
        ),
        (
            "<triangles count=\"1\"><p>0 1 2</p></triangles>".into(),
            &["input VERTEX"],
        ),
        (
            format!("<polylist count=\"1\">{INPUT}<vcount>4</vcount><p>0 1 2</p></polylist>"),
            &["vcount", "4 corners"],
        ),
    ];
    for (primitives, words) in cases {
        let error = part(&TETRAHEDRON, &primitives).unwrap_err();
        says(error.to_string(), &["part.dae", "geometry \"part\""]);
        says(error.to_string(), words);
    }
}
