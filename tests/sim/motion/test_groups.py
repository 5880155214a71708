"""Robots in lanes: numbers depend neither on the group nor on its width, and are those of single robots."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sim.arrays import Floats
from sim.lanes import ALONE, GROUP, HALF_GROUP
from sim.model.groups import Groups
from sim.motion import flips, grouping, orbit_groups
from sim.motion.flips import Flip, follow_flips
from sim.motion.growths import growths
from sim.motion.orbit_groups import orbits_in_groups
from sim.motion.orbit_slopes import slopes_of_orbits
from sim.motion.orbits import solve_orbits
from sim.motion.phased_orbits import orbits_with_phases
from sim.motion.response import mirrored, responses
from sim.motion.stability import growth, growth_of_orbit
from sim.solve.assembly import Nonlocal, bodies, numbers, unpacked
from sim.solve.refinement import FEW, MANY, NO_START, SOLVED, refined_orbit
from sim.solve.transient import lag_at, transient
from tests.sim.motion.test_stability import UNSTABLE
from tests.sim.robots import control, sweep_points

TIMES, MARKS = np.linspace(0.3, 1.0, 5), np.array([0.4, 0.7])
ALONG = (0, 4, 8, 9)  # ω̄, tail radius, ζ_perp, an entry of the resistance
Numbers = list[tuple[Any, ...]]  # of each robot


def robots(tails: int, count: int) -> Groups:
    """Return robots of the shipped sweep with N tails; those with one tail are robots with two that lost one."""
    columns = sweep_points(32 * count)
    rows = np.flatnonzero(columns["N"] == max(tails, 2))[:count]
    assert len(rows) == count
    columns["N"] = np.full(len(columns["N"]), tails)
    return Groups.from_columns({name: values[rows] for name, values in columns.items()})


def orbits_of(rows: Floats, tails: int) -> Numbers:
    return [(o.error, o.means, *o.x, *o.u) for o in orbits_in_groups(rows, tails, FEW)]


def slopes_of(rows: Floats, tails: int) -> Numbers:
    """Compute derivatives of the means along relative changes of four numbers, one at a time."""
    directions = np.zeros((len(rows), len(ALONG), rows.shape[1]))
    for k, number in enumerate(ALONG):
        directions[:, k, number] = rows[:, number]
    return [(slopes,) for slopes in slopes_of_orbits(rows, directions, orbits_in_groups(rows, tails, MANY))]


def growths_of(rows: Floats, tails: int) -> Numbers:
    return [(growth,) for growth in growths(rows, tails, orbits_in_groups(rows, tails, FEW))]


def flips_of(rows: Floats, tails: int, until: float = 1.0) -> list[Flip]:
    """Return flips of robots from the mirror images of their steady shapes."""
    flips = []
    for row, orbit in zip(rows, orbits_with_phases(rows, tails, [6])[0], strict=True):
        assert orbit is not None
        flips.append(Flip(row, mirrored(orbit.x), orbit.u, orbit.twist, until))
    return flips


def followed(flips: list[Flip]) -> list[Any]:
    return follow_flips(flips, TIMES, 1e-3, MARKS)


def courses_of(rows: Floats, tails: int) -> Numbers:
    return list(followed(flips_of(rows, tails)))


def same_bits(a: Any, b: Any) -> bool:
    return all(np.array_equal(p, q, equal_nan=True) for p, q in zip(a, b, strict=True))


solvers = pytest.mark.parametrize("solver", [orbits_of, slopes_of, growths_of, courses_of])


@solvers
@pytest.mark.parametrize("tails", [2, 3])
def test_a_robot_has_the_same_bits_in_any_group(solver: Callable[[Floats, int], Numbers], tails: int) -> None:
    """Eleven robots: three take lanes of robots that have come to their ends."""
    rows = numbers(robots(tails, 11))
    together = solver(rows, tails)
    assert sum(bool(np.isfinite(one[0]).all()) for one in together) > 8
    parts = [*solver(rows[:4], tails), *solver(rows[4:5], tails), *solver(rows[5:], tails)]
    assert all(map(same_bits, together, parts))
    assert all(map(same_bits, together, solver(rows[::-1], tails)[::-1]))


@solvers
@pytest.mark.parametrize(
    "width", [ALONE, *(pytest.param(width, marks=pytest.mark.rates) for width in (HALF_GROUP, GROUP))]
)
def test_the_width_of_groups_does_not_matter(
    solver: Callable[[Floats, int], Numbers], width: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Loops of the width that this machine does not use take two minutes to compile."""
    rows = numbers(robots(3, 6))
    wanted = solver(rows, 3)
    for place in (flips, orbit_groups, grouping):
        monkeypatch.setattr(place, "group_width", lambda: width)
    assert all(map(same_bits, wanted, solver(rows, 3)))


