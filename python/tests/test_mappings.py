"""Where a dictionary of names is wanted any mapping does."""

from types import MappingProxyType as View

import numpy as np
import pytest

import hydrograd as hg


def test_mappings_are_dictionaries(sim, controls, tmp_path):
    changes = {"ball.mass": 0.7, "fluid.density": np.float64(990.0)}
    assert sim.with_parameters(View(changes)).parameters == sim.with_parameters(changes).parameters
    rollout = sim.rollout(controls)
    names = {"ball.mass": 1.0, "fluid.density": 2.0}
    assert np.array_equal(rollout.jvp(parameters=View(names)).q, rollout.jvp(parameters=names).q)
    bars = {"velocities": np.ones((8, 2, 6))}
    one, other = rollout.vjp(observables=View(bars)), rollout.vjp(observables=bars)
    assert np.array_equal(one.controls, other.controls) and np.abs(one.controls).max() > 0
    record = sim.step(sim.state(), controls[0])[1]
    for one, other in zip(record.jvp(parameters=View(names)), record.jvp(parameters=names)):
        assert np.array_equal(one, other)
    assert hg.optimize.Unknown("mass", sets=View({"ball.mass": 1.0}), sets_start=View({"ball.x": 1.0})).name == "mass"
    paths = [rollout.write_gltf(tmp_path / f"{k}.glb", colors=c) for k, c in enumerate(({"ball": "#ff0000"}, None))]
    paths.append(rollout.write_gltf(tmp_path / "2.glb", colors=View({"ball": "#ff0000"})))
    red, plain, seen = (path.read_bytes() for path in paths)
    assert seen == red != plain
    thinner = View({"coin.semi_axes.x": 0.01})
    assert sim.scene.with_shape_parameters(thinner).shape_parameters["coin.semi_axes.x"] == 0.01


def test_a_tendon_takes_its_arms_as_any_mapping():
    def text(arms):
        scene = hg.Scene()
        scene.add(hg.Body(hg.sphere(0.05), name="arm", density=1000.0, joint=hg.revolute((0, 0, 1))))
        scene.add_force("tendon", arms=arms, stiffness=10.0, damping=0.1, gain=0.01)
        return scene.to_toml()

    assert text(View({"arm": 0.02})) == text({"arm": 0.02})


def test_what_is_no_mapping_is_told(sim, controls):
    rollout = sim.rollout(controls)
    record = sim.step(sim.state())[1]
    scene = sim.scene
    calls = [
        ("with_parameters", lambda given: sim.with_parameters(given)),
        ("with_shape_parameters", lambda given: scene.with_shape_parameters(given)),
        ("jvp: parameters", lambda given: rollout.jvp(parameters=given)),
        ("jvp: parameters", lambda given: record.jvp(parameters=given)),
        ("vjp: observables", lambda given: rollout.vjp(observables=given)),
        ("write_gltf: colors", lambda given: rollout.write_gltf("never.glb", colors=given)),
        ('unknown "k": sets', lambda given: hg.optimize.Unknown("k", sets=given)),
        ('unknown "k": sets_start', lambda given: hg.optimize.Unknown("k", sets_start=given)),
    ]
    for place, call in calls:
        with pytest.raises(hg.InputError, match=f"{place}: got a value of type list; must be a mapping of names"):
            call([1.0])
        with pytest.raises(hg.InputError, match=f"{place}: got 3; must have names as keys"):
            call({3: 1.0})
    with pytest.raises(hg.InputError, match=r'with_parameters\["ball.mass"\]: got \'heavy\'; must be a number'):
        sim.with_parameters({"ball.mass": "heavy"})
    with pytest.raises(hg.InputError, match=r'write_gltf: colors\["ball"\]: got 1; must be a text'):
        rollout.write_gltf("never.glb", colors={"ball": 1})
