//! A run as files of other programs, read back.

use crate::support::command::{fails, json, scene};
use crate::support::{example, says};
use gltf::animation::util::ReadOutputs;
use hydrograd::adjoint::lie::Vec3;
use hydrograd::output::{Frames, gltf as scenes, vtk};
use hydrograd::simulate::SurfacePressure;
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};
use nalgebra::{Quaternion, UnitQuaternion};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;
use vtkio::Vtk;
use vtkio::model::{Attribute, Attributes, DataSet, Extent, ImageDataPiece, Piece, PolyDataPiece};

/// Ten steps of a ball that falls beside a coin over a floor, begun in motion.
fn run() -> &'static Rollout {
    static RUN: OnceLock<Rollout> = OnceLock::new();
    RUN.get_or_init(|| {
        let mut scene = example("falling_ball");
        scene.gravity = [0.0, 0.0, -9.81];
        // The coin turns past half a turn, where quaternions of matrices change sign.
        scene.initial.q = vec![0.875, 0.9, -0.6, 2.8];
        scene.initial.v = vec![-0.5, 0.2, 0.1, 9.0];
        let settings = Settings::default().fidelity(Fidelity::Full).faces(80);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let controls = Controls::zeros(&simulator, 10);
        simulator.rollout(&controls).unwrap()
    })
}

/// Every third state, and the last.
const STATES: [usize; 5] = [0, 3, 6, 9, 10];

fn surface(path: &Path) -> PolyDataPiece {
    match Vtk::import(path).unwrap().data {
        DataSet::PolyData { mut pieces, .. } => match pieces.remove(0) {
            Piece::Inline(piece) => *piece,
            _ => panic!(),
        },
        _ => panic!(),
    }
}

fn image(path: &Path) -> (DataSet, ImageDataPiece) {
    let data = Vtk::import(path).unwrap().data;
    match &data {
        DataSet::ImageData { pieces, .. } => match &pieces[0] {
            Piece::Inline(piece) => (data.clone(), *piece.clone()),
            _ => panic!(),
        },
        _ => panic!(),
    }
}

/// An array's numbers.
fn numbers(attributes: &[Attribute], name: &str) -> Vec<f64> {
    let found = attributes.iter().find(|a| a.name() == name);
    match found.unwrap_or_else(|| panic!("no {name}")) {
        Attribute::DataArray(array) => array.data.cast_into().unwrap(),
        Attribute::Field { .. } => panic!(),
    }
}

fn vectors(values: &[f64]) -> Vec<Vec3> {
    values.chunks(3).map(Vec3::from_column_slice).collect()
}

fn names(attributes: &Attributes) -> Vec<&str> {
    attributes.point.iter().map(Attribute::name).collect()
}

/// Arrays of faces against [`Rollout::pressure`] at state `n`, of bodies all in the water.
fn the_water_presses(cell: &[Attribute], rollout: &Rollout, n: usize) {
    let pressures = rollout.pressure(n).unwrap();
    let right = |of: fn(&SurfacePressure) -> &[f64]| -> Vec<f64> {
        pressures.iter().flat_map(|p| of(p).to_vec()).collect()
    };
    let dynamic = right(|p| &p.pressures);
    assert!(dynamic.iter().any(|p| *p > 1.0) && dynamic.iter().any(|p| *p < -1.0));
    assert_eq!(numbers(cell, "pressure"), dynamic);
    let hydrostatic = right(|p| &p.hydrostatic);
    assert!(hydrostatic.iter().any(|p| p.abs() > 1e3));
    assert_eq!(numbers(cell, "hydrostatic"), hydrostatic);
    let velocities: Vec<Vec3> = pressures
        .iter()
        .flat_map(|p| p.velocities.clone())
        .collect();
    assert_eq!(vectors(&numbers(cell, "water_velocity")), velocities);
    assert_eq!(numbers(cell, "wetted"), vec![1.0; dynamic.len()]);
}

