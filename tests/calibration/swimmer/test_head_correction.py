"""Where no effect explains the runs: a correction that simulates, plans, and says its range."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calibration.__main__ import main
from calibration.report.corrected_robot import corrected_robot, corrected_toml
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.record import verdict_record
from calibration.verdict.verdict import Verdict
from planner.jobs.plan import plan
from planner.paths.path import circle
from planner.vehicle.calibration_table import read_knowledge
from planner.vehicle.from_table import table_vehicle
from sim.inputs import load_robot
from sim.io.errors import InputError, run_command
from sim.model.correction import Correction
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml
from sim.motion.steady import steady
from surrogate.table_file import load
from tests.calibration.toy_tables import DRAG, START, calibrated, toy_swimmer, toy_table
from tests.shared import shared

CONTROL = PRESETS["paper-control"]


def bent_table() -> pd.DataFrame:
    """A yaw rate that bends with the tails' length, of no effect's form."""
    bent = toy_table(9, lengths_cm=(5.0, 6.5, 8.0, 9.5, 11.0))
    bent["omega_yr_rad_s"] *= np.exp(0.02 * (bent["l_cm"] - 8.0) ** 2)
    return bent


@shared
def verdict() -> Verdict:
    return calibrated(bent_table(), few=(DRAG, "surface_couple", "anisotropic_head_drag"))


def correction(**changes: object) -> Correction:
    """C_yr grows by 10 % for each 0.2 of ln l."""
    x = np.array([CONTROL.tails, np.log(CONTROL.tail_length / CONTROL.head_radius), 0.0])
    x[2] = np.log(CONTROL.omega_bar) - 4 * x[1]
    low, high = x - np.array([0, 0.3, 0.3]), x + np.array([1, 0.3, 0.3])
    plain = Correction(
        tuple(x.tolist()), (1.0, 0.2, 1.0), tuple(low.tolist()), tuple(high.tolist()),
        ((0, 0, 0), (0, 1, 0)), {"C_yr": (0.2, 0.1), "surface_couple": (0.05, 0.0)}, 0.03, 0.05,
    )  # fmt: skip
    return replace(plain, **changes)


@pytest.mark.slow
def test_what_no_effect_does_is_left_unexplained_and_a_correction_predicts_it() -> None:
    """No effect is claimed; a correction of no effect's form helps in runs that it was not learnt from."""
    result, correction = verdict(), verdict().learnt
    assert result.verdict == "unexplained"
    assert result.effects == ()
    assert corrected_robot(START, result.final.parameters).effects == {}
    assert "no effect and no pair" in result.sentence
    assert any("ln l/R" in term for term in correction.terms)
    excess = result.error_before**2 - result.noise_ceiling**2
    assert result.error_predictive**2 - result.noise_ceiling**2 < 0.4 * excess
    assert f"{100 * result.error_predictive:.1f} % on runs" in result.sentence
    assert verdict_record(result, table="t")["error_predictive"] == result.error_predictive
    regression, fitted = result.regression, result.split.fitted
    assert any("ln l" in name for name in regression.features)
    residual = (toy_swimmer(bent_table()).runs.y - result.base.prediction)[fitted]
    assert ((residual - regression.correction[fitted]) ** 2).mean() < 0.7 * (residual**2).mean()


@pytest.mark.slow
def test_the_corrected_robot_simulates_what_was_predicted_and_states_its_uncertainty(tmp_path: Path) -> None:
    """The file's robot, with the table's settings, moves as the correction that was learnt from all runs says."""
    result, correction = verdict(), verdict().learnt
    (tmp_path / "with.toml").write_text(corrected_toml(START, result.final_refit, correction))
    (tmp_path / "without.toml").write_text(corrected_toml(START, result.final_refit))
    robot = load_robot(tmp_path / "with.toml")
    assert robot.correction == correction.correction
    model = toy_swimmer(bent_table())
    corrected = SwimmerModel(replace(robot, tail_length=START.tail_length), model.runs, solver=model.solver)
    start = {p.name: p.start for p in (*corrected.coefficients, *corrected.nuisances, *corrected.effects)}
    start["tail_length_offset"] = robot.tail_length - START.tail_length
    start |= {k: result.final_refit.parameters[k] for k in ("camera_scale", "heading_zero", "tachometer")}
    residual = (model.runs.y - corrected.predict([start])[0])[result.split.fitted]
    uncorrected = (model.runs.y - result.base.prediction)[result.split.fitted]
    assert (residual**2).mean() < 0.6 * (uncorrected**2).mean()
    known, plain = (read_knowledge(tmp_path / f"{name}.toml") for name in ("with", "without"))
    assert {"surface_couple", "anisotropic_head_drag"} <= set(known.names)
    place = known.names.index("C_yr")
    assert known.covariance[place, place] > 1.2 * plain.covariance[place, place]


