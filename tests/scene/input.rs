//! Bad scene files: each gets an error that names the place and the remedy, and never a panic.

use crate::support::{example_path, says};
use hydrograd::scene::Force;
use hydrograd::{Scene, Settings, Simulator};

/// A scene file with one ball; `body` is added to the ball, `rest` after it.
fn text(body: &str, rest: &str) -> String {
    format!(
        "time_step = 0.01\nsteps = 10\n\n[fluid]\ndensity = 998.0\n\n[[bodies]]\nname = \"ball\"\n\
         {body}\n\n{rest}\n"
    )
}

#[track_caller]
fn unread(text: &str, words: &[&str]) {
    says(Scene::from_toml(text, "").unwrap_err().to_string(), words);
}

#[test]
fn unknown_keys_get_line_place_and_nearest_key() {
    let sphere = "shape = { kind = \"sphere\", radius = 1.0 }";
    let in_body = |line: &str| text(line, "");
    let after = |lines: &str| text(sphere, lines);
    for (text, words) in [
        (
            "time_step = 1\nstepss = 2\n".into(),
            ["line 2", "the scene", "`stepss`", "`steps`"],
        ),
        (
            in_body("masss = 1"),
            [
                "line 9",
                "body \"ball\" has",
                "`masss`",
                "did you mean `mass`?",
            ],
        ),
        (
            in_body("shape = { kind = \"sphere\", raduis = 1 }"),
            [
                "line 9",
                "body \"ball\": shape",
                "`raduis`",
                "did you mean `radius`?",
            ],
        ),
        (
            in_body("[bodies.shape]\nkind = \"box\"\nsize = [1, 1, 1]\nface = 9"),
            [
                "line 12",
                "body \"ball\": shape",
                "`face`",
                "did you mean `faces`?",
            ],
        ),
        (
            in_body("[bodies.joint]\nkind = \"fixed\"\naxis = [1, 0, 0]"),
            ["line 11", "body \"ball\": joint", "`axis`", "remove it"],
        ),
        (
            in_body("joint = { kind = \"free\", plane = \"xy\" }"),
            ["line 9", "body \"ball\": joint", "`plane`", "remove it"],
        ),
        (
            in_body("joint = { kind = \"revolute\", axes = [1, 0, 0] }"),
            [
                "line 9",
                "body \"ball\": joint",
                "`axes`",
                "did you mean `axis`?",
            ],
        ),
        (
            in_body("[[bodies.motion]]\nkind = \"linear\"\noffset = 1\nrate = 1\nphase = 2"),
            [
                "line 13",
                "body \"ball\": motion[0]",
                "`phase`",
                "offset, rate",
            ],
        ),
        (
            in_body("position = [1, 0, 0]"),
            [
                "line 9",
                "body \"ball\" has",
                "`position`",
                "did you mean `placement`?",
            ],
        ),
        (
            in_body("placement = { positon = [1, 0, 0] }"),
            [
                "line 9",
                "body \"ball\": placement",
                "`positon`",
                "did you mean `position`?",
            ],
        ),
        (
            in_body("drag = { lineare = 1 }"),
            [
                "line 9",
                "body \"ball\": drag",
                "`lineare`",
                "did you mean `linear`?",
            ],
        ),
        (
            after("[[walls]]\npoint = [0, 0, 0]\nnormals = [0, 0, 1]"),
            ["line 13", "walls[0]", "`normals`", "did you mean `normal`?"],
        ),
        (
            after("[initial]\nqq = [1]"),
            ["line 12", "initial", "`qq`", "q, v, momentum"],
        ),
        (
            after("[controller]\nkind = \"constant\"\ncontrols = [1]"),
            [
                "line 13",
                "controller",
                "`controls`",
                "did you mean `control`?",
            ],
        ),
        (
            in_body("").replace("density = 998.0", "density = 998.0\ncurent = [0, 0, 0]"),
            ["line 6", "fluid", "`curent`", "did you mean `current`?"],
        ),
    ] {
        unread(&text, &words);
    }
}

#[test]
fn wrong_kinds_get_the_nearest_and_all_choices() {
    unread(
        &text("shape = { kind = \"spere\", radius = 1 }", ""),
        &[
            "line 9",
            "body \"ball\": shape.kind",
            "`spere`",
            "did you mean `sphere`?",
            "capsule",
        ],
    );
    unread(
        &text("[bodies.joint]\nkind = \"planer\"\nplane = \"yz\"", ""),
        &[
            "line 10",
            "body \"ball\": joint.kind",
            "did you mean `planar`?",
        ],
    );
    unread(
        &text("[bodies.joint]\nkind = \"planar\"\nplane = \"zy\"", ""),
        &["line 11", "body \"ball\": joint.plane", "`zy`", "yz"],
    );
    unread(
        &text("drag = { part = \"tangent\" }", ""),
        &[
            "line 9",
            "body \"ball\": drag.part",
            "did you mean `tangential`?",
        ],
    );
    unread(
        "preset = \"papper\"\n",
        &["line 1", "preset", "did you mean `paper`?"],
    );
}

