"""Videos of replays, and frames: what is in them, and what they need."""

import asyncio
import importlib
import os
import pathlib
import subprocess
import sys

import browser
import numpy as np
import pytest

import hydrograd as hg
from hydrograd._viewer import video as videos
from hydrograd._viewer.encode import KINDS, Encoded

if os.environ.get("HYDROGRAD_REQUIRE_BROWSER") != "1":
    pytest.importorskip("av")
    pytest.importorskip("playwright")
av = importlib.import_module("av")

BALL = pathlib.Path(__file__).parents[2] / "examples/scenes/falling_ball.toml"
SIZE = (320, 240)
COLORS = {"red": "#ff0000"}


@pytest.fixture(scope="module")
def rollout() -> hg.Rollout:
    """A red ball that goes 0.6 m along x in half a second."""
    out = hg.Scene(name="across", steps=10, time_step=0.05)
    motion = [hg.Motion.linear(1.2)]
    out.add(hg.Body(hg.sphere(0.1, faces=320), name="red", density=1000.0, joint=hg.prismatic((1, 0, 0)), motion=motion))
    return hg.Simulator(out, fidelity="isolated").rollout()


def across(picture: np.ndarray) -> float:
    """How far right the red is, pixels."""
    picture = picture.astype(int)
    red = picture[..., 0] > 90 + picture[..., 1:].max(axis=-1)
    assert red.sum() > 50
    return float(np.nonzero(red)[1].mean())


def of_video(path: pathlib.Path) -> tuple[list[np.ndarray], object]:
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frames = list(container.decode(video=0))
        # The first stands by itself; what follows is coded by what changes.
        assert [frame.key_frame for frame in frames[:12]] == [True, *[False] * (len(frames[:12]) - 1)]
        return [frame.to_ndarray(format="rgb24") for frame in frames], (stream.codec_context.name, stream.average_rate, float(container.duration) / 1e6)


def record(rollout, file, **more):
    browser.find()
    return hg.record(rollout, file, **{"fps": 10, "size": SIZE, "colors": COLORS, "view_from": (0, -1, 0), **more})


def test_frames_show_their_moments(rollout, tmp_path):
    """The same bytes each time; what a longer series left is gone, and what isn't of a series stays."""
    folder = tmp_path / "new/frames"
    told = []
    assert record(rollout, folder, progress=lambda *so_far: told.append(so_far)) == folder
    assert told == [(k + 1, 6) for k in range(6)]
    names = [f"frame_{k:05}.png" for k in range(6)]
    assert sorted(path.name for path in folder.iterdir()) == names
    pictures = [browser.pixels((folder / name).read_bytes()) for name in names]
    assert all(picture.shape == (SIZE[1], SIZE[0], 3) for picture in pictures)
    places = np.array([across(picture) for picture in pictures])
    # Straight across, a tenth of a second each: seen along y, right is along x.
    assert np.allclose(np.diff(places), np.diff(places).mean(), atol=1.0) and np.diff(places).mean() > 8.0
    before = [(folder / name).read_bytes() for name in names]
    (folder / "frame_00006.png").write_bytes(b"")
    (folder / "other.png").write_bytes(b"")
    record(rollout, f"{folder}/")
    assert [(folder / name).read_bytes() for name in names] == before
    assert sorted(path.name for path in folder.iterdir()) == [*names, "other.png"]


@pytest.mark.parametrize(("ending", "codec"), [(".mp4", "h264"), (".webm", "vp9")])
def test_videos(rollout, tmp_path, ending, codec):
    """As many pictures as asked for, of the size, at the rate, with the ball where it is then."""
    file = tmp_path / f"run{ending}"
    for _ in range(2):
        assert record(rollout, file, fps=20, speed=0.5) == file
    assert list(tmp_path.iterdir()) == [file]  # nothing half done stays behind
    pictures, (name, rate, lasts) = of_video(file)
    assert codec in name and rate == 20 and lasts == pytest.approx(21 / 20, abs=0.06)
    assert len(pictures) == 21 and all(picture.shape == (SIZE[1], SIZE[0], 3) for picture in pictures)
    places = np.array([across(picture) for picture in pictures])
    assert np.allclose(np.diff(places), np.diff(places).mean(), atol=1.2) and np.diff(places).mean() > 2.0


def test_moments_and_their_number():
    def times(fps, speed, last, first=0.0):
        return videos.Video.of("run.mp4", fps, speed, SIZE, False, 1.0, None).times(first, last)

    assert times(10, 1.0, 0.3) == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert times(10, 0.5, 0.12, 0.02) == pytest.approx([0.02, 0.07, 0.12])
    # What the last second isn't filled by has its last state.
    assert times(10, 1.0, 0.25) == pytest.approx([0.0, 0.1, 0.2, 0.25])
    assert times(30, 1.0, 0.0) == [0.0]
    # Rounding makes no picture more.
    assert len(times(30, 1.0, 4.2)) == 127
    with pytest.raises(hg.InputError, match="fps: got 30.0 and a speed of 1e-06, .* pictures; must be 108000 at most"):
        times(30, 1e-6, 1.0)


