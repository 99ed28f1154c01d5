"""Rollouts as files of VTK and glTF, read by VTK itself and by Khronos' validator."""

import json
import os
import pathlib
import shutil
import struct
import subprocess
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import hydrograd as hg
from hydrograd._viewer.data import PALETTE

SCENES = pathlib.Path(__file__).parents[2] / "examples/scenes"
STATES = [0, 4, 8, 12]


@pytest.fixture(scope="module")
def rollout():
    scene = hg.Scene.load(SCENES / "falling_ball.toml")
    return hg.Simulator(scene, fidelity="full", faces=80).rollout(steps=12)


@pytest.fixture(scope="module")
def vtk():
    """VTK's readers alone: what draws needs libraries of a screen."""
    from vtkmodules import vtkIOXML as readers
    from vtkmodules.util import numpy_support

    def read(path):
        kind = {".vtp": readers.vtkXMLPolyDataReader, ".vti": readers.vtkXMLImageDataReader}[pathlib.Path(path).suffix]
        reader = kind()
        reader.SetFileName(str(path))
        reader.Update()
        assert reader.GetErrorCode() == 0
        data = reader.GetOutput()

        def arrays(of):
            return {of.GetArrayName(i): numpy_support.vtk_to_numpy(of.GetArray(i)) for i in range(of.GetNumberOfArrays())}

        points = None if data.IsA("vtkImageData") else numpy_support.vtk_to_numpy(data.GetPoints().GetData())
        return data, points, arrays(data.GetPointData()), arrays(data.GetCellData())

    return read


def series(path):
    """Times and files of a series."""
    sets = ElementTree.parse(path).getroot().findall("Collection/DataSet")
    return np.array([float(s.get("timestep")) for s in sets]), [path.parent / s.get("file") for s in sets]


def test_vtk_reads_surfaces_and_loads(rollout, vtk, tmp_path):
    made = rollout.write_vtk(tmp_path / "vtk", frames_per_second=25.0, loads=True, pressure=True)
    assert made == [tmp_path / "vtk" / name for name in ("bodies.pvd", "walls.vtp", "loads.pvd")]
    times, files = series(made[0])
    assert np.array_equal(times, rollout.time[STATES])
    _, loads = series(made[2])
    meshes = rollout.simulator.meshes()
    for state, file, acting in zip(STATES, files, loads, strict=True):
        surface, points, _, cells = vtk(file)
        assert surface.GetNumberOfPolys() == sum(len(faces) for _, faces in meshes)
        places = zip(meshes, rollout.rotations[state], rollout.positions[state])
        right = np.concatenate([vertices @ turn.T + at for (vertices, _), turn, at in places])
        assert np.abs(points - right).max() < 1e-14
        body = np.repeat([0, 1], [len(faces) for _, faces in meshes])
        assert np.array_equal(cells["body"], body)
        first = surface.GetCell(len(meshes[0][1])).GetPointIds()
        assert [first.GetId(k) - len(meshes[0][0]) for k in range(3)] == list(meshes[1][1][0])
        centers = np.array([np.mean([surface.GetPoint(surface.GetCell(f).GetPointId(k)) for k in range(3)], axis=0) for f in range(len(body))])
        u = rollout.velocities[state][body]
        right = u[:, :3] + np.cross(u[:, 3:], centers - rollout.positions[state][body])
        assert np.abs(cells["velocity"] - right).max() < 1e-13
        pressed = rollout.pressure(state)
        assert [p.name for p in pressed] == rollout.simulator.body_names
        assert np.array_equal(cells["pressure"], np.concatenate([p.pressures for p in pressed]))
        assert np.array_equal(cells["hydrostatic"], np.concatenate([p.hydrostatic for p in pressed]))
        assert np.array_equal(cells["water_velocity"], np.concatenate([p.velocities for p in pressed]))
        assert cells["wetted"].all() and np.ptp(cells["pressure"]) > 1.0

        _, points, arrays, _ = vtk(acting)
        assert np.array_equal(points, rollout.positions[state])
        told = rollout.loads(state)
        for kind in told.kinds:
            name = kind.replace(" ", "_")
            assert np.array_equal(np.hstack([arrays[f"{name}_force"], arrays[f"{name}_moment"]]), told.wrenches(kind))
    assert vtk(made[1])[0].GetNumberOfPolys() == 1


