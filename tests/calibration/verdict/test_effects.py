"""Planted effects: found, sized, told from what no effect explains."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calibration.report.corrected_robot import corrected_robot
from calibration.report.report import write_report
from calibration.statistics.fit import fit
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import DRAWS, Study, middle_session
from tests.calibration import toy
from tests.calibration.toy_tables import (
    START,
    TRUTH,
    calibrated,
    calibrated_toy,
    install_few_candidates,
    toy_swimmer,
    toy_table,
)

EFFECT, SIZE = "end_over_end_drag", 5.0


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_a_planted_effect_is_found_sized_and_removed() -> None:
    result = calibrated_toy(5, **{EFFECT: SIZE})
    assert result.verdict == "effect"
    assert result.effects == (EFFECT,)
    low, high = result.final.interval(EFFECT)
    assert low <= SIZE <= high
    assert result.error_after < 1.25 * result.noise_ceiling
    assert result.error_after <= result.error_before
    assert corrected_robot(START, result.final.parameters).effects[EFFECT] == result.final.parameters[EFFECT]


@pytest.mark.rates
@pytest.mark.usefixtures("toy_model")
def test_planted_effects_are_mostly_found_sized_and_removed() -> None:
    named, covered = 0, 0
    for seed in range(6):
        result = calibrated(toy_table(100 + seed, **{EFFECT: SIZE}), draws=DRAWS)
        assert result.verdict != "none"
        assert EFFECT in result.effects or result.verdict == "unexplained"
        if result.effects == (EFFECT,):
            named += 1
            low, high = result.final.interval(EFFECT)
            covered += low <= SIZE <= high
            assert result.error_after < 1.25 * result.noise_ceiling
            assert result.error_after <= result.error_before
            robot = corrected_robot(START, result.final.parameters)
            assert robot.effects[EFFECT] == result.final.parameters[EFFECT]
    assert named >= 5
    assert covered >= named - 1


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_an_effect_that_the_coefficients_absorb_is_not_testable() -> None:
    """A direction that C_t covers leaves nothing to score, however wrong the model is."""
    model = toy_swimmer(toy_table(5, **{EFFECT: SIZE}))
    study = Study.fitted_to(model, ~middle_session(model.runs), draws=20)
    base = calibrated_toy(5, **{EFFECT: SIZE}).base
    misfit = examine_residual(study, base, Directions.plain(base.jacobian[..., :1]))
    assert misfit.scores.survived[0] < 1e-5
    assert misfit.p["score"] == 1.0
    assert misfit.general_p < 0.1


@pytest.mark.rest  # tests of the head's correction calibrate another such table
@pytest.mark.usefixtures("toy_model")
def test_an_effect_outside_the_catalogue_is_left_unexplained() -> None:
    table = toy_table(7)
    odd = 0.12 * np.sin(table["l_cm"] * 1.1) * np.where(table["omega_rpm"].abs() > 120, 1, -1)
    table["omega_yr_rad_s"] *= np.exp(odd)
    result = calibrated(table)
    assert result.verdict == "unexplained"
    assert result.effects == ()
    assert corrected_robot(START, result.final.parameters).effects == {}
    assert "no effect and no pair" in result.sentence


@pytest.mark.rest
@pytest.mark.usefixtures("toy_model")
def test_what_comes_nearest_is_said_where_nothing_explains() -> None:
    table = toy_table(7, end_over_end_drag=5.0)
    table["omega_h_rpm"] *= np.exp(0.04 * np.sin(3.0 * table["l_cm"]) * np.sign(table["omega_rpm"]))
    result = calibrated(table)
    assert result.verdict == "unexplained"
    assert "the nearest, head's end-over-end drag, removes" in result.sentence


@pytest.mark.slow
def test_coefficients_are_recovered_with_their_intervals_and_nothing_is_claimed() -> None:
    result = calibrated_toy(3)
    assert result.verdict == "none"
    assert result.effects == ()
    for name in ("C_t", "C_r", "C_yr"):
        low, high = result.base.interval(name)
        middle = result.base.parameters[name]
        assert low < middle < high
        assert middle == pytest.approx(getattr(TRUTH, name), rel=0.1)


@pytest.mark.usefixtures("toy_model")
def test_fits_arrive_along_a_valley() -> None:
    """The spin of the tails and the radius tell the rigid robot's coefficients apart along a bent valley only."""
    hidden = "end_over_end_drag"
    table = toy_table(6, **{hidden: 5.0}).drop(columns=["omega_h_rpm", "omega_yr_rad_s", "theta_deg"])
    model, true_model = toy_swimmer(table), toy_swimmer(table, TRUTH)
    names, every = (*(p.name for p in model.coefficients), hidden), np.ones(len(table), bool)
    from_preset = fit(model, {**start_values(model), hidden: 5.0}, names, every)
    from_truth = fit(true_model, {**start_values(true_model), hidden: 5.0}, names, every)
    assert from_preset.converged
    assert from_truth.converged
    assert from_preset.deviance == pytest.approx(from_truth.deviance, abs=0.5)


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize("candidates", ["few", pytest.param("all", marks=pytest.mark.rest)])
def test_two_effects_are_found_as_a_pair(candidates: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if candidates == "few":
        install_few_candidates(monkeypatch)
    result = calibrated(toy_table(31, end_over_end_drag=5.0, left_right_bias=0.15))
    assert result.verdict == "effect"
    assert set(result.effects) == {"end_over_end_drag", "left_right_bias"}
    assert result.error_after < 1.15 * result.noise_ceiling


def in_thinning_fluid(table: pd.DataFrame, rate: float) -> pd.DataFrame:
    """The same runs by robots whose fluid has lost a share `rate` of its viscosity with every hour.

    Every run is a robot of its own, with its own viscosity in SI; the effect that the calibration looks for is not
    used.
    """
    hours = table["elapsed_min"].to_numpy() / 60

    def outputs(rate: float) -> dict[str, np.ndarray]:
        robots = [
            replace(
                TRUTH, tails=int(n), tail_length=length / 100, motor_speed=abs(rpm) * 2 * math.pi / 60,
                viscosity=TRUTH.viscosity * math.exp(-rate * h),
            )
            for n, length, rpm, h in zip(table["N"], table["l_cm"], table["omega_rpm"], hours, strict=True)
        ]  # fmt: skip
        groups = [robot.group_values() for robot in robots]
        motion = toy.steady_columns({name: np.array([g[name] for g in groups]) for name in groups[0]})
        time = np.array([robot.time_scale for robot in robots])
        return {
            "omega_h_rpm": motion["omega_h_bar"] / time, "omega_t_rpm": motion["omega_t_bar"] / time,
            "omega_yr_rad_s": motion["omega_yr_bar"] / time, "R_yr_cm": motion["R_yr_over_l"],
            "theta_deg": motion["theta_deg"],
        }  # fmt: skip

    before, after = outputs(0.0), outputs(rate)
    ratios = {name: table[name] * (after[name] / before[name]) for name in before if name != "theta_deg"}
    return table.assign(**ratios, theta_deg=table["theta_deg"] + after["theta_deg"] - before["theta_deg"])


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize("seed", [7, *(pytest.param(seed, marks=pytest.mark.rest) for seed in (8, 9))])
def test_a_drift_with_time_is_found_where_there_is_a_clock(seed: int) -> None:
    """Viscosity that falls by 6 % an hour through a day of runs; nothing is claimed where it does not fall."""
    rate = 0.06
    table = toy_table(seed)
    assert "viscosity drifting with time" in toy_swimmer(table).untestable
    table["elapsed_min"] = 4.0 * np.arange(len(table))
    assert calibrated(table).verdict == "none"
    result = calibrated(in_thinning_fluid(table, rate))
    assert result.effects == ("viscosity_with_time",)
    low, high = result.fits.final_intervals["viscosity_with_time"]
    assert low < rate < high < 2 * rate
    assert low > 0.5 * rate
    assert result.error_after < result.error_before
    assert result.error_after < 1.25 * result.noise_ceiling


@pytest.mark.usefixtures("toy_model")
def test_without_a_clock_a_drift_is_no_effect_of_the_robot() -> None:
    """It stays unexplained, or passes for nothing; no effect is named for it, and the table says what it lacks."""
    table = toy_table(7)
    table["elapsed_min"] = 4.0 * np.arange(len(table))
    result = calibrated(in_thinning_fluid(table, 0.06).drop(columns="elapsed_min"))
    assert "viscosity_with_time" not in result.effects
    assert (
        result.evidence.untestable["viscosity drifting with time"]
        == "needs elapsed_min, differing between the runs"
    )


@pytest.mark.usefixtures("toy_model")
def test_a_tracked_point_off_the_centre_changes_radius_and_angle_alone() -> None:
    model = toy_swimmer(toy_table(8), TRUTH)
    names = {p.name: p.start for p in (*model.coefficients, *model.effects)}
    plain, off = model.predict([names, {**names, "tracked_point": 0.5}])
    changed = np.abs(off - plain).max(0) > 1e-9
    assert dict(zip(model.runs.outputs, changed.tolist(), strict=True)) == {
        "omega_h": False, "omega_t": False, "omega_yr": False, "R_yr": True, "theta": True,
    }  # fmt: skip


@pytest.mark.rest  # tests of the head's correction assert it, too
@pytest.mark.usefixtures("toy_model")
def test_the_generic_correction_helps_where_no_effect_explains() -> None:
    """A yaw rate that grows with tail length, of no effect's form."""
    table = toy_table(9)
    table["omega_yr_rad_s"] *= 1 + 0.02 * (table["l_cm"] - 8.0) ** 2
    model = toy_swimmer(table)
    result = calibrated(table)
    residual = (model.runs.y - result.base.prediction)[result.conditions.split.fitted]
    corrected = residual - result.corrections.regression.correction[result.conditions.split.fitted]
    assert any("ln l" in name for name in result.corrections.regression.features)
    assert (corrected**2).mean() < 0.7 * (residual**2).mean()


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_an_effect_that_changes_nothing_says_so(tmp_path: Path) -> None:
    """The toy's tails cannot touch: no size of contact shows, and the report has no size for it."""
    model = toy_swimmer(toy_table(1, lengths_cm=(8.0,), end_over_end_drag=4.0))
    result = calibrated_toy(1, lengths_cm=(8.0,), end_over_end_drag=4.0)
    contact = next(c for c in result.evidence.candidates if c.effect.name == "tail_contact")
    assert contact.verdict == "it changes nothing in these runs"
    write_report(result, model.runs, tmp_path / "report.html", title="t")
    text = (tmp_path / "report.html").read_text()
    assert "–</td>" in text
    assert "e+150" not in text
