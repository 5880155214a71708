"""The compiled loop of a query against the same steps with arrays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.effects import catalogue
from sim.model.groups import DWELL
from surrogate.input_ranges import ROBOT
from surrogate.table.intervals import PARTS
from surrogate.table.lookup import NeuralTable
from surrogate.table.model_file import load
from surrogate.table.quick_query import MANY
from surrogate.training.simulated import draw_robots
from surrogate.wrench.heads import needs_no_learning
from tests.oracles.query import answer, half_widths
from tests.surrogate.small import robots_inside, table

KNOWN = [name for name in catalogue() if needs_no_learning(name)]
OF_SPEED = ("v_x", "v_z", "lag_x", "lag_z", "net_speed_bar")  # differences of numbers of this size
FLAT = ("R_yr_over_l", "theta_deg")  # ill-conditioned where a robot moves straight ahead, or hardly at all


def robots(count: int = 400, seed: int = 5) -> dict[str, np.ndarray]:
    """Draw robots with two to eight tails, every third with its motor reversed; some are outside the domain."""
    drawn = draw_robots(count, seed, wide=True)
    rows = np.arange(count)
    speed = drawn["omega_bar"] * np.where(rows % 3 == 0, -1.0, 1.0)
    return drawn | {"N": 2.0 + rows % 7, "omega_bar": speed}


def check_same(found: dict[str, np.ndarray], wanted: dict[str, np.ndarray], tolerance: float = 1e-12) -> None:
    """Compare outputs, velocities and lags relative to their size."""
    assert (found["outside"] == wanted["outside"]).all()
    known = ~wanted["outside"]
    assert known.mean() > 0.3
    speed = np.hypot(wanted["v_x"], wanted["v_z"])
    for name in wanted:
        if name != "outside":
            size = speed if name in OF_SPEED else np.abs(wanted[name])
            finite = known & np.isfinite(wanted[name])
            apart = np.abs(found[name][finite] - wanted[name][finite])
            bound = tolerance * (100 if name in FLAT else 1)
            assert (apart <= bound * size[finite] + 1e-300).all(), name


def test_plain_robots() -> None:
    drawn = robots()
    check_same(load().query(drawn, flag=True), answer(load(), drawn))


@pytest.mark.parametrize("name", KNOWN)
def test_every_effect_that_the_table_knows(name: str) -> None:
    effect = catalogue()[name]
    random = np.random.default_rng(len(name))
    sizes = np.clip(effect.typical * random.uniform(-1, 1, 400), *effect.bounds)
    drawn = {**robots(), name: sizes}
    check_same(load().query(drawn, flag=True), answer(load(), drawn))


def test_the_response_at_equal_dwells() -> None:
    """Short, long and very long dwells, knots among them."""
    dwells = np.concatenate([np.geomspace(0.2, 80.0, 397), [0.2, 4.0, 1.0]])
    drawn = {**robots(), DWELL: dwells}
    check_same(load().query(drawn, flag=True), answer(load(), drawn), 1e-11)


def test_robots_with_one_tail() -> None:
    drawn = robots() | {"N": np.ones(400)}
    found = load().query(drawn, flag=True)
    check_same(found, answer(load(), drawn), 1e-11)
    assert np.isinf(found["tail_gap"]).all()


def test_one_tail_without_effects() -> None:
    drawn = {name: values for name, values in robots().items() if name in ROBOT} | {"N": np.ones(400)}
    check_same(load().query(drawn, flag=True), answer(load(), drawn), 1e-11)


def test_one_tail_with_every_effect_of_the_head() -> None:
    drawn = robots() | {"N": np.ones(400), "surface_couple": np.linspace(-1, 1, 400)}
    drawn["motor_droop"] = np.tile([0.0, 2.0], 200)
    check_same(load().query(drawn, flag=True), answer(load(), drawn), 1e-11)


@pytest.mark.parametrize("small", [False, True])
def test_widths_of_intervals(small: bool) -> None:
    """The loop's own, of networks with one member; and those with a spread of the members."""
    drawn = robots_inside(40) if small else robots()
    drawn[DWELL] = np.geomspace(0.3, 8.0, len(drawn["N"]))
    lookup = table() if small else load()
    found = lookup.query(drawn, flag=True, intervals=True)
    wanted = half_widths(lookup, drawn, answer(lookup, drawn))
    known = ~found["outside"]
    assert wanted
    for name, half in wanted.items():
        width = (found[f"{name}_high"] - found[f"{name}_low"])[known] / 2
        size = np.abs(found[name][known]) + half[known]
        assert (np.abs(width - half[known]) <= 1e-9 * half[known] + 1e-14 * size).all(), name


@pytest.mark.parametrize("effect", ["", "surface_couple", "left_right_bias"])
@pytest.mark.parametrize("count", [MANY - 1, MANY])
def test_robots_with_couples_in_yaw_have_factors_of_their_own(effect: str, count: int) -> None:
    """By the loop, by blocks and with arrays; files of earlier versions have one group for all robots."""
    drawn = {name: values for name, values in robots(count).items() if name in ROBOT}
    drawn |= {effect: np.full(count, 0.05)} if effect else {}
    factors = np.ones(PARTS), np.repeat([1.0, 3.0], PARTS)
    one, two = (with_factor(load(), factor) for factor in factors)
    before, after = (lookup.query(drawn, flag=True, intervals=True) for lookup in (one, two))
    wanted, known = half_widths(two, drawn, answer(two, drawn)), ~after["outside"]
    assert known.sum() > 2
    for name, half in wanted.items():
        narrow, wide = ((found[f"{name}_high"] - found[f"{name}_low"])[known] for found in (before, after))
        assert wide == pytest.approx((3 if effect else 1) * narrow, rel=1e-6), name
        assert wide / 2 == pytest.approx(half[known], rel=1e-6), name


def with_factor(lookup: NeuralTable, factor: np.ndarray) -> NeuralTable:
    assert lookup.intervals is not None
    factors = dict.fromkeys(lookup.intervals.factor, factor)
    return replace(lookup, intervals=replace(lookup.intervals, factor=factors))


def test_a_table_without_networks_for_two_tails() -> None:
    drawn = robots_inside(4) | {"N": np.full(4, 2.0)}
    found = table().query(drawn, flag=True)
    assert found["outside"].all()
    assert np.isnan(found["omega_yr_bar"]).all()
