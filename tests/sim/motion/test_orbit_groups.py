"""Orbits of groups of robots: a robot's numbers depend neither on its group nor on how wide groups are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sim.lanes import ALONE, GROUP, HALF_GROUP
from sim.model.groups import Groups
from sim.motion import grouping, orbit_groups, orbits
from sim.motion.orbit_groups import orbits_in_groups
from sim.motion.orbits import solve_orbits
from sim.solve.assembly import bodies, numbers
from sim.solve.refinement import FEW, NO_START, SOLVED, Orbit, refined_orbit
from tests.sim.points import sweep_points


def robots(tails: int, count: int) -> Groups:
    """Return robots of the shipped sweep with N tails; those with one tail are robots with two that lost one."""
    columns = sweep_points(32 * count)
    rows = np.flatnonzero(columns["N"] == max(tails, 2))[:count]
    assert len(rows) == count
    columns["N"] = np.full(len(columns["N"]), tails)
    return Groups.from_columns({name: values[rows] for name, values in columns.items()})


def same_bits(a: Orbit, b: Orbit) -> bool:
    """Compare all numbers of two orbits."""
    numbers_of_a, numbers_of_b = ([o.error, o.means, *o.x, *o.u] for o in (a, b))
    return a.ended == b.ended and all(
        np.array_equal(p, q, equal_nan=True) for p, q in zip(numbers_of_a, numbers_of_b, strict=True)
    )


@pytest.mark.parametrize("tails", [2, 3])
def test_a_robot_has_the_same_bits_in_any_group(tails: int) -> None:
    rows = numbers(robots(tails, 21))
    together = orbits_in_groups(rows, tails, FEW)
    assert sum(orbit.ended == SOLVED for orbit in together) > 15
    for i, orbit in enumerate(together):
        assert same_bits(orbit, orbits_in_groups(rows[i : i + 1], tails, FEW)[0]), i
    parts = [*orbits_in_groups(rows[:5], tails, FEW), *orbits_in_groups(rows[5:], tails, FEW)]
    backwards = orbits_in_groups(rows[::-1], tails, FEW)[::-1]
    assert all(same_bits(*pair) for pair in zip(together, parts, strict=True))
    assert all(same_bits(*pair) for pair in zip(together, backwards, strict=True))


def test_the_room_does_not_grow_with_the_number_of_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Room for 4,000 robots at once was 1.1 GB."""
    rows, sizes = numbers(robots(3, 11)), []
    wanted = solve_orbits(rows, 3)

    def counting(some: Any, *rest: Any) -> list[Orbit]:
        sizes.append(len(some))
        return orbits_in_groups(some, *rest)

    monkeypatch.setattr(grouping, "AT_ONCE", 4)
    monkeypatch.setattr(orbits, "orbits_in_groups", counting)
    found = solve_orbits(rows, 3)
    assert sizes == [4, 4, 3]
    for name, values in wanted._asdict().items():
        assert np.array_equal(values, getattr(found, name), equal_nan=True), name


@pytest.mark.parametrize("width", [ALONE, HALF_GROUP, GROUP])
def test_the_width_of_groups_does_not_matter(width: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    rows = numbers(robots(3, 9))
    wanted = orbits_in_groups(rows, 3, FEW)
    monkeypatch.setattr(orbit_groups, "group_width", lambda: width)
    found = orbits_in_groups(rows, 3, FEW)
    assert all(same_bits(*pair) for pair in zip(wanted, found, strict=True))


@pytest.mark.parametrize("tails", [1, 2, 4, 5])
def test_groups_agree_with_the_loops_of_single_robots(tails: int) -> None:
    groups = robots(tails, 12)
    for body, found in zip(bodies(groups), orbits_in_groups(numbers(groups), tails, FEW), strict=True):
        wanted = refined_orbit(body, tails, FEW)
        assert found.ended == wanted.ended
        if wanted.ended == SOLVED:
            assert found.means == pytest.approx(
                wanted.means, rel=1e-12, abs=1e-12 * np.abs(wanted.means[3:]).max()
            )
            assert found.error == pytest.approx(wanted.error, rel=1e-9)
            for mine, theirs in zip([*found.x, *found.u], [*wanted.x, *wanted.u], strict=True):
                assert mine == pytest.approx(theirs, rel=1e-11, abs=1e-11 * np.abs(theirs).max())


def test_a_robot_that_cannot_be_solved_leaves_the_others_of_its_group_alone() -> None:
    rows = numbers(robots(3, 8))
    wanted: list[Any] = orbits_in_groups(rows, 3, FEW)
    rows[4] = np.nan
    found = orbits_in_groups(rows, 3, FEW)
    assert found[4].ended == NO_START
    assert np.isnan(found[4].means).all()
    assert all(same_bits(wanted[i], found[i]) for i in range(8) if i != 4)
