"""Tables in which nothing is missing: claims and intervals are as rare and as wide as stated."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import binom

import sim.motion.batches
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import DRAWS
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import COEFFICIENTS, DIRECT, SwimmerModel
from calibration.verdict.verdict import Verdict
from tests.calibration import toy
from tests.calibration.toy_tables import START, TRUTH, calibrated, toy_table
from tests.shared import shared


@pytest.mark.usefixtures("toy_model")
def test_tests_on_the_toy_do_not_simulate() -> None:
    """A SwimmerModel takes the toy by itself, as the command line makes it; the simulator refuses."""
    data = read_measurements(toy_table(1))
    plain, real = SwimmerModel(START, data), SwimmerModel(START, data, solver=DIRECT)
    start = start_values(plain)
    assert plain.solver is toy.SOLVER
    assert np.isfinite(plain.predict([start])).all()
    with pytest.raises(AssertionError, match="simulated"):
        real.predict([start])
    with pytest.raises(AssertionError, match="simulated"):
        real.derivatives(start, ["C_t"])
    with pytest.raises(AssertionError, match="simulated"):
        sim.motion.batches.stepped_columns({k: np.array([v]) for k, v in START.group_values().items()}, title="")


@shared
def nulls() -> list[Verdict]:
    """60 tables of 64 runs in which nothing is missing."""
    return [calibrated(toy_table(seed, lengths_cm=(6.0, 9.0)), draws=DRAWS) for seed in range(60)]


@pytest.mark.rates
def test_no_effect_is_claimed_where_there_is_none_and_intervals_cover() -> None:
    """One claim in twenty is stated; more than `most` would come from that once in a hundred times (binomial).

    Stated errors allow for the tolerances of the nuisance parameters. Here these are exact.
    """
    most = binom.isf(0.01, len(nulls()), 0.05)
    assert sum(null.verdict != "none" for null in nulls()) <= most < 0.15 * len(nulls())
    assert all(null.effects == () for null in nulls() if null.verdict == "none")
    for name in COEFFICIENTS:
        ends = [null.base_intervals[name] for null in nulls()]
        assert sum(not low < getattr(TRUTH, name) < high for low, high in ends) <= most
        place = nulls()[0].base.names.index(name)
        stated = np.sqrt(np.mean([null.base.covariance[place, place] for null in nulls()]))
        scatter = np.std([math.log(null.base.parameters[name]) for null in nulls()])
        assert 0.7 < stated / scatter < 3.0  # 2.4 for C_r


@pytest.mark.rates
def test_twice_the_heavy_tails_do_not_make_an_effect() -> None:
    """Student noise with three degrees of freedom on the toy."""
    rng = np.random.default_rng(5)
    claimed = 0
    for seed in range(8):
        table = toy_table(40 + seed)
        for column in ("omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm"):
            table[column] *= np.exp(0.02 * rng.standard_t(3, len(table)))
        claimed += calibrated(table, draws=DRAWS).verdict != "none"
    assert claimed <= 2
