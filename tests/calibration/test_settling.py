"""A drift that settles, and friction whose speed is not known: both numbers of such effects are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from calibration.corrected import corrected_robot
from calibration.influences import influences
from calibration.loop import calibrate
from calibration.measurements import read_measurements
from calibration.model import by_differences, start_values
from calibration.swimmer import COEFFICIENTS, Swimmer
from calibration.synthetic import make_table
from tests.calibration.toy_tables import START, TRUTH, toy_swimmer, toy_table

DRIFT, RATE = "viscosity_with_time", "viscosity_settling"
FRICTION, SPEED = "contact_line", "contact_line_speed"


def over_hours(table: pd.DataFrame, hours: float) -> pd.DataFrame:
    """The runs in a random order, spread over so many hours."""
    order = np.random.default_rng(5).permutation(len(table))
    return table.assign(elapsed_min=60 * hours * order / (len(table) - 1))


def test_what_settles_begins_as_a_straight_line_and_stops() -> None:
    drift = influences()[DRIFT]
    hours = np.array([0.0, 0.1, 1.0, 100.0])
    assert drift.strength(hours, {RATE: 0.0}).tolist() == hours.tolist()
    settled = drift.strength(hours, {RATE: 2.0})
    assert settled[0] == 0
    assert settled[1] == pytest.approx(0.1, rel=0.1)
    assert settled[3] == pytest.approx(0.5)
    for rate in (0.0, 1e-4, 2.0):
        ends = [drift.strength(hours[:3], {RATE: rate + step}) for step in (1e-5, 2e-5)]
        slope = (ends[1] - ends[0]) / 1e-5
        assert drift.strength_by_rate(hours[:3], {RATE: rate}) == pytest.approx(slope, rel=1e-3, abs=1e-4)


def test_derivatives_along_both_numbers() -> None:
    table = over_hours(make_table(TRUTH, seed=2, tails=(2, 3), lengths_cm=(6.0, 9.0), title=""), 3.0)
    model = Swimmer(START, read_measurements(table))
    names = [DRIFT, RATE, FRICTION, SPEED]
    at = {**start_values(model), DRIFT: 0.08, RATE: 0.7, FRICTION: 0.3, SPEED: 6.0}
    ours, J = model.derivatives(at, names)
    theirs, differences = by_differences(model, at, names)
    assert ours == pytest.approx(theirs, abs=1e-3)
    scale = np.abs(differences).max((0, 1))
    assert (scale > 1e-4).all()
    assert (np.abs(J - differences).max((0, 1)) < 0.05 * scale).all()


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_a_drift_that_settles_is_found_with_its_rate() -> None:
    """With a quarter of the usual noise."""
    model = toy_swimmer(over_hours(toy_table(6), 4.0))
    truth = {**start_values(model), **{name: getattr(TRUTH, name) for name in COEFFICIENTS}}
    clean, drifting = model.predict([truth, {**truth, DRIFT: 0.14, RATE: 0.8}])
    runs = replace(model.runs, y=drifting + 0.25 * (model.runs.y - clean))
    result = calibrate(replace(model, runs=runs), progress=False)
    assert result.effects == (DRIFT,)
    refit = next(c.refit for c in result.explaining if c.effect.name == DRIFT)
    assert refit is not None
    low, high = refit.interval(RATE)
    assert -0.3 < low < 0.8 < high < 3
    assert refit.parameters[DRIFT] == pytest.approx(0.14, rel=0.4)
    assert RATE not in corrected_robot(START, refit.parameters).effects
