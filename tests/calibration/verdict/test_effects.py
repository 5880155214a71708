"""Planted effects and none: found, sized, told from what no effect explains; and the held-out runs judge them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom

from calibration.attribution.hypothesis import Reason
from calibration.report.report import write_report
from calibration.robot.corrected_robot import corrected_robot
from calibration.statistics.fit import Fit, fit, least_determined
from calibration.statistics.forward import by_differences
from calibration.statistics.residual_tests import Directions, directions, examine_residual
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import DRAWS, Study, middle_session
from calibration.swimmer.influences import influences
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import COEFFICIENTS, SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from common.run_columns import MEASURED
from tests.calibration.toy_tables import (
    DRAG,
    START,
    TRUTH,
    ambiguous,
    calibrated,
    effect,
    none,
    toy_swimmer,
    toy_table,
    verdict_of,
)
from tests.shared import shared

SIZE = 5.0


@pytest.mark.slow
@pytest.mark.parametrize("few", [True, pytest.param(False, marks=pytest.mark.rates)], ids=["few", "all"])
def test_a_planted_effect_is_found_sized_and_removed(few: bool) -> None:
    result = effect() if few else calibrated(toy_table(5, **{DRAG: SIZE}))
    assert result.verdict == "effect"
    assert result.effects == (DRAG,)
    assert result.excluded == ()
    low, high = result.final.interval(DRAG)
    assert low <= SIZE <= high
    assert result.error_after < 1.25 * result.noise_ceiling
    assert result.error_after <= result.error_before
    assert corrected_robot(START, result.final.parameters).effects[DRAG] == result.final.parameters[DRAG]


@pytest.mark.rates
def test_planted_effects_are_mostly_found_sized_and_removed() -> None:
    results = [calibrated(toy_table(100 + seed, **{DRAG: SIZE}), draws=DRAWS) for seed in range(6)]
    assert all(r.verdict != "none" and (DRAG in r.effects or r.verdict == "unexplained") for r in results)
    named = [r for r in results if r.effects == (DRAG,)]
    assert len(named) >= 5
    assert all(r.error_after < 1.25 * r.noise_ceiling and r.error_after <= r.error_before for r in named)
    intervals = [r.final.interval(DRAG) for r in named]
    assert sum(low <= SIZE <= high for low, high in intervals) >= len(named) - 1


@pytest.mark.slow
def test_an_effect_that_the_coefficients_absorb_is_not_testable() -> None:
    """A direction that C_t covers leaves nothing to score, however wrong the model is."""
    model = toy_swimmer(toy_table(5, **{DRAG: SIZE}))
    study = Study.fitted_to(model, ~middle_session(model.runs), draws=20)
    base = effect().base
    misfit = examine_residual(study, base, Directions.plain(base.jacobian[..., :1]))
    assert misfit.scores.survived[0] < 1e-5
    assert misfit.p["score"] == 1.0
    assert misfit.general_p < 0.1


@pytest.mark.slow
def test_what_comes_nearest_is_adopted_where_nothing_explains() -> None:
    table = toy_table(7, **{DRAG: 5.0})
    table["omega_h_rpm"] *= np.exp(0.04 * np.sin(3.0 * table["l_cm"]) * np.sign(table["omega_rpm"]))
    result = calibrated(table, few=True)
    assert (result.verdict, result.effects) == ("partial", ())
    assert "The nearest effect, head's end-over-end drag (end_over_end_drag), is kept" in result.sentence
    assert result.error_after < 0.75 * result.error_before
    robot = verdict_of(result)
    assert 2.0 < robot.corrected.effects[DRAG] < 8.0
    assert robot.knowledge.names.count(DRAG) == 1


@pytest.mark.slow
def test_coefficients_are_recovered_with_their_intervals_and_nothing_is_claimed() -> None:
    result = none()
    assert result.verdict == "none"
    assert result.effects == ()
    for name in ("C_t", "C_r", "C_yr"):
        low, high = result.base.interval(name)
        middle = result.base.parameters[name]
        assert low < middle < high
        assert middle == pytest.approx(getattr(TRUTH, name), rel=0.1)
    direction, error = least_determined(result.base)
    assert set(direction) == {"C_t", "C_r", "C_yr"}
    assert sum(part**2 for part in direction.values()) == pytest.approx(1.0)
    assert 0 < error < 1.0


def test_fits_arrive_along_a_valley() -> None:
    """The spin of the tails and the radius tell the rigid robot's coefficients apart along a bent valley only."""
    table = toy_table(6, **{DRAG: 5.0}).drop(columns=["omega_h_rpm", "omega_yr_rad_s", "theta_deg"])
    model, true_model = toy_swimmer(table), toy_swimmer(table, TRUTH)
    names, every = (*(p.name for p in model.coefficients), DRAG), np.ones(len(table), bool)
    from_preset = fit(model, {**start_values(model), DRAG: 5.0}, names, every)
    from_truth = fit(true_model, {**start_values(true_model), DRAG: 5.0}, names, every)
    assert from_preset.converged
    assert from_truth.converged
    assert from_preset.deviance == pytest.approx(from_truth.deviance, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("few", [True, pytest.param(False, marks=pytest.mark.rates)], ids=["few", "all"])
def test_two_effects_are_found_as_a_pair(few: bool) -> None:
    result = calibrated(toy_table(31, left_right_bias=0.15, **{DRAG: 5.0}), few=few)
    assert result.verdict == "effect"
    assert set(result.effects) == {DRAG, "left_right_bias"}
    assert result.error_after < 1.15 * result.noise_ceiling


def in_thinning_fluid(table: pd.DataFrame, rate: float) -> pd.DataFrame:
    """The same runs in a fluid that loses a share `rate` of its viscosity with every hour.

    Each run has a viscosity of its own; the effect that the calibration looks for is not used.
    """
    model, hours = toy_swimmer(table, TRUTH), table["elapsed_min"] / 60
    at = start_values(model)
    thinner = model.predict([at, *({**at, "viscosity": TRUTH.viscosity * math.exp(-rate * h)} for h in hours)])
    change = np.diagonal(thinner[1:], axis1=0, axis2=1).T - thinner[0]
    outputs = [MEASURED[name].column for name in model.runs.outputs]
    return table.assign(
        **table[outputs[:-1]] * np.exp(change[:, :-1]), theta_deg=table["theta_deg"] + np.degrees(change[:, -1])
    )


@pytest.mark.parametrize("seed", [7, *(pytest.param(seed, marks=pytest.mark.rates) for seed in (8, 9))])
def test_a_drift_with_time_is_found_where_there_is_a_clock(seed: int) -> None:
    """Viscosity that falls by 6 % an hour through a day of runs; nothing is claimed where it does not fall."""
    few = ("viscosity_with_time", DRAG, "left_right_bias") if seed == 7 else ()
    rate = 0.06
    table = toy_table(seed)
    assert "viscosity drifting with time" in toy_swimmer(table).untestable
    table["elapsed_min"] = 4.0 * np.arange(len(table))
    assert calibrated(table, few=few).verdict == "none"
    drifting = in_thinning_fluid(table, rate)
    result = calibrated(drifting, few=few)
    assert result.effects == ("viscosity_with_time",)
    low, high = result.final_intervals["viscosity_with_time"]
    assert 0.5 * rate < low < rate < high < 2 * rate
    assert result.error_after < result.error_before
    assert result.error_after < 1.25 * result.noise_ceiling
    without_clock = calibrated(drifting.drop(columns="elapsed_min"), few=few)
    assert "viscosity_with_time" not in without_clock.effects
    missing = without_clock.untestable["viscosity drifting with time"]
    assert missing == "needs elapsed_min, differing between the runs"


def test_a_tracked_point_off_the_centre_changes_radius_and_angle_alone() -> None:
    model = toy_swimmer(toy_table(8), TRUTH)
    names = {p.name: p.start for p in (*model.coefficients, *model.effects)}
    plain, off = model.predict([names, {**names, "tracked_point": 0.5}])
    changed = np.abs(off - plain).max(0) > 1e-9
    assert dict(zip(model.runs.outputs, changed.tolist(), strict=True)) == {
        "omega_h": False, "omega_t": False, "omega_yr": False, "R_yr": True, "theta": True,
    }  # fmt: skip


@pytest.mark.slow
def test_an_effect_that_changes_nothing_says_so(tmp_path: Path) -> None:
    """The toy's tails cannot touch: no size of contact shows, and the report has no size for it."""
    result = ambiguous()
    contact = next(c for c in result.attribution.candidates if c.effect.name == "tail_contact")
    assert contact.reason is Reason.NO_CHANGE
    write_report(result, result.to_dict(), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    assert "–</td>" in text
    assert "e+150" not in text


@pytest.mark.slow
def test_the_held_out_session_has_no_say_judges_and_is_used_in_the_end() -> None:
    """Ruining it changes the reported errors and the last fit, which has all runs, and nothing else."""
    table, result = toy_table(5, **{DRAG: SIZE}), effect()
    assert result.errors.p_value > 0.01
    table.loc[table["session"] == result.split.names, "omega_yr_rad_s"] *= 1.5
    ruined = calibrated(table, few=True)
    assert ruined.final.parameters == result.final.parameters
    assert ruined.attribution.misfit.p_value == result.attribution.misfit.p_value
    assert ruined.error_after > 1.5 * result.error_after
    assert ruined.errors.p_value < 0.01
    assert ruined.final_refit.parameters["C_yr"] != pytest.approx(ruined.final.parameters["C_yr"], rel=0.02)


def test_the_result_is_deterministic() -> None:
    first, second = (calibrated(toy_table(3), few=True) for _ in range(2))
    assert first.to_dict() == second.to_dict()


@pytest.mark.rates
def test_p_of_the_locked_session_is_even_for_a_good_model() -> None:
    good = [calibrated(toy_table(seed), draws=DRAWS).errors.p_value for seed in range(17, 25)]
    assert 0.2 < np.mean(good) < 0.8


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


THINNING, TIME = "shear_thinning", "shear_thinning_time"
HIDDEN = {THINNING: 0.45, TIME: 0.6}
SPEEDS = (30.0, 70.0, 170.0)  # rpm: rates of shear from below 1/λ to above it


def recovered(refit: Fit | None) -> None:
    """Both numbers are within 95 % intervals that say something."""
    for name, true in HIDDEN.items():
        low, high = refit.interval(name)
        assert low - 0.2 * (high - low) < true < high + 0.2 * (high - low)
    low, high = refit.interval(THINNING)
    assert high - low < 0.6


def test_scores_are_taken_at_several_values_and_the_largest_counts() -> None:
    model = toy_swimmer(toy_table(5, **HIDDEN))
    used = np.ones(len(model.runs), bool)
    base = fit(model, start_values(model), ("C_t", "C_r", "C_yr"), used, title="")
    candidates = directions(model, base.parameters, model.effects)
    place = [e.name for e in model.effects].index(THINNING)
    columns = candidates.table[..., candidates.owner == place]
    second = influences()[THINNING].parameter.second
    assert second.name == TIME
    assert TIME not in influences()  # it is no candidate of its own
    grid = second.grid
    assert columns.shape[-1] == len(grid)
    for column, value in zip(np.moveaxis(columns, -1, 0), grid, strict=True):
        expected = by_differences(model, {**base.parameters, TIME: value, THINNING: 1e-6}, [THINNING])[1][..., 0]
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
    few = (THINNING, DRAG) if seed == 4 else ()
    result = calibrated(toy_table(seed, design={"motor_rpm": SPEEDS}, **HIDDEN), few=few)
    assert THINNING in result.effects
    recovered(next(c.fit for c in result.claims if c.effect.name == THINNING))
    assert result.error_after < 1.15 * result.noise_ceiling


@pytest.mark.rates
def test_local_thinning_is_found_by_the_simulator() -> None:
    """Truth by time steps on a finer mesh."""
    truth = replace(TRUTH, effects=HIDDEN)
    table = make_table(truth, seed=4, tails=(2, 3, 4), lengths_cm=(5.0, 8.0), motor_rpm=SPEEDS, title="")
    result = calibrate(SwimmerModel(START, read_measurements(table)), progress=False)
    assert THINNING in result.effects
    assert result.error_after < 1.2 * result.noise_ceiling
    refit = next(c.fit for c in result.claims if c.effect.name == THINNING)
    recovered(refit)
    assert corrected_robot(START, refit.parameters).effects == {n: refit.parameters[n] for n in HIDDEN}