def test_vtk_reads_the_flow(rollout, vtk, tmp_path):
    # 32 × 32 points in a plane: an array whose bytes are a whole number of blocks.
    low, high, spacing = (0.0, -1.55, -1.5), (0.0, 1.55, 1.6), 0.1
    made = rollout.write_vtk(tmp_path, every=12, flow=(low, high, spacing))
    times, files = series(made[-1])
    assert made[-1].name == "flow.pvd" and list(times) == list(rollout.time[[0, 12]])
    for state, file in zip((0, 12), files, strict=True):
        image, _, arrays, _ = vtk(file)
        assert image.GetDimensions() == (1, 32, 32) and np.allclose(image.GetSpacing(), 0.1, rtol=1e-15)
        points = np.array([image.GetPoint(i) for i in range(1024)])
        resolved = rollout.flow_resolved(state, points)
        assert 0 < resolved.sum() < 1024
        assert np.array_equal(arrays["resolved"], resolved)
        hidden = image.GetPointGhostArray()
        assert [hidden.GetValue(i) for i in range(1024)] == [0 if r else 2 for r in resolved]
        assert np.all(arrays["velocity"][~resolved] == 0.0) and np.all(np.isfinite(arrays["velocity"]))
        right = rollout.flow(state, points[resolved])
        assert np.abs(arrays["velocity"][resolved] - right).max() < 1e-9


