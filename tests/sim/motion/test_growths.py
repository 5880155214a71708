"""Growth of perturbations in groups: it does not depend on the group, and agrees with that of single robots."""

from __future__ import annotations

import numpy as np
import pytest

from sim.lanes import ALONE, GROUP, HALF_GROUP
from sim.motion import grouping
from sim.motion.growths import growths
from sim.motion.orbit_groups import orbits_in_groups
from sim.motion.stability import growth, growth_of_orbit
from sim.solve.assembly import numbers, unpacked
from sim.solve.refinement import FEW, Orbit, refined_orbit
from tests.sim.motion.test_orbit_groups import robots
from tests.sim.motion.test_stability import UNSTABLE
from tests.sim.robots import control


def orbits_of(tails: int, count: int) -> tuple[np.ndarray, list[Orbit]]:
    rows = numbers(robots(tails, count))
    return rows, orbits_in_groups(rows, tails, FEW)


@pytest.mark.parametrize("tails", [2, 3])
def test_the_growth_of_a_robot_does_not_depend_on_its_group(tails: int) -> None:
    rows, orbits = orbits_of(tails, 11)
    together = growths(rows, tails, orbits)
    assert (together < 0).all()
    assert np.array_equal(together, growths(rows[::-1], tails, orbits[::-1])[::-1])
    for i, orbit in enumerate(orbits):
        assert growths(rows[i : i + 1], tails, [orbit])[0] == together[i]


@pytest.mark.parametrize("width", [ALONE, HALF_GROUP, GROUP])
def test_the_width_of_groups_does_not_matter(width: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    rows, orbits = orbits_of(3, 6)
    wanted = growths(rows, 3, orbits)
    monkeypatch.setattr(grouping, "group_width", lambda: width)
    assert np.array_equal(growths(rows, 3, orbits), wanted)


@pytest.mark.parametrize("tails", [2, 5])
def test_groups_agree_with_single_robots(tails: int) -> None:
    rows, orbits = orbits_of(tails, 5)
    bodies = unpacked(rows)
    wanted = [growth(body, tails, orbit.x[1], orbit.u[1]) for body, orbit in zip(bodies, orbits, strict=True)]
    assert growths(rows, tails, orbits) == pytest.approx(wanted, rel=1e-9)


def test_the_direction_of_the_motor_does_not_matter() -> None:
    rows, orbits = orbits_of(3, 3)
    mixed = np.concatenate([rows, rows * np.where(np.arange(rows.shape[1]) == 0, -1.0, 1.0)])
    found = growths(mixed, 3, orbits_in_groups(mixed, 3, FEW))
    assert found[3:] == pytest.approx(growths(rows, 3, orbits), rel=1e-9)


def test_local_and_nonlocal_and_doubtful_robots_keep_their_places() -> None:
    """The growth of the robot that yaws fast is computed again; that of the curved one is computed alone."""
    plain, curved, quick = control(1, N=6), control(1, N=6, natural_curvature=0.5), control(1, **UNSTABLE)
    rows = np.concatenate([numbers(groups) for groups in (quick, curved, plain, quick, plain)])
    orbits = [refined_orbit(body, 6, FEW) for body in unpacked(rows)]
    wanted = [growth_of_orbit(body, 6, orbit) for body, orbit in zip(unpacked(rows), orbits, strict=True)]
    assert wanted[0] > 0 > wanted[1] != wanted[2]
    assert growths(rows, 6, orbits) == pytest.approx(wanted, rel=1e-6)
    assert growths(rows[:0], 6, []).shape == (0,)