#[test]
fn surfaces_and_loads_stand_in_files_of_vtk() {
    let (rollout, folder) = (run(), tempfile::tempdir().unwrap());
    let out = folder.path().join("new/deep");
    let options = vtk::Options {
        frames: Frames::Every(3),
        loads: true,
        pressure: true,
        flow: None,
        streamlines: None,
    };
    for _ in 0..2 {
        let written = vtk::write(rollout, &out, &options).unwrap();
        let right = ["bodies.pvd", "walls.vtp", "loads.pvd"].map(|name| out.join(name));
        assert_eq!(written, right);
    }
    let frames = fs::read_dir(out.join("bodies")).unwrap().count();
    assert_eq!(frames, STATES.len(), "no temporary files stay behind");

    let series = fs::read_to_string(out.join("bodies.pvd")).unwrap();
    let meshes = rollout.simulator().meshes().unwrap();
    let velocities = rollout.velocities();
    for (k, n) in STATES.into_iter().enumerate() {
        let sample = &rollout.samples()[n];
        let name = format!("bodies/bodies_{k:05}.vtp");
        let entry = format!("timestep=\"{}\" part=\"0\" file=\"{name}\"", sample.time);
        assert!(series.contains(&entry), "{entry} in {series}");

        let read = surface(&out.join(name));
        let points = vectors(&read.points.cast_into::<f64>().unwrap());
        let (corners, ends) = read.polys.unwrap().into_xml();
        let body = numbers(&read.data.cell, "body");
        let velocity = vectors(&numbers(&read.data.cell, "velocity"));
        the_water_presses(&read.data.cell, rollout, n);
        let (mut point, mut face) = (0, 0);
        for (b, mesh) in meshes.iter().enumerate() {
            let (mesh, pose) = (mesh.as_ref().unwrap(), &sample.poses[b]);
            let moves = velocities.fixed_view::<6, 1>(6 * b, n);
            for (x, read) in mesh.vertices().iter().zip(&points[point..]) {
                assert_eq!(pose.apply(x), *read);
            }
            for (k, f) in mesh.faces().iter().enumerate() {
                let at = face + k;
                let read = &corners[3 * at..3 * at + 3];
                assert_eq!(read, f.map(|i| (point + i) as u64));
                assert_eq!(ends[at], 3 * at as u64 + 3);
                assert_eq!(body[at], b as f64);
                let arm = pose.rotation * mesh.centroid(k);
                let right = moves.fixed_rows::<3>(0) + moves.fixed_rows::<3>(3).cross(&arm);
                assert!((velocity[at] - right).norm() < 1e-13);
            }
            point += mesh.vertices().len();
            face += mesh.faces().len();
        }
        assert_eq!((points.len(), ends.len()), (point, face));

        let read = surface(&out.join(format!("loads/loads_{k:05}.vtp")));
        let points = vectors(&read.points.cast_into::<f64>().unwrap());
        assert_eq!(read.verts.unwrap().num_cells(), 2);
        let loads = rollout.loads(n).unwrap();
        assert!(loads.kinds().any(|kind| kind == "linear drag"));
        let kinds = loads
            .kinds()
            .map(|k| (k.replace(' ', "_"), loads.wrenches(k).unwrap()));
        for (name, wrenches) in kinds.chain([("joint".into(), loads.joints())]) {
            let force = vectors(&numbers(&read.data.point, &format!("{name}_force")));
            let moment = vectors(&numbers(&read.data.point, &format!("{name}_moment")));
            for (b, right) in wrenches.iter().enumerate() {
                assert_eq!(points[b], sample.poses[b].translation);
                assert_eq!(force[b], right.fixed_rows::<3>(0), "{name}");
                assert_eq!(moment[b], right.fixed_rows::<3>(3), "{name}");
            }
        }
    }
    // Arrays that come and go are dropped by readers.
    let first = surface(&out.join("loads/loads_00000.vtp"));
    let last = surface(&out.join("loads/loads_00004.vtp"));
    assert_eq!(names(&first.data), names(&last.data));

    let walls = surface(&out.join("walls.vtp"));
    let points = vectors(&walls.points.cast_into::<f64>().unwrap());
    assert_eq!(points.len(), 4);
    assert!(points.iter().all(|x| (x.z + 0.98).abs() < 1e-12));
    let normal = (points[1] - points[0]).cross(&(points[2] - points[1]));
    assert!(normal.z > 0.0, "seen from the water");
}

