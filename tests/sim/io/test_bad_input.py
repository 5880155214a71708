"""What cannot be simulated is refused in one line with exit status 2, and nothing is written."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from sim.inputs import load_robot
from sim.io.errors import InputError, run_command
from sim.io.files import whole_file
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.robot_toml import robot_toml
from tests.processes import LIMIT
from tests.sim.robots import CONTROL_VALUES

GOOD = ",".join(f"{CONTROL_VALUES[k]:g}" for k in CONTROL_VALUES)
HEADER = ",".join(CONTROL_VALUES)


def table(**changes: object) -> str:
    values = {**CONTROL_VALUES, **changes}
    return ",".join(values) + "\n" + ",".join(str(v) for v in values.values()) + "\n"


BAD_TABLES = {
    "negative length": (table(l_over_R=-3), "l_over_R = -3"),
    "disc without radius": (table(a_over_R=0), "a_over_R = 0 in row 1; it must be above 0"),
    "disc of negative radius": (table(a_over_R=-1), "a_over_R = -1"),
    "no tails": (table(N=0), "N = 0"),
    "half a tail": (table(N=2.5), "N = 2.5"),
    "nan": (table(C_t="nan"), "C_t = nan"),
    "text": (table(C_t="three"), "C_t"),
    "integer beyond floats": (table(C_t="1" * 400), "C_t = inf in row 1"),
    "stout tail": (table(l_over_r0=1.2), "l/r0 = 1.2"),
    "motor at rest": (table(omega_bar=0), "omega_bar = 0"),
    "unknown column": (table(colour=3), "unknown column 'colour'"),
    "effect out of bounds": (table(end_over_end_drag=-1), "end_over_end_drag = -1"),
    "missing column": ("C_t,C_r\n1,2\n", "missing column"),
    "no rows": (HEADER + "\n", "no rows"),
    "empty": ("", "is empty"),
}


@pytest.mark.parametrize("case", list(BAD_TABLES))
def test_steady_refuses(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from sim.__main__ import main

    text, expected = BAD_TABLES[case]
    points, out = tmp_path / "points.csv", tmp_path / "out.csv"
    points.write_text(text)
    assert run_command(main, ["steady", str(points), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert "points.csv" in error
    assert error.startswith("error: ")
    assert len(error.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["points.csv"]


def test_the_command_itself_exits_with_2(tmp_path: Path) -> None:
    """Through the interpreter, as a user meets it."""
    words = [sys.executable, "-m", "sim", "steady", str(tmp_path / "none.csv"), "--out", str(tmp_path / "o.csv")]
    done = subprocess.run(words, capture_output=True, text=True, cwd=Path(__file__).parents[3], timeout=LIMIT)
    assert done.returncode == 2
    assert "none.csv" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_an_interrupted_write_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "a.csv"
    target.write_text("old")

    def write_half() -> None:
        with whole_file(target) as part:
            part.write_text("half of the n")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        write_half()
    assert target.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_robots_in_files_come_back_as_they_were(tmp_path: Path) -> None:
    robot = PRESETS["paper-measured"]
    from dataclasses import replace

    robot = replace(robot, effects={"end_over_end_drag": 4.5}, disc_offset=0.012)
    (tmp_path / "robot.toml").write_text(robot_toml(robot))
    assert load_robot(tmp_path / "robot.toml") == robot


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("length_cm = 11", "length_cm = -11", "tail_length"),
        ("count = 2", "count = 0", "N = 0"),
        ("count = 2", 'count = "two"', "give a number"),
        ("[head]", "[head]\ncolour = 1", "unknown entry"),
        ("C_t = 3.0", "", "missing entry"),
        ("[tails]", "[tails", "not TOML"),
    ],
)
def test_robot_files_are_checked(old: str, new: str, expected: str, tmp_path: Path) -> None:
    text = robot_toml(PRESETS["paper-control"])
    assert old in text
    (tmp_path / "robot.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=expected):
        load_robot(tmp_path / "robot.toml")


def test_time_scale_of_the_control_example() -> None:
    assert PRESETS["paper-control"].time_scale == pytest.approx(2.207, abs=1e-3)
    assert PRESETS["paper-control"].omega_bar == pytest.approx(10.0)
    values = PRESETS["paper-control"].group_values()
    assert [values[k] for k in ("l_over_R", "L_over_R", "l_over_r0")] == pytest.approx([6.875, 3.75, 34.375])


def test_a_robot_of_another_kind_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="paper-control"):
        load_robot("no-such-robot")
    with pytest.raises(InputError, match="one N"):
        Groups.from_columns({k: [v, v] for k, v in {**CONTROL_VALUES}.items() if k != "N"} | {"N": [2, 3]})  # type: ignore[arg-type]
    with pytest.raises(InputError, match="above 0"):
        Robot(**{**vars(PRESETS["paper-control"]), "viscosity": -1.0})
