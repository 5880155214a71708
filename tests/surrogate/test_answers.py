"""Answers for robots of a laboratory: with their error, by the command and by Python, or refused in its units."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import softflagella as sf
from sim.__main__ import main as sim
from sim.inputs import group_columns, save_robot
from sim.io.errors import run_command
from sim.io.units import to_si
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.steady_motion import describe_motion
from surrogate.__main__ import main
from surrogate.answers import answer_with_error, refusing_robots
from surrogate.interface import OutsideError
from surrogate.table_file import load
from tests.surrogate.small import robot_table

ROBOT = PRESETS["paper-control"]
COLUMNS = {name: np.array([value]) for name, value in ROBOT.group_values().items()}


def test_the_error_is_that_of_the_widest_interval() -> None:
    answer = answer_with_error(load(), COLUMNS)
    speed = float(np.hypot(answer["v_x"], answer["v_z"])[0])
    sizes = {"omega_t_bar": 7.588, "omega_h_bar": 2.412, "omega_yr_bar": 0.04903, "v_x": speed, "v_z": speed}
    halves = [(answer[f"{name}_high"] - answer[f"{name}_low"])[0] / 2 / size for name, size in sizes.items()]
    assert answer["error"].item() == pytest.approx(max(halves), rel=1e-3)
    assert "error" not in answer_with_error(replace(load(), intervals=None), COLUMNS)


def test_a_table_of_one_robot_has_the_error_that_it_states() -> None:
    table = robot_table()
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
    assert "name the file of their motion with --out" in capsys.readouterr().err
    assert run_command(sim, ["steady", "paper-control"]) == 0
    assert capsys.readouterr().out.splitlines()[0] == said.splitlines()[0]


END = r"([\d.]+) (rpm|cm|mm) \(\w+ = [\d.]+\)"
WITHIN = re.compile(f"for this robot it knows {END} to {END}")


def refusal(robot: Robot) -> str:
    table = load()
    with pytest.raises(OutsideError) as caught, refusing_robots([robot], table):
        table.query(group_columns([robot]))
    return str(caught.value)


BEYOND: list[tuple[dict[str, float], str, str, str]] = [
    ({"motor_speed": to_si(1000.0, "rpm")}, "motor_speed", "rpm", "motor speed 1000 rpm (omega_bar = 231)"),
    ({"tail_radius": 0.02}, "tail_radius", "mm", "tail radius 20 mm (l_over_r0 = 5.5)"),
    ({"disc_offset": 0.0016}, "disc_offset", "mm", "disc offset 1.6 mm (a_over_R = 0.1)"),
    ({"tail_length": 0.3}, "tail_length", "cm", "tail length 30 cm (l_over_R = 18.8)"),
    ({"C_t": 0.01, "C_yr": 10.0, "motor_speed": to_si(9.0, "rpm")}, "motor_speed", "rpm",
     "it yaws nearly as fast as its tails turn, and may have several motions; motor speed 9 rpm (omega_bar"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "field", "unit", "words"), BEYOND)
def test_the_number_of_the_laboratory_comes_first(
    change: dict[str, float], field: str, unit: str, words: str
) -> None:
    robot = replace(ROBOT, name="mine", **change)
    message = refusal(robot)
    assert message.startswith(f"robot 'mine' is outside the look-up table: {words}")
    within = WITHIN.search(message)
    assert within is not None, message
    assert within[2] == within[4] == unit
    for end in (float(within[1]) * 1.001, float(within[3]) * 0.999):
        load().query(group_columns([replace(robot, **{field: to_si(end, unit)})]))  # the table knows it


def test_what_is_said_where_no_motor_speed_or_another_direction_is_known() -> None:
    message = refusal(replace(ROBOT, C_r=0.02))
    assert "motor speed 43.26 rpm (omega_bar = 10); change the robot" in message
    against = {"surface_couple": -1.2}
    assert "a couple turns it against its tails" in refusal(replace(ROBOT, tails=3, effects=against))
    single = replace(ROBOT, tails=1, effects=against)
    assert load().query(group_columns([single]))["omega_yr_bar"][0] < 0


def test_the_command_and_python_say_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_robot(replace(ROBOT, motor_speed=to_si(1000.0, "rpm")), tmp_path / "fast.toml")
    assert run_command(main, ["query", str(tmp_path / "fast.toml")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert WITHIN.search(line)
    assert "motor speed 1000 rpm (omega_bar = " in line
    with pytest.raises(sf.InputError, match=r"robot 'paper-control' is outside .* rpm \(omega_bar = "):
        sf.query(["paper-control", str(tmp_path / "fast.toml")])
