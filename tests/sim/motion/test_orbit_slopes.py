"""Derivatives of the means in groups: they do not depend on the group, and agree with differences of solutions."""

from __future__ import annotations

import numpy as np
import pytest

from sim.lanes import ALONE, GROUP, HALF_GROUP
from sim.motion import grouping
from sim.motion.orbit_groups import orbits_in_groups
from sim.motion.orbit_slopes import slopes_of_orbits
from sim.solve.assembly import Nonlocal, numbers
from sim.solve.refinement import MANY
from tests.sim.motion.test_orbit_groups import robots

TAILS = 3
ALONG = (0, 4, 8, 9)  # ω̄, tail radius, ζ_perp, an entry of the resistance


def case(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of robots, and relative changes of four of their numbers, one at a time."""
    rows = numbers(robots(TAILS, count))
    directions = np.zeros((count, len(ALONG), rows.shape[1]))
    for k, number in enumerate(ALONG):
        directions[:, k, number] = rows[:, number]
    return rows, directions


def test_derivatives_do_not_depend_on_the_group() -> None:
    rows, directions = case(11)
    orbits = orbits_in_groups(rows, TAILS, MANY)
    together = slopes_of_orbits(rows, directions, orbits)
    for i, orbit in enumerate(orbits):
        alone = slopes_of_orbits(rows[i : i + 1], directions[i : i + 1], [orbit])
        assert np.array_equal(alone[0], together[i])


@pytest.mark.parametrize("width", [ALONE, HALF_GROUP, GROUP])
def test_the_width_of_groups_does_not_matter(width: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    rows, directions = case(6)
    orbits = orbits_in_groups(rows, TAILS, MANY)
    wanted = slopes_of_orbits(rows, directions, orbits)
    monkeypatch.setattr(grouping, "group_width", lambda: width)
    assert np.array_equal(slopes_of_orbits(rows, directions, orbits), wanted)


def test_derivatives_agree_with_differences_of_solutions() -> None:
    rows, directions = case(3)
    found = slopes_of_orbits(rows, directions, orbits_in_groups(rows, TAILS, MANY))
    step = 1e-3
    for k in range(len(ALONG)):
        ends = [orbits_in_groups(rows + way * step * directions[:, k], TAILS, MANY) for way in (-1, 1)]
        for i, (below, above) in enumerate(zip(*ends, strict=True)):
            difference = (above.means - below.means) / (2 * step)
            assert found[i, k] == pytest.approx(difference, rel=1e-4, abs=1e-5 * np.abs(found[i, k]).max())


def test_a_direction_in_a_non_local_effect_is_taken_beside_local_ones() -> None:
    """The robots are local, but not along the direction."""
    rows, directions = case(3)
    orbits = orbits_in_groups(rows, TAILS, MANY)
    wanted = slopes_of_orbits(rows, directions, orbits)
    directions[1, 3] = 0.0
    directions[1, 3, rows.shape[1] - len(Nonlocal._fields) + Nonlocal._fields.index("tail_interaction")] = 1.0
    found = slopes_of_orbits(rows, directions, orbits)
    assert np.array_equal(found[[0, 2]], wanted[[0, 2]])
    assert found[1, :3] == pytest.approx(wanted[1, :3], rel=1e-9)
    assert not np.allclose(found[1, 3], wanted[1, 3], rtol=1e-2)
