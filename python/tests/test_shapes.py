"""Shapes as parameters."""

import numpy as np
import pytest

import hydrograd as hg


def scene() -> hg.Scene:
    out = hg.Scene(steps=10, time_step=0.02)
    out.add(hg.Body(hg.box(0.4, 0.7, 0.2, faces=80), name="finger", density=1200.0))
    out.set_initial(v=[0.3, -0.2, 0.25, 0.5, 0.4, -0.6])
    return out


def test_a_gradient_has_entries_for_shapes():
    """Held against differences of scenes that are made anew."""

    def end(scene, **settings):
        rollout = hg.Simulator(scene, fidelity="isolated", **settings).rollout()
        seed = np.zeros_like(rollout.positions)
        seed[-1, 0] = [1.0, 2.0, -1.0]
        return rollout, seed

    own = scene()
    rollout, seed = end(own, shape_parameters=["finger"])
    gradient = rollout.vjp(positions=seed).parameters
    assert {name for name in gradient if "size" in name} == set(own.shape_parameters)
    for name, value in own.shape_parameters.items():
        h = 1e-4 * value
        ends = [float((end(own.with_shape_parameters({name: value + t}))[0].positions * seed).sum()) for t in (h, -h)]
        assert gradient[name] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-5)


def test_scenes_of_other_shapes():
    own = scene()
    assert own.shape_parameters == {"finger.size.x": 0.4, "finger.size.y": 0.7, "finger.size.z": 0.2}
    other = own.with_shape_parameters({"finger.size.x": 0.5, "finger.size.z": 0.1})
    assert other.shape_parameters == {"finger.size.x": 0.5, "finger.size.y": 0.7, "finger.size.z": 0.1}
    assert own.shape_parameters["finger.size.x"] == 0.4


@pytest.mark.parametrize(
    ("values", "says"),
    [({"finger.size.y": -0.1}, "finger.size.y"), ({"finger.size.y": np.nan}, "finger.size.y"), ({"finger.radius": 1.0}, "finger.size.x")],
)
def test_shapes_that_cannot_be(values, says):
    with pytest.raises(hg.InputError, match=says):
        scene().with_shape_parameters(values)


def test_names_that_no_shape_has():
    with pytest.raises(hg.InputError, match="finger.radius.*finger.size.x"):
        hg.Simulator(scene(), shape_parameters=["finger.radius"])


def test_a_shape_is_changed_in_the_scene():
    sim = hg.Simulator(scene(), fidelity="isolated", shape_parameters=["*"])
    assert sim.parameters["finger.size.y"] == 0.7
    with pytest.raises(hg.InputError, match="change the shape in the scene"):
        sim.with_parameters({"finger.size.y": 0.8})
