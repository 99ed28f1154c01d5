"""The examples run, small, and show what they say."""

import importlib
import json
import math
import os
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
    closing = re.fullmatch(r"found by descent: lost \(.*\), cost 12\.9 -> (\d+\.\d+)", said[-2])
    assert closing and float(closing[1]) < 12.9


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
    found = json.loads(run("system_id", tmp_path, "--recordings", 1, "--json"))
    fit = found["fit"]
    assert (
        found["within_two"]
        and fit["mass"] == pytest.approx(0.030, rel=0.02)
        and fit["drag"] == pytest.approx(0.4, rel=0.1)
    )
    assert fit["simulations"] < 20
    assert fit["mass_standard_error"] == pytest.approx(0.143e-3, rel=0.02)
    assert fit["drag_standard_error"] == pytest.approx(0.0093, rel=0.03)
    assert 0.7 < fit["chi_squared"] < 1.3 and fit["correlation"] == pytest.approx(0.98, abs=0.01)


def test_swimmer_codesign(tmp_path):
    """Few iterations; the whole of it says 44 %."""
    pytest.importorskip("scipy")
    assert json.loads(said_by_check("swimmer_codesign"))["off"] < 1e-6
    found = json.loads(run("swimmer_codesign", tmp_path, "--quick", "--json"))
    before, after = found["alone"], found["together"]
    assert found["gain"] > 0.2 and before["distance"] > 2.0 * found["start"] and after["work"] < before["work"]
    for own in (before, after):
        assert np.linalg.norm(own["torques"]) == pytest.approx(own["effort"])
        # As heavy as ever.
        assert np.dot(own["widths"], own["heights"]) == pytest.approx(3.0 / 180.0)


def test_finger_codesign(tmp_path):
    """Few iterations; the whole of it says 31 % and 41 %."""
    pytest.importorskip("scipy")
    off = json.loads(said_by_check("finger_codesign"))
    assert off["forces"] < 1e-6 and off["shape"] < 0.02
    found = json.loads(run("finger_codesign", tmp_path, "--quick", "--json"))
    assert all(gain > 0.05 for gain in found["gains"].values())
    for own in (found["alone"], found["together"]):
        assert np.linalg.norm(own["forces"]) == pytest.approx(own["effort"])
        assert np.prod(own["size"]) == pytest.approx(6e-4) and own["size"][0] > 0.0599


