"""The examples run, small, and show what they say."""

import json
import math
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

import hydrograd as hg
from hydrograd.tasks import grasp

ROOT = pathlib.Path(__file__).parents[2]


def run(name, folder, *options):
    """What an example prints; its picture, where Matplotlib is there, lies in the folder."""
    picture = folder / f"{name}.svg"
    command = [sys.executable, ROOT / f"examples/{name}.py", "--out", picture, *options]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        assert "matplotlib isn't installed" in done.stderr
    else:
        assert "</svg>" in picture.read_text()
    return done.stdout


def last_line(printed):
    return printed.strip().split("\n")[-1]


def test_falling_ball(tmp_path):
    full, isolated = json.loads(run("falling_ball", tmp_path, "--faces", 80, "--steps", 12, "--json"))
    assert len(full["time"]) == 13
    # The water turns or presses the coin only where the bodies feel each other.
    assert max(map(abs, isolated["coin_angle"])) < 1e-9
    assert max(map(abs, full["coin_angle"])) > 1e-3
    said = last_line(run("falling_ball", tmp_path, "--faces", 80, "--steps", 3))
    assert said.startswith("isolated  coin at 0.03 s: +0.00° and 0.1050 m above the floor   (")


def test_grasp(tmp_path):
    """The beginning; all of it takes half a minute."""
    pytest.importorskip("scipy")
    said = run("grasp", tmp_path, "--approach", 2, "--hold", 0).split("\n")
    assert said[0] == "naive push without water: caught"
    assert said[1] == "naive push in water: lost"
    closing = re.fullmatch(r"found by descent: lost \(.*\), cost 13\.0 -> (\d+\.\d+)", said[-2])
    assert closing and float(closing[1]) < 13.0


def test_a_random_grasp():
    """The first of those that are drawn, with few pushes."""
    command = [sys.executable, ROOT / "examples/grasp.py", "--random", 1, "--pushes", 6, "--json"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (found,) = json.loads(done.stdout)
    assert found["simulations"] >= 6 and found["caught"], found


def test_the_grasps_cost():
    """Its gradient is that of differences, and it knows a good place."""
    pytest.importorskip("scipy")
    from importlib import util

    spec = util.spec_from_file_location("grasp_example", ROOT / "examples/grasp.py")
    example = util.module_from_spec(spec)
    sys.modules[spec.name] = example
    spec.loader.exec_module(example)
    sim = hg.Simulator(grasp.scene(), fidelity="isolated")
    knots, goal = example.Knots(20), example.Hold(0.12, 1.25, 0.7, 90.0, 0.05, 0.05, 0.05, 0.05, 0.1, 100.0)
    random = np.random.default_rng(0)
    x, direction = random.normal(scale=0.5, size=(2, 33))

    def cost(x):
        return goal.of(sim.rollout(knots.controls(x)))

    value, controls_bar = cost(x)
    slope = knots.controls_vjp(x, controls_bar) @ direction
    differences = [(cost(x + h * direction)[0] - cost(x - h * direction)[0]) / (2.0 * h) for h in (1e-3, 1e-4)]
    assert slope == pytest.approx(differences[1], rel=1e-6) and abs(slope) > 1e-3 * value
    assert np.allclose(knots.through(knots.controls(x))[:3], x[:3]) and np.abs(knots.controls(9.0 * x)).max() <= 500.0


def test_system_id(tmp_path):
    pytest.importorskip("scipy")
    found = json.loads(run("system_id", tmp_path, "--recordings", 1, "--json"))
    fit = found["fit"]
    assert (
        found["within_two"]
        and fit["mass"] == pytest.approx(0.030, rel=0.02)
        and fit["drag"] == pytest.approx(0.4, rel=0.1)
    )
    assert fit["mass_standard_error"] == pytest.approx(0.143e-3, rel=0.02)
    assert fit["drag_standard_error"] == pytest.approx(0.0093, rel=0.03)
    assert 0.7 < fit["chi_squared"] < 1.3 and fit["correlation"] == pytest.approx(0.98, abs=0.01)


def study(tmp_path, *options):
    said = last_line(run("ray_study", tmp_path, "--gaps", 2, "--densities", 2, "--descent", 2, *options))
    form = r"mean squared miss (\S+) -> (\S+) rad² in 2 steps; digest ([0-9a-f]{16})"
    before, after, digest = re.fullmatch(form, said).groups()
    assert math.isfinite(float(before)) and 0.0 < float(after) < float(before)
    return said


def test_the_study_over_ray_is_that_without(tmp_path):
    serial = study(tmp_path, "--serial")
    pytest.importorskip("ray")
    assert study(tmp_path, "--workers", 2) == serial


def test_the_study_without_ray_says_what_is_missing():
    hidden = "import sys, runpy; sys.modules['ray'] = None; sys.argv = ['ray_study.py']; "
    code = hidden + f"runpy.run_path({str(ROOT / 'examples/ray_study.py')!r}, run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.strip() == "this example needs Ray (pip install ray), or --serial"


def test_the_bench_of_batches():
    """Small: what it measures is the same to the bit, however many cores."""
    command = [sys.executable, ROOT / "benches/batch.py", "--rollouts", 3, "--steps", 5, "--rounds", 2]
    command += ["--fidelity", "isolated", "--json"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["same_to_the_bit"] and set(found["cores"]) == {"1", "2"}


def test_replay(tmp_path):
    page = tmp_path / "ball.html"
    options = ["--fidelity", "full", "--faces", "80", "--steps", "3", "--flow", "x"]
    command = [sys.executable, ROOT / "examples/replay.py", ROOT / "examples/scenes/falling_ball.toml", page, *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "4 states" in done.stdout and page.stat().st_size > 500_000


def test_cookbook(tmp_path, monkeypatch):
    """The programs in docs/cookbook.md run, one after the other, and hold what they assert."""
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/cookbook.md").read_text(), re.MULTILINE | re.DOTALL)
    assert len(blocks) > 9
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in blocks:
        exec(block, names)
    assert (tmp_path / "run.html").stat().st_size > 500_000


def test_what_is_shown_of_control():
    """The program in docs/control.md runs, and holds what it asserts."""
    (block,) = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/control.md").read_text(), re.MULTILINE | re.DOTALL)
    exec(block, {})


def test_what_is_shown_of_replays(tmp_path, monkeypatch):
    """The programs in docs/viewer.md run."""
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/viewer.md").read_text(), re.MULTILINE | re.DOTALL)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    exec(blocks[0], {})
    scene = hg.Scene.load("examples/scenes/falling_ball.toml")
    rollout = hg.Simulator(scene, fidelity="full", faces=80).rollout(steps=2)
    exec(blocks[1], {"np": np, "hg": hg, "rollout": rollout})
    assert {path.name for path in tmp_path.glob("*.html")} == {"grasp.html", "ball.html"}
    assert len(blocks) == 2
