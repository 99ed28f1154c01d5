//! Mesh files: round trips, and files that are broken in every way.

use hydrograd::Error;
use hydrograd::adjoint::lie::Vec3;
use hydrograd::adjoint::sample::Samples;
use hydrograd::shape::file::{FileMesh, read, read_unchecked, write_obj};
use hydrograd::shape::{Kind, TriMesh, build, parse_shape};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use tempfile::TempDir;

pub fn body() -> TriMesh {
    let shape = parse_shape("ellipsoid:1,0.8,0.3").unwrap();
    build(&shape, Path::new("."), Some(320)).unwrap()
}

/// A cube of polygons: 8 vertices, 6 quadrilaterals, counter-clockwise from outside.
pub const CUBE: [[i32; 3]; 8] = [
    [0, 0, 0],
    [1, 0, 0],
    [1, 1, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1, 0, 1],
    [1, 1, 1],
    [0, 1, 1],
];
pub const SIDES: [[usize; 4]; 6] = [
    [3, 2, 1, 0],
    [4, 5, 6, 7],
    [0, 1, 5, 4],
    [1, 2, 6, 5],
    [2, 3, 7, 6],
    [3, 0, 4, 7],
];

pub fn put(dir: &TempDir, name: &str, contents: impl AsRef<[u8]>) -> PathBuf {
    let path = dir.path().join(name);
    std::fs::write(&path, contents).unwrap();
    path
}

pub fn stl_text(mesh: &TriMesh) -> String {
    let mut s = "solid body\n".to_owned();
    for f in 0..mesh.faces().len() {
        let n = mesh.normal(f);
        writeln!(s, "facet normal {} {} {}\n outer loop", n.x, n.y, n.z).unwrap();
        for p in mesh.corners(f) {
            writeln!(
                s,
                "  vertex {:e} {:e} {:e}",
                p.x as f32, p.y as f32, p.z as f32
            )
            .unwrap();
        }
        s += " endloop\nendfacet\n";
    }
    s + "endsolid body\n"
}

fn stl_binary(mesh: &TriMesh, header: &str) -> Vec<u8> {
    let mut b = vec![b' '; 80];
    b[..header.len()].copy_from_slice(header.as_bytes());
    b.extend((mesh.faces().len() as u32).to_le_bytes());
    for f in 0..mesh.faces().len() {
        let corners = mesh.corners(f);
        for p in [mesh.normal(f), corners[0], corners[1], corners[2]] {
            p.iter().for_each(|&x| b.extend((x as f32).to_le_bytes()));
        }
        b.extend([0, 0]);
    }
    b
}

pub fn ply_text(mesh: &TriMesh) -> String {
    let mut s = ply_header("ascii", "double", mesh.vertices().len(), mesh.faces().len());
    for p in mesh.vertices() {
        writeln!(s, "{:e} {:e} {:e}", p.x, p.y, p.z).unwrap();
    }
    for [a, b, c] in mesh.faces() {
        writeln!(s, "3 {a} {b} {c}").unwrap();
    }
    s
}

pub fn ply_header(format: &str, number: &str, vertices: usize, faces: usize) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment made by hand\nelement vertex {vertices}\n\
         property {number} x\nproperty {number} y\nproperty {number} z\nelement face {faces}\n\
         property list uchar int vertex_indices\nend_header\n"
    )
}

fn ply_binary(mesh: &TriMesh, big: bool) -> Vec<u8> {
    let (v, f) = (mesh.vertices(), mesh.faces());
    let format = if big {
        "binary_big_endian"
    } else {
        "binary_little_endian"
    };
    let mut b = ply_header(format, "double", v.len(), f.len()).into_bytes();
    for p in v {
        for x in p.iter() {
            b.extend(if big {
                x.to_be_bytes()
            } else {
                x.to_le_bytes()
            });
        }
    }
    for face in f {
        b.push(3);
        for &i in face {
            let i = i as i32;
            b.extend(if big {
                i.to_be_bytes()
            } else {
                i.to_le_bytes()
            });
        }
    }
    b
}

/// Same faces in the same order, corners within `tolerance`.
fn assert_same(a: &TriMesh, b: &TriMesh, tolerance: f64) {
    assert_eq!(a.vertices().len(), b.vertices().len());
    assert_eq!(a.faces().len(), b.faces().len());
    for f in 0..a.faces().len() {
        for (p, q) in a.corners(f).iter().zip(b.corners(f)) {
            assert!((p - q).amax() <= tolerance, "face {f}: {p:?} {q:?}");
        }
    }
}