def test_a_robot_with_a_correction_is_that_with_other_drag() -> None:
    robot = replace(CONTROL, correction=correction())
    longer = replace(robot, tail_length=1.1 * CONTROL.tail_length)
    for corrected in (robot, longer):
        plain, values = replace(corrected, correction=None).group_values(), corrected.group_values()
        g = 0.2 + 0.1 * np.log(corrected.tail_length / CONTROL.tail_length) / 0.2
        assert values["C_yr"] == pytest.approx(plain["C_yr"] * np.exp(1.5 * np.tanh(g / 1.5)))
        assert values["surface_couple"] == pytest.approx(2 * np.tanh(0.025))
        assert {k: v for k, v in values.items() if k not in ("C_yr", "surface_couple")} == {
            k: v for k, v in plain.items() if k != "C_yr"
        }
    moved, still = steady(robot.groups()), steady(CONTROL.groups())
    assert abs(moved.omega_yr[0]) > 1.1 * abs(still.omega_yr[0])
    planned, plain_plan = (table_vehicle(swimmer, load()).yaw_rate for swimmer in (robot, CONTROL))
    assert planned == pytest.approx(abs(moved.omega_yr[0]), rel=0.01)  # the planner steers with it
    assert planned > 1.1 * plain_plan


def test_outside_its_range_it_refuses() -> None:
    for change in (
        {"tails": 4},
        {"tail_length": 2 * CONTROL.tail_length},
        {"motor_speed": 2 * CONTROL.motor_speed},
    ):
        robot = replace(CONTROL, correction=correction(), **change)
        with pytest.raises(InputError, match="outside the runs that the robot's correction was learnt from"):
            plan(circle(2.0), robot)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("C_yr = [0.2, 0.1]", "C_q = [0.2, 0.1]|unknown weights"),
        ("C_yr = [0.2, 0.1]", "C_yr = [0.2]|a weight for every term"),
        ("powers = [[0, 0, 0], [0, 1, 0]]", "powers = [[0, 0, 0], [0, 4, 0]]|powers are"),
        ("error = 0.03", "|no entry 'error'"),
        ("error = 0.03", 'error = "small"|cannot be read'),
        ("error = 0.03", "error = nan|finite"),
    ],
    ids=["name", "weights", "powers", "no error", "words", "nan"],
)
def test_it_is_read_as_it_is_written_and_a_wrong_table_is_refused(
    change: str, expected: str, tmp_path: Path
) -> None:
    robot = replace(CONTROL, correction=correction())
    text = robot_toml(robot)
    (tmp_path / "robot.toml").write_text(text)
    assert load_robot(tmp_path / "robot.toml") == robot
    new, _, message = expected.partition("|")
    assert change in text
    (tmp_path / "robot.toml").write_text(text.replace(change, new))
    with pytest.raises(InputError, match=message):
        load_robot(tmp_path / "robot.toml")


def test_a_corrected_robot_is_not_calibrated_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    toy_table(1).to_csv(tmp_path / "t.csv", index=False)
    (tmp_path / "robot.toml").write_text(robot_toml(replace(CONTROL, correction=correction())))
    words = ["calibrate", str(tmp_path / "t.csv"), "--robot", str(tmp_path / "robot.toml"), "--out", str(tmp_path)]
    assert run_command(main, words) == 2
    assert "calibrate the robot as it was given" in capsys.readouterr().err
