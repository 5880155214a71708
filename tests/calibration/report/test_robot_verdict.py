"""A verdict on a robot: what it says, its report and files, and the corrected robot, with its uncertainty."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from calibration.report.report import write_report
from calibration.robot.corrected_robot import as_toml, calibration_knowledge, corrected_robot, handed_on
from calibration.robot.robot_verdict import RobotVerdict
from calibration.statistics.fit import Pull
from calibration.swimmer.influences import CURRENT, nuisance_parameters
from calibration.swimmer.synthetic_table import make_table
from calibration.verdict.verdict import Verdict
from calibration.words.quantities import detectable, direction_in_words, plain, size, with_error
from calibration.words.render import next_steps
from common.errors import run_command
from planner.files.saved_plan import load_plan
from planner.jobs.plan import plan
from planner.paths.path import circle
from sim.inputs import load_robot, save_robot
from sim.knowledge import read_knowledge
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.schedule import Schedule, load_schedule
from sim.motion.replay import replay
from softflagella.__main__ import main as softflagella
from surrogate.__main__ import main as surrogate
from surrogate.table_file import load_table
from tests.calibration.toy_tables import (
    DRAG,
    START,
    effect,
    install_few_candidates,
    none,
    number,
    verdict_of,
)
from tests.page_text import PageText
from tracking.tracks import tracking_error


def with_effect() -> RobotVerdict:
    return verdict_of(effect())


@pytest.mark.slow
def test_a_verdict_says_what_it_found_in_a_few_lines() -> None:
    for verdict in (with_effect(), verdict_of(none())):
        text = repr(verdict)
        assert len(text.encode()) < 1000
        assert text.startswith(f"Verdict {verdict.verdict!r}")
        assert all(name in text for name in verdict.effects)
        assert verdict.sentence[:200] in text
        on_sessions = re.sub(r"\(.*?\)", "", text.splitlines()[-1].partition("; on conditions")[0])
        shares = [float(share) for share in re.findall(r"([\d.]+) %", on_sessions)]
        errors = [verdict.error_uncalibrated, verdict.error_before]
        errors += [verdict.error_after] if verdict.effects else []
        assert shares == pytest.approx([100 * error for error in (*errors, verdict.noise_ceiling)], abs=0.006)
    page = verdict._repr_html_()
    assert page.startswith("<pre ")
    assert "data:image/png" in page
    values = dict(verdict.quantities())
    assert verdict.sentence == values.pop("conclusion")
    assert values.pop("errors") == verdict.errors_in_words
    parameters = verdict.to_dict()["parameters"]
    assert set(values) == {each["title"] for each in parameters.values()}
    for each in parameters.values():
        number, low, high = map(
            float, re.findall(r"-?[\d.]+(?:e-?\d+)?", values[each["title"]].replace("−", "-"))[:3]
        )
        assert low < number < high
    axes = Figure().add_subplot()
    assert verdict.plot(axes) is axes
    assert axes.patches


@pytest.mark.slow
def test_a_verdict_has_the_corrected_robot_and_writes_its_files_and_errors(tmp_path: Path) -> None:
    verdict = with_effect()
    assert verdict.corrected == handed_on(START, verdict.final_refit)[0]
    assert verdict.corrected.effects[DRAG] == pytest.approx(5.0, rel=0.3)
    paths = verdict.save(tmp_path / "calibrated")
    assert [path.name for path in paths] == ["verdict.json", "report.html", "corrected.toml"]
    assert load_robot(paths[2]) == verdict.corrected
    assert read_knowledge(paths[2]).names == verdict.knowledge.names
    assert json.loads(paths[0].read_text())["effects"] == [DRAG]
    assert "runs.csv" in paths[1].read_text()
    frame = verdict.to_frame()
    assert frame.loc["after", "all"] == verdict.error_after
    assert frame.loc["before", "omega_yr"] == verdict.errors.by_output["before"]["omega_yr"]
    assert verdict.to_dict()["table"] == "runs.csv"


@pytest.mark.slow
def test_the_corrected_robot_carries_the_covariance_of_its_fit(tmp_path: Path) -> None:
    result = effect()
    path = tmp_path / "corrected.toml"
    path.write_text(as_toml(*handed_on(START, result.final_refit)))
    robot, knowledge = load_robot(path), read_knowledge(path)
    fitted = corrected_robot(START, result.final_refit.parameters)
    sigma = dict(zip(knowledge.names, np.sqrt(np.diag(knowledge.covariance)), strict=True))
    assert {"C_t", "C_r", "C_yr", "youngs_modulus", "tail_length", DRAG} <= set(sigma)
    for name in sigma:  # written to the digits that the runs have determined
        value, exact = (each.effects.get(name) or getattr(each, name) for each in (robot, fitted))
        error = sigma[name] * (1 if name in robot.effects else exact)
        assert abs(value - exact) <= 0.05 * error
    written = [word for line in path.read_text().split("[calibration]")[0].splitlines() if "speed" not in line
               for word in line.split("#")[0].split("=")[1:]]  # fmt: skip
    assert max(sum(map(str.isdigit, word)) for word in written if "[" not in word) < 10
    low, high = result.final.interval(DRAG)
    assert 2 * 1.96 * sigma[DRAG] == pytest.approx(high - low, rel=0.35)  # a session more
    assert sigma["youngs_modulus"] < START.sigma("youngs_modulus").of(1.0)
    assert sigma["tail_length"] == pytest.approx(1e-3 / START.tail_length, rel=0.5)  # of ln l, by its prior


def test_a_current_is_handed_on_with_its_error() -> None:
    delivered = none().final_refit
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
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Through the commands. E, μ0 and the coefficients are not those that were given; the true robot swims."""
    install_few_candidates(monkeypatch)
    given = replace(PRESETS["paper-measured"], tails=2)
    truth = replace(
        given, C_t=3.1, C_r=2.4, C_yr=4.4,
        youngs_modulus=0.93 * given.youngs_modulus, viscosity=1.03 * given.viscosity,
    )  # fmt: skip
    save_robot(given, tmp_path / "given.toml")
    make_table(truth, seed=8, tails=(2, 3, 4), lengths_cm=(6.0, 9.0), title="").to_csv(tmp_path / "runs.csv")
    robot, table, out = (str(tmp_path / name) for name in ("out/corrected.toml", "robot.json", "plan"))
    words = ["calibrate", str(tmp_path / "runs.csv"), "--robot", str(tmp_path / "given.toml")]
    assert run_command(softflagella, [*words, "--no-laws", "--no-path", "--out", str(tmp_path / "out")]) == 0
    assert run_command(surrogate, ["robot", robot, "--out", table]) == 0
    assert run_command(softflagella, ["plan", "circle:2l", "--robot", robot, "--lookup", table, "--out", out]) == 0
    record = load_plan(Path(out) / "plan.json")
    error = tracking_error(record, _swum(load_schedule(Path(out) / "plan.json"), load_robot(robot), truth))
    assert error.largest < record["stated_error_over_l"] < 6 * error.largest
    assert "within the stated error" in error.line
    unsure = plan(circle(2.0), load_robot(robot), lookup=load_table(table)).stated_error
    assert unsure < 0.8 * record["stated_error_over_l"]
    capsys.readouterr()


