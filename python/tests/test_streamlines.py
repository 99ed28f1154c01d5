"""Lines along the water's velocity, and torques of the flow, in replays."""

import html
import json

import browser
import numpy as np
import pytest
from pages import Parts, data_of, unpacked

import hydrograd as hg
from hydrograd._viewer import streamlines


@pytest.fixture(scope="module")
def rising() -> hg.Rollout:
    """A ball that moves along z in still water."""
    out = hg.Scene(steps=2)
    out.add(hg.Body(hg.sphere(0.1, faces=320), name="ball", density=998.0, position=(0.3, -0.2, 0.1)))
    sim = hg.Simulator(out, fidelity="reduced")
    return sim.with_start(v=[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).rollout()


@pytest.fixture(scope="module")
def turned() -> hg.Rollout:
    """A plate at a slant to its way, which the water turns."""
    out = hg.Scene(steps=2)
    out.add(hg.Body(hg.ellipsoid(0.05, 0.2, 0.2), name="plate", density=998.0))
    sim = hg.Simulator(out, fidelity="reduced", faces=320)
    return sim.with_start(v=[0.5, 0.5, 0.0, 0.0, 0.0, 0.0]).rollout()


def lines_of(data: dict) -> list[list[np.ndarray]]:
    """Of each frame its lines, in the world."""
    points, ends, starts = unpacked(data["streamlines"]["points"]) + data["center"], unpacked(data["streamlines"]["lines"]), unpacked(data["streamlines"]["frames"])
    return [[points[ends[k] : ends[k + 1]] for k in range(a, b)] for a, b in zip(starts, starts[1:])]


def test_lines_around_a_ball_are_those_of_a_dipole(rising):
    """Along each the stream function r² sin²θ / r³ of a dipole is the same, and the water has its speed; lines end at the ball."""
    data = data_of(hg.view(rising, streamlines=True))
    frames = lines_of(data)
    assert len(frames) == 3 and all(len(lines) == 16 for lines in frames)
    speeds, ends = unpacked(data["streamlines"]["speeds"]), unpacked(data["streamlines"]["lines"])
    at = 0
    for state, lines in enumerate(frames):
        up = rising.velocities[state, 0, 2]
        for line in lines:
            arm = line - rising.positions[state, 0]
            r, beside = np.linalg.norm(arm, axis=1), np.linalg.norm(arm[:, :2], axis=1)
            stream = beside**2 / r**3
            # To what 320 faces know of the flow.
            assert np.ptp(stream) < 0.01 * stream.mean()
            assert r.min() > 0.098  # the faces are a little within the ball
            speed = up * (0.1 / r) ** 3 / 2 * np.sqrt(3 * (arm[:, 2] / r) ** 2 + 1)
            of_page = speeds[ends[at] : ends[at + 1]]
            # Between steps in proportion.
            assert np.abs(of_page - speed)[::4].max() < 0.03 * speed.max()
            # Downstream: out of the ball in front, into it behind.
            along = np.diff(line, axis=0)
            flow = 3 * (arm[:-1, 2] / r[:-1])[:, None] * arm[:-1] / r[:-1, None] - [0.0, 0.0, 1.0]
            assert np.all(np.sum(along * flow, axis=1) > 0.0)
            at += 1
    assert data["streamlines"]["fastest"] == pytest.approx(speeds.max())
    assert data_of(hg.view(rising))["streamlines"] is None


def test_lines_through_given_points(rising):
    """They reach as far as they are asked to, and those in a body or in still water are left out."""
    ball = rising.positions[0, 0]
    seeds = ball + [[0.0, 0.25, 0.0], [0.0, 0.0, 0.02], [50.0, 0.0, 0.0], [0.2, 0.0, 0.05]]
    data = data_of(hg.view(rising, streamlines=seeds, streamline_length=0.15, max_frames=2))
    for lines in lines_of(data):
        assert len(lines) == 2
        for line, seed in zip(lines, seeds[[0, 3]], strict=True):
            assert np.abs(line - seed).sum(axis=1).min() < 1e-6
            assert np.linalg.norm(np.diff(line, axis=0), axis=1).sum() == pytest.approx(0.3, rel=0.03)


def test_the_order_of_the_steps(rising):
    """A line closes on the exact one with the fourth power of its step."""

    class Water:
        """A dipole in the water, where a ball isn't."""

        @staticmethod
        def known_flow(_, points):
            r = np.linalg.norm(points, axis=1, keepdims=True)
            return 3 * points[:, 2:] * points / r**5 - [0.0, 0.0, 1.0] / r**3, r[:, 0] > 0.1

    seed = np.array([[0.4, 0.0, 0.0]])
    errors = []
    for step in (0.05, 0.025):
        ((line, _),) = streamlines.traced(Water(), 0, seed, 0.3, step, 0.0)
        ends = line[[0, -1]]
        r = np.linalg.norm(ends, axis=1)
        errors.append(np.abs(ends[:, 0] ** 2 / r**3 - 1 / 0.4).max())
    assert 10.0 < errors[0] / errors[1] < 30.0 and errors[1] < 1e-4


def test_no_lines_in_still_water():
    out = hg.Scene(steps=1)
    out.add(hg.Body(hg.sphere(0.1), density=998.0))
    data = data_of(hg.view(hg.Simulator(out, fidelity="reduced", faces=80), streamlines=True))["streamlines"]
    assert unpacked(data["frames"]).tolist() == [0, 0] and unpacked(data["points"]).shape == (0, 3) and data["fastest"] == 0.0


def test_on_one_scale(rising, turned):
    view = hg.view([rising, turned], streamlines=True, forces=True, max_frames=2)
    pages = [html.unescape(part.split('"></iframe>')[0]) for part in view.html.split('srcdoc="')[1:]]
    first, second = (json.loads(Parts(page).scripts[0]) for page in pages)
    assert first["streamlines"]["fastest"] == second["streamlines"]["fastest"] > 0.0
    assert first["forces"]["largest_torque"] == second["forces"]["largest_torque"] > 0.0


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"streamlines": (0, 0, 0)}, r"streamlines: got an array of shape \(3,\); must be True, False or points \(n, 3\)"),
        ({"streamlines": "x"}, "streamlines"),
        ({"streamlines": [[0, 0, np.nan]]}, "streamlines: got numbers that aren't finite"),
        ({"streamlines": True, "streamline_length": 0.0}, "streamline_length: got 0.0; must be finite and positive, in m"),
    ],
)
def test_wrong_lines(rising, given, says):
    with pytest.raises(hg.InputError, match=says):
        hg.view(rising, **given)


