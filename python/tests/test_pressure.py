"""Pressure on bodies and around them, as NumPy arrays."""

import numpy as np
import pytest

import hydrograd as hg

RADIUS = 0.2


@pytest.fixture(scope="module")
def rollout():
    """A heavy sphere that falls past a light one."""
    scene = hg.Scene(fluid=hg.Fluid(density=998.0), gravity=(0, 0, -9.81))
    for name, x, density in [("heavy", 0.0, 2000.0), ("light", 0.6, 500.0)]:
        scene.add(hg.Body(hg.sphere(RADIUS, faces=320), name=name, density=density, position=(x, 0, 0)))
    sim = hg.Simulator(scene, dt=0.01, fidelity="reduced")
    return sim.rollout(steps=20)


def test_pressures_add_up_to_what_the_water_does(rollout):
    surfaces = rollout.pressure(-2)
    assert [p.name for p in surfaces] == ["heavy", "light"]
    water = rollout.loads(-2).wrenches("water")
    poses = rollout.observe("positions")[-2]
    for p, right, origin in zip(surfaces, water, poses, strict=True):
        n = len(p.areas)
        assert p.centres.shape == p.normals.shape == p.velocities.shape == (n, 3)
        assert p.pressures.shape == p.hydrostatic.shape == (n,)
        forces = -p.normals * (p.pressures * p.areas)[:, None]
        by_hand = np.concatenate([forces.sum(0), np.cross(p.centres - origin, forces).sum(0)])
        assert p.wrench == pytest.approx(by_hand, abs=1e-9)
        assert p.wrench == pytest.approx(right, abs=4e-3 * np.abs(water).max())
        lifted = 998.0 * 9.81 * 4 / 3 * np.pi * RADIUS**3
        assert p.hydrostatic_wrench[2] == pytest.approx(lifted, rel=1e-2)


def test_the_pressure_around_goes_over_into_that_on_the_body(rollout):
    p = rollout.pressure(-2)[0]
    beside = rollout.flow_pressure(-2, p.centres + 1e-6 * p.normals)
    assert beside == pytest.approx(p.pressures, abs=1e-2 * np.abs(p.pressures).max())
    far = rollout.flow_pressure(-2, [(0.0, 50.0, 0.0)])
    assert abs(far[0]) < 1e-3 * np.abs(p.pressures).max()
    velocities = rollout.flow(-2, p.centres + 1e-6 * p.normals)
    assert velocities == pytest.approx(p.velocities, abs=1e-2 * np.abs(p.velocities).max())


def test_pressures_are_recorded_beside_the_rest(rollout):
    table = rollout.to_dict(pressure=True)
    assert set(rollout.to_dict()) < set(table)
    for state in (0, -1):
        for p in rollout.pressure(state):
            row = [table[f"{p.name}.pressure_{k}"][state] for k in range(len(p.pressures))]
            assert np.array_equal(row, p.pressures)


def test_pressures_in_a_gap_that_a_film_carries():
    scene = hg.Scene(fluid=hg.Fluid(density=998.0), gravity=(0, 0, -9.81))
    for z, density in [(0.0, 900.0), (1.02, 2000.0)]:
        scene.add(hg.Body(hg.box(1.0, 1.0, 1.0), density=density, position=(0, 0, z)))
    rollout = hg.Simulator(scene, dt=0.001, fidelity="reduced").rollout(steps=1)
    surfaces = rollout.pressure(0)
    right = rollout.loads(0).wrenches("water")
    largest = np.abs(right[:, :3]).max()
    for p, water in zip(surfaces, right, strict=True):
        assert p.at_films.shape == p.pressures.shape
        # The sides in the gap are at it all over; it reaches around their edges, where it fades.
        facing = (p.centres[:, 2] > 0.495) & (p.centres[:, 2] < 0.525)
        assert p.areas[facing].sum() == pytest.approx(1.0) and p.at_films[facing].min() > 0.9
        assert not p.at_films[np.abs(p.centres[:, 2] - 0.51) > 1.0].any()
        assert p.wrench[:3] == pytest.approx(water[:3], abs=0.03 * largest)


def test_what_is_not_known_is_refused(rollout):
    with pytest.raises(IndexError, match="state"):
        rollout.pressure(30)
    with pytest.raises(hg.UnresolvedError, match="heavy"):
        rollout.flow_pressure(0, [(0.0, 0.0, 0.0)])
