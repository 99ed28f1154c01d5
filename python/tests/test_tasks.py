"""The tasks' scenes, and what it means to hold the coin."""

import pathlib
import re

import numpy as np
import pytest

import hydrograd as hg
from hydrograd.tasks import grasp, swimmer
from hydrograd.tasks._planar import ellipse_polygon_gap

FILE = pathlib.Path(__file__).parents[2] / "examples/scenes/grasp.toml"


def test_the_grasp_is_that_of_the_example():
    text, controller = FILE.read_text().split("[controller]")
    assert "speed-stages" in controller
    example = hg.Scene.from_toml(text)
    assert grasp.scene() == example
    assert grasp.scene().to_toml() == example.to_toml()
    assert grasp.scene(0.0).fluid.density == 0.0
    sim = hg.Simulator(grasp.scene(), fidelity="isolated")
    assert tuple(sim.q_names) == grasp.COORDINATES and sim.control_size == 3
    assert np.array_equal(sim.initial_q, grasp.START)


def test_gaps_are_distances():
    random = np.random.default_rng(0)
    corners = np.array([[0.0, -0.5], [1.0, -0.4], [1.2, 0.1], [0.3, 0.2]])
    share = np.linspace(0.0, 1.0, 500)[:, None]
    outline = np.concatenate([a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0))])
    around = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    ellipse = np.stack([0.05 * np.cos(around), 0.2 * np.sin(around)], axis=-1)
    apart = 0
    for _ in range(40):
        center, angle = random.uniform(-1.0, 1.5, 2), random.uniform(-4.0, 4.0)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        points = center + ellipse @ turn.T
        nearest = np.sqrt(((outline[:, None] - points[None, ::4]) ** 2).sum(-1)).min()
        gap = ellipse_polygon_gap(center, angle, (0.05, 0.2), corners)
        if gap > 0.0:
            apart += 1
            assert gap == pytest.approx(nearest, abs=3e-4)
        else:
            # Their outlines cross, or one lies in the other.
            assert gap > -0.5 and nearest < 0.5
    assert 20 < apart < 40


def test_gaps_overlap():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    # On its side above an edge: its second semi-axis reaches down.
    assert ellipse_polygon_gap((0.5, 1.1), 0.0, (0.05, 0.2), square) == pytest.approx(-0.1, abs=1e-9)
    assert ellipse_polygon_gap((0.5, 1.1), np.pi / 2, (0.05, 0.2), square) == pytest.approx(0.05, abs=1e-9)
    # Beside a corner, along the diagonal: a circle.
    assert ellipse_polygon_gap((2.0, 2.0), 0.3, (0.2, 0.2), square) == pytest.approx(np.sqrt(2.0) - 0.2, abs=1e-9)


@pytest.mark.parametrize(("until", "push", "since"), [(0.12, 850.0, 2.36), (0.08, 1000.0, 2.16)])
def test_hand_tuned_controllers_hold_the_coin_too_late(until, push, since):
    """By compressed sources alone, on the scene's own faces."""
    last = 0.18 if push < 900.0 else 0.2
    stages = (
        f"stages = [{{ until = {until}, control = [0.0, 400.0, -400.0] }}, "
        f"{{ until = {last}, control = [{push}, 400.0, -400.0] }}]"
    )
    scene = hg.Scene.from_toml(re.sub(r"stages = .*", stages, FILE.read_text()))
    rollout = hg.Simulator(scene, fidelity="reduced", films=False).rollout(steps=grasp.STEPS)
    assert grasp.held_since(rollout) == pytest.approx(since, abs=0.015)
    assert not grasp.caught(rollout)
    # The coin's gaps are those of its mesh, to what the mesh lies inside.
    apart = grasp.gaps(rollout.q).min(-1)
    assert np.abs(rollout.min_gap - apart).max() < 2e-3


def test_held():
    q = np.array([0.0, -0.065, 0.065, 1.4, 0.0, np.pi / 2])
    still = np.zeros(6)
    assert grasp.held(q, still)
    assert not grasp.held(q, np.array([0.0, 0.0, 0.0, 0.006, 0.0, 0.0]))
    assert not grasp.held(q, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.03]))  # the rim, 0.2 m out
    for entry, value in ((grasp.COIN_Y, 1.9), (grasp.FINGERS[0], -0.075), (grasp.COIN_Y, -0.1)):
        moved = q.copy()
        moved[entry] = value
        assert not grasp.held(moved, still)
    assert grasp.held(np.stack([q, moved]), np.stack([still, still])).tolist() == [True, False]


def test_the_swimmer_knows_where_its_links_are():
    sim = hg.Simulator(swimmer.scene(), fidelity="isolated")
    assert tuple(sim.q_names) == swimmer.COORDINATES
    q = np.array([0.3, -0.2, 0.5, 0.4, -0.7, 1.1])
    state = sim.state(q)
    # Bodies' origins are their hinges, but the head's, its centre.
    offset = np.array([0.0] + [-swimmer.HALF_LENGTH] * 3)[:, None]
    centers = state.positions + offset * state.rotations[:, :, 0]
    assert np.allclose(swimmer.centers(q), centers[:, :2], atol=1e-12)
    assert np.allclose(swimmer.center_of_mass(q), centers[:, :2].mean(0), atol=1e-12)