def _swum(schedule: Schedule, planned: Robot, truth: Robot) -> pd.DataFrame:
    """The track of the true robot, in units of the planned one: seconds and metres are the same."""
    time, length = planned.time_scale / truth.time_scale, planned.tail_length / truth.tail_length
    x, y, heading = schedule.start
    schedule_of_truth = Schedule(
        truth.group_values(), schedule.first_direction, schedule.dwells * time, (x * length, y * length, heading),
        truth.time_scale,
    )  # fmt: skip
    track = replay(schedule_of_truth)
    track[["x_over_l", "y_over_l"]] /= length
    return track


def page(result: Verdict, folder: Path) -> PageText:
    write_report(result, result.to_dict(), folder / "report.html")
    return PageText(folder / "report.html")


@pytest.mark.slow
def test_a_report_is_in_the_words_and_units_of_a_lab_with_what_to_do_next_near_the_top(tmp_path: Path) -> None:
    """verdict.json stays in SI units; only what is shown has others."""
    result = number()
    seen = page(result, tmp_path)
    assert "SI" not in seen.text
    for value in ("1.2 MPa", "1.49 Pa s", "3.2 mm", "1.6 cm", "6 cm", "± 1 mm", "± 1°", "1.600 ± 0.016 cm"):
        assert value in seen.text, value
    assert re.findall(r"\d[eE][-+]\d\d", seen.text) == []  # no exponents
    assert "^" not in seen.text  # no products of powers
    assert re.findall(r"omega_\w+|R_yr|theta", seen.text) == []
    assert re.search(r"one standard deviation is C_t [\d.]+ % \w+, C_r [\d.]+ % \w+ and C_yr", seen.text)
    assert seen.headings[:2] == ["The verdict in full", "What to do next"]
    assert "Measure again: " in seen.text
    assert "scale of the camera" in seen.text
    assert [c.effect.name for c in result.attribution.candidates if f"({c.effect.name})" not in seen.text] == []
    assert seen.text.count("tail length [cm]") == 3  # of both models, and on the first screen
    record = result.to_dict()
    given = {entry["name"]: entry["given"] for entry in record["numbers_as_given"]}
    assert given["youngs_modulus"] == START.youngs_modulus
    assert given["head_length"] == START.head_length
    assert record["next_steps"] == next_steps(result.facts)


