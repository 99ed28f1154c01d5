"""Replays: what the page holds, and what a browser draws of it."""

import base64
import html
import json
import os
import pathlib
import subprocess
import sys
import webbrowser

import browser
import numpy as np
import pytest
from pages import Parts, data_of, unpacked

import hydrograd as hg

NASTY = '</script><script>alert("&")</script>{{data}}<!--'


def scene(size: float = 1.0) -> hg.Scene:
    """A ball carried round the world's z axis by a shape far from its body's origin, beside a fixed one and a floor."""
    out = hg.Scene(name="round", steps=20, time_step=0.05)
    turn = [hg.Motion.linear(np.pi)]  # half a turn in a second
    joint = hg.revolute((0, 0, 1))
    carried = {"shape_position": (0.5 * size, 0.0, 0.0), "shape_rotation": (0.0, 0.3, 0.0)}
    ball = hg.sphere(0.1 * size, faces=320)
    out.add(hg.Body(ball, name="red", density=1000.0, joint=joint, motion=turn, **carried))
    out.add(hg.Body(ball, name="blue", mass=1.0, joint=hg.fixed(), position=(0.0, 0.0, 0.4 * size)))
    out.add(hg.Body(mass=1.0, inertia=(1, 1, 1), name=NASTY))
    out.add_wall((0.0, 0.0, -0.5 * size), (0.0, 0.0, 2.0))
    return out


@pytest.fixture(scope="module")
def rollout() -> hg.Rollout:
    return hg.Simulator(scene(), fidelity="isolated").rollout()


COLORS = {"red": "#ff0000", "blue": "#0000ff"}


@pytest.fixture(scope="module")
def page(rollout, tmp_path_factory) -> pathlib.Path:
    """The replay seen from the front, along y."""
    file = tmp_path_factory.mktemp("view") / "round.html"
    hg.view(rollout, file, colors=COLORS, view_from=(0, -1, 0))
    return file