#[test]
fn obj_comes_back_bit_for_bit() {
    let dir = TempDir::new().unwrap();
    for scale in [1e-6, 1.0, 1e6] {
        let mesh = body().scaled(scale).unwrap();
        let path = dir.path().join("body.OBJ");
        write_obj(&path, &mesh).unwrap();
        assert_same(&read(&path, 1.0).unwrap(), &mesh, 0.0);
    }
}

#[test]
fn stl_comes_back_in_single_precision() {
    let dir = TempDir::new().unwrap();
    let mesh = body();
    let text = stl_text(&mesh);
    for (name, contents) in [
        ("text.stl", text.clone().into_bytes()),
        ("upper.STL", text.to_uppercase().into_bytes()),
        ("windows.stl", text.replace('\n', "\r\n").into_bytes()),
        ("nameless.stl", text.replace(" body", "").into_bytes()),
        ("binary.stl", stl_binary(&mesh, "made by hand")),
        // A binary file whose header begins as text does.
        ("solid.stl", stl_binary(&mesh, "solid facet body")),
    ] {
        let path = put(&dir, name, contents);
        assert_same(&read(&path, 1.0).unwrap(), &mesh, 6e-8);
        let raw = read_unchecked(&path, 1.0).unwrap();
        assert_eq!(
            (raw.repairs.merged_near, raw.repairs.collapsed),
            (0, 0),
            "{name}"
        );
    }
}

#[test]
fn ply_comes_back_bit_for_bit() {
    let dir = TempDir::new().unwrap();
    let mesh = body();
    for (name, contents) in [
        ("text.ply", ply_text(&mesh).into_bytes()),
        (
            "windows.ply",
            ply_text(&mesh).replace('\n', "\r\n").into_bytes(),
        ),
        ("little.ply", ply_binary(&mesh, false)),
        ("big.PLY", ply_binary(&mesh, true)),
    ] {
        let path = put(&dir, name, contents);
        assert_same(&read(&path, 1.0).unwrap(), &mesh, 0.0);
    }
}

#[test]
fn polygons_groups_and_relative_numbers_are_understood() {
    let dir = TempDir::new().unwrap();
    let vertices: String = CUBE
        .iter()
        .map(|[x, y, z]| format!("v {x} {y} {z}\n"))
        .collect();
    let face = |f: &[usize; 4], base: i64| -> String {
        let corners = f.map(|v| format!("{}/7/-9", v as i64 + base));
        format!("f {}\n", corners.join(" "))
    };
    let plain: String = SIDES.iter().map(|f| face(f, 1)).collect();
    let relative: String = SIDES.iter().map(|f| face(f, -8)).collect();
    let grouped: String = SIDES
        .iter()
        .enumerate()
        .map(|(i, f)| format!("g side {i}\nusemtl m{i}\ns 1\n{}", face(f, 1)))
        .collect();
    let continued = plain.replace(" 6/", " \\\n 6/");
    let commented = plain.replace("\n", " # side\n");
    for faces in [plain, relative, grouped, continued, commented] {
        let text = format!("# a cube\nmtllib none.mtl\nvt 0 0\no cube\n{vertices}{faces}");
        let raw = read_unchecked(&put(&dir, "cube.obj", &text), 0.5).unwrap();
        assert_eq!(raw.repairs.polygons_split, 6, "{text}");
        assert_eq!(raw.repairs.merged_same, 0);
        let mass = raw.into_mesh().unwrap().mass_properties();
        assert!((mass.volume - 0.125).abs() < 1e-15);
    }

    let mut ply = ply_header("ascii", "float", 8, 6);
    CUBE.iter()
        .for_each(|[x, y, z]| writeln!(ply, "{x} {y} {z}").unwrap());
    SIDES
        .iter()
        .for_each(|[a, b, c, d]| writeln!(ply, "4 {a} {b} {c} {d}").unwrap());
    let raw = read_unchecked(&put(&dir, "cube.ply", &ply), 1.0).unwrap();
    assert_eq!(raw.repairs.polygons_split, 6);
    assert!((raw.into_mesh().unwrap().mass_properties().volume - 1.0).abs() < 1e-15);
}

