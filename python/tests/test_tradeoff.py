"""Time against error from Python."""

import pytest

import hydrograd as hg


def two_spheres(density=998.0):
    scene = hg.Scene(hg.Fluid(density), name="two", steps=4)
    scene.add(hg.Body(hg.sphere(1.0), density=1500.0, joint=hg.prismatic((1, 0, 0))))
    scene.add(hg.Body(hg.sphere(1.0), density=998.0, position=(2.5, 0, 0), joint=hg.prismatic((1, 0, 0))))
    scene.set_initial(v=[0.3, 0.0])
    return scene


def test_configurations_are_measured():
    found = hg.tradeoff(
        two_spheres(),
        fidelities=["isolated", "reduced"],
        methods=["exact"],
        ranks=[10, 40],
        accuracies=[1e-2],
        integrators=["rk2"],
        time_steps=[0.01],
        reference_faces=500,
        budget=20.0,
    )
    assert isinstance(found, hg.Tradeoff)
    assert found.scene == "two" and found.left_out == [] and found.budget == 20.0
    assert 0 < found.reference.added_mass.error_estimate < 0.05
    assert "500 faces a body" in found.reference.added_mass.what
    rows = {(r.fidelity, r.rank): r for r in found.rows}
    assert all(r.error is None and r.method == "exact" for r in found.rows)
    # Alone in the water, neither sphere feels the other; more points come nearer.
    errors = [rows[key].added_mass_rel_error for key in (("isolated", None), ("reduced", 10), ("reduced", 40))]
    assert errors[0] > 0.05 > errors[1] > errors[2]
    for row in found.rows:
        assert 0 < row.ms_per_step < row.ms_per_gradient_step
        assert row.integrator == "rk2" and row.time_step == 0.01
    front = [r for r in found.rows if r.pareto]
    assert front and min(found.rows, key=lambda r: r.ms_per_step) in front
    with pytest.raises(AttributeError):
        front[0].ms_per_step = 0.0


def test_wrong_choices_are_told():
    scene = two_spheres()
    for keywords, words in [
        ({"fidelities": ["fulll"]}, ["fidelities", "fulll", "full"]),
        ({"methods": ["best"]}, ["methods", "best", "panel"]),
        ({"ranks": [0]}, ["ranks", "above zero"]),
        ({"accuracies": [2.0]}, ["accuracies", "between 0 and 1"]),
        ({"budget": -1.0}, ["budget", "above zero"]),
    ]:
        with pytest.raises(hg.InputError) as raised:
            hg.tradeoff(scene, **keywords)
        assert all(word in str(raised.value) for word in words), raised.value
    with pytest.raises(hg.InputError, match="without water"):
        hg.tradeoff(two_spheres(density=0.0))
