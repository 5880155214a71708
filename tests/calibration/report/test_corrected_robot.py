"""What a calibration hands on: the corrected robot knows how sure it is, and the planner says so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.report.corrected_robot import calibration_knowledge, corrected_robot, corrected_toml
from calibration.swimmer.candidate_effects import CURRENT
from calibration.swimmer.synthetic_table import make_table
from planner.files.plan_json import load_plan
from planner.files.tracking_error import tracking_error
from planner.paths.path import circle
from planner.planning.plan import plan
from planner.vehicle.calibration_table import read_knowledge
from sim.inputs import load_robot, save_robot
from sim.io.errors import run_command
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.schedule import Schedule, load_schedule
from sim.motion.replay import replay
from surrogate.table.model_file import load_table
from tests.calibration.toy_tables import START, calibrated_toy


@pytest.mark.slow
def test_the_corrected_robot_carries_the_covariance_of_its_fit(tmp_path: Path) -> None:
    result = calibrated_toy(5, end_over_end_drag=5.0)
    assert result.effects == ("end_over_end_drag",)
    path = tmp_path / "corrected.toml"
    path.write_text(corrected_toml(START, result.fits.final_refit))
    robot, knowledge = load_robot(path), read_knowledge(path)
    fitted = corrected_robot(START, result.fits.final_refit.parameters)
    sigma = dict(zip(knowledge.names, np.sqrt(np.diag(knowledge.covariance)), strict=True))
    assert {"C_t", "C_r", "C_yr", "youngs_modulus", "tail_length", "end_over_end_drag"} <= set(sigma)
    for name in sigma:  # written to the digits that the runs have determined
        value, exact = (each.effects.get(name) or getattr(each, name) for each in (robot, fitted))
        error = sigma[name] * (1 if name in robot.effects else exact)
        assert abs(value - exact) <= 0.05 * error
    written = [word for line in path.read_text().split("[calibration]")[0].splitlines() if "speed" not in line
               for word in line.split("#")[0].split("=")[1:]]  # fmt: skip
    assert max(sum(map(str.isdigit, word)) for word in written if "[" not in word) < 10
    low, high = result.final.interval("end_over_end_drag")
    assert 2 * 1.96 * sigma["end_over_end_drag"] == pytest.approx(high - low, rel=0.35)  # a session more
    assert sigma["youngs_modulus"] < START.sigma("youngs_modulus").of(1.0)
    assert sigma["tail_length"] == pytest.approx(1e-3 / START.tail_length, rel=0.5)  # of ln l, by its prior


@pytest.mark.slow
def test_a_current_is_handed_on_with_its_error() -> None:
    delivered = calibrated_toy(3).fits.final_refit
    current = replace(delivered.fitted[0], name=CURRENT[1], logarithmic=False)
    handed_on = calibration_knowledge(
        START,
        replace(
            delivered,
            parameters={**delivered.parameters, CURRENT[1]: 2e-4},
            fitted=(*delivered.fitted, current),
            covariance=np.block([
                [delivered.covariance, np.zeros((len(delivered.fitted), 1))],
                [np.zeros((1, len(delivered.fitted))), np.array([[1e-10]])],
            ]),
        ),
    )  # fmt: skip
    assert handed_on.current == (0.0, 2e-4)
    assert handed_on.current_error == (0.0, pytest.approx(1e-5))
    assert CURRENT[1] not in handed_on.names


@pytest.mark.rest
def test_from_a_table_to_a_path_whose_stated_error_holds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Through the commands. E, μ0 and the coefficients are not those that were given; the true robot swims."""
    from calibration.__main__ import main as calibration
    from planner.__main__ import main as planner
    from surrogate.__main__ import main as surrogate

    given = replace(PRESETS["paper-measured"], tails=2)
    truth = replace(
        given, C_t=3.1, C_r=2.4, C_yr=4.4,
        youngs_modulus=0.93 * given.youngs_modulus, viscosity=1.03 * given.viscosity,
    )  # fmt: skip
    save_robot(given, tmp_path / "given.toml")
    make_table(truth, seed=8, tails=(2, 3, 4), lengths_cm=(6.0, 9.0), title="").to_csv(tmp_path / "runs.csv")
    robot, table, out = (str(tmp_path / name) for name in ("out/corrected.toml", "robot.json", "plan"))
    words = ["calibrate", str(tmp_path / "runs.csv"), "--robot", str(tmp_path / "given.toml")]
    assert run_command(calibration, [*words, "--out", str(tmp_path / "out")]) == 0
    assert run_command(surrogate, ["robot", robot, "--out", table]) == 0
    assert run_command(planner, ["plan", "circle:2l", "--robot", robot, "--lookup", table, "--out", out]) == 0
    record = load_plan(Path(out) / "plan.json")
    error = tracking_error(record, _swum(load_schedule(Path(out) / "plan.json"), load_robot(robot), truth))
    assert error.largest < record["stated_error_over_l"] < 6 * error.largest
    assert "within the stated error" in error.line
    unsure = plan(circle(2.0), load_robot(robot), lookup=load_table(table)).stated_error
    assert unsure < 0.8 * record["stated_error_over_l"]
    capsys.readouterr()


def _swum(schedule: Schedule, planned: Robot, truth: Robot):  # type: ignore[no-untyped-def]
    """The track of the true robot, in units of the planned one: seconds and metres are the same."""
    time, length = planned.time_scale / truth.time_scale, planned.tail_length / truth.tail_length
    x, y, heading = schedule.start
    schedule_of_truth = Schedule(
        truth.group_values(), schedule.first_direction, schedule.dwells * time, (x * length, y * length, heading),
        truth.time_scale,
    )  # fmt: skip
    track = replay([schedule_of_truth])[0]
    track[["x_over_l", "y_over_l"]] /= length
    return track