#[test]
fn vertices_are_merged_where_that_closes_the_surface() {
    let dir = TempDir::new().unwrap();
    // Every side with vertices of its own, as exporters with normals do.
    let mut split = String::new();
    for side in SIDES {
        for v in side {
            let [x, y, z] = CUBE[v];
            writeln!(split, "v {x} {y} {z}").unwrap();
        }
        split += "f -4 -3 -2 -1\n";
    }
    let raw = read_unchecked(&put(&dir, "split.obj", &split), 1.0).unwrap();
    assert_eq!((raw.repairs.merged_same, raw.repairs.merged_near), (16, 0));
    raw.into_mesh().unwrap();

    // Text rounded differently for each face.
    let mesh = body();
    let mut flip = false;
    let rough: String = stl_text(&mesh)
        .lines()
        .map(|line| match line.trim().strip_prefix("vertex") {
            Some(numbers) => {
                flip = !flip;
                let shift = if flip { 2e-7 } else { -2e-7 };
                let moved = numbers
                    .split_whitespace()
                    .map(|x| format!(" {:.9}", x.parse::<f64>().unwrap() + shift));
                format!("vertex{}\n", moved.collect::<String>())
            }
            None => format!("{line}\n"),
        })
        .collect();
    let raw = read_unchecked(&put(&dir, "rough.stl", rough), 1.0).unwrap();
    assert!(raw.repairs.merged_near > 100, "{:?}", raw.repairs);
    assert_same(&raw.into_mesh().unwrap(), &mesh, 1e-6);

    // A real hole isn't closed by force, and the report speaks of the file.
    let mut open = stl_binary(&mesh, "");
    open.truncate(open.len() - 50);
    open[80..84].copy_from_slice(&319u32.to_le_bytes());
    let raw = read_unchecked(&put(&dir, "open.stl", open), 1.0).unwrap();
    assert_eq!(raw.check().find(Kind::OpenEdge).unwrap().count, 3);
    assert_eq!(raw.repairs.merged_near, 0);
    let error = raw.into_mesh().unwrap_err().to_string();
    assert!(
        error.contains("open.stl") && error.contains("close the holes"),
        "{error}"
    );

    // A face that is a line in single precision goes, the rest stays closed.
    let mut flap = stl_text(&mesh);
    let p = mesh.vertices()[0];
    let point = format!("vertex {} {} {}\n", p.x as f32, p.y as f32, p.z as f32);
    let extra =
        format!("facet normal 0 0 1\nouter loop\n{point}{point}vertex 0 0 9\nendloop\nendfacet\n");
    flap = flap.replace("endsolid", &format!("{extra}endsolid"));
    let raw = read_unchecked(&put(&dir, "flap.stl", flap), 1.0).unwrap();
    assert_eq!(raw.repairs.collapsed, 1);
    raw.into_mesh().unwrap();
}

#[test]
fn several_solids_in_one_text_are_all_read() {
    let dir = TempDir::new().unwrap();
    let text = stl_text(&body());
    let faces: Vec<&str> = text.split_inclusive("endfacet\n").collect();
    let half = faces[..100].concat() + "endsolid body\nsolid rest\n" + &faces[100..].concat();
    let mesh = read(&put(&dir, "parts.stl", half), 1.0).unwrap();
    assert_eq!(mesh.faces().len(), 320);
}

/// The error of a file, which must name it.
fn refusal(path: &Path) -> String {
    let error = read_unchecked(path, 1.0)
        .and_then(FileMesh::into_mesh)
        .unwrap_err()
        .to_string();
    assert!(error.contains(&path.display().to_string()), "{error}");
    error
}