#[test]
fn missing_keys_are_named() {
    unread(
        "steps = 1\n[fluid]\ndensity = 1\n",
        &["the scene", "`time_step`", "add"],
    );
    unread(
        "time_step = 1\nsteps = 1\nbodies = []\n[fluid]\ncurrent = [0, 0, 0]\n",
        &["line 4", "fluid", "`density`"],
    );
    unread(
        "time_step = 1\nsteps = 1\n[fluid]\ndensity = 1\n[[bodies]]\nmass = 1\n",
        &["line 5", "bodies[0] (unnamed)", "`name`"],
    );
    unread(
        &text("[[bodies.motion]]\nkind = \"sine\"\namplitude = 1", ""),
        &["line 9", "body \"ball\": motion[0]", "`frequency`"],
    );
    unread(
        &text("shape = { radius = 1 }", ""),
        &[
            "line 9",
            "body \"ball\": shape",
            "`kind`",
            "one of sphere, ellipsoid",
        ],
    );
}

#[test]
fn wrong_types_name_key_and_line() {
    let long = "shape = { kind = \"box\", faces = 12, size = [1, 2] }";
    for (text, words) in [
        (
            text("mass = \"1 kg\"", ""),
            ["line 9", "body \"ball\": mass", "expected a number"],
        ),
        (
            text("locked = 1", ""),
            ["line 9", "body \"ball\": locked", "expected true or false"],
        ),
        (
            text(long, ""),
            [
                "line 9",
                "body \"ball\": shape.size",
                "expected a list of length 3",
            ],
        ),
        (
            text(
                "shape = { kind = \"prism\", length = 1, profile = [[0, 0], [1, 0, 2], [0, 1]] }",
                "",
            ),
            [
                "line 9",
                "body \"ball\": shape.profile",
                "expected 2 elements",
            ],
        ),
        (
            text(
                "[bodies.shape]\nkind = \"sphere\"\nfaces = 320\nradius = \"1\"",
                "",
            ),
            [
                "line 12",
                "body \"ball\": shape.radius",
                "expected a number",
            ],
        ),
        (
            text(
                "[bodies.shape]\nkind = \"sphere\"\nfaces = -1\nradius = 1",
                "",
            ),
            ["line 11", "body \"ball\": shape.faces", "whole number"],
        ),
        (
            text("placement = { position = [1, 2] }", ""),
            ["line 9", "body \"ball\": placement.position", "length 3"],
        ),
        (
            text("", "").replace("= 10", "= 1.5"),
            ["line 2", "steps", "whole number"],
        ),
        (
            text("", "[initial]\nq = [1, \"2\"]"),
            ["line 12", "initial.q[1]", "expected a number"],
        ),
        (
            text("shape = \"sphere\"", ""),
            ["line 9", "body \"ball\": shape", "sphere"],
        ),
    ] {
        unread(&text, &words);
    }
    // Whole numbers do where numbers are expected.
    let scene = Scene::from_toml(&text("mass = 1\ninertia = [1, 1, 1]", ""), "").unwrap();
    scene.validate().unwrap();
}

#[test]
fn broken_toml_gets_its_line() {
    unread("time_step = 1\nsteps =\n", &["line 2", "TOML"]);
    unread("time_step = 1\n[fluid\n", &["line 2", "TOML"]);
    unread(
        "time_step = 1\ntime_step = 2\n",
        &["line 2", "duplicate key"],
    );
    unread(
        "# only a comment\n\n",
        &["nothing but blanks", "time_step", "[[bodies]]"],
    );
    unread("", &["line 1", "nothing but blanks"]);
}

#[test]
fn files_that_are_no_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let unread = |name: &str, words: &[&str]| {
        says(
            Scene::load(folder.path().join(name))
                .unwrap_err()
                .to_string(),
            words,
        );
    };
    std::fs::write(
        folder.path().join("latin.toml"),
        b"steps = 1\nname = \"caf\xe9\"\n",
    )
    .unwrap();
    std::fs::write(folder.path().join("empty.toml"), "").unwrap();
    unread("latin.toml", &["latin.toml", "line 2", "UTF-8"]);
    unread("empty.toml", &["empty.toml", "line 1", "time_step"]);
    unread(
        "emptyy.toml",
        &["emptyy.toml", "read failed", "did you mean", "empty.toml?"],
    );
    unread("quite/elsewhere.toml", &["elsewhere.toml", "no such file"]);
    unread("", &["read failed", "folder"]);
}