def test_many_robots_are_solved_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    some = robots(3, 5)
    wanted = solve_orbits(numbers(some), 3), responses(some, history=False)
    monkeypatch.setattr(grouping, "AT_ONCE", 2)
    found = solve_orbits(numbers(some), 3), responses(some, history=False)
    assert same_bits(wanted[0], found[0])
    assert same_bits((wanted[1].lag, wanted[1].net_speed), (found[1].lag, found[1].net_speed))


@pytest.mark.parametrize("tails", [1, 2, 4, 5])
def test_orbits_and_growths_agree_with_the_loops_of_single_robots(tails: int) -> None:
    groups = robots(tails, 8)
    rows = numbers(groups)
    orbits = orbits_in_groups(rows, tails, FEW)
    for body, found in zip(bodies(groups), orbits, strict=True):
        wanted = refined_orbit(body, tails, FEW)
        assert found.ended == wanted.ended
        if wanted.ended == SOLVED:
            assert found.means == pytest.approx(
                wanted.means, rel=1e-12, abs=1e-12 * np.abs(wanted.means[3:]).max()
            )
            assert found.error == pytest.approx(wanted.error, rel=1e-9)
            for mine, theirs in zip([*found.x, *found.u], [*wanted.x, *wanted.u], strict=True):
                assert mine == pytest.approx(theirs, rel=1e-11, abs=1e-11 * np.abs(theirs).max())
    if tails > 1:
        alone = [growth(body, tails, o.x[1], o.u[1]) for body, o in zip(bodies(groups), orbits, strict=True)]
        assert growths(rows, tails, orbits) == pytest.approx(alone, rel=1e-9)


@pytest.mark.parametrize("tails", [2, 3, 5])
def test_courses_agree_with_those_of_single_robots(tails: int) -> None:
    rows = numbers(robots(tails, 9))
    for flip, course in zip(some := flips_of(rows, tails), followed(some), strict=True):
        x = flip.x.copy()
        alone = transient(unpacked(flip.row[None])[0], x, flip.u.copy(), flip.twist, 1.0, MARKS, 1e-3)
        assert alone.solved
        assert course.lag == pytest.approx(lag_at(alone, TIMES), abs=1e-10)
        assert course.shapes == pytest.approx(alone.shapes, abs=1e-10)
        assert course.end == pytest.approx(x, abs=1e-10)


def test_derivatives_agree_with_differences_of_solutions() -> None:
    rows, step = numbers(robots(3, 3)), 1e-3
    found = slopes_of(rows, 3)
    for k, number in enumerate(ALONG):
        change = np.where(np.arange(rows.shape[1]) == number, step, 0.0) * rows
        ends = [orbits_in_groups(rows + way * change, 3, MANY) for way in (-1, 1)]
        for i, (below, above) in enumerate(zip(*ends, strict=True)):
            slopes, difference = found[i][0], (above.means - below.means) / (2 * step)
            assert slopes[k] == pytest.approx(difference, rel=1e-4, abs=1e-5 * np.abs(slopes[k]).max())