#[test]
fn broken_files_are_refused_with_path_and_remedy() {
    let dir = TempDir::new().unwrap();
    let huge = |format: &str| ply_header(format, "float", 4_000_000_000, 4_000_000_000);
    let huge_list = [
        ply_header("binary_little_endian", "float", 0, 1).replace("list uchar", "list uint"),
        "\u{7f}\u{7f}\u{7f}\u{7f}".into(),
    ]
    .concat();
    let mut huge_stl = stl_binary(&body(), "");
    huge_stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let ply = ply_text(&body());
    let stl = stl_text(&body());
    let cases: Vec<(&str, Vec<u8>, &[&str])> = vec![
        ("empty.obj", vec![], &["empty", "export"]),
        ("empty.stl", vec![], &["empty", "export"]),
        ("empty.ply", b" \n ".to_vec(), &["empty", "export"]),
        ("mesh.step", b"x".to_vec(), &["\"step\"", ".obj, .stl"]),
        ("mesh", b"x".to_vec(), &["extension", ".obj, .stl"]),
        ("binary.obj", vec![0xff; 500], &["no faces"]),
        (
            "text.stl",
            b"hello, world".to_vec(),
            &["12 bytes", "export"],
        ),
        ("noise.stl", vec![0xa5; 500], &["declares", "500", "export"]),
        ("noise.ply", vec![0xa5; 500], &["header", "export"]),
        ("points.obj", triangle.into(), &["no faces"]),
        (
            "number.obj",
            format!("{triangle}# c\nv 0 x 1\nf 1 2 3\n").into(),
            &["line 5", "v 0 x 1", "three numbers"],
        ),
        (
            "short.obj",
            format!("{triangle}v 0 1\nf 1 2 3\n").into(),
            &["line 4", "three numbers"],
        ),
        (
            "face.obj",
            format!("{triangle}f 1 2 a\n").into(),
            &["line 4", "vertex numbers"],
        ),
        (
            "edge.obj",
            format!("{triangle}f 1 2 3\nf\n").into(),
            &["line 5", "three corners"],
        ),
        (
            "range.obj",
            format!("{triangle}f 1 2 3\nf 1 2 4\nf 1 2 3\n").into(),
            &["line 5", "f 1 2 4", "counted from 1"],
        ),
        (
            "zero.obj",
            format!("{triangle}f 0 1 2\n").into(),
            &["line 4", "counted from 1"],
        ),
        (
            "below.obj",
            format!("{triangle}f -4 1 2\n").into(),
            &["line 4", "counted from 1"],
        ),
        (
            "vast.obj",
            format!("{triangle}f 1 2 9223372036854775807\n").into(),
            &["line 4", "counted from 1"],
        ),
        (
            "least.obj",
            format!("{triangle}f 1 2 -9223372036854775808\n").into(),
            &["line 4", "counted from 1"],
        ),
        (
            "nan.obj",
            format!("{triangle}v nan 0 0\nf 1 2 4\n").into(),
            &["NaN", "finite"],
        ),
        ("huge.stl", huge_stl, &["4294967295 faces", "export"]),
        (
            "words.stl",
            "solid x\nfacet normal 0 0 zero\nendsolid".into(),
            &["float", "export"],
        ),
        (
            "nan.stl",
            stl.replace("endsolid", "facet normal nan 0 0\nendsolid")
                .into(),
            &["finite"],
        ),
        (
            "hugetext.ply",
            huge("ascii").into(),
            &["4000000000", "cut off"],
        ),
        (
            "hugebinary.ply",
            huge("binary_little_endian").into(),
            &["4000000000", "cut off"],
        ),
        ("hugelist.ply", huge_list.into(), &["cut off"]),
        (
            "nothing.ply",
            "ply\nformat ascii 1.0\nelement face 99999999999\nend_header\n".into(),
            &["no properties"],
        ),
        (
            "noxyz.ply",
            ply.replace("double y", "double w").into(),
            &["vertex 0", "x, y, z"],
        ),
        (
            "nolist.ply",
            ply.replace("vertex_indices", "other").into(),
            &["vertex_indices"],
        ),
        (
            "float.ply",
            ply.replace("uchar int", "uchar float").into(),
            &["vertex_indices"],
        ),
        (
            "two.ply",
            ply.replace("\n3 ", "\n2 ").into(),
            &["face 0", "2 corners"],
        ),
        (
            "minus.ply",
            ply.replacen("\n3 ", "\n3 -1", 1).into(),
            &["face 0", "negative"],
        ),
        (
            "beyond.ply",
            ply.replacen("\n3 ", "\n3 9999", 1).into(),
            &["out of range", "face 0"],
        ),
        (
            "version.ply",
            ply.replace("ascii 1.0", "ascii").into(),
            &["header", "export"],
        ),
    ];
    for (name, contents, parts) in cases {
        let error = refusal(&put(&dir, name, contents));
        println!("{error}");
        for part in parts {
            assert!(error.contains(part), "{name}: {error:?} lacks {part:?}");
        }
    }
    let missing = dir.path().join("missing.obj");
    assert!(matches!(
        read(&missing, 1.0),
        Err(Error::File { action: "read", .. })
    ));
    refusal(&missing);
    let folder = dir.path().join("folder.ply");
    std::fs::create_dir(&folder).unwrap();
    refusal(&folder);
    let nowhere = dir.path().join("no/such/folder.obj");
    assert!(matches!(
        write_obj(&nowhere, &body()),
        Err(Error::File {
            action: "write",
            ..
        })
    ));
    let good = put(&dir, "good.ply", ply);
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = read(&good, scale).unwrap_err().to_string();
        assert!(
            error.contains("scale") && error.contains("positive"),
            "{error}"
        );
    }
}

