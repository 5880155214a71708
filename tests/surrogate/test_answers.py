"""Answers of a table, with their errors, in laboratory units, and as functions of tensors with gradients."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch
from torch import Tensor

import softflagella as sf
from common.errors import run_command
from common.units import to_si
from sim.__main__ import main as sim
from sim.inputs import group_columns, save_robot
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
    ({"tails": 3, "C_t": 0.01, "C_yr": 10.0, "motor_speed": to_si(9.0, "rpm")}, "motor_speed", "rpm",
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
        sf.query(["paper-control", str(tmp_path / "fast.toml")], strict=True)


def test_a_robot_outside_is_marked_and_the_others_are_answered(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robots = pd.DataFrame([ROBOT.group_values()] * 4)
    robots["omega_bar"] *= [1.0, 400.0, 1.1, 1.2]
    robots.to_csv(file := tmp_path / "robots.csv", index=False)
    words = ["query", str(file), "--out", str(tmp_path / "motion.csv")]
    assert run_command(main, words) == 0
    said = capsys.readouterr().err
    assert said == "note: 1 of 4 robots are outside the look-up table: see the column note\n"
    found, alone = pd.read_csv(tmp_path / "motion.csv"), sf.query(robots.iloc[[0, 2, 3]])
    results = [name for name in alone if name not in (*robots, "note")]
    assert found.loc[[0, 2, 3], results].to_numpy() == pytest.approx(alone[results].to_numpy(float), rel=1e-7)
    assert found.loc[1, results].isna().all()
    assert found["note"].notna().tolist() == [False, True, False, False]
    assert re.search("not learned.*; omega_bar = .*, learned were ", found["note"][1])
    slopes = sf.query(robots, derivatives=["C_t"])["v_z_per_C_t"]
    assert slopes.isna().tolist() == [False, True, False, False]
    flagged = sf.query(robots, flag=True)
    assert flagged["outside"].tolist() == (flagged["note"] != "").tolist() == [False, True, False, False]
    assert flagged[results].notna().all(axis=None)
    (tmp_path / "motion.csv").unlink()
    assert run_command(main, [*words, "--strict"]) == 2
    assert "the robot in row 2 is outside" in capsys.readouterr().err
    assert run_command(main, [*words, "--strict", "--flag"]) == 2
    assert "leave one of them out" in capsys.readouterr().err
    robots.iloc[[1, 1]].to_csv(file, index=False)  # none is inside
    assert run_command(main, words) == 2
    assert not (tmp_path / "motion.csv").exists()


THREE_TAILS = sf.load_robot("paper-control").group_values() | {"N": 3}


def columns() -> dict[str, Any]:
    """Return three robots, of which two columns require gradients, one of them for all robots."""
    C_yr = torch.tensor([1.5, 2.0, 3.0], dtype=torch.float64, requires_grad=True)
    speed = torch.tensor(10.0, dtype=torch.float64, requires_grad=True)
    return {**THREE_TAILS, "C_yr": C_yr, "omega_bar": speed}


@pytest.mark.parametrize(("ask", "more"), [
    (sf.torch_query, {}), (sf.torch_query, {"dwell_bar": 1.0}), (sf.torch_query, {"N": 1}), (sf.torch_steady, {}),
])  # fmt: skip
def test_gradients_are_those_of_differences(ask: Callable[..., dict[str, Tensor]], more: dict[str, float]) -> None:
    given = columns() | more
    outputs = ["omega_yr_bar", "v_z"] + ["net_speed_bar"] * ("dwell_bar" in more)

    def total(robots: dict[str, Any]) -> Tensor:
        answer = ask(robots)
        return torch.stack([(answer[name] ** 2).sum() for name in outputs]).sum()

    total(given).backward()  # type: ignore[no-untyped-call]
    for name in ("C_yr", "omega_bar"):
        at = given[name].detach()
        high, low = (total({**given, name: at * (1 + s * 1e-3)}).item() for s in (1, -1))
        assert float((given[name].grad * at).sum()) == pytest.approx((high - low) / 2e-3, rel=1e-4)


def test_a_query_adds_its_jacobian() -> None:
    found = sf.query("paper-control", derivatives=True)
    robot = sf.load_robot("paper-control").group_values()
    slopes = sf.sensitivities("paper-control", ["C_yr", "omega_bar"])
    for name in ("C_yr", "omega_bar"):
        assert found[f"omega_yr_bar_per_{name}"].item() == pytest.approx(
            slopes["omega_yr_bar", name].item(), rel=0.01
        )
    named = sf.query(robot, derivatives=["end_over_end_drag"])
    assert [name for name in named if name.startswith("v_z_per")] == ["v_z_per_end_over_end_drag"]
    with pytest.raises(sf.InputError, match="no input with derivatives"):
        sf.query(robot, derivatives=["v_x"])


def test_values_without_gradients_are_those_of_the_table() -> None:
    robots = {name: np.full(2, value) for name, value in THREE_TAILS.items()}
    answer = sf.torch_query(robots)
    wanted = sf.load_table().query(robots)
    assert {name: value.tolist() for name, value in answer.items()} == {n: v.tolist() for n, v in wanted.items()}
    assert not any(value.requires_grad for value in answer.values())


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(sf.InputError, match="N requires a gradient"):
        sf.torch_query({**THREE_TAILS, "N": torch.tensor(3.0, requires_grad=True)})
    with pytest.raises(sf.InputError, match="differ in length"):
        sf.torch_query({**THREE_TAILS, "C_t": torch.ones(2), "C_r": torch.ones(3)})
    with pytest.raises(sf.InputError, match="outside the look-up table"):
        sf.torch_query({**THREE_TAILS, "omega_bar": 2000.0})