def test_vtk_reads_frames_without_a_line(vtk, tmp_path):
    """A seed that a body covers at first has a line once the body has left it."""
    scene = hg.Scene(hg.Fluid(998.0))
    scene.add(hg.Body(hg.sphere(0.1), density=998.0))
    scene.set_initial(v=[0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    made = hg.Simulator(scene, dt=0.01, faces=80).rollout(steps=20).write_vtk(tmp_path, every=5, streamlines=([[0.0, 0.0, 0.0]], 0.3))
    lines = next(file for file in made if file.name == "streamlines.pvd")
    read = [vtk(file) for file in series(lines)[1]]
    assert [data.GetNumberOfLines() for data, *_ in read] == [0, 0, 0, 1, 1]
    for data, points, at_points, at_lines in read:
        there = data.GetNumberOfLines() > 0
        assert len(points) == (data.GetCell(0).GetNumberOfPoints() if there else 1)
        assert len(at_points["velocity"]) == len(points) and np.isfinite(at_points["velocity"]).all() == there
        assert at_lines["seed"].tolist() == [0] * there if there else not len(at_lines.get("seed", ()))


def test_bodies_without_a_shape_are_points(vtk, tmp_path):
    scene = hg.Scene(gravity=(0.0, 0.0, -9.81))
    scene.add(hg.Body(hg.sphere(0.1), density=1000.0))
    scene.add(hg.Body(None, name='a "frame" & <é>', mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 2.0, 0.0)))
    rollout = hg.Simulator(scene, fidelity="isolated", faces=80).rollout(steps=0)
    made = rollout.write_vtk(tmp_path, pressure=True)
    _, (file,) = series(made[0])
    data, points, _, cells = vtk(file)
    assert (data.GetNumberOfVerts(), data.GetNumberOfPolys()) == (1, len(cells["body"]) - 1)
    assert cells["body"][0] == 1 and not cells["body"][1:].any()
    assert list(points[data.GetCell(0).GetPointId(0)]) == [0.0, 2.0, 0.0]
    (ball,) = rollout.pressure(0)
    assert cells["wetted"].tolist() == [0] + [1] * len(ball.pressures)
    assert cells["pressure"][0] == cells["hydrostatic"][0] == 0.0 and not cells["water_velocity"][0].any()
    assert np.array_equal(cells["hydrostatic"][1:], ball.hydrostatic) and np.ptp(ball.hydrostatic) > 1000.0
    _, (file,) = series(rollout.write_vtk(tmp_path / "plain")[0])
    assert set(vtk(file)[3]) == {"body", "velocity"}
    tree, _ = chunks(rollout.write_gltf(tmp_path / "run.glb"))
    assert tree["nodes"][1]["name"] == 'a "frame" & <é>' and "mesh" not in tree["nodes"][1]


def validator():
    """Khronos' validator; without it the test is skipped, or fails where HYDROGRAD_GLTF_VALIDATOR says where it is to be."""
    folder = os.environ.get("HYDROGRAD_GLTF_VALIDATOR")
    if folder is None:
        pytest.skip("needs the npm package gltf-validator in the folder that HYDROGRAD_GLTF_VALIDATOR names")
    assert shutil.which("node"), "the validator is a program for Node.js"
    return folder


VALIDATE = """
const [folder, file] = process.argv.slice(1);
const validator = require(require.resolve("gltf-validator", { paths: [folder] }));
const bytes = new Uint8Array(require("fs").readFileSync(file));
validator.validateBytes(bytes).then((report) => console.log(JSON.stringify(report)));
"""


@pytest.mark.parametrize("name", ["falling_ball", "gripper"])
def test_gltf_is_valid(name, tmp_path):
    sim = hg.Simulator(hg.Scene.load(SCENES / f"{name}.toml"), fidelity="isolated")
    path = sim.rollout(steps=9).write_gltf(tmp_path / "run.glb", every=2)
    done = subprocess.run(["node", "-e", VALIDATE, validator(), path], capture_output=True, text=True, check=True)
    report = json.loads(done.stdout)
    issues = report["issues"]
    assert issues["numErrors"] == issues["numWarnings"] == 0, issues
    assert report["info"]["animationCount"] == 1 and report["info"]["totalTriangleCount"] > 0


def chunks(path):
    """JSON and bytes of a file."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def test_gltf_moves_bodies(rollout, tmp_path):
    path = rollout.write_gltf(str(tmp_path / "run.glb"), every=4, colors={"coin": "#00ff00"})
    assert path == tmp_path / "run.glb"
    tree, data = chunks(path)

    def array(i):
        accessor = tree["accessors"][i]
        view = tree["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        return np.frombuffer(data, "<f4", accessor["count"] * width, view["byteOffset"]).reshape(-1, width)

    animation = tree["animations"][0]
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        body = rollout.simulator.body_names.index(tree["nodes"][channel["target"]["node"]]["name"])
        assert np.array_equal(array(sampler["input"])[:, 0], rollout.time[STATES].astype("f4"))
        values = array(sampler["output"]).astype("f8")
        if channel["target"]["path"] == "translation":
            assert np.array_equal(values, rollout.positions[STATES, body].astype("f4"))
            continue
        x, y, z, w = values.T
        turned = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)], axis=1)
        assert np.abs(turned - rollout.rotations[STATES, body, :, 0]).max() < 1e-6
        assert np.all(np.sum(values[1:] * values[:-1], axis=1) > 0.0)
    colors = [m["pbrMetallicRoughness"]["baseColorFactor"] for m in tree["materials"]]
    assert colors[1] == [0.0, 1.0, 0.0, 1.0]
    # The first of a replay's colours, linear.
    parts = np.array([int(PALETTE[0][k : k + 2], 16) for k in (1, 3, 5)]) / 255
    assert np.allclose(colors[0][:3], ((parts + 0.055) / 1.055) ** 2.4, atol=1e-6)


def test_what_cannot_be_written_is_refused(rollout, tmp_path):
    box = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    with pytest.raises(hg.InputError, match=r"flow grid: points: got 1.003e9 .*at most 2e7.*spacing"):
        rollout.write_vtk(tmp_path / "none", flow=(*box, 1e-3))
    for spacing in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(hg.InputError, match="flow grid: spacing"):
            rollout.write_vtk(tmp_path / "none", flow=(*box, spacing))
    with pytest.raises(hg.InputError, match="every: got -2; must be at least 1"):
        rollout.write_gltf(tmp_path / "run.glb", every=-2)
    for options in ({"frames_per_second": 0.0}, {"every": 0}, {"every": -2}, {"every": 2, "frames_per_second": 9.0}):
        with pytest.raises(hg.InputError, match="every|frames per second"):
            rollout.write_vtk(tmp_path / "none", **options)
        with pytest.raises(hg.InputError, match="every|frames per second"):
            rollout.write_gltf(tmp_path / "none.glb", **options)
    with pytest.raises(hg.InputError, match="#rrggbb"):
        rollout.write_gltf(tmp_path / "none.glb", colors={"coin": "green"})
    assert not any(tmp_path.iterdir())
    taken = tmp_path / "taken"
    taken.write_text("x")
    with pytest.raises(hg.FileError, match="taken"):
        rollout.write_vtk(taken)
    with pytest.raises(hg.FileError, match="taken"):
        rollout.write_gltf(taken / "run.glb")
    with pytest.raises(hg.FileError, match="folder"):
        rollout.write_gltf(tmp_path)
    dry = hg.Scene(hg.Fluid(0.0))
    dry.add(hg.Body(hg.sphere(0.1), density=1000.0))
    with pytest.raises(hg.UnsupportedError, match=r"pressure without water.*density"):
        hg.Simulator(dry, faces=80).rollout(steps=0).write_vtk(tmp_path / "dry", pressure=True)
