"""Branches of steady motions: curves are followed, robots with several motions, the equations that they solve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.arrays import Floats
from sim.effects import catalogue
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.sweepable import SLOPE_INPUTS, SWEEPABLE, read_range
from sim.motion.branch_report import branch_table, draw_branches, largest_hysteresis
from sim.motion.branches import Branch, Branches, Motion, find_branches
from sim.motion.continuation import Point, first_point, follow, locate
from sim.motion.revolution import Revolutions
from sim.motion.shapes import state_from_orbit
from sim.motion.stability import DOUBLING, FOLD, HOPF, Leading, leading_exponent
from sim.motion.swept_input import SweptInput, perturbed, settled_from
from sim.motion.tails_alike import EDGES, TailsAlike
from sim.solve.refinement import difference
from tests.shared import shared

CONTROL = PRESETS["paper-control"]


def wide_robot(tails: int, omega_bar: float, sizes: tuple[float, ...], coefficients: tuple[float, ...]) -> Robot:
    """Make a robot from l/R, L/R, l/r0 and C_t, C_r, C_yr."""
    radius = CONTROL.tail_length / sizes[0]
    return replace(
        CONTROL, name="wide", tails=tails, head_radius=radius, head_length=sizes[1] * radius,
        tail_radius=CONTROL.tail_length / sizes[2], **dict(zip(("C_t", "C_r", "C_yr"), coefficients, strict=True)),
    ).with_motor(omega_bar)  # fmt: skip


# Two robots of `python -m benchmarks robustness`, rows 3507 and 3620, that have several motions.
TWO_TAILS = wide_robot(2, 207.513, (13.619, 8.686, 24.204), (0.87, 1.815, 14.683))
SEVEN_TAILS = wide_robot(7, 88.865, (12.674, 11.832, 37.736), (0.604, 2.088, 13.138))


@shared
def two_tails(low: float, steps: int) -> Branches:
    return find_branches(SweptInput(TWO_TAILS, "omega_bar", low, 220.0), steps=steps)


def alike_family(swept: SweptInput) -> TailsAlike:
    return TailsAlike(swept.body_at, swept.robot.tails)


def beginning(family: TailsAlike, s: float = 0.0) -> Point:
    """Return the first point of a branch of orbits, from straight tails."""
    start = family.start(s)
    assert start is not None
    first = first_point(family, start, 1.0)
    assert first is not None
    return first


def test_the_tangent_is_the_change_of_the_orbit() -> None:
    family = alike_family(SweptInput(CONTROL, "omega_bar", 10.0, 30.0))
    ends = [beginning(family, s) for s in (0.5 - 1e-3, 0.5, 0.5 + 1e-3)]
    slope = (ends[2].y - ends[0].y) / 2e-3
    assert ends[1].tangent / ends[1].turns == pytest.approx(slope, abs=1e-3 * np.abs(slope).max())


@pytest.mark.parametrize("effect", ["natural_curvature", "C_t"])
def test_points_along_an_input_are_orbits(effect: str) -> None:
    swept = SweptInput(CONTROL, effect, 0.2, 0.9)
    family = alike_family(swept)
    first = beginning(family)
    last = list(follow(family, first, 100))[-1]
    assert last.s == pytest.approx(1.0, abs=1e-6)
    direct = beginning(family, 1.0)
    assert difference(family.means(last.y), family.means(direct.y)) < 1e-5


def test_what_happens_where_the_growth_changes_its_sign() -> None:
    leading = [Leading(0.0, turns, tails) for turns, tails in ((0.0, 4), (2.0, 4), (1.0, 4), (0.5, 1))]
    assert [one.kind for one in leading] == [FOLD, DOUBLING, HOPF, DOUBLING]


@pytest.mark.rest
def test_an_exponent_that_has_not_converged_does_not_count() -> None:
    """A copy of the leading one, N ω_t away, converges last: at a residual of 0.05 its growth is 0.46."""
    curved = replace(SEVEN_TAILS, effects={"natural_curvature": -0.2})
    swept = SweptInput(curved, "omega_bar", 60.0, 115.0)
    family = alike_family(swept)
    first = beginning(family)
    point = next(p for p in follow(family, first, 60) if swept.value(p.s) > 75.0)
    x, u = family.unpack(point.y)
    body, means = swept.body_at(point.s), family.means(point.y)
    turns = Revolutions(swept.body_at, 7, EDGES, int(96 * abs(body.omega / means[0])))
    time = 2 * np.pi / abs(means[0])
    fixed = first_point(turns, turns.start(state_from_orbit(body, x, u), point.s, time), 1.0)
    assert fixed is not None
    found, stepped = leading_exponent(body, 7, x, u), turns.leading(fixed.y)
    assert stepped.growth > 0.2
    assert found.growth == pytest.approx(stepped.growth, rel=0.06)
    assert found.turns == pytest.approx(stepped.turns, abs=0.02)


def test_the_map_over_a_turn_has_the_orbit_as_fixed_point_with_its_growth() -> None:
    swept = SweptInput(TWO_TAILS, "omega_bar", 60.0, 220.0)
    family = alike_family(swept)
    start = family.start(0.8)
    assert start is not None
    x, u = family.unpack(start)
    body = swept.body_at(0.8)
    means = family.means(start)
    time = 2 * np.pi / abs(means[0])
    turns = Revolutions(swept.body_at, 2, EDGES, 2 * int(48 * abs(body.omega / means[0])))
    state = state_from_orbit(body, x, u)
    point = first_point(turns, turns.start(state, 0.8, time), 1.0)
    assert point is not None
    turn = turns.at(point.y)
    assert turn is not None
    assert difference(turn.means, means) < 0.005
    leading, expected = turns.leading(point.y), leading_exponent(body, 2, x, u)
    assert leading.growth == pytest.approx(expected.growth, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("low", "steps", "count"), [(160.0, 2, 2), pytest.param(60.0, 6, 3, marks=pytest.mark.rates)]
)
def test_both_stable_motions_of_two_tails_are_found_and_drawn(low: float, steps: int, count: int) -> None:
    """The direct solution reaches one, time steps from rest the other; docs/steady-motions.md."""
    result = two_tails(low, steps)
    s = (TWO_TAILS.omega_bar - low) / (220.0 - low)
    alike = [motion for branch in result.branches if branch.alike for motion in branch.at(s)]
    assert sorted(m.means[2] for m in alike if m.stable) == pytest.approx([79.8, 87.0], rel=0.03)
    assert len(alike) == count
    for motion in (*result.up, *result.down):
        assert motion.settled
        assert any(branch.has(motion.s, motion.means) for branch in result.branches)
    table = branch_table(result)
    assert set(table["branch"]) == set(range(len(result.branches) + 1))
    assert (table["origin"] == "time steps, up").sum() == steps
    on_branches = table[table["branch"] > 0]
    assert on_branches["omega_bar"].between(low - 1e-3, 220 + 1e-3).all()
    assert (on_branches["stable"] == (on_branches["growth"] < 0)).all()
    labels = draw_branches(result).axes[0].get_legend_handles_labels()[1]
    assert "tails alike, stable" in labels
    assert (FOLD in labels) == (count == 3)
    assert largest_hysteresis(result)[0] < 0.03


@pytest.mark.rates
def test_the_fold_joins_a_stable_to_an_unstable_motion() -> None:
    """Below the fold time steps leave the branch; above it they return to the stable motion."""
    result = two_tails(60.0, 6)
    branch = next(b for b in result.branches if any(m.kind == FOLD for m in b.motions))
    fold = next(m for m in branch.motions if m.kind == FOLD)
    assert fold.s == pytest.approx(min(m.s for m in branch.motions), abs=1e-6)
    assert abs(fold.leading.growth) < 0.05
    place = branch.motions.index(fold)
    sides = branch.motions[place - 2].stable, branch.motions[place + 2].stable
    assert sorted(sides) == [False, True]


@pytest.mark.rest
def test_a_hopf_point_separates_decay_from_growth_in_time_steps() -> None:
    swept = SweptInput(SEVEN_TAILS, "omega_bar", 60.0, 92.0)
    family = alike_family(swept)
    here = beginning(family)

    def grows(point: object) -> float:
        x, u = family.unpack(point.y)  # type: ignore[attr-defined]
        return leading_exponent(swept.body_at(point.s), 7, x, u).growth  # type: ignore[attr-defined]

    crossing = None
    for point in follow(family, here, 60):
        if grows(here) < 0 < grows(point):
            crossing = locate(family, here, point, grows)
            break
        here = point
    assert crossing is not None
    assert swept.value(crossing.s) == pytest.approx(82.0, abs=0.5)
    x, u = family.unpack(crossing.y)
    assert leading_exponent(swept.body_at(crossing.s), 7, x, u).kind == HOPF
    for s, stays in ((crossing.s - 0.06, True), (crossing.s + 0.06, False)):
        beside = first_point(family, np.append(crossing.y[:-1], s), 1.0)
        assert beside is not None
        x, u = family.unpack(beside.y)
        state = perturbed(state_from_orbit(swept.body_at(s), x, u), 1e-3, 0)
        means = family.means(beside.y)
        settled = settled_from(swept.body_at, 7, s, state, 2 * np.pi / abs(means[0]))
        assert (difference(settled.means, means) < 0.03) == stays


def test_the_picture_of_growth_shows_all_of_it() -> None:
    growths, means = (-0.2, 15.0, -20.0), np.array([20.0, -10.0, 1.0, 0.1, 0.1])
    leading = [Leading(growth, 0.0, 2) for growth in growths]
    branches = [Branch(True, [Motion(s, means, one) for s in (0.0, 1.0)]) for one in leading]
    swept = SweptInput(CONTROL, "omega_bar", 10.0, 20.0)
    axes = draw_branches(Branches(swept, branches, [], [])).axes[1]
    low, high = axes.get_ylim()
    assert low < min(*growths, 0.0) <= max(*growths, 0.0) < high
    zero, small = axes.transData.transform([[0, 0.0], [0, -0.2]])[:, 1]
    assert zero - small > 2  # pixels: what is near zero is seen, too


def test_ranges_without_robots_are_refused() -> None:
    assert set(SWEEPABLE) == {*SLOPE_INPUTS, *catalogue()}
    assert read_range("C_t", "1:2.5") == (1.0, 2.5)
    for text in ("", "1", "1:", ":2", "1:x", "1:inf", "nan:2", "1-2", "1:2:3"):
        with pytest.raises(InputError, match="LOW:HIGH"):
            read_range("C_t", text)
    for name, low, high, words in (
        ("speed", 0.0, 20.0, "above 0"), ("omega_bar", -5.0, 20.0, "above 0"), ("C_t", -1.0, 1.0, "above 0"),
        ("C_t", 2.0, 1.0, "the lower one first"), ("natural_curvature", 0.0, 3.0, "from -1 to 1"),
        ("colour", 0.0, 1.0, "no input"), ("l_over_r0", 2.0, 20.0, "slender"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words):
            SweptInput(CONTROL, name, low, high)


class Cubic:
    """s − 1/2 = z − 4 z³, with folds at z = ±1/√12."""

    tolerance = 1e-10

    def correction(self, y: Floats, row: Floats, defect: float) -> Floats:
        z, s = y
        matrix = np.array([[12 * z**2 - 1, 1.0], row])
        return np.linalg.solve(matrix, [-(s - 0.5 - z + 4 * z**3), -defect])

    def tangent(self, y: Floats, row: Floats) -> Floats:
        return np.linalg.solve(np.array([[12 * y[0] ** 2 - 1, 1.0], row]), [0.0, 1.0])

    def moved(self, y: Floats, dy: Floats) -> Floats:
        return y + dy

    def is_valid(self, y: Floats) -> bool:
        return True


class Circle(Cubic):
    """z² + (s − 1/2)² = 1/16."""

    def correction(self, y: Floats, row: Floats, defect: float) -> Floats:
        z, s = y
        return np.linalg.solve(np.array([[2 * z, 2 * s - 1], row]), [-(z**2 + (s - 0.5) ** 2 - 1 / 16), -defect])

    def tangent(self, y: Floats, row: Floats) -> Floats:
        return np.linalg.solve(np.array([[2 * y[0], 2 * y[1] - 1], row]), [0.0, 1.0])


def test_a_curve_is_followed_around_both_folds_to_the_end() -> None:
    curve = Cubic()
    first = first_point(curve, np.array([0.6, 0.0]), 1.0)
    assert first is not None
    points = list(follow(curve, first, 500))
    assert points[-1].s == pytest.approx(1.0, abs=1e-6)
    assert points[-1].y[0] < -0.5
    signs = np.sign([point.turns for point in points])
    assert np.count_nonzero(np.diff(signs)) == 2
    for point in points:
        z, s = point.y
        assert s - 0.5 == pytest.approx(z - 4 * z**3, abs=1e-9)
        assert np.linalg.norm(point.tangent) == pytest.approx(1.0)


def test_folds_are_located() -> None:
    curve = Cubic()
    here, folds = first_point(curve, np.array([0.6, 0.0]), 1.0), []
    assert here is not None
    for point in follow(curve, here, 500):
        if here.turns * point.turns < 0:
            fold = locate(curve, here, point, lambda p: p.turns)
            assert fold is not None
            folds.append(fold.y[0])
        here = point
    assert folds == pytest.approx([1 / np.sqrt(12), -1 / np.sqrt(12)], abs=1e-6)


def test_a_closed_curve_is_followed_once() -> None:
    curve = Circle()
    first = first_point(curve, np.array([0.2, 0.4]), 1.0)
    assert first is not None
    points = list(follow(curve, first, 1000))
    around = sum(np.linalg.norm(b.y - a.y) for a, b in zip([first, *points[:-1]], points, strict=True))
    assert around == pytest.approx(np.pi / 2, rel=0.1)


def test_a_guess_too_far_away_is_no_solution() -> None:
    assert first_point(Cubic(), np.array([50.0, 0.5]), 1.0) is None
