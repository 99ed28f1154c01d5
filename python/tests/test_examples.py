"""The examples run and show what they say."""

import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).parents[2]


def test_falling_ball():
    command = [sys.executable, ROOT / "examples/falling_ball.py", "--faces", "80", "--steps", "12", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    full, isolated = json.loads(done.stdout)
    assert len(full["time"]) == 13
    # The water turns or presses the coin only where the bodies feel each other.
    assert max(map(abs, isolated["coin_angle"])) < 1e-9
    assert max(map(abs, full["coin_angle"])) > 1e-3


def test_replay(tmp_path):
    page = tmp_path / "ball.html"
    options = ["--fidelity", "full", "--faces", "80", "--steps", "3", "--flow", "x"]
    command = [sys.executable, ROOT / "examples/replay.py", ROOT / "examples/scenes/falling_ball.toml", page, *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "4 states" in done.stdout and page.stat().st_size > 500_000
