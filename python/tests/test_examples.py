"""The examples run and show what they say."""

import json
import pathlib
import re
import subprocess
import sys

import numpy as np

import hydrograd as hg

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
