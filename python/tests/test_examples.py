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