def said_by_check(name):
    command = [sys.executable, ROOT / f"examples/{name}.py", "--check", "--json"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_rov(tmp_path):
    """Once it has learnt the current, MPC holds the vehicle as well as tuned PIDs and arrives sooner; without, it stays off."""
    found = json.loads(run("rov", tmp_path, "--quick", "--json"))
    pid, mpc, learning = (found[name] for name in ("pid", "mpc", "mpc, learning"))
    for own in found.values():
        # Limits are reached on the way there, and not exceeded.
        assert 39.0 < own["thrust_most_N"] <= 40.0 + 1e-9 and own["torque_most_Nm"] <= 9.0 + 1e-9
        assert own["gap_least_mm"] > 40.0 and own["hand_to_wall_least_mm"] > 85.0
    assert learning["place_mm"]["rms"] < 5.0 and learning["place_mm"]["worst"] < 14.0
    assert learning["heading_deg"]["worst"] < 0.5 and learning["hand_mm"]["rms"] < 2.0
    assert learning["place_mm"]["rms"] < 1.1 * pid["place_mm"]["rms"] and pid["place_mm"]["rms"] < 0.6 * mpc["place_mm"]["rms"]
    assert learning["cost"] < 0.98 * pid["cost"] and learning["arrived_s"] < pid["arrived_s"]
    # What it isn't better at: the fingertip, which a stiff PID of the arm keeps.
    assert pid["hand_mm"]["rms"] < learning["hand_mm"]["rms"] < mpc["hand_mm"]["rms"]
    # It takes the plant's drag, a fifth larger than the model's, for some more current.
    for learnt, (y, z) in zip(learning["currents_learnt"], ((0.25, 0.0), (-0.2, 0.1))):
        assert abs(learnt[0] - y) < 0.03 and abs(learnt[1] - z) < 0.02
    assert mpc["plans"] == learning["plans"] == 50 and mpc["plans_failed"] == learning["plans_failed"] == 0


# Recordings of the tanks, where a folder with them is given.
TANKS = pathlib.Path(os.environ.get("HYDROGRAD_RECORDINGS", "recordings"))


def refused(name, *options):
    """What an example says of what it can't use."""
    command = [sys.executable, ROOT / f"examples/{name}.py", *options]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 1
    return last_line(done.stderr)


def test_uvms_on_recordings_of_our_own(tmp_path):
    found = json.loads(run("uvms", tmp_path, "--quick", "--json"))
    for u in found["unknowns"]:
        assert abs(u["value"] - u["truth"]) < 4.0 * u["standard_error"], u
    dynamic, still, documented = (found[m]["unseen"] for m in ("dynamic", "equilibrium", "documented"))
    for angle in ("roll", "pitch"):
        assert dynamic[angle] < 0.1 and dynamic[angle] < 0.7 * still[angle] < documented[angle]
    assert found["identification"]["simulations"] <= 60


def test_uvms_reads_any_folder_of_that_form(tmp_path):
    command = [sys.executable, ROOT / "examples/uvms.py", "--make", tmp_path / "tank", "--quick"]
    subprocess.run(list(map(str, command)), check=True, capture_output=True)
    tank = tmp_path / "tank"
    assert "made-3" in refused("uvms", "--data", tank, "--only", "made-3")
    file = tank / "runs/made-1.csv"
    text = file.read_text()
    file.write_text(text.replace("imu_roll", "imu_rol", 1))
    said = refused("uvms", "--data", tank)
    assert "made-1.csv" in said and "'imu_roll'" in said
    lines = text.split("\n")
    lines[7] = lines[7].replace(",", ",x", 1)
    file.write_text("\n".join(lines))
    assert "column" in (said := refused("uvms", "--data", tank)) and "line 8" in said
    file.write_text("\n".join(text.split("\n")[:40]))
    assert "'free'" in refused("uvms", "--data", tank)
    file.write_text(text)
    # Without training runs it predicts with what was found in the tank; with constants, with those.
    other = json.loads(run("uvms", tmp_path, "--data", tank, "--only", "made-1", "--json"))
    assert other["training"] == [] and other["unseen"] == ["made-1"]
    other["constants"]["zero of joint5"] = 0.3
    (tmp_path / "constants.json").write_text(json.dumps(other))
    given = json.loads(run("uvms", tmp_path, "--data", tank, "--only", "made-1", "--constants", tmp_path / "constants.json", "--json"))
    assert given["dynamic"]["runs"]["made-1"]["roll"] != other["dynamic"]["runs"]["made-1"]["roll"]
    (tank / "blue_rov_hardware_fixedjaw.urdf").unlink()
    assert "urdf" in refused("uvms", "--data", tank)


@pytest.mark.skipif(not (TANKS / "uvms").is_dir(), reason="the recordings aren't here")
def test_uvms_in_its_tank(tmp_path):
    runs = ["006-1", "014-1", "020-0"]
    found = json.loads(run("uvms", tmp_path, "--data", TANKS / "uvms", "--only", *runs, "--train", *runs[:2], "--json"))
    dynamic, still = found["dynamic"]["runs"], found["equilibrium"]["runs"]
    assert dynamic["014-1"]["pitch"] < 0.5 * still["014-1"]["pitch"]
    assert dynamic["020-0"]["roll"] < 0.6 and dynamic["020-0"]["pitch"] < 0.6


def slopes(sim, names, observed, h=1e-5):
    """Derivatives of what is observed by parameters, by central differences, each in parts of the parameter's size."""
    columns = []
    for name in names:
        at = sim.parameters[name]
        step = h * max(abs(at), 1e-3)
        ends = [observed(sim.with_parameters({name: at + s * step})) for s in (1.0, -1.0)]
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    return np.stack(columns, axis=-1)


def test_jacobians_of_both_tanks(tmp_path, monkeypatch):
    """Exact ones against differences, 1e-6 of the largest in each column."""
    monkeypatch.syspath_prepend(ROOT / "examples")
    uvms, fish = (importlib.import_module(name) for name in ("uvms", "fish_tank"))
    recordings, urdf = uvms.folder(uvms.make(tmp_path, ["014-1"], 4.0))
    sim = uvms.truth_of(uvms.prepare(recordings["014-1"], urdf))
    names = [f"{uvms.VEHICLE}.center_of_buoyancy.y", f"{uvms.VEHICLE}.inertia.yy", "water.linear.wx"]
    steps = recordings["014-1"].steps
    rollout = sim.rollout(steps=steps)
    exact = rollout.jacobian(of=["attitudes"], parameters=names, states=[steps])["attitudes"][0, 0]
    found = slopes(sim, names, lambda s: s.rollout(steps=steps).observe("attitudes")[-1, 0])
    assert np.all(np.abs(exact - found) < 1e-6 * np.abs(found).max(axis=0))
    for drive, names in (("angles", ["along.linear.x", "edge.factor"]), ("tendons", ["tendons.gain", "body 3.quadratic.y"])):
        swim = fish.Swim(drive, 0.75)
        short = {"controls": swim.controls[:150]} if drive == "tendons" else {"steps": 150}
        rollout = swim.sim.rollout(**short)
        exact = rollout.jacobian(of=["site_positions"], parameters=names, states=[150])["site_positions"][0, 8]
        found = slopes(swim.sim, names, lambda s: s.rollout(**short).observe("site_positions")[-1, 8])
        assert np.all(np.abs(exact - found) < 1e-6 * np.abs(found).max(axis=0)), (drive, exact, found)


def test_fish_on_tracks_of_our_own(tmp_path):
    found = json.loads(run("fish_tank", tmp_path, "--quick", "--drive", "angles", "--json"))
    drive = found["drives"]["angles"]
    for c in drive["coefficients"]:
        assert abs(c["value"] - c["truth"]) < 4.0 * c["standard_error"], c
    errors = drive["errors"]
    assert errors["speed"] < 0.002 and errors["tip"] < 0.05 and errors["yaw"] < 0.5 and errors["sway"] < 0.003


def test_fish_tells_what_is_wrong_with_tracks(tmp_path):
    command = [sys.executable, ROOT / "examples/fish_tank.py", "--make", tmp_path, "--quick"]
    subprocess.run(list(map(str, command)), check=True, capture_output=True)
    file = tmp_path / "tracks/f1_50.csv"
    text = file.read_text()
    file.write_text(text.replace("y8", "z8", 1))
    said = refused("fish_tank", "--data", tmp_path)
    assert "f1_50.csv" in said and "'y8'" in said
    file.write_text(text)
    # Without training films it predicts with what was found in the tank.
    other = json.loads(run("fish_tank", tmp_path, "--data", tmp_path, "--train", "f0_75", "f1_50", "--drive", "angles", "--json"))
    assert other["training"] == [] and other["unseen"] == ["f1_00", "f1_75"]
    file.rename(file.with_name("fast.csv"))
    assert "fast.csv" in refused("fish_tank", "--data", tmp_path)


@pytest.mark.skipif(not (TANKS / "fish").is_dir(), reason="the tracks aren't here")
def test_fish_in_its_tank(tmp_path):
    found = json.loads(run("fish_tank", tmp_path, "--data", TANKS / "fish", "--drive", "angles", "--json"))
    errors = found["drives"]["angles"]["errors"]
    assert errors["speed"] < 0.010 and errors["tip"] < 0.1 and errors["yaw"] < 1.5
    assert found["drives"]["angles"]["seconds"] < 60.0


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


@pytest.mark.parametrize("page", ["control", "identification"])
def test_what_is_shown_on_pages(page):
    """Their programs run, and hold what they assert."""
    (block,) = re.findall(r"^```python\n(.*?)^```", (ROOT / f"docs/{page}.md").read_text(), re.MULTILINE | re.DOTALL)
    exec(block, {})


def test_what_is_shown_of_replays(tmp_path, monkeypatch):
    """The programs in docs/viewer.md run."""
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/viewer.md").read_text(), re.MULTILINE | re.DOTALL)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    exec(blocks[0], {})
    scene = hg.Scene.load("examples/scenes/falling_ball.toml")
    rollout = hg.Simulator(scene, fidelity="full", faces=80).rollout(steps=2)
    names = {"np": np, "hg": hg, "rollout": rollout}
    # Videos are made by test_video.py.
    shown = [block for block in blocks[1:] if "hg.record" not in block]
    for block in shown:
        exec(block, names)
        assert {path.name for path in tmp_path.glob("*.html")} == {"grasp.html", "ball.html"}
        (tmp_path / "ball.html").unlink()
        names["points"] = np.array([[0.0, 0.6, 0.3]])
    assert len(shown) == 3 and len(blocks) == 5


def test_what_is_shown_of_pressures(capsys):
    """The programs in docs/pressure.md run."""
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/pressure.md").read_text(), re.MULTILINE | re.DOTALL)
    scene = hg.Scene.load(ROOT / "examples/scenes/falling_ball.toml")
    rollout = hg.Simulator(scene, fidelity="reduced", faces=80).rollout(steps=2)
    points, plotted = np.array([[0.0, 1.5, 0.0], [0.0, -1.0, 0.3]]), []
    names = {"hg": hg, "rollout": rollout, "state": 1, "points": points, "seeds": points, "measured": 0.0, "plot": plotted.append}
    for block in blocks[:3]:
        exec(block, names)
    assert "coin" in capsys.readouterr().out
    assert names["u"].shape == (2, 3) and names["p"].shape == names["known"].shape == (2,)
    # A body that is there, and a place beside it.
    exec(blocks[3].replace('[[0.0, 0.05, 0.0]], "fin"', '[[0.0, 3.0, 0.0]], "sphere"'), names)
    assert names["u"].shape == (3, 1, 3) and np.isfinite(rollout.value(names["goal"]))
    exec(blocks[4], names)
    assert len(plotted) == len(names["paths"]) == 2
    assert len(blocks) == 5