def test_the_camera_follows_and_nears(rollout, tmp_path):
    """The ball stays in the middle, and is larger."""
    record(rollout, tmp_path / "far")
    record(rollout, tmp_path / "near", follow="red", zoom=2.0)
    far, near = (
        [browser.pixels((tmp_path / folder / f"frame_{k:05}.png").read_bytes()) for k in (0, 5)] for folder in ("far", "near")
    )
    assert all(abs(across(picture) - SIZE[0] / 2) < 2.0 for picture in near)
    red = [(p.astype(int)[..., 0] > 90 + p.astype(int)[..., 1:].max(axis=-1)).sum() for p in (far[0], near[0])]
    assert 3.0 < red[1] / red[0] < 5.0


def test_the_panel_and_the_legend(tmp_path):
    """Without the panel there is the scale of what is drawn; where there is none there is nothing."""
    out = hg.Scene(steps=1)
    out.add(hg.Body(hg.sphere(0.1), name="red", density=998.0))
    made = hg.Simulator(out, fidelity="reduced", faces=80).with_start(v=[1.0, 0, 0, 0, 0, 0]).rollout()
    light = []
    for name, more in (("bare", {}), ("legend", {"pressure": True}), ("panel", {"panel": True})):
        record(made, tmp_path / name, size=(640, 400), fps=1, **more)
        picture = browser.pixels((tmp_path / name / "frame_00000.png").read_bytes())
        corner = picture[10:380, 420:].astype(int)
        light.append((corner.min(axis=-1) > 244).sum())
        # No buttons below: the sky's colour up to the edge, but for axes, scale and time.
        assert np.abs(picture[-3, 200:400].astype(int) - picture[-3, 200].astype(int)).max() < 60
    assert light[0] < 0.2 * light[1] and light[1] < 0.5 * light[2], light


def test_several_beside_each_other(rollout, tmp_path):
    """Both at the same moment in every picture; the shorter one stays at its end."""
    longer = rollout.simulator.rollout(steps=20)
    record([rollout, longer], tmp_path / "both", size=(840, 240), fps=2)
    pictures = [browser.pixels(path.read_bytes()) for path in sorted((tmp_path / "both").iterdir())]
    assert len(pictures) == 3
    left, right = (np.array([across(picture[:, at : at + 419]) for picture in pictures]) for at in (0, 421))
    assert np.allclose(left[:2], right[:2], atol=1.5) and abs(left[2] - left[1]) < 1.0 and right[2] > right[1] + 10


def test_where_an_event_loop_runs(rollout, tmp_path):
    """As in a notebook."""

    async def work():
        return record(rollout, tmp_path / "frames", fps=2)

    assert len(list(asyncio.run(work()).iterdir())) == 2


def test_a_view_records_itself(rollout, tmp_path):
    browser.find()
    view = hg.view(rollout, colors=COLORS, view_from=(0, -1, 0))
    file = view.record(tmp_path / "run.webm", fps=4, size=SIZE)
    pictures, _ = of_video(file)
    assert view.times == (0.0, 0.5) and len(pictures) == 3 and across(pictures[2]) > 30 + across(pictures[0])


def test_what_progress_raises_ends_it(rollout, tmp_path):
    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record(rollout, tmp_path / "run.mp4", progress=stop)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("file", "given", "says"),
    [
        ("run.avi", {}, r"file: got .*run.avi.*; must end in .mp4 or .webm, or be a folder"),
        ("run.mp4", {"fps": 0}, "fps: got 0; must be finite and positive, per second"),
        ("run.mp4", {"fps": np.nan}, "fps"),
        ("run.mp4", {"fps": "30"}, "fps"),
        ("run.mp4", {"speed": -1}, "speed: got -1"),
        ("run.mp4", {"zoom": np.inf}, "zoom"),
        ("run.mp4", {"size": (321, 240)}, r"size: got \(321, 240\); must be even numbers for a video"),
        ("run.mp4", {"size": (320,)}, r"size: got \(320,\); must be width and height, whole numbers of pixels from 16 to 7680"),
        ("frames", {"size": (8, 240)}, "size"),
        ("frames", {"size": (320.0, 240)}, "size"),
        ("frames", {"size": 320}, "size"),
        ("frames", {"follow": 3}, "follow: got 3; must be the name of a body"),
        ("frames", {"follow": "blue"}, r"follow: got a body 'blue'; must be one of \['red'\]"),
        ("frames", {"view_from": (0, 0, 0)}, "view_from"),
    ],
)
def test_wrong_input(rollout, tmp_path, monkeypatch, file, given, says):
    monkeypatch.setattr(videos, "_shoot", None)
    with pytest.raises(hg.InputError, match=says):
        record(rollout, tmp_path / file, **given)