/// Example scenes cut short, with a line missing, or with a character changed: read or refused with
/// a line number, never a panic.
#[test]
fn mangled_scenes_never_panic() {
    let judge = |text: &str| match Scene::from_toml(text, "") {
        Ok(scene) => drop(scene.validate()),
        Err(error) => says(error.to_string(), &["line "]),
    };
    for name in ["falling_ball", "fish"] {
        let text = std::fs::read_to_string(example_path(name)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        for k in 0..lines.len() {
            let without = [&lines[..k], &lines[k + 1..]].concat().join("\n");
            judge(&without);
        }
        for (at, c) in text.char_indices().step_by(3) {
            judge(&text[..at]);
            for other in ["", "x", "-", "\"", "[", "\n", "é"] {
                judge(&format!(
                    "{}{other}{}",
                    &text[..at],
                    &text[at + c.len_utf8()..]
                ));
            }
        }
    }
}

/// A mesh that can't be read, or is none, is told with its body and field.
#[test]
fn a_mesh_that_cannot_be_read_is_told_with_its_body() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("folder.obj")).unwrap();
    std::fs::write(folder.path().join("empty.stl"), b" ").unwrap();
    let open = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    std::fs::write(folder.path().join("open.obj"), open).unwrap();
    for name in ["folder.obj", "missing.ply", "empty.stl", "open.obj"] {
        let text = format!(
            "name = \"meshes\"\ntime_step = 0.01\nsteps = 1\n[fluid]\ndensity = 0.0\n[[bodies]]\nname = \"coin\"\ndensity = 1.0\n\
             shape = {{ kind = \"mesh\", path = \"{name}\" }}\n"
        );
        let scene = Scene::from_toml(&text, folder.path()).unwrap();
        let error = Simulator::new(&scene, Settings::default()).err().unwrap();
        says(error, &["body \"coin\"", "shape", name]);
    }
}

/// Whatever is wrong with a mesh, the message has the scene's file, the line, the body and the key.
#[test]
#[cfg(feature = "meshio")]
fn meshes_are_named_by_file_line_body_and_key() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    put("empty.obj", "");
    put("garbage.ply", "this is no mesh");
    put("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    // Two tetrahedra in one another.
    let tetrahedron = |x: f64, n: usize| {
        let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        let vertices = corners.map(|[a, b, c]| format!("v {} {} {}\n", a + x, b + x, c + x));
        let faces = [[1, 3, 2], [1, 2, 4], [1, 4, 3], [2, 3, 4]];
        let faces = faces.map(|[a, b, c]| format!("f {} {} {}\n", a + n, b + n, c + n));
        [vertices.concat(), faces.concat()].concat()
    };
    put(
        "crossing.obj",
        &[tetrahedron(0.0, 0), tetrahedron(0.1, 4)].concat(),
    );
    for (path, said) in [
        (".", "this is a folder"),
        ("nowhere.obj", "No such file"),
        ("empty.obj", "empty"),
        ("garbage.ply", "garbage.ply"),
        ("mesh.xyz", "unknown extension"),
        ("open.obj", "3 edges with one face only"),
        ("crossing.obj", "pass through each other"),
    ] {
        let inline = format!("density = 1.0\nshape = {{ kind = \"mesh\", path = \"{path}\" }}");
        let table = format!("density = 1.0\n\n[bodies.shape]\nkind = \"mesh\"\npath = \"{path}\"");
        for (body, line) in [(inline, 10), (table, 13)] {
            let file = folder.path().join("scene.toml");
            std::fs::write(&file, text(&body, "")).unwrap();
            let scene = Scene::load(&file).unwrap();
            let error = Simulator::new(&scene, Settings::default()).err().unwrap();
            let place = format!("scene.toml, line {line}: body \"ball\": shape.path");
            says(error, &[said, &place]);
        }
    }
    // What a scene is doesn't depend on where it stands.
    let scene = Scene::load(folder.path().join("scene.toml")).unwrap();
    let again = Scene::from_toml(&scene.to_toml().unwrap(), "").unwrap();
    assert_eq!(scene, again);
}

/// A force by itself is read as one in a scene is, and told alike.
#[test]
fn forces_by_themselves_are_told_by_their_keys() {
    let spring = "{\"kind\": \"spring\", \"body\": \"ball\", \"stiffness\": 3, \"to\": null}";
    let Force::Spring(spring) = Force::from_json(spring).unwrap() else {
        panic!("no spring");
    };
    assert_eq!((spring.stiffness, spring.to), (3.0, None));
    for (keys, words) in [
        ("{", ["force", "EOF"]),
        (
            "{\"body\": \"ball\"}",
            ["it lacks the key `kind`", "spring"],
        ),
        (
            "{\"kind\": \"spring\", \"body\": \"ball\"}",
            ["it lacks the key `stiffness`", "add"],
        ),
        (
            "{\"kind\": \"damping\", \"body\": \"ball\", \"linear\": [1, 2]}",
            ["linear: six numbers", "six rows"],
        ),
        (
            "{\"kind\": \"thruster\", \"body\": \"ball\", \"direction\": [1, 0]}",
            ["direction: invalid length 2", "a list of length 3"],
        ),
    ] {
        says(Force::from_json(keys).unwrap_err().to_string(), &words);
    }
}
