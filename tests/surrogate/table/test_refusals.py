"""A robot that a table does not know is refused in lab units, with values that the table knows."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

import softflagella as sf
from sim.inputs import group_columns, save_robot
from sim.io.errors import run_command
from sim.io.units import to_si
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from surrogate.__main__ import main
from surrogate.interface import OutsideError
from surrogate.table.model_file import load
from surrogate.table.refusals import refusing_robots

CONTROL = PRESETS["paper-control"]
END = r"([\d.]+) (rpm|cm|mm) \(\w+ = [\d.]+\)"
WITHIN = re.compile(f"for this robot it knows {END} to {END}")


def refusal(robot: Robot) -> str:
    table = load()
    with pytest.raises(OutsideError) as caught, refusing_robots([robot], table):
        table.query(group_columns([robot]))
    return str(caught.value)


@pytest.mark.parametrize(
    ("change", "field", "unit", "words"),
    [
        ({"motor_speed": to_si(1000.0, "rpm")}, "motor_speed", "rpm", "motor speed 1000 rpm (omega_bar = 231)"),
        ({"tail_radius": 0.02}, "tail_radius", "mm", "tail radius 20 mm (l_over_r0 = 5.5)"),
        ({"disc_offset": 0.0016}, "disc_offset", "mm", "disc offset 1.6 mm (a_over_R = 0.1)"),
        ({"tail_length": 0.3}, "tail_length", "cm", "tail length 30 cm (l_over_R = 18.8)"),
        (
            {"C_t": 0.01, "C_yr": 10.0, "motor_speed": to_si(9.0, "rpm")},
            "motor_speed",
            "rpm",
            "it yaws nearly as fast as its tails turn, and may have several motions; motor speed 9 rpm (omega_bar",
        ),
    ],
)
def test_the_number_of_the_laboratory_comes_first(
    change: dict[str, float], field: str, unit: str, words: str
) -> None:
    """A refusal used to name ω̄ and what was learned of it, which says nothing about rpm."""
    robot = replace(CONTROL, name="mine", **change)
    message = refusal(robot)
    assert message.startswith(f"robot 'mine' is outside the look-up table: {words}")
    within = WITHIN.search(message)
    assert within is not None, message
    assert within[2] == within[4] == unit
    for end in (float(within[1]) * 1.001, float(within[3]) * 0.999):
        load().query(group_columns([replace(robot, **{field: to_si(end, unit)})]))  # the table knows it


def test_where_no_motor_speed_is_known_none_is_named() -> None:
    message = refusal(replace(CONTROL, C_r=0.02))
    assert "motor speed 43.26 rpm (omega_bar = 10); change the robot" in message


def test_a_robot_that_a_couple_turns_against_its_tails_is_told_so() -> None:
    against = {"surface_couple": -1.2}
    assert "a couple turns it against its tails" in refusal(replace(CONTROL, tails=3, effects=against))
    single = replace(CONTROL, tails=1, effects=against)
    assert load().query(group_columns([single]))["omega_yr_bar"][0] < 0


def test_the_command_and_python_say_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_robot(replace(CONTROL, motor_speed=to_si(1000.0, "rpm")), tmp_path / "fast.toml")
    assert run_command(main, ["query", str(tmp_path / "fast.toml")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert WITHIN.search(line)
    assert "motor speed 1000 rpm (omega_bar = " in line
    with pytest.raises(sf.InputError, match=r"robot 'paper-control' is outside .* rpm \(omega_bar = "):
        sf.query(["paper-control", str(tmp_path / "fast.toml")])
