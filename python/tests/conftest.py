"""Scenes that several tests run."""

import numpy as np
import pytest

import hydrograd as hg


def two_bodies() -> hg.Scene:
    """A driven ball beside a free coin, with drag, in a current."""
    scene = hg.Scene(hg.Fluid(998.0, current=(0.02, 0.0, 0.0)), gravity=(0.0, 0.0, -0.1), steps=7)
    drag = hg.Drag(linear=20.0, part="total", quadratic=0.5, quadratic_part="total")
    ball = hg.Body(hg.sphere(0.05), name="ball", density=1100.0, position=(-0.12, 0.0, 0.0), actuated=True)
    coin = hg.Body(hg.ellipsoid(0.02, 0.04, 0.04), name="coin", density=1050.0, drag=drag, position=(0.01, 0.0, 0.02))
    scene.add(ball)
    scene.add(coin)
    return scene


@pytest.fixture(scope="session")
def sim() -> hg.Simulator:
    """The two bodies, coupled through the water."""
    return hg.Simulator(two_bodies(), 0.01, fidelity="full", faces=80, tolerance=1e-12)


@pytest.fixture
def controls() -> np.ndarray:
    """Seven steps of a push that turns (N, N m)."""
    random = np.random.default_rng(3)
    return random.normal(scale=[0.5] * 3 + [0.01] * 3, size=(7, 6))