def test_more_lines_than_a_page_holds(rising, monkeypatch):
    monkeypatch.setattr(streamlines, "MOST", 1000)
    monkeypatch.setattr(streamlines, "traced", None)  # before anything is solved
    with pytest.raises(hg.InputError, match="streamlines: got 16 lines at 3 frames, up to .* points; must be 1000 points at most"):
        hg.view(rising, streamlines=True)


def test_the_flow_that_is_known(rising):
    points = rising.positions[1, 0] + [[0.0, 0.0, 0.3], [0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]
    velocities, known = rising.known_flow(1, points)
    assert known.tolist() == rising.flow_resolved(1, points).tolist() == [True, False, True]
    assert np.array_equal(velocities[known], rising.flow(1, points[known])) and not velocities[1].any()
    with pytest.raises(IndexError):
        rising.known_flow(3, points)
    with pytest.raises(hg.InputError, match=r"known_flow: points.*\(n, 3\)"):
        rising.known_flow(0, np.zeros(3))


def test_torques_in_a_page(rising, turned):
    data = data_of(hg.view(turned, forces=True))["forces"]
    right = np.array([turned.loads(state).wrenches("water")[:, 3:] for state in range(3)])
    assert np.allclose(unpacked(data["torques"]), right, rtol=1e-6) and data["largest_torque"] == pytest.approx(np.linalg.norm(right, axis=-1).max())
    assert data["largest_torque"] > 0.1
    # What rounding makes of none on a ball isn't shown as one.
    none = data_of(hg.view(rising, forces=True))["forces"]
    assert none["largest_torque"] == 0.0 and not unpacked(none["torques"]).any()


LOOKS = """
    const { player, stage } = hydrograd;
    const found = { scales: document.getElementById("scales").textContent, facts: document.getElementById("facts").textContent };
    const arc = player.torques.meshes[0];
    const matrix = new THREE.Matrix4();
    arc.getMatrixAt(0, matrix);
    found.arcs = arc.count;
    found.axis = new THREE.Vector3().setFromMatrixColumn(matrix, 2).toArray();
    found.at = new THREE.Vector3().setFromMatrixPosition(matrix).toArray();
    found.widest = player.torques.widest;
    found.segments = player.streamlines.mesh.geometry.drawRange.count / 2;
    found.heads = player.streamlines.arrows.heads.count;
    found.first = [...player.streamlines.mesh.geometry.getAttribute("position").array.slice(0, 6)];
    player.seek(player.last);
    found.last = [...player.streamlines.mesh.geometry.getAttribute("position").array.slice(0, 6)];
    for (const id of ["torques", "lines"]) document.getElementById(id).click();
    found.shown = [arc.visible, player.streamlines.mesh.visible, player.streamlines.arrows.heads.visible];
    document.title = JSON.stringify(found);
"""


def test_a_browser_draws_arcs_and_lines(turned, tmp_path):
    file = tmp_path / "lines.html"
    view = hg.view(turned, forces=True, streamlines=True)
    file.write_text(view.html.replace("</body>", f"<script>{LOOKS}</script></body>"), encoding="utf-8")
    says, after = browser.body(file)
    assert says["status"] == "drawn" and "errors" not in says
    found, data = json.loads(Parts(after).title), data_of(view)
    # About the torque's axis, at the body's origin, and as wide as it is large.
    torque = unpacked(data["forces"]["torques"])[0, 0].astype(float)
    share = np.linalg.norm(torque) / data["forces"]["largest_torque"]
    assert found["arcs"] == 1 and np.allclose(found["axis"], found["widest"] * share * torque / np.linalg.norm(torque), atol=1e-5)
    assert np.allclose(found["at"], turned.positions[0, 0] - data["center"], atol=1e-6)
    assert found["widest"] == pytest.approx(0.12 * data["size"])
    lines = lines_of(data)
    assert found["heads"] == len(lines[0]) > 5 and found["segments"] == sum(len(line) - 1 for line in lines[0])
    for name, frame in (("first", 0), ("last", -1)):
        assert np.allclose(np.reshape(found[name], (2, 3)) + data["center"], lines[frame][0][:2], atol=1e-6)
    assert found["first"] != found["last"] and found["shown"] == [False, False, False]
    for words in ("violet arrow", "orange arc", "N m", "darkest line", "m/s"):
        assert words in found["scales"]
    assert "streamlines" in found["facts"] and "torque up to" in found["facts"]


def test_a_picture_of_them(turned, tmp_path):
    """Orange arcs and blue lines, and neither with its switch off."""
    file = tmp_path / "seen.html"
    text = hg.view(turned, forces=True, streamlines=True, colors={"plate": "#cccccc"}, view_from=(0, -1, 0.3)).html
    seen = []
    for press in ("", "for (const id of ['torques', 'lines', 'loads']) document.getElementById(id).click();"):
        file.write_text(text.replace("</body>", f"<script>{press}</script></body>"), encoding="utf-8")
        picture = browser.picture(file)[40:420, :760].astype(int)
        orange = (picture[..., 0] > 150) & (picture[..., 1] < 130) & (picture[..., 2] < 90)
        blue = (picture[..., 2] > 40 + picture[..., 0]) & (picture[..., 0] < 170)
        seen.append((orange.sum(), blue.sum()))
    assert min(seen[0]) > 100 and max(seen[1]) < 20, seen
