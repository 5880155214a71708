"""An effect with a second number: found at the largest of several scores, and both numbers recovered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibration.report.corrected_robot import corrected_robot
from calibration.statistics.fit import Fit, fit
from calibration.statistics.residual_tests import Directions, directions, examine_residual
from calibration.statistics.statistical_model import by_differences, start_values
from calibration.statistics.study import Study
from calibration.swimmer.influences import influences
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from calibration.verdict.calibrate import calibrate
from tests.calibration.toy_tables import DRAG, START, TRUTH, calibrated, toy_swimmer, toy_table

SIZE, TIME = "shear_thinning", "shear_thinning_time"
HIDDEN = {SIZE: 0.45, TIME: 0.6}
SPEEDS = (30.0, 70.0, 170.0)  # rpm: rates of shear from below 1/λ to above it


def recovered(refit: Fit | None) -> None:
    """Both numbers are within 95 % intervals that say something."""
    assert refit is not None
    for name, true in HIDDEN.items():
        low, high = refit.interval(name)
        assert low - 0.2 * (high - low) < true < high + 0.2 * (high - low)
    low, high = refit.interval(SIZE)
    assert high - low < 0.6


def test_scores_are_taken_at_several_values_and_the_largest_counts() -> None:
    model = toy_swimmer(toy_table(5, **HIDDEN))
    used = np.ones(len(model.runs), bool)
    base = fit(model, start_values(model), ("C_t", "C_r", "C_yr"), used, title="")
    candidates = directions(model, base.parameters, model.effects)
    place = [e.name for e in model.effects].index(SIZE)
    columns = candidates.table[..., candidates.owner == place]
    second = influences()[SIZE].parameter.second
    assert second is not None
    assert second.name == TIME
    assert TIME not in influences()  # it is no candidate of its own
    grid = second.grid
    assert columns.shape[-1] == len(grid)
    for column, value in zip(np.moveaxis(columns, -1, 0), grid, strict=True):
        expected = by_differences(model, {**base.parameters, TIME: value, SIZE: 1e-6}, [SIZE])[1][..., 0]
        assert column == pytest.approx(expected, rel=0.05, abs=1e-4)
    study = Study.fitted_to(model, used, level=0.05, draws=50)
    misfit = examine_residual(study, base, candidates)
    alone = [examine_residual(study, base, Directions.plain(columns[..., [j]])) for j in range(len(grid))]
    z = np.array([abs(single.scores.z[0]) for single in alone])
    assert abs(misfit.scores.z[place]) == pytest.approx(z.max())
    assert misfit.second[place] == grid[int(np.argmax(z))]
    assert len(misfit.scores.z) == len(model.effects)
    together = examine_residual(study, base, Directions(columns, np.zeros(3, int), np.array(grid)), draws=200)
    first = examine_residual(study, base, Directions.plain(columns[..., [0]]), draws=200)
    assert together.critical_z >= first.critical_z  # the bootstrap takes the largest, too
    table = np.arange(4.0) * np.ones((2, 1, 4))  # leaving an effect out leaves all its columns out
    remaining = Directions(table, np.array([0, 1, 1, 2]), np.array([np.nan, 0.0, 1.0, np.nan])).without(1)
    assert remaining.owner.tolist() == [0, 1]
    assert remaining.table[0, 0].tolist() == [0.0, 3.0]


@pytest.mark.parametrize("seed", [4, pytest.param(3, marks=pytest.mark.rates)])
def test_size_and_time_are_recovered_from_the_toy(seed: int) -> None:
    few = (SIZE, DRAG) if seed == 4 else ()
    result = calibrated(toy_table(seed, design={"motor_rpm": SPEEDS}, **HIDDEN), few=few)
    assert SIZE in result.effects
    recovered(next(c.refit for c in result.explaining if c.effect.name == SIZE))
    assert result.error_after < 1.15 * result.noise_ceiling


@pytest.mark.rates
def test_local_thinning_is_found_by_the_simulator() -> None:
    """Truth by time steps on a finer mesh."""
    truth = replace(TRUTH, effects=HIDDEN)
    table = make_table(truth, seed=4, tails=(2, 3, 4), lengths_cm=(5.0, 8.0), motor_rpm=SPEEDS, title="")
    result = calibrate(SwimmerModel(START, read_measurements(table)), progress=False)
    assert SIZE in result.effects
    assert result.error_after < 1.2 * result.noise_ceiling
    refit = next(c.refit for c in result.explaining if c.effect.name == SIZE)
    recovered(refit)
    assert refit is not None
    assert corrected_robot(START, refit.parameters).effects == {n: refit.parameters[n] for n in HIDDEN}
