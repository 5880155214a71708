"""Answers of look-up tables for robots, each with its error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.__main__ import main as sim
from sim.io.errors import run_command
from sim.model.presets import PRESETS
from sim.motion.lab_units import describe_motion
from surrogate.__main__ import main
from surrogate.one_robot.tabulate import tabulate
from surrogate.table.answers import answer_with_error
from surrogate.table.model_file import load

ROBOT = PRESETS["paper-control"]
COLUMNS = {name: np.array([value]) for name, value in ROBOT.group_values().items()}


def test_the_error_is_that_of_the_widest_interval() -> None:
    answer = answer_with_error(load(), COLUMNS)
    speed = float(np.hypot(answer["v_x"], answer["v_z"])[0])
    sizes = {"omega_t_bar": 7.588, "omega_h_bar": 2.412, "omega_yr_bar": 0.04903, "v_x": speed, "v_z": speed}
    halves = [(answer[f"{name}_high"] - answer[f"{name}_low"])[0] / 2 / size for name, size in sizes.items()]
    assert answer["error"].item() == pytest.approx(max(halves), rel=1e-3)


def test_a_table_without_intervals_has_no_error() -> None:
    assert "error" not in answer_with_error(replace(load(), intervals=None), COLUMNS)


def test_a_table_of_one_robot_has_the_error_that_it_states() -> None:
    table = tabulate(ROBOT)
    worst = max(table.errors[name]["rms"] for name in ("omega_yr_bar", "v_x", "v_z"))
    assert answer_with_error(table, COLUMNS)["error"].tolist() == [worst]


def test_the_command_prints_the_answer_for_a_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(main, ["query", "paper-control", "--certify"]) == 0
    said = capsys.readouterr().out
    answer = answer_with_error(load(), COLUMNS)
    assert said.startswith(describe_motion(ROBOT, answer, error="relative error of the look-up table (90 %)"))
    assert "certified relative error 0.0" in said
    assert run_command(main, ["query", "points.csv"]) == 2
    assert "points.csv: no such file" in capsys.readouterr().err
    Path("points.csv").write_text("N\n2\n")
    assert run_command(main, ["query", "points.csv"]) == 2
    assert "name the file of the answers with --out" in capsys.readouterr().err
    assert run_command(sim, ["steady", "paper-control"]) == 0
    assert capsys.readouterr().out.splitlines()[0] == said.splitlines()[0]