def test_places_that_cannot_be(rollout, tmp_path):
    (tmp_path / "taken").write_text("x")
    (tmp_path / "folder.mp4").mkdir()
    with pytest.raises(hg.FileError, match="taken.* can't be written"):
        record(rollout, tmp_path / "taken/run.mp4")
    with pytest.raises(hg.FileError, match="taken can't be written"):
        record(rollout, tmp_path / "taken")
    with pytest.raises(hg.InputError, match="a folder; a video can't take its place"):
        record(rollout, tmp_path / "folder.mp4")


def test_what_it_needs_is_said_first(rollout, tmp_path, monkeypatch):
    """Before a page is made, let alone solved for."""
    monkeypatch.setattr("hydrograd._viewer.recording.view", None)
    for module, package, file in (("playwright.sync_api", "playwright", "frames"), ("av", "av", "run.mp4")):
        with monkeypatch.context() as without:
            without.setitem(sys.modules, module, None)
            with pytest.raises(ImportError, match=f"hydrograd.record needs {package}: pip install playwright av"):
                hg.record(rollout, tmp_path / file)
    with monkeypatch.context() as without:
        without.setenv("HYDROGRAD_BROWSER", "no-such-browser")
        with pytest.raises(hg.UnsupportedError, match="HYDROGRAD_BROWSER: got 'no-such-browser'"):
            hg.record(rollout, tmp_path / "frames")
    with monkeypatch.context() as without:
        without.delenv("HYDROGRAD_BROWSER", raising=False)
        without.setattr(videos, "BROWSERS", ("no-such-browser",))
        without.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path / "none"))
        with pytest.raises(hg.UnsupportedError, match="needs Chromium or Chrome.*apt-get install chromium"):
            hg.record(rollout, tmp_path / "frames")


def test_a_program_that_is_no_browser(rollout, tmp_path, monkeypatch):
    monkeypatch.setenv("HYDROGRAD_BROWSER", sys.executable)
    with pytest.raises(hg.UnsupportedError, match="doesn't start"):
        hg.record(rollout, tmp_path / "frames", fps=2)


def test_a_page_that_cannot_be_drawn(rollout, tmp_path, monkeypatch):
    browser.find()
    monkeypatch.setattr(videos, "OPTIONS", (*videos.OPTIONS, "--disable-3d-apis"))
    with pytest.raises(hg.UnsupportedError, match="record: The replay can't be shown"):
        hg.record(rollout, tmp_path / "run.mp4", fps=2)
    assert list(tmp_path.iterdir()) == []


def hydrograd(*arguments, **environment):
    script = pathlib.Path(sys.executable).parent / ("hydrograd.exe" if os.name == "nt" else "hydrograd")
    return subprocess.run([script, *arguments], capture_output=True, text=True, timeout=300, env={**os.environ, **environment})


def test_the_command_makes_them(tmp_path):
    browser.find()
    run = ("run", BALL, "--fidelity", "reduced", "--faces", "80", "--steps", "20")
    look = ("--video-fps", "10", "--video-size", "320x240", "--video-view", "1,-1,0.5", "--video-follow", "sphere", "--video-show", "pressure,forces")
    done = hydrograd(*run, "--video", tmp_path / "run.mp4", *look)
    assert done.returncode == 0, done.stderr
    assert str(tmp_path / "run.mp4") in done.stdout
    pictures, (name, rate, _) = of_video(tmp_path / "run.mp4")
    assert "h264" in name and rate == 10 and len(pictures) == 3 and pictures[0].shape == (240, 320, 3)
    assert np.abs(pictures[0].astype(int) - pictures[2]).max() > 60


@pytest.mark.parametrize(
    ("arguments", "environment", "says"),
    [
        (("--video", "run.avi"), {}, "must end in .mp4 or .webm"),
        (("--video", "run.mp4", "--video-size", "321x240"), {}, "must be even numbers"),
        (("--video", "run.mp4"), {"HYDROGRAD_BROWSER": "no-such-browser"}, "no-such-browser"),
        (("--video", "run.mp4", "--video-follow", "cube"), {}, "--video-follow: got cube; must be one of"),
    ],
)
def test_the_command_says_what_is_wrong_before_it_runs(tmp_path, arguments, environment, says):
    browser.find()
    done = subprocess.run(
        [sys.executable, "-m", "hydrograd", "run", str(BALL), "--steps", "1000000", *arguments],
        capture_output=True, text=True, timeout=60, cwd=tmp_path, env={**os.environ, **environment},
    )
    assert done.returncode == 1 and says in done.stderr and "Traceback" not in done.stderr, done.stderr


def test_every_kind_is_tested():
    assert set(KINDS) == {".mp4", ".webm"}


def test_an_encoder_that_is_not_there_leaves_nothing(tmp_path, monkeypatch):
    for form, codec in (("mp4", "nothing"), ("nothing", "libx264")):
        monkeypatch.setitem(KINDS, ".mp4", (form, codec, {"movflags": "+faststart"}))
        with pytest.raises(hg.UnsupportedError, match=f"{form} by {codec} is not available"):
            Encoded(tmp_path / "run.mp4", SIZE, 10.0).__enter__()
        assert list(tmp_path.iterdir()) == []