/// Each file cut off at many places, and with bytes changed: an error or a mesh, no panic, and
/// never a mesh that isn't closed.
#[test]
fn damaged_files_never_panic() {
    let dir = TempDir::new().unwrap();
    let shape = parse_shape("box:1,2,3").unwrap();
    let mesh = build(&shape, Path::new("."), Some(12)).unwrap();
    let obj = dir.path().join("whole.obj");
    write_obj(&obj, &mesh).unwrap();
    let files = [
        ("damaged.obj", std::fs::read(obj).unwrap()),
        ("damaged.stl", stl_text(&mesh).into_bytes()),
        ("damaged.STL", stl_binary(&mesh, "solid")),
        ("damaged.ply", ply_text(&mesh).into_bytes()),
        ("damaged.PLY", ply_binary(&mesh, false)),
    ];
    // A linear congruence: any sequence will do, but always the same one.
    // Panics that are caught count as well: other tests here don't panic unless they fail.
    let panics = Arc::new(AtomicUsize::new(0));
    let counter = panics.clone();
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        counter.fetch_add(1, Ordering::Relaxed);
        usual(info);
    }));
    let mut random = Samples::new(12345);
    for (name, whole) in &files {
        assert_eq!(
            read(&put(&dir, name, whole), 1.0).unwrap().faces().len(),
            mesh.faces().len()
        );
        let mut refused = 0;
        for cut in 0..whole.len() {
            refused += usize::from(read(&put(&dir, name, &whole[..cut]), 1.0).is_err());
        }
        // All but a loss of the last line end, or of digits that are not missed.
        assert!(
            refused + 20 > whole.len(),
            "{name}: {refused} of {}",
            whole.len()
        );
        for _ in 0..2000 {
            let mut bytes = whole.clone();
            for _ in 0..=random.below(4) {
                let at = random.below(bytes.len());
                bytes[at] = random.below(256) as u8;
            }
            if let Ok(read) = read(&put(&dir, name, bytes), 1.0) {
                assert!(read.mass_properties().volume > 0.0);
                let mut numbers = read.vertices().iter().flat_map(Vec3::iter);
                assert!(numbers.all(|x| x.is_finite()));
            }
        }
    }
    assert_eq!(panics.load(Ordering::Relaxed), 0);
}

#[test]
fn a_shape_from_a_file_is_found_beside_the_scene() {
    let dir = TempDir::new().unwrap();
    write_obj(&dir.path().join("body.obj"), &body()).unwrap();
    let shape = hydrograd::scene::Shape::Mesh {
        path: "body.obj".into(),
        scale: 1e-3,
    };
    let mesh = build(&shape, dir.path(), None).unwrap();
    assert_same(&mesh, &body().scaled(1e-3).unwrap(), 0.0);
}

/// A vertex that no face uses changes nothing, wherever it is and whatever the format.
#[test]
fn loose_vertices_change_nothing() {
    let dir = TempDir::new().unwrap();
    let mesh = body();
    let places = [[0.1, 0.0, 0.0], [1e3, 0.0, 0.0], [1e70, -1e300, 0.0]];
    for (k, [x, y, z]) in places.into_iter().enumerate() {
        let mut v = mesh.vertices().to_vec();
        v.push(Vec3::new(x, y, z));
        let mut ply = ply_header("ascii", "double", v.len(), mesh.faces().len());
        let mut off = String::new();
        for p in &v {
            writeln!(ply, "{:e} {:e} {:e}", p.x, p.y, p.z).unwrap();
            writeln!(off, "v {:e} {:e} {:e}", p.x, p.y, p.z).unwrap();
        }
        for [a, b, c] in mesh.faces() {
            writeln!(ply, "3 {a} {b} {c}").unwrap();
            writeln!(off, "f {} {} {}", a + 1, b + 1, c + 1).unwrap();
        }
        for (name, text) in [(format!("{k}.ply"), ply), (format!("{k}.obj"), off)] {
            let path = put(&dir, &name, text);
            let report = read_unchecked(&path, 1.0).unwrap().check();
            assert!(report.is_ok(), "{report}");
            assert_same(&read(&path, 1.0).unwrap(), &mesh, 0.0);
        }
    }
}

#[test]
fn a_folder_is_told_from_a_file() {
    let dir = TempDir::new().unwrap();
    let folder = dir.path().join("meshes.obj");
    std::fs::create_dir(&folder).unwrap();
    for path in [dir.path(), &folder] {
        let error = read(path, 1.0).unwrap_err();
        assert!(matches!(error, Error::File { .. }));
        let said = error.to_string();
        assert!(said.contains("this is a folder"), "{said}");
    }
}