def turned(quaternions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors turned by quaternions x, y, z, w, as three.js does it."""
    axis, w = quaternions[..., :3], quaternions[..., 3:]
    across = 2.0 * np.cross(axis, vectors)
    return vectors + w * across + np.cross(axis, across)


def test_the_page_holds_what_the_rollout_has(rollout):
    data = data_of(hg.view(rollout))
    center = np.array(data["center"])
    assert np.allclose(unpacked(data["time"]), rollout.time, rtol=0, atol=0)
    assert np.array_equal(unpacked(data["steps"]), np.arange(21))
    assert np.allclose(unpacked(data["positions"]) + center, rollout.positions, atol=1e-7)
    quaternions = unpacked(data["rotations"]).astype(np.float64)
    for axis in np.eye(3):
        assert np.allclose(turned(quaternions, axis), rollout.rotations @ axis, atol=1e-6)
    assert [body["name"] for body in data["bodies"]] == ["red", "blue", NASTY]
    # In the body's frame, off its origin: half a metre, and not where the shape's own mesh is.
    meshes = rollout.simulator.meshes()
    assert np.allclose(unpacked(data["bodies"][0]["vertices"]), meshes[0][0], atol=1e-7)
    assert np.array_equal(unpacked(data["bodies"][0]["faces"]), meshes[0][1])
    assert np.allclose(meshes[0][0].mean(axis=0), [0.5, 0.0, 0.0], atol=1e-3)
    assert meshes[2] is None and data["bodies"][2]["vertices"] is None
    # The ball sweeps half a circle of 0.6 m and is above the floor of z = -0.5 m.
    assert np.allclose(center, [0.0, 0.25, 0.2], atol=0.06)
    assert data["walls"][0]["normal"] == [0.0, 0.0, 1.0]
    assert np.isclose(data["walls"][0]["point"][2] + center[2], -0.5)
    series = {s["name"]: unpacked(s["values"]) for s in data["series"]}
    assert np.array_equal(series["kinetic energy"], rollout.kinetic_energy)
    assert np.array_equal(series["smallest gap"], rollout.min_gap)


def test_quaternions_of_all_turns():
    from hydrograd._viewer.frames import quaternions

    random = np.random.default_rng(0)
    q = random.normal(size=(200, 4))
    # Half turns about each axis too, where one way to compute them after the other divides by zero.
    q = np.concatenate([q, np.eye(4), np.eye(4)[::-1] + 1e-9])
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    matrices = np.stack([turned(q, axis) for axis in np.eye(3)], axis=-1)
    assert np.allclose(np.abs((quaternions(matrices) * q).sum(axis=1)), 1.0, atol=1e-14)


def test_shapes_placed_in_their_bodies():
    for faces in (80, 320):
        out = hg.Scene()
        at = {"shape_position": (0.3, 0.2, -0.1), "shape_rotation": (0.0, 0.0, np.pi / 2)}
        out.add(hg.Body(hg.box(0.4, 0.2, 0.1), density=1.0, **at))
        vertices, triangles = hg.Simulator(out, fidelity="isolated", faces=faces).meshes()[0]
        assert np.allclose(vertices.min(axis=0), [0.2, 0.0, -0.15]) and np.allclose(vertices.max(axis=0), [0.4, 0.4, -0.05])
        # As many as the simulator was asked for.
        assert abs(len(triangles) / faces - 1) < 0.5


def test_nothing_in_a_name_is_markup(rollout):
    parts = Parts(hg.view(rollout, title=NASTY).html)
    assert len(parts.scripts) == 3 and parts.title == NASTY
    assert json.loads(parts.scripts[0])["bodies"][2]["name"] == NASTY


def test_nothing_is_fetched(rollout):
    text = hg.view(rollout).html
    assert Parts(text).addresses == []
    assert "default-src 'none'" in text
    assert "MIT licence" in text


def test_the_same_page_twice(rollout):
    again = hg.Simulator(scene(), fidelity="isolated").rollout()
    assert hg.view(rollout).html == hg.view(again).html


def test_a_simulator_is_seen_at_its_start(rollout):
    sim = rollout.simulator
    assert hg.view(sim).html == hg.view(sim.rollout(steps=0)).html


def test_long_rollouts_are_thinned():
    long = hg.Simulator(scene(), 0.001, fidelity="isolated").rollout(steps=997)
    view = hg.view(long, max_frames=100)
    data = data_of(view)
    steps = unpacked(data["steps"])
    assert len(steps) == 100 and steps[0] == 0 and steps[-1] == 997
    assert set(np.diff(steps)) == {10, 11}
    assert np.array_equal(unpacked(data["time"]), long.time[steps])
    assert "100 of 998 states" in view.html


def test_no_steps():
    data = data_of(hg.view(hg.Simulator(scene(), fidelity="isolated").rollout(steps=0)))
    assert unpacked(data["time"]).tolist() == [0.0]


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_small_and_large_scenes_far_away(size):
    """Single precision is enough wherever the scene is."""
    out = hg.Scene(steps=3)
    far = np.array([1e5, -2e5, 3e4]) * size
    out.add(hg.Body(hg.sphere(size), density=1000.0, position=far, joint=hg.free()))
    simulator = hg.Simulator(out, fidelity="isolated").with_start(v=[size, 0, 0, 0, 0, 0])
    made = simulator.rollout()
    data = data_of(hg.view(made))
    found = unpacked(data["positions"]) + np.array(data["center"])
    assert np.allclose(found - far, made.positions - far, atol=1e-6 * size)
    assert 2 * size < data["size"] < 4 * size


def resting() -> hg.Rollout:
    """A ball that came to rest on a floor at z = 0."""
    out = hg.Scene(gravity=(0, 0, -9.81), contact=hg.Contact(gap=0.002), time_step=0.005)
    out.add_wall((0, 0, 0), (0, 0, 1))
    out.add(hg.Body(hg.sphere(0.1), density=2000.0, position=(0, 0, 0.103), joint=hg.prismatic((0, 0, 1))))
    return hg.Simulator(out, fidelity="isolated").rollout(steps=300)


def test_contacts():
    rollout = resting()
    found = rollout.contacts(-1)
    assert len(found) == 1 and found.first.tolist() == [0] and found.second.tolist() == [-1]
    # The floor carries the weight in water.
    weight = (2000.0 - 998.0) * 4 / 3 * np.pi * 0.1**3 * 9.81
    assert np.allclose(found.forces, [[0, 0, weight]], rtol=5e-3, atol=1e-9)
    assert np.allclose(found.normals, [[0, 0, 1]])
    assert np.all(np.abs(found.positions) < 0.003)
    assert np.isclose(found.gaps[0], rollout.min_gap[-2], atol=1e-3)
    assert len(rollout.contacts(0)) == 0 and len(rollout.contacts(0, slack=1.0)) == 1
    assert np.array_equal(rollout.contacts(299).forces, found.forces)
    for wrong in (300, -301):
        with pytest.raises(IndexError, match="300"):
            rollout.contacts(wrong)
    for wrong in (-1.0, np.nan):
        with pytest.raises(hg.InputError, match="slack"):
            rollout.contacts(0, slack=wrong)
    data = data_of(hg.view(rollout))["contacts"]
    starts, forces = unpacked(data["starts"]), unpacked(data["forces"])
    assert len(starts) == 302 and starts[-1] == len(forces) == len(unpacked(data["positions"]))
    assert starts[-1] == starts[-2]  # no step begins at the last state
    assert np.allclose(forces[starts[299] : starts[300]], found.forces)
    center = data_of(hg.view(rollout))["center"]
    assert np.allclose(unpacked(data["positions"])[starts[299] : starts[300]] + center, found.positions, atol=1e-7)
    assert data["largest"] > weight and data["scale"] is None
    assert data_of(hg.view(rollout, contacts=False))["contacts"]["largest"] == 0.0
    assert data_of(hg.view(rollout, force_scale=0.1))["contacts"]["scale"] == 0.1


@pytest.fixture(scope="module")
def stirring() -> hg.Rollout:
    """A ball with an arm that moves and turns, in a current, over three steps."""
    out = hg.Scene(hg.Fluid(998.0, current=(0.0, 0.1, 0.0)), steps=3)
    out.add(hg.Body(hg.sphere(0.1, faces=320), name="ball", density=998.0, shape_position=(0.2, 0.0, 0.0)))
    sim = hg.Simulator(out, fidelity="full")
    return sim.with_start(v=[0.5, 0.0, 0.2, 0.0, 1.0, 3.0]).rollout()


def test_flow_around_a_sphere(stirring):
    for state in (0, -1):
        velocity, spin = stirring.velocities[state, 0, :3], stirring.velocities[state, 0, 3:]
        arm = stirring.rotations[state, 0] @ [0.2, 0.0, 0.0]
        current = np.array([0.0, 0.1, 0.0])
        u = velocity + np.cross(spin, arm) - current  # of its middle, through the water
        rays = np.random.default_rng(1).normal(size=(50, 3))
        rays *= np.linspace(0.13, 0.5, 50)[:, None] / np.linalg.norm(rays, axis=1, keepdims=True)
        points = stirring.positions[state, 0] + arm + rays
        distance = np.linalg.norm(rays, axis=1, keepdims=True)
        along = rays / distance
        right = (0.1 / distance) ** 3 / 2 * (3 * (along @ u)[:, None] * along - u)
        found = stirring.flow(state, points) - current
        # 320 faces: within 3 % of the speed there.
        assert np.all(np.linalg.norm(found - right, axis=1) < 0.03 * np.linalg.norm(right, axis=1))
        inside = np.vstack([points, stirring.positions[state, 0] + arm])
        assert stirring.flow_resolved(state, inside).tolist() == [True] * 50 + [False]
        with pytest.raises(hg.UnresolvedError, match=r"points\[50\].*ball"):
            stirring.flow(state, inside)
    with pytest.raises(IndexError):
        stirring.flow(4, points)
    with pytest.raises(hg.InputError, match=r"flow: points.*\(n, 3\)"):
        stirring.flow(0, np.zeros(3))
    with pytest.raises(hg.InputError, match="finite"):
        stirring.flow_resolved(0, [[np.nan, 0, 0]])


def grid() -> np.ndarray:
    x, z = np.meshgrid(np.arange(-0.2, 0.61, 0.1), np.arange(-0.3, 0.31, 0.1))
    return np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3)


def test_flow_in_a_page(rollout, stirring):
    data = data_of(hg.view(stirring, flow=grid()))["flow"]
    velocities = unpacked(data["velocities"])
    assert velocities.shape == (4, 63, 3)
    known = stirring.flow_resolved(2, grid())
    assert 0 < known.sum() < 63
    assert np.allclose(velocities[2, known], stirring.flow(2, grid()[known]), atol=1e-7)
    assert np.all(velocities[2, ~known] == 0.0)
    assert np.isclose(data["longest"], 0.15)  # one and a half of the way to the next
    assert data_of(hg.view(stirring, flow=grid(), flow_scale=2.0))["flow"]["scale"] == 2.0
    assert data_of(hg.view(stirring))["flow"] is None
    with pytest.raises(hg.InputError, match="fewer points"):
        hg.view(stirring, flow=np.zeros((1_000_000, 3)))
    # The flow comes with every fidelity.
    alone = unpacked(data_of(hg.view(rollout, flow=grid(), max_frames=2))["flow"]["velocities"])
    known = rollout.flow_resolved(-1, grid())
    assert np.allclose(alone[1, known], rollout.flow(-1, grid()[known]), atol=1e-7)


@pytest.mark.parametrize("hydrostatic", [False, True])
def test_pressure_in_a_page(stirring, hydrostatic):
    """In 254 steps of the scale, which the largest 2 % are beyond."""
    data = data_of(hg.view(stirring, pressure="hydrostatic" if hydrostatic else True))["pressure"]
    (ball,) = data["bodies"]
    codes = unpacked(ball["codes"])
    found = [stirring.pressure(state)[0] for state in range(4)]
    right = np.array([p.pressures + hydrostatic * p.hydrostatic for p in found])
    assert ball["body"] == 0 and codes.dtype == np.int8 and codes.shape == right.shape and data["hydrostatic"] is hydrostatic
    scale = data["scale"]
    assert np.isclose(scale, np.quantile(np.abs(right), 0.98), rtol=1e-5) and np.abs(right).max() > scale > 1.0
    assert np.abs(codes * scale / 127 - np.clip(right, -scale, scale)).max() < 0.501 * scale / 127
    assert codes.max() == 127 or codes.min() == -127
    assert np.allclose(unpacked(data["ends"]), np.stack([right.min(axis=1), right.max(axis=1)], axis=1), rtol=1e-6)
    assert data_of(hg.view(stirring))["pressure"] is None


@pytest.fixture(scope="module")
def coupled() -> hg.Rollout:
    """With fidelities that couple bodies the fixed one is in the water, too."""
    return hg.Simulator(scene(), fidelity="reduced").rollout()


def test_pressure_of_several_bodies_and_rollouts(coupled, stirring):
    """On one scale; bodies without a shape have none, and of a thinned rollout the frames that are drawn."""
    view = hg.view([coupled, stirring], pressure=True, max_frames=3)
    pages = [html.unescape(part.split('"></iframe>')[0]) for part in view.html.split('srcdoc="')[1:]]
    first, second = (json.loads(Parts(page).scripts[0])["pressure"] for page in pages)
    assert first["scale"] == second["scale"] > 0.0
    assert [body["body"] for body in first["bodies"]] == [0, 1]
    right = [np.array([[p.pressures for p in one.pressure(state)] for state in states]) for one, states in ((coupled, (0, 10, 20)), (stirring, (0, 2, 3)))]
    every = np.abs(np.concatenate([of.ravel() for of in right]))
    assert np.isclose(first["scale"], np.quantile(every, 0.98), rtol=1e-5)
    for data, of in zip((first, second), right, strict=True):
        for number, body in enumerate(data["bodies"]):
            shown = unpacked(body["codes"]) * data["scale"] / 127
            assert np.abs(shown - np.clip(of[:, number], -data["scale"], data["scale"])).max() < 0.501 * data["scale"] / 127


def test_pressure_that_cannot_be_shown(coupled, monkeypatch):
    dry = hg.Scene(hg.Fluid(0.0))
    dry.add(hg.Body(hg.sphere(0.1), density=1000.0))
    with pytest.raises(hg.UnsupportedError, match="pressure without water"):
        hg.view(hg.Simulator(dry), pressure=True)
    monkeypatch.setattr("hydrograd._viewer.pressure.MOST", 13439)
    with pytest.raises(hg.InputError, match="got 640 faces at 21 frames; must be 13439 pressures at most: give fewer max_frames"):
        hg.view(coupled, pressure=True)
    assert data_of(hg.view(coupled, pressure=True, max_frames=20))["pressure"]["scale"] > 0.0


def test_steps_of_pressure():
    from hydrograd._viewer.pressure import codes, scale

    values = np.array([[-3.0, -1.0, 0.0, 0.5, np.nan, np.inf, 2.0]], np.float32)
    assert codes(values, 1.0).tolist() == [[-127, -127, 0, 64, -128, -128, 127]]
    assert scale([values]) == pytest.approx(np.quantile([0.0, 0.5, 1.0, 2.0, 3.0], 0.98))
    still = np.zeros((2, 100), np.float32)
    assert scale([still]) == scale([]) == 0.0 and not codes(still, 0.0).any()
    still[0, 7] = -4.0
    assert scale([still]) == 4.0  # rather than the zero that nearly all are


def test_forces_of_the_flow_in_a_page(rollout, stirring):
    data = data_of(hg.view(stirring, forces=True))["forces"]
    right = np.array([stirring.loads(state).wrenches("water")[:, :3] for state in range(4)])
    assert np.allclose(unpacked(data["forces"]), right, rtol=1e-6) and np.abs(right).max() > 0.0
    assert np.isclose(data["largest"], np.linalg.norm(right, axis=-1).max())
    assert data_of(hg.view(stirring))["forces"] is None
    view = hg.view([rollout, stirring], forces=True)
    pages = [html.unescape(part.split('"></iframe>')[0]) for part in view.html.split('srcdoc="')[1:]]
    first, second = (json.loads(Parts(page).scripts[0])["forces"] for page in pages)
    assert first["largest"] == second["largest"] >= data["largest"]
    dry = hg.Scene(hg.Fluid(0.0), steps=1)
    dry.add(hg.Body(hg.sphere(0.1), density=1000.0))
    assert data_of(hg.view(hg.Simulator(dry), forces=True))["forces"]["largest"] == 0.0


def test_walls():
    assert scene().walls == [([0.0, 0.0, -0.5], [0.0, 0.0, 2.0], "rigid")]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"max_frames": 1}, "max_frames: got 1; must be a whole number, 2 or more"),
        ({"max_frames": 10.0}, "max_frames"),
        ({"height": 0}, "height"),
        ({"up": (0, 0, 0)}, "up: got"),
        ({"view_from": (1, 2)}, "view_from"),
        ({"view_from": "x"}, "view_from"),
        ({"view_from": (1, np.nan, 0)}, "view_from"),
        ({"colors": {"ball": "#123456"}}, "must be one of"),
        ({"colors": {"red": "red"}}, "#rrggbb"),
        ({"force_scale": -1.0}, "force_scale"),
        ({"force_scale": np.nan}, "force_scale"),
        ({"force_scale": "x"}, "force_scale"),
        ({"flow": (0, 0, 0)}, r"flow: got an array of shape \(3,\)"),
        ({"flow": "x"}, "flow"),
        ({"flow": [[0, 0, np.inf]]}, "finite"),
        ({"flow_scale": 0}, "flow_scale"),
        ({"pressure": "total"}, "pressure: got 'total'; must be True, False or \"hydrostatic\""),
        ({"pressure": 1.5}, "pressure: got 1.5"),
        ({"title": ["a", "b"]}, "title: got 2 of them; must be one for each of 1"),
    ],
)
def test_wrong_input(rollout, given, says):
    with pytest.raises(hg.InputError, match=says):
        hg.view(rollout, **given)


def test_wrong_rollouts_and_files(rollout, tmp_path):
    with pytest.raises(hg.InputError, match="type ndarray; must be a Rollout"):
        hg.view(rollout.positions)
    with pytest.raises(hg.InputError, match="got none"):
        hg.view([])
    with pytest.raises(hg.InputError, match="type int; must be a Rollout"):
        hg.view([rollout, 3])
    with pytest.raises(hg.FileError, match="nowhere"):
        hg.view(rollout, tmp_path / "nowhere" / "a.html")


def test_in_a_notebook(rollout):
    view = hg.view(rollout, height=300)
    shown = view._repr_html_()
    found = shown.split('srcdoc="')[1].split('"')[0]
    assert html.unescape(found) == view.html
    # Scripts run, but as of another origin.
    assert 'sandbox="allow-scripts"' in shown and "height: 300px" in shown


def test_where_there_is_no_browser(rollout, tmp_path, monkeypatch):
    def nothing(*_):
        raise webbrowser.Error("could not locate runnable browser")

    monkeypatch.setattr(webbrowser, "get", nothing)
    file = tmp_path / "a.html"
    with pytest.warns(UserWarning, match="a.html"):
        view = hg.view(rollout, file, open=True)
    assert file.read_text(encoding="utf-8") == view.html and view.file == file and str(file) in repr(view)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    other = hg.view(rollout)
    assert other.file is None and not other.open() and other.file.parent == tmp_path


def test_where_there_is_one(rollout, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "get", lambda *_: None)
    monkeypatch.setattr(webbrowser, "open", lambda address: opened.append(address) or True)
    hg.view(rollout, tmp_path / "a.html", open=True)
    assert opened == [(tmp_path / "a.html").as_uri()]


def test_without_a_screen(tmp_path):
    """A page is written, and not opened, where there is no screen to show it on."""
    program = (
        "import hydrograd as hg, sys, warnings; warnings.simplefilter('ignore'); scene = hg.Scene(steps=1);"
        "scene.add(hg.Body(hg.sphere(1.0, faces=80), density=1.0));"
        "view = hg.view(hg.Simulator(scene, fidelity='isolated').rollout(), sys.argv[1], open=True); print(view.open())"
    )
    bare = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")}
    command = [sys.executable, "-c", program, tmp_path / "a.html"]
    done = subprocess.run(command, env=bare, capture_output=True, text=True, check=True)
    assert (tmp_path / "a.html").stat().st_size > 500_000
    if sys.platform == "linux":
        assert done.stdout == "False\n"


def stage(picture: np.ndarray) -> np.ndarray:
    """The part of the page that only the bodies' picture is seen in."""
    return picture[40:420, :760].astype(int)


def blob(picture: np.ndarray, channel: int) -> tuple[np.ndarray, float]:
    """Middle (right, up) of what has this colour, pixels, and the radius of a disc as large."""
    others = [c for c in range(3) if c != channel]
    seen = picture[..., channel] > 90 + picture[..., others].max(axis=-1)
    rows, columns = np.nonzero(seen)
    assert len(rows) > 50
    return np.array([columns.mean(), -rows.mean()]), np.sqrt(len(rows) / np.pi)


def test_a_browser_draws_it(page):
    says, _ = browser.body(page)
    assert says["status"] == "drawn" and "errors" not in says
    assert (says["frames"], says["meshes"], says["time"]) == ("21", "2", "0")
    assert int(says["triangles"]) >= 2 * 320
    start, end = stage(browser.picture(page)), stage(browser.picture(page, "#t=1"))
    assert len(np.unique(start.reshape(-1, 3), axis=0)) > 200
    assert (np.abs(start - end).max(axis=-1) > 30).mean() > 0.01
    # Seen along y, the red ball goes from x = 0.5 m to -0.5 m at the blue one's distance; the fixed one stays.
    (blue, radius), (still, _) = blob(start, 2), blob(end, 2)
    assert np.allclose(blue, still, atol=0.5)
    for picture, x in ((start, 0.5), (end, -0.5)):
        red, size = blob(picture, 0)
        assert np.isclose(size, radius, rtol=0.15)
        assert np.allclose((red - blue) / radius, np.array([x, -0.4]) / 0.1, rtol=0.06)


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_a_browser_draws_it_whatever_its_size(page, tmp_path, size):
    rollout = hg.Simulator(scene(size), fidelity="isolated").rollout()
    file = tmp_path / "sized.html"
    hg.view(rollout, file, colors=COLORS, view_from=(0, -1, 0))
    change = np.abs(stage(browser.picture(page, "#t=1")) - stage(browser.picture(file, "#t=1")))
    assert (change.max(axis=-1) > 12).mean() < 1e-3


def test_a_browser_plays_it(page):
    says, _ = browser.body(page, "#t=0.2&play")
    assert says["status"] == "drawn" and float(says["time"]) > 0.3


def test_buttons(page):
    """A script that presses them tells what it finds."""
    program = """
    const press = (id) => document.getElementById(id).click();
    const put = (id, value) => { const e = document.getElementById(id); e.value = value; e.dispatchEvent(new Event("change")); };
    const { player, stage } = hydrograd;
    const found = {};
    const key = (name, where) => where.dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true }));
    press("on"); press("on"); press("back");
    found.stepped = player.time;
    key("End", document.getElementById("play"));
    found.end = player.time;
    key("ArrowLeft", document.body);
    key("Home", document.getElementById("scrub")); // the slider's own
    found.back = player.time;
    press("trails"); press("edges"); press("glass");
    found.shown = [player.bodies.paths[0].visible, player.bodies.groups[0].userData.lines.visible];
    put("follow", "0");
    const away = () => player.bodies.middle(0).distanceTo(stage.controls.target);
    player.seek(0.7);
    found.followed = away();
    press("reset");
    found.left = away();
    press("look-z");
    found.above = stage.camera.position.z;
    document.querySelector("#bodies input").click();
    found.hidden = !player.bodies.groups[0].visible;
    put("curve", "1");
    document.getElementById("scrub").value = "0.5";
    document.getElementById("scrub").dispatchEvent(new Event("input"));
    found.scrubbed = player.time;
    // Between two frames, half of the turn of pi / 20 and of the way.
    player.seek(0.125);
    const { position, quaternion } = player.bodies.groups[0];
    found.turn = 2 * Math.atan2(quaternion.z, quaternion.w);
    document.title = JSON.stringify(found);
    """
    file = page.with_name("buttons.html")
    text = page.read_text(encoding="utf-8")
    file.write_text(text.replace("</body>", f"<script>{program}</script></body>"), encoding="utf-8")
    says, after = browser.body(file)
    assert says["status"] == "drawn" and "errors" not in says
    found = json.loads(Parts(after).title)
    assert np.isclose(found["stepped"], 0.05) and np.isclose(found["scrubbed"], 0.5)
    assert np.isclose(found["end"], 1.0) and np.isclose(found["back"], 0.95)
    assert found["shown"] == [True, True] and found["hidden"]
    assert found["followed"] < 1e-6 < 0.1 < found["left"]
    assert found["above"] > 0.5
    assert np.isclose(found["turn"], 0.125 * np.pi, atol=1e-5)


PROBE = """
    const found = { wide: document.documentElement.scrollWidth, window: window.innerWidth, open: document.querySelector("aside details").open };
    found.ink = hydrograd.color("--ink");
    const box = (e) => e.getBoundingClientRect();
    found.inside = [...document.querySelectorAll("aside, footer, footer button, footer #scrub, h1")].every((e) => box(e).left >= 0 && box(e).right <= window.innerWidth);
    found.touch = Math.min(...[...document.querySelectorAll("#play, #speed, summary")].map((e) => box(e).height));
    const picture = hydrograd.stage.picture();
    found.size = [picture.width, picture.height];
    found.png = picture.toDataURL("image/png");
    document.querySelector("aside details").open = true;
    const aside = box(document.querySelector("aside"));
    found.panel = aside.left >= 0 && aside.right <= window.innerWidth && aside.bottom <= box(document.querySelector("footer")).top;
    parent.postMessage(JSON.stringify(found), "*");
"""


def probed(page: pathlib.Path, name: str, *more: str, size: tuple[int, int] = (1000, 700)) -> dict:
    """What a script in the page finds, where it is so many pixels large: in a frame, since no window is narrower than 500."""
    inner = page.with_name(f"{name}.inner.html")
    text = page.read_text(encoding="utf-8")
    inner.write_text(text.replace("</body>", f"<script>{PROBE}</script></body>"), encoding="utf-8")
    file = page.with_name(f"{name}.html")
    frame = f'<iframe src="{inner.name}" style="width:{size[0]}px;height:{size[1]}px;border:0"></iframe>'
    listen = "<script>onmessage = (event) => { document.title = event.data; };</script>"
    file.write_text(f'<html><body data-status="">{listen}{frame}</body></html>', encoding="utf-8")
    return json.loads(Parts(browser.body(file, "", *more)[1]).title)


def test_on_a_phone_and_in_the_dark(page):
    """At 390 × 844 pixels nothing lies outside, the panel is folded and what is touched is large; the colours go with the system's scheme."""
    light = probed(page, "light")
    phone = probed(page, "phone", "--force-dark-mode", size=(390, 844))
    assert light["open"] and not phone["open"]
    assert phone["wide"] <= phone["window"] == 390
    for found in (light, phone):
        assert found["inside"] and found["panel"]
    assert phone["touch"] >= 36
    assert light["ink"] == "#24343f" and phone["ink"] == "#dbe6ec"


def test_a_picture_is_kept(page):
    """The PNG of a frame has the size of what is seen, with the bodies on their background."""
    found = probed(page, "kept")
    image = browser.pixels(base64.b64decode(found["png"].split(",")[1]))
    assert list(image.shape[:2]) == found["size"][::-1]
    red = (image[..., 0] > 150) & (image[..., 1] < 90) & (image[..., 2] < 90)
    blue = (image[..., 2] > 150) & (image[..., 0] < 90) & (image[..., 1] < 90)
    assert red.sum() > 200 and blue.sum() > 200
    assert np.abs(image[5, 5].astype(int) - [238, 244, 247]).max() < 12


def test_a_browser_draws_forces_and_flow(stirring, tmp_path):
    """In their colours, and not where they are switched off."""
    file = tmp_path / "arrows.html"
    for rollout, more, switch, like in (
        (resting(), {"max_frames": 50}, "forces", lambda p: (p[..., 0] > 150) & (p[..., 1:].max(axis=-1) < 80)),
        (stirring, {"flow": grid()}, "flow", lambda p: (p[..., 0] < 60) & (p[..., 2] > 90) & (p[..., 2] < 190)),
    ):
        text = hg.view(rollout, view_from=(0, -1, 0.2), colors={rollout.simulator.body_names[0]: "#cccccc"}, **more).html
        seen = []
        for shown in (True, False):
            press = "" if shown else f"document.getElementById('{switch}').click();"
            file.write_text(text.replace("</body>", f"<script>{press}</script></body>"), encoding="utf-8")
            seen.append(like(stage(browser.picture(file, "#t=1"))).sum())
        assert seen[0] > 150 + seen[1], (switch, seen)
        assert seen[1] < 50


PRESSED = """
    const { player } = hydrograd;
    const found = {};
    const { skin } = player.bodies.groups[0].userData;
    const legend = document.getElementById("pressures");
    const colors = () => [...skin.geometry.getAttribute("color").array];
    const look = () => [skin.material.vertexColors, skin.material.color.getHexString(), !legend.hidden];
    found.corners = [...skin.geometry.getAttribute("position").array].map((x, i) => x * skin.scale.x + skin.position.getComponent(i % 3));
    found.first = colors();
    found.on = look();
    found.legend = [...legend.querySelectorAll("span")].map((part) => part.textContent);
    player.seek(player.last);
    found.last = colors();
    found.name = document.getElementById("pressure").parentElement.textContent;
    found.facts = document.getElementById("facts").textContent;
    document.getElementById("pressure").click();
    found.off = look();
    document.getElementById("pressure").click();
    found.again = look();
    found.arrows = player.forces.arrows.shafts.count;
    document.getElementById("loads").click();
    found.hidden = !player.forces.arrows.shafts.visible;
    document.title = JSON.stringify(found);
"""


def diverging(part: np.ndarray) -> np.ndarray:
    """Colours of pressures, -1 to 1, as light: blue, white, red."""
    stops = np.array([[0x21, 0x66, 0xAC], [0x92, 0xC5, 0xDE], [0xF7, 0xF7, 0xF7], [0xF4, 0xA5, 0x82], [0xB2, 0x18, 0x2B]]) / 255
    coded = np.stack([np.interp(part, np.linspace(-1, 1, 5), stops[:, k]) for k in range(3)], axis=-1)
    return ((coded + 0.055) / 1.055) ** 2.4


def test_a_browser_colours_faces_by_pressure(stirring, tmp_path):
    """Each face in one colour, another at another frame; the switch and the legend."""
    file = tmp_path / "pressed.html"
    view = hg.view(stirring, pressure=True, forces=True, colors={"ball": "#cccccc"})
    file.write_text(view.html.replace("</body>", f"<script>{PRESSED}</script></body>"), encoding="utf-8")
    says, after = browser.body(file)
    assert says["status"] == "drawn" and "errors" not in says
    found = json.loads(Parts(after).title)
    vertices, faces = stirring.simulator.meshes()[0]
    assert np.allclose(np.reshape(found["corners"], (-1, 3, 3)), vertices[faces], atol=1e-6)
    scale = data_of(view)["pressure"]["scale"]
    for name, state in (("first", 0), ("last", 3)):
        colors = np.reshape(found[name], (len(faces), 3, 3))
        assert np.all(colors == colors[:, :1])
        right = diverging(np.clip(stirring.pressure(state)[0].pressures / scale, -1, 1))
        # To the steps of pressures and of colours.
        assert np.abs(colors[:, 0] - right).max() < 0.03
    assert np.abs(np.subtract(found["first"], found["last"])).max() > 0.1
    assert found["on"] == found["again"] == [True, "dadada", True] and found["off"] == [False, "cccccc", False]
    low, none, high = found["legend"]
    assert none == "0" and float(low.split()[1]) == -float(high.split()[1]) == pytest.approx(-scale, rel=1e-3) and high.endswith("Pa")
    assert found["name"] == "pressure of the flow" and "pressure" in found["facts"] and "force of the flow" in found["facts"]
    assert found["arrows"] == 1 and found["hidden"]


def test_a_picture_of_pressure(stirring, tmp_path):
    """A grey ball is red in front and blue at its sides, and grey with the switch off."""
    file = tmp_path / "coloured.html"
    text = hg.view(stirring, pressure="hydrostatic", view_from=(0, -1, 0.2), colors={"ball": "#cccccc"}).html
    seen = []
    for shown in (True, False):
        press = "" if shown else "document.getElementById('pressure').click();"
        file.write_text(text.replace("</body>", f"<script>{press}</script></body>"), encoding="utf-8")
        picture = stage(browser.picture(file))[:, 200:]
        seen.append([(picture[..., a] > 40 + picture[..., b]).sum() for a, b in ((0, 2), (2, 0))])
    assert min(seen[0]) > 100 and max(seen[1]) < 0.2 * min(seen[0]), seen


UNTIL = """
    const begun = performance.now();
    const until = async (holds) => {
      while (!holds()) {
        if (performance.now() > begun + 180000) throw new Error(`${holds} never came`);
        await new Promise(requestAnimationFrame);
      }
    };
    const { player, stage, link } = hydrograd;
"""
ACTS = """async () => {
    UNTIL
    // The page around has said where to begin.
    await until(() => link.lead > 0);
    player.seek(0.3); stage.look(new THREE.Vector3(1, 0, 0));
    const speed = document.getElementById("speed"), loop = document.getElementById("loop");
    speed.value = "0.1"; speed.dispatchEvent(new Event("change"));
    // It goes on until it is stopped.
    loop.checked = true; loop.dispatchEvent(new Event("change"));
    document.getElementById("play").click();
    await until(() => player.playing);
}""".replace("UNTIL", UNTIL)
# What the clock said last is said once more after the press, as where it was on its way.
STOPS = """async () => {
    UNTIL
    let last = null;
    window.addEventListener("message", ({ data }) => { if (data.state) last = data; });
    await until(() => player.playing && player.time > 0.3 && last && last.state.playing);
    const found = { before: player.time, went: player.playing && player.led, led: link.leader !== link.place };
    document.getElementById("play").click();
    window.dispatchEvent(new MessageEvent("message", { data: last, source: window.parent }));
    await until(() => link.leader === link.place);
    return found;
}""".replace("UNTIL", UNTIL)
FOUND = """() => {
    const { player, stage } = hydrograd;
    const speed = document.getElementById("speed").value, loop = document.getElementById("loop").checked;
    const { time, playing, first, last } = player;
    return { range: [first, last], time, playing, speed, loop, camera: stage.camera.position.toArray() };
}"""


def timed(text: str) -> str:
    """A page around others in which a timer asks for pictures: a browser without a screen hardly asks frames in a sandbox."""
    timer = "<script>window.requestAnimationFrame = (f) => setTimeout(() => f(performance.now()), 16);</script>"
    return text.replace(html.escape("<head>"), html.escape("<head>" + timer))


def test_two_beside_each_other(rollout, tmp_path):
    """What is done to one is done to the other: moment, camera, speed, play in the first, pause in the second; each shows its own rollout."""
    longer = hg.Simulator(scene(), fidelity="isolated").rollout(steps=40)
    view = hg.view([rollout, longer], title=["short <one>", "long"], colors=COLORS, view_from=(0, -1, 0))
    assert view.title == "short <one>, long"
    pages = [html.unescape(part.split('"></iframe>')[0]) for part in view.html.split('srcdoc="')[1:]]
    first, second = (json.loads(Parts(page).scripts[0]) for page in pages)
    assert first["range"] == second["range"] == [0.0, 2.0] and first["center"] == second["center"] and first["size"] == second["size"]
    assert unpacked(first["time"])[-1] == 1.0 and unpacked(second["time"])[-1] == 2.0
    file = tmp_path / "beside.html"
    file.write_text(view.html, encoding="utf-8")
    with browser.opened(file) as around:
        around.wait_for_selector("body[data-status]")
        assert around.evaluate("() => document.body.dataset.status") == "drawn"
        frames = around.frames[1:]
        frames[0].evaluate(ACTS)
        stopped = frames[1].evaluate(STOPS)
        frames[0].wait_for_function("() => !hydrograd.player.playing")
        left, right = (frame.evaluate(FOUND) for frame in frames)
    assert left["range"] == right["range"] == [0.0, 2.0]
    assert stopped["went"] and stopped["led"] and stopped["before"] >= 0.3
    assert not left["playing"] and not right["playing"]
    assert left["time"] == right["time"] >= stopped["before"]
    assert np.allclose(left["camera"], right["camera"], atol=1e-12) and left["camera"][0] > 1.0
    assert left["speed"] == right["speed"] == "0.1" and left["loop"] and right["loop"]


def test_beside_each_other_at_a_moment(rollout, tmp_path):
    """The address of the page around gives the moment to both; the red ball is where it is then in both halves."""
    file = tmp_path / "moment.html"
    view = hg.view((rollout, rollout), colors=COLORS, view_from=(0, -1, 0))
    file.write_text(timed(view.html), encoding="utf-8")
    picture = browser.picture(file, "#t=1", clock=8000)
    width = browser.WIDTH // 2
    halves = [picture[40:420, at : at + width - 250].astype(int) for at in (0, width)]
    reds = [blob(half, 0)[0] - blob(half, 2)[0] for half in halves]
    assert np.allclose(reds[0], reds[1], atol=2.0) and reds[0][0] < -20


def test_without_webgl_it_says_so(page):
    says, after = browser.body(page, "", "--disable-3d-apis")
    assert says["status"] == "failed"
    assert "The replay can't be shown" in after.split('id="note"')[1]


def test_in_a_sandbox(rollout, tmp_path):
    """As notebooks show it."""
    file = tmp_path / "notebook.html"
    shown = hg.view(rollout, colors=COLORS, height=500)._repr_html_()
    file.write_text(f"<!DOCTYPE html><body style='margin: 0'>{shown}</body>", encoding="utf-8")
    blob(stage(browser.picture(file, clock=8000)), 0)


def test_no_name_leaves_its_place():
    """Whatever bodies and titles are called, they are text of the page and nothing else."""
    from hydrograd._viewer.page import page

    rng = np.random.default_rng(1)
    parts = ["</script>", "<script>", "<!--", "-->", "]]>", "{{data}}", "{{scripts}}", "\\u003c", "\\", '"', "'", "&lt;", "&", "<", ">"]
    parts += ["\u2028", "\u2029", "\x00", "\r", "\n", "</title>", "<style>", "\U0001f41f", "\ufffe", "`${1}`", "javascript:", "a", " "]
    plain = len(Parts(page("", "", {"name": ""})).scripts)
    for _ in range(300):
        name = "".join(rng.choice(parts, size=rng.integers(1, 12)))
        found = Parts(page(name, name, {"name": name, "of": [{name: 1.5}]}))
        assert json.loads(found.scripts[0]) == {"name": name, "of": [{name: 1.5}]}
        assert len(found.scripts) == plain
