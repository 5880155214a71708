"""A verdict on a robot: what it says, the corrected robot, its files."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from calibration.report.corrected_robot import handed_on
from calibration.report.robot_verdict import FILES, RobotVerdict
from calibration.swimmer.measured_table import read_measurements
from planner.vehicle.calibration_table import read_knowledge
from sim.inputs import load_robot
from tests.calibration.toy_tables import START, calibrated_toy, install_toy, toy_table


def verdict_of(seed: int, **effects: float) -> RobotVerdict:
    with pytest.MonkeyPatch.context() as patch:
        install_toy(patch)
        runs = read_measurements(toy_table(seed, **effects))
    return RobotVerdict(**vars(calibrated_toy(seed, **effects)), robot=START, runs=runs, table="runs.csv")


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "effects"), [(5, {"end_over_end_drag": 5.0}), (3, {})])
def test_a_verdict_says_what_it_found_in_a_few_lines(seed: int, effects: dict[str, float]) -> None:
    verdict = verdict_of(seed, **effects)
    text = repr(verdict)
    assert len(text.encode()) < 1000
    assert text.startswith(f"Verdict {verdict.verdict!r}")
    assert all(name in text for name in verdict.effects)
    assert verdict.sentence[:200] in text
    shares = [float(share) for share in re.findall(r"([\d.]+) %", text.splitlines()[-1])]
    errors = [verdict.error_uncalibrated, verdict.error_before]
    errors += [verdict.error_after] if verdict.effects else []
    assert shares == pytest.approx([100 * error for error in (*errors, verdict.noise_ceiling)], abs=0.006)
    page = verdict._repr_html_()
    assert page.startswith("<pre ")
    assert "data:image/png" in page
    axes = Figure().add_subplot()
    assert verdict.plot(axes) is axes
    assert axes.patches


@pytest.mark.slow
def test_a_verdict_has_the_corrected_robot_and_writes_its_files(tmp_path: Path) -> None:
    verdict = verdict_of(5, end_over_end_drag=5.0)
    assert verdict.corrected == handed_on(START, verdict.fits.final_refit)[0]
    assert verdict.corrected.effects["end_over_end_drag"] == pytest.approx(5.0, rel=0.3)
    paths = verdict.save(tmp_path / "calibrated")
    assert [path.name for path in paths] == list(FILES)
    assert load_robot(paths[2]) == verdict.corrected
    assert read_knowledge(paths[2]).names == verdict.knowledge.names
    assert json.loads(paths[0].read_text())["effects"] == ["end_over_end_drag"]
    assert "runs.csv" in paths[1].read_text()


@pytest.mark.slow
def test_the_errors_of_a_verdict_as_a_table() -> None:
    verdict = verdict_of(5, end_over_end_drag=5.0)
    frame = verdict.to_frame()
    assert frame.loc["after", "all"] == verdict.error_after
    assert frame.loc["before", "omega_yr"] == verdict.errors.by_output["before"]["omega_yr"]
    assert verdict.to_dict()["table"] == "runs.csv"