#[test]
fn the_flow_stands_on_a_grid() {
    let (rollout, folder) = (run(), tempfile::tempdir().unwrap());
    // 16³ points: arrays that fill the blocks in which they would be compressed. Some lie in bodies, some behind the wall.
    let grid = vtk::Grid {
        low: [-1.5, -1.4, -1.1],
        high: [1.5, 1.6, 1.9],
        spacing: 0.2,
    };
    assert_eq!(grid.counts().unwrap(), [16; 3]);
    let options = vtk::Options {
        frames: Frames::Every(10),
        flow: Some(grid),
        ..vtk::Options::default()
    };
    let files = vtk::write(rollout, folder.path(), &options).unwrap();
    assert_eq!(files.last().unwrap(), &folder.path().join("flow.pvd"));
    for (k, n) in [0, 10].into_iter().enumerate() {
        let path = folder.path().join(format!("flow/flow_{k:05}.vti"));
        let (whole, piece) = image(&path);
        let DataSet::ImageData {
            origin, spacing, ..
        } = whole
        else {
            panic!();
        };
        assert_eq!((origin, spacing), ([-1.5, -1.4, -1.1], [0.2; 3]));
        assert_eq!(piece.extent, Extent::Ranges([0..=15, 0..=15, 0..=15]));
        let velocity = vectors(&numbers(&piece.data.point, "velocity"));
        let resolved = numbers(&piece.data.point, "resolved");
        let ghosts = numbers(&piece.data.point, "vtkGhostType");
        assert_eq!(velocity.len(), 4096);
        let at = |i: usize| {
            let steps = [i % 16, i / 16 % 16, i / 256].map(|k| 0.2 * k as f64);
            Vec3::from(grid.low) + Vec3::from(steps)
        };
        let points: Vec<Vec3> = (0..4096).map(at).collect();
        let clear = rollout.flow_resolved(n, &points).unwrap();
        let in_water: Vec<usize> = (0..4096).filter(|i| clear[*i]).collect();
        assert!(1000 < in_water.len() && in_water.len() < 4000);
        let some: Vec<usize> = in_water.into_iter().step_by(97).collect();
        let places: Vec<Vec3> = some.iter().map(|i| points[*i]).collect();
        for (i, right) in some.iter().zip(rollout.flow(n, &places).unwrap()) {
            assert!((velocity[*i] - right).norm() < 1e-9 * right.norm().max(1e-3));
        }
        for i in 0..4096 {
            assert_eq!(resolved[i], f64::from(u8::from(clear[i])));
            assert_eq!(ghosts[i], if clear[i] { 0.0 } else { 2.0 });
            assert!(clear[i] || velocity[i] == Vec3::zeros());
        }
    }
}

#[test]
fn bodies_move_in_a_file_of_gltf() {
    let (rollout, folder) = (run(), tempfile::tempdir().unwrap());
    let path = folder.path().join("new/run.glb");
    let options = scenes::Options {
        frames: Frames::Every(3),
        colors: BTreeMap::from([("coin".into(), "#ff0000".into())]),
    };
    for _ in 0..2 {
        scenes::write(rollout, &path, &options).unwrap();
    }
    let written = fs::read_dir(path.parent().unwrap()).unwrap().count();
    assert_eq!(written, 1, "no temporary files stay behind");

    // It is validated as it is opened.
    let file = gltf::Gltf::open(&path).unwrap();
    let bytes = file.blob.as_deref().unwrap();
    assert_eq!(bytes.len() % 4, 0);
    let data = |_: gltf::Buffer| Some(bytes);
    let top = file.default_scene().unwrap().nodes().next().unwrap();
    let named: Vec<_> = top
        .children()
        .map(|c| c.name().unwrap().to_string())
        .collect();
    assert_eq!(named, ["sphere", "coin", "wall 0"]);
    let turn = |q: [f32; 4]| {
        let [x, y, z, w] = q.map(f64::from);
        UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
    };
    let up = turn(top.transform().decomposed().1);
    assert!((up * Vec3::z() - Vec3::y()).norm() < 1e-7);

    let animation = file.animations().next().unwrap();
    assert_eq!(animation.name(), Some("falling ball"));
    assert_eq!(animation.channels().count(), 4);
    let meshes = rollout.simulator().meshes().unwrap();
    for (b, node) in top.children().take(2).enumerate() {
        let primitive = node.mesh().unwrap().primitives().next().unwrap();
        let read = primitive.reader(data);
        let vertices: Vec<[f32; 3]> = read.read_positions().unwrap().collect();
        let corners: Vec<u32> = read.read_indices().unwrap().into_u32().collect();
        let mesh = meshes[b].as_ref().unwrap();
        let faces = mesh.faces().iter().flatten().map(|i| *i as u32);
        assert!(corners.into_iter().eq(faces));
        let singles = mesh
            .vertices()
            .iter()
            .map(|x| [x.x as f32, x.y as f32, x.z as f32]);
        assert!(vertices.iter().copied().eq(singles));
        let bounds = primitive.bounding_box();
        assert!(
            vertices.contains(&bounds.max)
                || (0..3).all(|i| vertices.iter().any(|x| x[i] == bounds.max[i]))
        );

        let mut moved: Vec<[f32; 3]> = Vec::new();
        let mut turned: Vec<[f32; 4]> = Vec::new();
        for channel in animation
            .channels()
            .filter(|c| c.target().node().index() == node.index())
        {
            let read = channel.reader(data);
            let times: Vec<f32> = read.read_inputs().unwrap().collect();
            let right = STATES.map(|n| rollout.samples()[n].time as f32);
            assert_eq!(times, right);
            match read.read_outputs().unwrap() {
                ReadOutputs::Translations(all) => moved = all.collect(),
                ReadOutputs::Rotations(all) => turned = all.into_f32().collect(),
                _ => panic!(),
            }
        }
        for (k, n) in STATES.into_iter().enumerate() {
            let pose = &rollout.samples()[n].poses[b];
            let q = turn(turned[k]);
            let at = Vec3::from(moved[k].map(f64::from));
            for (x, single) in mesh.vertices().iter().zip(&vertices) {
                let shown = up * (q * Vec3::from(single.map(f64::from)) + at);
                let right = pose.apply(x);
                let right = Vec3::new(right.x, right.z, -right.y);
                assert!((shown - right).norm() < 1e-6, "{shown} {right}");
            }
            if k > 0 {
                let dot: f32 = turned[k - 1]
                    .iter()
                    .zip(turned[k])
                    .map(|(a, b)| a * b)
                    .sum();
                assert!(dot > 0.0, "the shorter way round");
            }
        }
        let (at, q, _) = node.transform().decomposed();
        assert_eq!((at, q), (moved[0], turned[0]));
    }
    let color = |b: usize| {
        let mesh = file.meshes().nth(b).unwrap();
        let material = mesh.primitives().next().unwrap().material();
        material.pbr_metallic_roughness().base_color_factor()
    };
    assert_eq!(color(1), [1.0, 0.0, 0.0, 1.0]);
    // #3f74b5.
    let right = [0.0497, 0.1746, 0.4621, 1.0];
    assert!(
        color(0)
            .iter()
            .zip(right)
            .all(|(a, b)| (a - b).abs() < 1e-3),
        "{:?}",
        color(0)
    );
}

