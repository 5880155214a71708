"""What a table knows of itself: its support, the sizes of its errors, intervals, and errors as modes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from common.arrays import Flags, Floats
from sim.model.presets import PRESETS
from sim.model.response import BEFORE, DWELLS
from surrogate.domain import Support
from surrogate.error_modes import STEADY, CurveErrors, error_modes
from surrogate.held_out import error_scale, shortcomings, summary
from surrogate.intervals import NOVELTY, Intervals
from surrogate.response import Basis
from surrogate.table_file import load
from surrogate.tails import COUPLE, PLACES, ROBOT_NUMBERS
from tests.surrogate.small import table

ERRORS = {name: {"rms": 0.002} for name in (*STEADY, "lag_z", "lag_x", "lag_psi_rad")}
MOTION = {"v_z": 0.018, "v_x": 0.042, "omega_yr_bar": 0.049}


def test_the_support_is_joint() -> None:
    """Two inputs that always move together: one high and one low is outside, though each alone is in range."""
    random = np.random.default_rng(1)
    x, noise = random.standard_normal((4000, 1)), 0.05 * random.standard_normal((4000, 2))
    support = Support.learned(np.concatenate([x, x], 1) + noise)
    points = np.array([[0.0, 0.0], [1.5, 1.5], [-1.0, -1.05], [1.0, -1.0], [6.0, 6.0]])
    assert (support.novelty(points) <= 1).tolist() == [True, True, True, False, False]


@pytest.mark.parametrize("size", [7, 13])
def test_each_input_must_be_in_its_range(size: int) -> None:
    """Along one input alone the joint measure grows slowly: a tenth beyond the range it is below its limit."""
    x = np.random.default_rng(3).uniform(-1, 1, (4000, size))
    support = Support.learned(x)
    points = np.zeros((2, size))
    points[:, 2] = [0.99, 1.1]
    inside, beyond = support.novelty(points)
    assert inside < 1
    assert beyond == pytest.approx((1.1 - support.shift[2]) / support.scale[2])


def sampled(
    count: int, random: np.random.Generator, size: Callable[[Floats, Floats], Floats]
) -> tuple[Floats, Floats, Floats]:
    """Draw features with values from 0 to 1, and packed robots, with errors of that size."""
    features, robots = random.uniform(size=(count, 11)), np.zeros((count, ROBOT_NUMBERS))
    robots[:, 0] = random.uniform(size=count)
    robots[:, PLACES.number], robots[:, COUPLE] = random.integers(1, 9, count), random.uniform(size=count) < 0.5
    return features, size(features, robots) * random.standard_normal(count), robots


def covered(size: Callable[[Floats, Floats], Floats], count: int = 40_000) -> tuple[Floats, Floats, Flags]:
    """Learn intervals from such errors; return fresh features and robots, and which of their errors are inside."""
    random = np.random.default_rng(2)
    (x, error, _), (more, other, known), (test, last, robots) = (
        sampled(n, random, size) for n in (3000, count, 40_000)
    )
    found = Intervals.learned(x, {"v": error}).calibrated(more, {"v": other}, known)
    return test, robots, np.abs(last) <= found.half_widths(["v"], test, robots)[0]


def test_intervals_cover_as_they_say() -> None:
    """Errors whose size depends on an input: 90 % are covered, on the loud side and on the quiet side."""
    test, _, inside = covered(lambda x, robots: np.exp(3 * x[:, 0]))
    assert inside.mean() == pytest.approx(0.9, abs=0.02)
    for side in (test[:, 0] < 0.3, test[:, 0] > 0.7):
        assert 0.86 < inside[side].mean() < 0.94


GROUPED = {
    "tails": lambda x, robots: 1 + 20 * (robots[:, PLACES.number] == 2),
    "couple": lambda x, robots: 1 + 4 * robots[:, COUPLE],
    "speed": lambda x, robots: 1 + 8 * (robots[:, 0] > 2 / 3),
    "novelty": lambda x, robots: 1 + 8 * (np.abs(x[:, NOVELTY] - 0.4) < 0.1),
}


@pytest.mark.parametrize("kind", GROUPED)
def test_intervals_cover_in_each_group(kind: str) -> None:
    """Errors that are large in some groups, which the local width does not know or cannot follow."""
    test, robots, inside = covered(GROUPED[kind])
    third = np.searchsorted([1 / 3, 2 / 3], robots[:, 0])
    group = np.column_stack([robots[:, PLACES.number], robots[:, COUPLE], third, test[:, NOVELTY] > 0.5])
    shares = [inside[(group == own).all(1)].mean() for own in np.unique(group, axis=0)]
    assert len(shares) == 96
    assert min(shares) > 0.8
    assert max(shares) < 0.98
    assert np.std(shares) < 0.025


def test_a_group_of_few_robots_has_the_intervals_of_all_robots_with_as_many_tails() -> None:
    """Groups of 17 robots; with as many tails there are 200."""
    _, robots, inside = covered(lambda x, robots: 1 + 20 * (robots[:, PLACES.number] == 2), 1600)
    for tails in range(1, 9):
        assert 0.85 < inside[robots[:, PLACES.number] == tails].mean() < 0.95


def test_figures_of_errors_and_a_table_of_few_rows_that_says_that_it_is_poor() -> None:
    words = shortcomings(table().errors)
    assert any("net speed" in line for line in words)
    assert all("learn more rows" in line for line in words)
    figures = summary({"v": np.array([0.1, -0.2, 5.0])}, np.array([True, True, False]))["v"]
    assert figures["rms"] == pytest.approx(np.sqrt(0.025))
    assert figures["largest"] == pytest.approx(0.2)
    assert figures["rms_with_touching"] > 2


def columns() -> dict[str, np.ndarray]:
    return {name: np.array([value]) for name, value in PRESETS["paper-control"].group_values().items()}


def test_errors_of_known_size_have_this_size_at_each_dwell() -> None:
    modes = error_modes(ERRORS, MOTION)
    curves = np.concatenate([modes.lag[:, None] + modes.memory, modes.lag[:, None]], 1)
    sizes = [0.002 * float(error_scale(name, MOTION)) for name in ("lag_z", "lag_x", "lag_psi_rad")]
    assert np.sqrt((curves**2).sum(0)) == pytest.approx(np.broadcast_to(sizes, curves.shape[1:]), rel=0.02)
    assert np.sqrt((modes.twist**2).sum(0)) == pytest.approx([0.002 * error_scale(n, MOTION) for n in STEADY])


def test_errors_of_unequal_dwells_do_not_cancel() -> None:
    """With one number for all dwells, errors of heading of a left and a right dwell cancelled, on curves too."""
    modes = error_modes(ERRORS, MOTION)
    after = {k: modes.lag + modes.memory[:, k] for k in range(len(BEFORE))}

    def heading(dwell: float, before: float) -> np.ndarray:
        i, k = int(np.argmin(abs(DWELLS - dwell))), int(np.argmin(abs(BEFORE - before)))
        return after[k][:, i, 2]

    size = np.sqrt((heading(0.6, 0.6) ** 2).sum())
    apart = np.sqrt(((heading(0.9, 0.4) - heading(0.4, 0.9)) ** 2).sum())
    assert 0.5 * size < apart < 1.5 * size


def test_sizes_and_shapes_are_learned_from_held_out_robots() -> None:
    """Errors of one known shape, whose size is proportional to a feature: the mode is this shape, at that size."""
    rng = np.random.default_rng(1)
    features = np.column_stack([rng.uniform(-1, 1, (600, 10)), np.zeros(600)])
    vectors = rng.normal(size=(3, 75))
    shape = (rng.normal(size=3) @ vectors).reshape(25, 3)
    sizes = np.exp(features[:, 4])
    lag = rng.normal(size=600)[:, None, None] * sizes[:, None, None] * shape
    noise = 0.02 * rng.normal(size=lag.shape)  # of time steps
    bases = {"lag": Basis(np.zeros(75), vectors), "memory": Basis(np.zeros(1200), np.zeros((1, 1200)))}
    errors = {"lag": lag + noise, "memory": np.zeros((600, len(BEFORE), 25, 3))}
    learned = CurveErrors.learned(features, errors, bases, np.full(600, 1e-4))
    for factor in (-0.8, 0.8):
        at = np.zeros((1, 11))
        at[0, 4] = factor
        modes = learned.modes(at, np.ones((1, 3)))[:, -1]
        assert np.sqrt((modes**2).sum(0)) == pytest.approx(np.exp(factor) * abs(shape), rel=0.25, abs=0.02)
    assert learned.simulator == pytest.approx(1e-4)


def test_the_shipped_table_states_smaller_errors_where_it_knows_more() -> None:
    """Local errors of the control robot, in the middle of the domain, against the mean error of all robots."""
    lookup = load()
    local, of_all = lookup.error_modes(columns()), error_modes(lookup.errors, MOTION)
    sizes = [np.sqrt((modes.lag[..., 2] ** 2).sum(0)).mean() for modes in (local, of_all)]
    assert 0 < sizes[0] < sizes[1]


def test_a_table_of_earlier_versions_states_its_mean_errors(tmp_path: Path) -> None:
    replace(load(), curve_errors=None).save(tmp_path / "model.safetensors")
    older = load(tmp_path / "model.safetensors")
    assert older.curve_errors is None
    motion = {name: float(values[0]) for name, values in older.query(columns()).items()}
    assert older.error_modes(columns()).lag == pytest.approx(error_modes(older.errors, motion).lag)