def test_numbers_are_written_without_exponents_and_changes_in_words() -> None:
    assert [plain(v) for v in (1.2e6, 3.2e-3, 8.7e-10, 0.0, 12.0)] == [
        "1200000", "0.0032", "0.00000000087", "0", "12",
    ]  # fmt: skip
    assert with_error(1.3456, 0.0932, "MPa") == "1.346 ± 0.093 MPa"
    assert with_error(-1e-9, 0.84, "mm", signed=True) == "0.00 ± 0.84 mm"
    assert with_error(0.63, 0.26, "°", signed=True) == "+0.63 ± 0.26°"
    worst = direction_in_words({"C_t": 0.6, "C_r": -0.8, "C_yr": 0.01}, 0.1)
    assert worst == "C_t 6.2 % larger and C_r 7.7 % smaller"
    stiffness = nuisance_parameters(START, {}, ("omega_yr",), ())[0]
    for change, words in (
        (8.7e-12, "E (Young's modulus) is what was given (0.0 σ)"),
        (math.log(0.6), "E (Young's modulus) is 40 % below what was given (5.1 σ)"),
        (math.log(2.24), "E (Young's modulus) is 124 % above what was given (8.1 σ)"),
    ):
        assert Pull(stiffness, change, 0.1, change, 0.1, change / 0.1, False).words == words


@pytest.mark.parametrize(
    ("unit", "shown", "words"),
    [
        ("1", 1.0, "0.05"),
        ("cm/s", 100.0, "5 cm/s"),
        ("1/h", 1.0, "0.05 per h"),
        ("8π μ0 R³", 1.0, "0.05 × 8π μ0 R³"),
        ("μ0 a² l", 1.0, "0.05 × μ0 a² l"),
        ("L, forward", 1.0, "0.05 L, forward"),
    ],
)
def test_the_size_of_an_effect_has_its_unit(unit: str, shown: float, words: str) -> None:
    effect = {"given": 0.0, "bounds": [-1.0, 2.0], "unit": unit, "shown": shown}
    assert size(0.05, effect) == words
    assert detectable(1e150, effect) == "–"
    assert detectable(6.2e6, effect) == "beyond its range"
