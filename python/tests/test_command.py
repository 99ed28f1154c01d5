"""The command that the package brings."""

import json
import os
import pathlib
import subprocess
import sys

import numpy as np

import hydrograd as hg

BALL = pathlib.Path(__file__).parents[2] / "examples/scenes/falling_ball.toml"


def hydrograd(*arguments):
    script = pathlib.Path(sys.executable).parent / ("hydrograd.exe" if os.name == "nt" else "hydrograd")
    return subprocess.run([script, *arguments], capture_output=True, text=True, timeout=120)


def test_it_runs_what_the_package_runs():
    done = hydrograd("run", BALL, "--faces", "80", "--steps", "3", "--fidelity", "reduced", "--json")
    assert done.returncode == 0, done.stderr
    sim = hg.Simulator(hg.Scene.from_toml(BALL.read_text()), faces=80, fidelity="reduced")
    np.testing.assert_array_equal(json.loads(done.stdout)["final_q"], np.ravel(sim.rollout(steps=3).q[-1]))


def test_errors_have_codes_and_words():
    done = hydrograd("run", "nowhere.toml")
    assert done.returncode == 1 and "nowhere.toml" in done.stderr
    assert hydrograd("runn").returncode == 2
