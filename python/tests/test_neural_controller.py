"""The example that trains a network through the water, with few iterations."""

import importlib.util
import json
import pathlib
import re
import sys

import pytest

pytest.importorskip("torch")
pytest.importorskip("matplotlib")

FILE = pathlib.Path(__file__).parents[2] / "examples/neural_controller.py"


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("neural_controller", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sim = module.simulator()
    module.simulator = lambda: sim
    return module


def run(example, monkeypatch, capsys, *options):
    few = ["--iterations", "3", "--starts", "2", "--unseen", "2", "--rate", "3e-3"]
    monkeypatch.setattr(sys, "argv", ["neural_controller.py", *few, *map(str, options)])
    example.main()
    return capsys.readouterr()


def test_the_cost_falls_and_the_last_line_says_so(example, monkeypatch, capsys, tmp_path):
    file = tmp_path / "new" / "curve.svg"
    said = run(example, monkeypatch, capsys, "--out", file)
    number = r"(\d+\.\d+)"
    line = (
        rf"2 unseen starts: mean cost {number} untrained, {number} trained, {number} times less; coin off its place "
        rf"by at most {number} mm, {number} mm; 3 iterations of 2 starts in \d+ s; wrote (.*)"
    )
    found = re.fullmatch(line, said.out.splitlines()[-1])
    assert found, said.out
    untrained, trained, times, miss, less, name = found.groups()
    assert float(trained) < 0.8 * float(untrained) and float(less) < float(miss)
    assert abs(float(untrained) / float(trained) / float(times) - 1.0) < 0.05
    assert name == str(file) and "<svg" in file.read_text()
    assert said.err.count("iteration") == 3

    # Again, to the last bit.
    again = json.loads(run(example, monkeypatch, capsys, "--json", "--out", file).out)
    assert f"{again['untrained_cost']:.2f}" == untrained and f"{again['trained_cost']:.2f}" == trained
    # Nothing touched: surfaces do so at 15 mm, where the cost would be another.
    assert again["untrained_nearest_mm"] > 20.0 and again["trained_nearest_mm"] > 20.0
    assert [f"{cost:9.4f}" in said.err for cost in again["history"]] == [True] * 3


def test_wrong_options(example, monkeypatch, capsys):
    with pytest.raises(SystemExit):
        run(example, monkeypatch, capsys, "--starts", "0")
    assert "--starts: got 0; must be at least 1" in capsys.readouterr().err