#[test]
fn what_cannot_be_written_is_refused_by_name() {
    let (rollout, folder) = (run(), tempfile::tempdir().unwrap());
    let refused = |grid: vtk::Grid, words: &[&str]| {
        let options = vtk::Options {
            flow: Some(grid),
            ..vtk::Options::default()
        };
        let out = folder.path().join("none");
        let said = vtk::write(rollout, &out, &options).unwrap_err();
        says(said, words);
        assert!(!out.exists(), "nothing is begun");
    };
    let grid = vtk::Grid {
        low: [0.0; 3],
        high: [1.0; 3],
        spacing: 1e-3,
    };
    refused(
        grid,
        &[
            "flow grid: points",
            "1.003e9",
            "at most 2e7",
            "spacing larger than 0.001",
        ],
    );
    for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300] {
        refused(
            vtk::Grid { spacing, ..grid },
            &["flow grid: spacing", "finite and positive"],
        );
    }
    let low = [0.0, f64::NAN, 0.0];
    refused(
        vtk::Grid { low, ..grid },
        &["flow grid: low[1]", "NaN", "finite"],
    );
    let high = [1.0, 1.0, -1.0];
    refused(
        vtk::Grid { high, ..grid },
        &["flow grid: high[2]", "-1", "at least"],
    );
    let high = [1e30; 3];
    refused(
        vtk::Grid { high, ..grid },
        &["flow grid: points", "smaller box"],
    );

    for (frames, words) in [
        (Frames::PerSecond(f64::NAN), "frames per second"),
        (Frames::PerSecond(0.0), "frames per second"),
        (Frames::Every(0), "every"),
    ] {
        let options = scenes::Options {
            frames,
            ..scenes::Options::default()
        };
        let said = scenes::write(rollout, Path::new("run.glb"), &options).unwrap_err();
        says(said, &[words]);
    }
    for (name, color, words) in [
        ("coin", "red", &["colors[\"coin\"]", "\"red\"", "#rrggbb"]),
        ("ball", "#ff0000", &["\"ball\"", "no body", "sphere"]),
    ] {
        let options = scenes::Options {
            colors: BTreeMap::from([(name.into(), color.into())]),
            ..scenes::Options::default()
        };
        let said = scenes::write(rollout, Path::new("run.glb"), &options).unwrap_err();
        says(said, words);
    }
    let taken = folder.path().join("taken");
    fs::write(&taken, "x").unwrap();
    let said = vtk::write(rollout, &taken, &vtk::Options::default()).unwrap_err();
    says(said, &["taken: write failed"]);
    let said = scenes::write(rollout, folder.path(), &scenes::Options::default()).unwrap_err();
    says(said, &["write failed", "not a folder"]);
    let said = scenes::write(rollout, &taken.join("run.glb"), &scenes::Options::default());
    says(said.unwrap_err(), &["taken: write failed"]);
    assert_eq!(fs::read_to_string(&taken).unwrap(), "x");
}

