"""Robots in lanes and in batches have the numbers that they have alone; derivatives are differences."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from common.arrays import Floats
from common.errors import InputError
from sim.effects import catalogue, effect_named
from sim.model.groups import SLOPE_INPUTS, SLOPE_OUTPUTS, Groups
from sim.motion.batches import in_batches, sensitivity_columns, split
from sim.motion.response import mirrored, orbits_with_phases, responses
from sim.motion.sensitivity import sensitivities, slopes_of_orbits
from sim.motion.stability import growths
from sim.motion.steady import orbits
from sim.solve import grouping, refinement
from sim.solve.assembly import Nonlocal, bodies, numbers
from sim.solve.march import Marcher, equal_steps, new_state, side_by_side
from sim.solve.refinement import NO_START, PHASES, PHASES_FOR_SLOPES, refined_orbits
from sim.solve.transient import Flip, follow_flips
from tests.sim.motion.test_stability import UNSTABLE
from tests.sim.robots import CONTROL_VALUES, control, sweep_points

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
    return [(o.error, o.means, *o.x, *o.u) for o in refined_orbits(rows, tails, PHASES)]


def slopes_of(rows: Floats, tails: int) -> Numbers:
    """Compute derivatives of the means along relative changes of four numbers, one at a time."""
    directions = np.zeros((len(rows), len(ALONG), rows.shape[1]))
    for k, number in enumerate(ALONG):
        directions[:, k, number] = rows[:, number]
    return [
        (slopes,) for slopes in slopes_of_orbits(rows, directions, refined_orbits(rows, tails, PHASES_FOR_SLOPES))
    ]


def growths_of(rows: Floats, tails: int) -> Numbers:
    return [(growth,) for growth in growths(rows, tails, refined_orbits(rows, tails, PHASES))]


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


def agree(a: Any, b: Any) -> bool:
    """Tell whether numbers agree to 1e-9 of the largest one of an array."""

    def near(p: Any, q: Any) -> bool:
        scale = np.abs(np.nan_to_num(q)).max(initial=0.0)
        return np.allclose(p, q, rtol=0, atol=1e-9 * scale, equal_nan=True)

    return all(near(p, q) for p, q in zip(a, b, strict=True))


solvers = pytest.mark.parametrize("solver", [orbits_of, slopes_of, growths_of, courses_of])


@solvers
@pytest.mark.parametrize("tails", [1, 2, 3, 5])
def test_a_robot_has_the_same_numbers_in_any_group_and_alone(
    solver: Callable[[Floats, int], Numbers], tails: int
) -> None:
    """Eleven robots: three take lanes of robots that have come to their ends."""
    rows = numbers(robots(tails, 11))
    together = solver(rows, tails)
    assert sum(bool(np.isfinite(one[0]).all()) for one in together) > 8
    parts = [*solver(rows[:4], tails), *solver(rows[4:5], tails), *solver(rows[5:], tails)]
    assert all(map(agree, together, parts))
    assert all(map(agree, together, solver(rows[::-1], tails)[::-1]))


def test_many_robots_are_solved_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    some = robots(3, 5)

    def found() -> list[Floats]:
        motion, slopes, curves = orbits(some), sensitivities(some, ["C_t"]), responses(some, history=False)
        derivatives = slopes.derivatives.values()
        return [motion.omega_yr, motion.tail_gap, *derivatives, curves.lag, curves.net_speed]

    wanted = found()
    monkeypatch.setattr(grouping, "AT_ONCE", 2)
    assert agree(wanted, found())


def test_a_robot_that_cannot_be_solved_leaves_the_others_of_its_group_alone() -> None:
    rows = numbers(robots(3, 10))
    wanted = orbits_of(rows, 3)
    broken = rows.copy()
    broken[4] = np.nan
    found = orbits_of(broken, 3)
    assert refined_orbits(broken, 3, PHASES)[4].status == NO_START
    assert np.isnan(found[4][1]).all()
    assert all(agree(wanted[i], found[i]) for i in range(10) if i != 4)
    some: list[Any] = flips_of(rows, 3)
    courses = followed(some)
    some[2], some[7], some[9] = with_speed(some[2], np.nan), None, with_speed(some[9], 1e12)
    assert [i for i, course in enumerate(followed(some)) if course is None] == [2, 7, 9]
    assert all(agree(courses[i], followed(some)[i]) for i in (0, 1, 3, 4, 5, 6, 8))


def with_speed(flip: Flip, omega: float) -> Flip:
    """Return the flip of the same robot with another speed of its motor."""
    return flip._replace(numbers=np.array([omega, *flip.numbers[1:]]))


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
    assert all(agree(course, followed([flip])[0]) for flip, course in zip(some, together, strict=True))
    early = followed([some[1]._replace(until=0.7)])[0]
    assert (np.isfinite(early.lag).all((1, 2)) == (TIMES <= 0.7)).all()
    assert np.array_equal(early.end, early.shapes[1])
    plain = followed(flips_of(numbers(control(omega_bar=14.0)), 2))[0]
    assert np.abs(together[1].lag - plain.lag).max() > 1e-3
    # Along one of three directions, a robot without the effect gets it.
    rows = numbers(robots(3, 3))
    directions = np.zeros((3, 2, rows.shape[1]))
    directions[:, :, 0] = rows[:, :1]
    solved = refined_orbits(rows, 3, PHASES_FOR_SLOPES)
    wanted = slopes_of_orbits(rows, directions, solved)
    directions[1, 1] = 0.0
    directions[1, 1, rows.shape[1] - len(Nonlocal._fields) + Nonlocal._fields.index("tail_interaction")] = 1.0
    found = slopes_of_orbits(rows, directions, solved)
    assert agree([found[[0, 2]]], [wanted[[0, 2]]])
    assert found[1, 0] == pytest.approx(wanted[1, 0], rel=1e-9)
    assert not np.allclose(found[1, 1], wanted[1, 1], rtol=1e-2)


def test_local_and_nonlocal_and_doubtful_robots_keep_their_places() -> None:
    """The growth of the robot that yaws fast is computed again; the curved one has a group of its own."""
    plain, curved, quick = control(1, N=6), control(1, N=6, natural_curvature=0.5), control(1, **UNSTABLE)
    rows = np.concatenate([numbers(groups) for groups in (quick, curved, plain, quick, plain)])
    orbits = refined_orbits(rows, 6, PHASES)
    wanted = [growths(rows[[i]], 6, refined_orbits(rows[[i]], 6, PHASES))[0] for i in range(len(rows))]
    assert wanted[0] > 0 > wanted[1] != wanted[2]
    assert growths(rows, 6, orbits) == pytest.approx(wanted, rel=1e-6)
    assert growths(rows[:0], 6, []).shape == (0,)


def test_a_group_may_hold_local_and_nonlocal_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    """A lane without non-local effects ends after its own solution; its numbers do not change."""
    rows = numbers(control(3, omega_bar=np.array([12.0, 14.0, 16.0]), tail_interaction=np.array([0.0, 1.0, 0.0])))
    wanted = orbits_of(rows, 2)
    monkeypatch.setattr(refinement, "are_local", lambda rows: np.ones(len(rows), bool))
    assert all(map(agree, wanted, orbits_of(rows, 2)))


@pytest.mark.parametrize("effect", ["tail_interaction", "natural_curvature", "tail_contact", "root_compliance"])
def test_robots_with_nonlocal_effects_have_the_same_numbers_in_a_group_and_alone(effect: str) -> None:
    """Their lanes take different numbers of products in GMRES, which leaves 1e-3 of a correction."""
    sizes = effect_named(effect).typical * np.linspace(0.1, 1.0, 5)
    rows = numbers(control(5, omega_bar=np.linspace(8, 40, 5), **{effect: sizes}))
    together = refined_orbits(rows, 2, PHASES)
    assert sum(bool(np.isfinite(orbit.means).all()) for orbit in together) > 3
    for i, orbit in enumerate(together):
        alone = refined_orbits(rows[[i]], 2, PHASES)[0]
        assert orbit.means == pytest.approx(alone.means, rel=1e-6, nan_ok=True)


@pytest.mark.parametrize("tails", [1, 4])
@pytest.mark.parametrize("effect", ["", "tail_interaction", "natural_curvature", "tail_contact", "motor_droop"])
def test_time_steps_of_a_robot_alone_have_the_numbers_of_a_lane(tails: int, effect: str) -> None:
    sizes = {effect: np.array([effect_named(effect).typical])} if effect else {}
    body, steps = bodies(control(1, **sizes))[0], equal_steps(0.24, 12)
    alone, first, second = (Marcher(body, body, new_state(tails, 8, body.offset), steps) for _ in range(3))
    (swum,), (_, beside) = side_by_side([alone]), side_by_side([first, second])
    assert swum.done == beside.done == len(steps.lengths)
    for plain, in_lane in ((swum.poses, beside.poses), *zip(alone.state, second.state, strict=True)):
        assert in_lane == pytest.approx(plain, rel=1e-9, abs=1e-12)


def test_batches_hold_every_row_once_and_one_n_each() -> None:
    tails = np.array([2.0, 5.0, 2.0, 3.0, 2.0, 5.0, 2.0])
    batches = split(tails, 2)
    assert sorted(np.concatenate(batches).tolist()) == list(range(7))
    assert all(len(b) <= 2 and len(set(tails[b])) == 1 for b in batches)
    with pytest.raises(InputError, match="no parameter 'colour'"):
        sensitivities(control(), ["colour"])
    with pytest.raises(InputError, match="jobs = 0; give at least 1"):
        in_batches(vars, {}, 1, jobs=0)


def blas_threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_threads_at_work_leave_the_number_of_threads_alone() -> None:
    """Workers that overlap and end in the order in which they began."""
    with threadpool_limits(2, user_api="blas"):

        def work(groups: Groups) -> dict[str, np.ndarray]:
            time.sleep(groups.omega_bar[0])
            return {"threads": np.array(list(blas_threads()))}

        columns = {name: np.full(4, value) for name, value in CONTROL_VALUES.items()}
        seen = in_batches(work, {**columns, "omega_bar": np.array([0.1, 0.2, 0.2, 0.2])}, 1, jobs=2)
        assert seen["threads"].tolist() == [1] * 4
        assert blas_threads() == {2}


def test_sensitivities_in_threads_are_those_of_one_robot_at_a_time() -> None:
    """In the order of the rows, tails mixed; forward differentiation must not leak from thread to thread."""
    count = 35
    values = {**CONTROL_VALUES, "N": np.tile([2.0, 3.0, 2.0, 4.0, 2.0], count // 5)}
    values["omega_bar"] = np.linspace(2.0, 12.0, count)
    columns = {k: np.broadcast_to(np.asarray(v, float), count).copy() for k, v in values.items()}
    names = ("C_t", "tail_spin_drag")
    found = sensitivity_columns(columns, names, jobs=2, title="")
    for row in (0, 1, 33):
        alone = sensitivities(Groups.from_columns({k: v[row : row + 1] for k, v in columns.items()}), names)
        assert found.values["omega_yr_bar"][row] == pytest.approx(alone.values["omega_yr_bar"][0], rel=1e-9)
        assert found.derivatives["v_z"][row] == pytest.approx(alone.derivatives["v_z"][0], rel=1e-6)


LOCAL = {name: effect for name, effect in catalogue().items() if effect.reach == "local"}


def steady_values(groups: Groups) -> dict[str, np.ndarray]:
    motion = orbits(groups, phases=PHASES_FOR_SLOPES)
    assert motion.converged.all()
    values = (motion.omega_t, motion.omega_h, motion.omega_yr, motion.v_x, motion.v_z, motion.turn_radius)
    return dict(zip(SLOPE_OUTPUTS, (*values, motion.slip_angle), strict=True))


def moved(groups: Groups, name: str, by: float) -> Groups:
    if name in SLOPE_INPUTS:
        return replace(groups, **{name: getattr(groups, name) + by})
    size = groups.effects.get(name, np.full(len(groups), catalogue()[name].null))
    return replace(groups, effects={**groups.effects, name: size + by})


@pytest.mark.parametrize("tails", [2, 3, 5])
def test_derivatives_equal_differences_of_solutions(tails: int) -> None:
    """In every input and local effect, for robots of the sweep; both motor directions. (Others: test_nonlocal.)"""
    points = sweep_points(48)
    rows = np.flatnonzero(points["N"] == tails)[:3]
    columns = {name: values[rows].copy() for name, values in points.items()}
    columns["omega_bar"][1] *= -1
    effects = {name: np.full(len(rows), 0.5 * effect.typical) for name, effect in LOCAL.items()}
    groups = Groups.from_columns({**columns, **effects})
    names = (*SLOPE_INPUTS, *LOCAL)
    derivatives = sensitivities(groups, names)
    plain = steady_values(groups)
    for output in SLOPE_OUTPUTS:
        assert derivatives.values[output] == pytest.approx(plain[output], rel=1e-12)
    for k, name in enumerate(names):
        size = (
            float(np.abs(getattr(groups, name)).mean()) if name in SLOPE_INPUTS else abs(catalogue()[name].typical)
        )
        width = 1e-3 * size
        before, after = steady_values(moved(groups, name, -width)), steady_values(moved(groups, name, width))
        for output in SLOPE_OUTPUTS:
            slope = (after[output] - before[output]) / (2 * width)
            # The differences carry the error of Newton's tolerance and of their own width.
            close = 3e-5 * np.abs(plain[output]) / size + 2e-3 * np.abs(slope)
            assert (np.abs(derivatives.derivatives[output][:, k] - slope) < close).all(), (name, output)