def test_a_robot_that_cannot_be_solved_leaves_the_others_of_its_group_alone() -> None:
    rows = numbers(robots(3, 10))
    wanted = orbits_of(rows, 3)
    broken = rows.copy()
    broken[4] = np.nan
    found = orbits_of(broken, 3)
    assert orbits_in_groups(broken, 3, FEW)[4].ended == NO_START
    assert np.isnan(found[4][1]).all()
    assert all(same_bits(wanted[i], found[i]) for i in range(10) if i != 4)
    some: list[Any] = flips_of(rows, 3)
    courses = followed(some)
    some[2], some[7], some[9] = with_speed(some[2], np.nan), None, with_speed(some[9], 1e12)
    assert [i for i, course in enumerate(followed(some)) if course is None] == [2, 7, 9]
    assert all(same_bits(courses[i], followed(some)[i]) for i in (0, 1, 3, 4, 5, 6, 8))


def with_speed(flip: Flip, omega: float) -> Flip:
    """Return the flip of the same robot with another speed of its motor."""
    return flip._replace(row=np.array([omega, *flip.row[1:]]))


def test_every_robot_is_followed_until_its_own_end() -> None:
    some = flips_of(numbers(robots(3, 5)), 3)
    ends = [0.4, 0.55, 0.7, 0.9, 1.0]
    courses = followed([flip._replace(until=end) for flip, end in zip(some, ends, strict=True)])
    for course, whole, end in zip(courses, followed(some), ends, strict=True):
        assert (np.isfinite(course.lag).all((1, 2)) == (end >= TIMES)).all()
        assert course.lag[end >= TIMES] == pytest.approx(whole.lag[end >= TIMES], abs=2e-3)
        assert (np.isfinite(course.shapes).all((1, 2, 3)) == (end >= MARKS)).all()
        if end in MARKS:
            assert np.array_equal(course.end, course.shapes[end == MARKS][0])


def test_robots_with_non_local_effects_are_solved_beside_the_others() -> None:
    mixed = control(3, omega_bar=np.array([12.0, 14.0, 16.0]), tail_interaction=np.array([0.0, 1.0, 0.0]))
    rows = numbers(mixed)
    some = flips_of(rows, 2)
    together = followed(some)
    assert all(same_bits(course, followed([flip])[0]) for flip, course in zip(some, together, strict=True))
    early = followed([some[1]._replace(until=0.7)])[0]
    assert (np.isfinite(early.lag).all((1, 2)) == (TIMES <= 0.7)).all()
    assert np.array_equal(early.end, early.shapes[1])
    plain = followed(flips_of(numbers(control(omega_bar=14.0)), 2))[0]
    assert np.abs(together[1].lag - plain.lag).max() > 1e-3
    # Along one of three directions, a robot without the effect gets it.
    rows = numbers(robots(3, 3))
    directions = np.zeros((3, 2, rows.shape[1]))
    directions[:, :, 0] = rows[:, :1]
    solved = orbits_in_groups(rows, 3, MANY)
    wanted = slopes_of_orbits(rows, directions, solved)
    directions[1, 1] = 0.0
    directions[1, 1, rows.shape[1] - len(Nonlocal._fields) + Nonlocal._fields.index("tail_interaction")] = 1.0
    found = slopes_of_orbits(rows, directions, solved)
    assert np.array_equal(found[[0, 2]], wanted[[0, 2]])
    assert found[1, 0] == pytest.approx(wanted[1, 0], rel=1e-9)
    assert not np.allclose(found[1, 1], wanted[1, 1], rtol=1e-2)


def test_local_and_nonlocal_and_doubtful_robots_keep_their_places() -> None:
    """The growth of the robot that yaws fast is computed again; that of the curved one is computed alone."""
    plain, curved, quick = control(1, N=6), control(1, N=6, natural_curvature=0.5), control(1, **UNSTABLE)
    rows = np.concatenate([numbers(groups) for groups in (quick, curved, plain, quick, plain)])
    orbits = [refined_orbit(body, 6, FEW) for body in unpacked(rows)]
    wanted = [growth_of_orbit(body, 6, orbit) for body, orbit in zip(unpacked(rows), orbits, strict=True)]
    assert wanted[0] > 0 > wanted[1] != wanted[2]
    assert growths(rows, 6, orbits) == pytest.approx(wanted, rel=1e-6)
    assert growths(rows[:0], 6, []).shape == (0,)