#[test]
fn the_program_writes_both() {
    let folder = tempfile::tempdir().unwrap();
    let of = |name: &str| folder.path().join(name).display().to_string();
    let (out, file, scene) = (of("vtk"), of("run.glb"), scene("falling_ball"));
    let run = ["run", &scene, "--fidelity", "isolated", "--faces", "80"];
    let asked = [
        "--steps",
        "12",
        "--vtk",
        &out,
        "--gltf",
        &file,
        "--vtk-loads",
        "--vtk-pressure",
        "--vtk-seed",
        "-0.9,0.8,1.2",
        "--vtk-seed",
        "0.9,0.8,1.2",
        "--vtk-line-length",
        "0.5",
    ];
    let report = json(&[&run[..], &asked, &["--frames-per-second", "25"]].concat());
    let files: Vec<&str> = (report["files"].as_array().unwrap().iter())
        .map(|f| f.as_str().unwrap())
        .collect();
    let right = [
        "vtk/bodies.pvd",
        "vtk/walls.vtp",
        "vtk/loads.pvd",
        "vtk/streamlines.pvd",
        "run.glb",
    ];
    assert_eq!(files, right.map(of));
    let drawn = surface(&folder.path().join("vtk/streamlines/streamlines_00002.vtp"));
    assert_eq!(numbers(&drawn.data.cell, "seed"), [0.0, 1.0]);
    let velocity = numbers(&drawn.data.point, "velocity");
    assert!(velocity.len() > 12 && velocity.iter().all(|x| x.is_finite()));
    let first = surface(&folder.path().join("vtk/bodies/bodies_00000.vtp"));
    let wetted = numbers(&first.data.cell, "wetted");
    assert!(!wetted.is_empty() && wetted.iter().all(|w| *w == 1.0));
    let pressure = numbers(&first.data.cell, "pressure");
    assert!(pressure.len() == wetted.len() && pressure.iter().any(|p| *p != 0.0));
    // 0.01 s a step: every fourth state.
    let frames = fs::read_dir(folder.path().join("vtk/bodies"))
        .unwrap()
        .count();
    assert_eq!(frames, 4);
    let read = gltf::Gltf::open(&file).unwrap();
    assert_eq!(
        read.accessors()
            .find(|a| a.dimensions() == gltf::accessor::Dimensions::Scalar
                && a.data_type() == gltf::accessor::DataType::F32)
            .unwrap()
            .count(),
        4
    );

    let (taken, within) = (of("taken"), of("taken/run.glb"));
    fs::write(&taken, "x").unwrap();
    let refused = [&run[..], &["--vtk", &taken]].concat();
    fails(&refused, 1, &["taken", "write failed"]);
    let refused = [&run[..], &["--gltf", &within]].concat();
    fails(&refused, 1, &["taken", "write failed"]);
    // What may not stand in another file's place.
    let own = of("ball.toml");
    fs::copy(&scene, &own).unwrap();
    let refused = ["run", &own, "--fidelity", "isolated", "--gltf", &own];
    fails(&refused, 1, &["ball.toml", "extension \"toml\"", ".glb"]);
    assert!(fs::read(&own).unwrap() == fs::read(&scene).unwrap());
    // What the scene can't have.
    let text = fs::read_to_string(&own).unwrap();
    assert!(text.contains("density = 998.0"));
    fs::write(&own, text.replacen("density = 998.0", "density = 0.0", 1)).unwrap();
    let dry = ["run", &own, "--steps", "100000000", "--vtk", &out];
    let dry = [&dry[..], &["--vtk-pressure"]].concat();
    fails(&dry, 1, &["--vtk-pressure", "fluid.density", "above zero"]);
    let alone = [&run[..], &["--frames-per-second", "25"]].concat();
    fails(&alone, 2, &["--vtk", "--gltf"]);
    for rate in ["0", "-3", "nan"] {
        let refused = [&run[..], &["--gltf", &file, "--frames-per-second", rate]].concat();
        fails(&refused, 2, &["--frames-per-second", "above zero"]);
    }
    for length in ["0", "-1", "nan", "inf"] {
        let lines = ["--vtk", &out, "--vtk-seed", "0,0,1", "--vtk-line-length"];
        let refused = [&run[..], &lines, &[length]].concat();
        fails(&refused, 2, &["--vtk-line-length", "above zero"]);
    }
}
