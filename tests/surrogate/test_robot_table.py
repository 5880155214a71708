"""Tables of one robot: they answer like the simulator, and damaged files are refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.errors import InputError
from planner.jobs.plan import plan
from planner.paths.path import polygon
from sim.mechanics import planar
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.response import DWELLS, at_equal_dwells
from sim.model.robot import Robot
from sim.motion.replay import replay
from sim.motion.response import responses
from sim.motion.run import Resolution
from sim.motion.steady import steady
from sim.motion.steady_motion import twists
from surrogate.answers import answer_with_error
from surrogate.robot_table import RobotTable, load_robot_table
from surrogate.table_file import load_table
from surrogate.tabulate import longer_memory, tabulate
from tests.oracles.switching import switch_response
from tests.sim.robots import control
from tests.surrogate.small import refusal, robot_table
from tracking.tracks import tracking_error

pytestmark = pytest.mark.slow


def test_a_table_of_one_robot_comes_back_as_it_was_and_damaged_ones_are_refused(tmp_path: Path) -> None:
    """Or hold the same numbers, as where 1e-5 has become 1E-5."""
    path = tmp_path / "robot.json"
    robot_table().save(path)
    assert load_table(path) == robot_table()
    assert load_table(path).identity == robot_table().identity
    contents = path.read_bytes()
    random = np.random.default_rng(6)
    same = 0
    for place in [*range(20), *random.integers(len(contents), size=60)]:
        broken = bytearray(contents)
        broken[place] ^= 1 << int(random.integers(8))
        path.write_bytes(broken)
        try:
            loaded = load_robot_table(path)
        except InputError:
            refusal(path, load_robot_table)
        else:
            same += 1
            assert loaded == robot_table()
    assert same < 5
    for size in [0, 1, len(contents) // 2, len(contents) - 3]:
        path.write_bytes(contents[:size])
        refusal(path, load_robot_table)
    for content in (b"\xff\xfe", b"[" * 100_000, b"[1]", b"9" * 10_000):
        path.write_bytes(content)
        assert "not a table of a robot" in refusal(path, load_robot_table)
    assert "no such file" in refusal(tmp_path / "absent.json", load_robot_table)
    path.write_text('{"robot": {}, "dwells": [1.0]}')
    assert "has format 1, this version reads 3" in refusal(path, load_robot_table)


WRONG = [
    ("lag", [[1.0]], "'lag' is not finite numbers, 2 × 25 × 3"), ("spread", None, "'spread' is not"),
    ("steady", {}, "'omega_t_bar' is not"), ("robot", {"C_t": float("nan")}, "'C_t' is not finite numbers, one"),
    ("slopes", {"C_t": [1.0]}, "'slope in C_t' is not"), ("before", 5, "has another form"),
    ("errors", {"v_x": {"rms": float("inf")}}, "'error of v_x' is not"),
    ("errors", {"v_x": {"rms": "0.1"}}, "'error of v_x' is not"),
    ("slopes", {"C_t": [["1", 2.0, 3.0], [1.0, 2.0, 3.0]]}, "'slope in C_t' is not"),
    ("error_curves", [[1.0]], "'error_curves' is not"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "value", "expected"), WRONG)
def test_wrong_numbers_of_one_robot_are_refused_though_the_hash_is_right(
    name: str, value: Any, expected: str, tmp_path: Path
) -> None:
    path = tmp_path / "robot.json"
    RobotTable(**{**vars(robot_table()), name: value}).save(path)
    assert expected in refusal(path, load_robot_table)


def test_an_edited_number_and_a_missing_key_of_one_robot_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.json"
    robot_table().save(path)
    content = json.loads(path.read_text())
    for name in content:
        less = {key: part for key, part in content.items() if key != name}
        path.write_text(json.dumps(less))
        assert ("format" if name == "format" else "was changed") in refusal(path, load_robot_table)
    content["robot"]["omega_bar"] += 1
    path.write_text(json.dumps(content))
    assert "was changed" in refusal(path, load_robot_table)


ROBOT = replace(PRESETS["paper-control"], effects={"end_over_end_drag": 5.0})


def columns(count: int = 1, robot: Robot = ROBOT) -> dict[str, np.ndarray]:
    return {k: np.full(count, v) for k, v in robot.group_values().items()}


def test_it_answers_like_the_simulator() -> None:
    """Net speed at equal dwells, against flips in time steps that go on until the motion repeats."""
    at = [7, 13, 22]
    dwells = DWELLS[at]
    expected = switch_response(Groups.from_columns(columns(3)), dwells)
    found = robot_table(5.0).response(columns())
    assert found.net_speed[0, at] == pytest.approx(expected.net_speed, rel=1e-2)
    assert found.lag[0, 22, 2] == pytest.approx(expected.lag_psi[2], abs=2e-4)


def test_it_has_both_directions_of_a_robot_that_turns_unequally() -> None:
    robot = replace(ROBOT, effects={"left_right_bias": 0.2})
    table = tabulate(robot)
    both = {k: np.repeat(v, 2) for k, v in columns(1, robot).items()}
    both["omega_bar"] = both["omega_bar"] * [1.0, -1.0]
    motion = steady(Groups.from_columns(both))
    found = table.query(both)
    assert found["omega_yr_bar"] == pytest.approx(motion.omega_yr)
    assert found["v_x"] == pytest.approx(motion.v_x)
    assert abs(found["omega_yr_bar"][0]) > 1.2 * abs(found["omega_yr_bar"][1])
    curves = table.response(both)
    assert np.abs(curves.lag[0] - curves.lag[1]).max() > 1e-5


@pytest.mark.parametrize("effect", ["end_over_end_drag", pytest.param("left_right_bias", marks=pytest.mark.rest)])
def test_a_robot_with_an_effect_is_planned_and_stays_within_the_stated_error(effect: str, tmp_path: Path) -> None:
    robot = ROBOT if effect in ROBOT.effects else replace(ROBOT, effects={effect: 0.2})
    (robot_table(5.0) if robot is ROBOT else tabulate(robot)).save(tmp_path / "robot.json")
    result = plan(polygon(4, 2.5), robot, lookup=load_table(tmp_path / "robot.json"))
    error = tracking_error(result.to_dict(), replay(result.schedule()))
    assert error.largest < error.stated
    assert error.rms < (0.03 if robot is ROBOT else 1.5 * result.predicted_rms + 0.005)


def test_finer_curves_differ_by_less_than_the_stated_errors() -> None:
    """Meshes half as fine again and a quarter of the tolerance, of a robot that the sizes were not found with."""
    groups = Groups.from_columns(columns())
    finer = responses(groups, tolerance=2.5e-5, meshes=(9, 13), extrapolated_memory=True)
    assert not finer.stepped.any()
    table = robot_table(5.0)
    missed = np.array(table.lag)[0] + np.array(table.memory)[0] - finer.lag[0] - finer.memory[0]
    stated = np.array(table.error_curves)[:3, :-1]
    sizes = np.sqrt((stated**2).sum(0).mean((0, 1)))
    assert (np.sqrt((missed**2).mean((0, 1))) < 2 * sizes).all()


@pytest.mark.parametrize("omega_bar", [12.0, 20.0])
def test_what_flips_that_go_on_leave_of_the_curves_is_below_what_a_table_states(omega_bar: float) -> None:
    """Dwells of 0.3 and 0.4: the curves know one dwell before the last, and the robot a little more."""
    few = np.array([3, 5])
    groups, both = control(omega_bar=omega_bar, N=4.0), control(2, omega_bar=omega_bar, N=4.0)
    stepped = switch_response(both, DWELLS[few], resolution=Resolution(24, 72)).net_speed
    motion, curves = steady(groups), responses(groups)
    twist = twists(motion.v_z, motion.v_x, motion.omega_yr, np.ones(1))
    lag = curves.lag + at_equal_dwells(curves.memory)
    off = abs(planar.net_speed(twist[:, None], lag, DWELLS)[0, few] - stepped)
    forward, aside, _ = longer_memory(DWELLS[few], omega_bar).T
    stated = np.hypot(forward, aside) * np.hypot(twist[0, 0], twist[0, 1]) / DWELLS[few]
    assert (off < 2 * stated).all()


def test_another_robot_is_refused() -> None:
    with pytest.raises(InputError, match="end_over_end_drag"):
        plan(polygon(4, 3.0), replace(ROBOT, effects={"end_over_end_drag": 4.0}), lookup=robot_table(5.0))
    with pytest.raises(InputError, match="C_t = 9"):
        robot_table(5.0).query({**columns(), "C_t": np.array([9.0])})
    own, other = robot_table(5.0).query(columns())["v_z"].item(), {"C_t": np.array([9.0, columns()["C_t"].item()])}
    two = {**{k: np.repeat(v, 2) for k, v in columns().items()}, **other}
    found = answer_with_error(robot_table(5.0), two, strict=False)
    np.testing.assert_array_equal(found["v_z"], [np.nan, own])
    assert np.isnan(found["error"]).tolist() == [True, False]
    assert [note.split("(")[0] for note in found["note"]] == ["C_t = 9 is outside this robot's table ", ""]


def test_its_slopes_are_those_of_the_simulator() -> None:
    """In every group and in the robot's effect."""
    values = ROBOT.group_values()
    assert set(robot_table(5.0).slopes) == set(values) - {"N"}
    for name in ("C_yr", "omega_bar", "l_over_r0", *ROBOT.effects):
        step = 0.01 if name not in ROBOT.effects else 0.01 * ROBOT.effects[name]
        changed = {**values, name: values[name] + step if name in ROBOT.effects else values[name] * np.exp(step)}
        found = steady(Groups.from_columns({k: np.array([v]) for k, v in changed.items()}))
        difference = found.omega_yr[0] - robot_table(5.0).steady["omega_yr_bar"][0]
        assert difference == pytest.approx(np.array(robot_table(5.0).slopes[name])[0, 2] * step, rel=0.05), name
