"""Robots as people give them; tables in lab units; inverse queries and sweeps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
import surrogate.__main__
from common.tables import read_table
from dataset.schema import INPUTS, OUTPUTS
from sim.motion.steady_motion import LAB_COLUMNS
from sim.robot_rows import UNITS, robot_rows, with_units
from tests.planner.plans import CONTROL, own_table


@pytest.fixture
def file(tmp_path: Path) -> Path:
    sf.save_robot(replace(CONTROL, name="mine", viscosity=2.0), tmp_path / "robot.toml")
    return tmp_path / "robot.toml"


def test_a_robot_its_name_and_its_values_are_the_same_rows(file: Path) -> None:
    for robots in (CONTROL, "paper-control", [CONTROL], ["paper-control"], CONTROL.group_values(),
                   pd.DataFrame([CONTROL.group_values()])):  # fmt: skip
        columns = robot_rows(robots).columns
        assert {name: values.item() for name, values in columns.items()} == pytest.approx(CONTROL.group_values())
    for path in (file, str(file), [file]):
        assert robot_rows(path).robots == (sf.load_robot(file),)


def test_a_list_fills_in_the_null_of_an_effect_that_a_robot_lacks() -> None:
    odd = replace(CONTROL, effects={"anisotropic_head_drag": 1.5})
    null = sf.effects()["anisotropic_head_drag"].null
    assert robot_rows([CONTROL, odd]).columns["anisotropic_head_drag"].tolist() == [null, 1.5]
    with pytest.raises(sf.InputError, match="differ in length"):
        robot_rows({**CONTROL.group_values(), "C_t": [1.0, 2.0], "C_r": [1.0, 2.0, 3.0]})
    with pytest.raises(sf.InputError, match="no robots"):
        robot_rows([])
    with pytest.raises(sf.InputError, match="no robot 'paper'"):
        robot_rows("paper")


def test_a_table_begins_with_names_and_lab_units(file: Path) -> None:
    for motion in (sf.steady([CONTROL, file]), sf.query([CONTROL, file])):
        assert list(motion)[: 1 + len(LAB_COLUMNS)] == ["robot", *LAB_COLUMNS]
        assert motion["robot"].tolist() == ["paper-control", "mine"]
        assert not motion.columns.duplicated().any()
        units = motion.attrs["units"]
        assert {units[name] for name in LAB_COLUMNS} == {"rpm", "rad/s", "cm", "degrees", "cm/s", "s"}
        assert units["omega_yr_bar"] == "EI/(mu0 l^4)"
        assert (motion["error"] < 0.01).all()
    motion = sf.steady({**CONTROL.group_values(), "omega_bar": [5.0, 10.0]})  # without lab units
    assert len(motion) == 2
    assert not {"robot", *LAB_COLUMNS} - {"theta_deg"} & set(motion)
    assert motion["omega_yr_bar"].iloc[1] == sf.steady(CONTROL)["omega_yr_bar"].item()


RUNS = pd.DataFrame({"Tails": [2, 3], "l_mm": [90.0, 110.0], "rpm": [60.0, -40.0], "R_yr_cm": 1.0, "day": "=a"})


def test_runs_of_a_robot_come_back_with_their_inputs(tmp_path: Path) -> None:
    alone = [
        replace(CONTROL, tails=n, tail_length=length, motor_speed=rpm * np.pi / 30)
        for n, length, rpm in ((2, 0.09, 60.0), (3, 0.11, 40.0))
    ]
    motion, expected = sf.query(RUNS, robot=CONTROL), sf.query(alone)
    assert list(motion)[:5] == ["Tails", "l_mm", "rpm", "day", "omega_h_rpm"]
    assert motion["omega_yr_rad_s"].to_numpy() == pytest.approx(expected["omega_yr_rad_s"].to_numpy() * [1, -1])
    assert motion["R_yr_cm"].to_numpy() == pytest.approx(expected["R_yr_cm"].to_numpy())
    RUNS.to_csv(tmp_path / "runs.csv", index=False)
    command = ["query", str(tmp_path / "runs.csv"), "--robot", "paper-control", "--out", str(tmp_path / "o.csv")]
    surrogate.__main__.main(command)
    written = read_table(tmp_path / "o.csv")
    assert written["R_yr_cm"].to_numpy() == pytest.approx(expected["R_yr_cm"].to_numpy(), rel=1e-6)
    assert written["day"].tolist() == ["=a", "=a"]
    columns = {**CONTROL.group_values(), "omega_bar": [5.0, 10.0]}
    assert list(sf.query(columns))[: len(columns)] == list(columns)


@pytest.mark.parametrize(
    ("runs", "words"),
    [
        (RUNS.assign(Tails=[2.5, 3]), "the table, row 1: N = 2.5; give a whole number"),
        (RUNS.assign(l_mm=["long", 3]), "the table, row 1: tail_length"),
        (RUNS[["day"]], "the table: no column N, l_cm, omega_rpm"),
        ([CONTROL], "robot goes with a table of runs"),
    ],
    ids=["half a tail", "a word", "no columns", "robots"],
)
def test_runs_that_cannot_be_are_refused(runs: pd.DataFrame, words: str) -> None:
    with pytest.raises(sf.InputError, match=words):
        robot_rows(runs, CONTROL)


@pytest.mark.slow
def test_a_response_in_lab_units(file: Path) -> None:
    both = sf.response([CONTROL, file])
    alone = sf.response(file)
    second = both[both["robot"] == "mine"].reset_index(drop=True)
    assert len(both) == 2 * len(alone)
    np.testing.assert_allclose(second["lag_z"], alone["lag_z"], rtol=1e-9, atol=1e-12)
    robot = sf.load_robot(file)
    assert (alone["dwell_s"] / alone["dwell_bar"]).to_numpy() == pytest.approx(robot.time_scale)
    moves = alone.dropna(subset="net_speed_bar")
    assert (moves["net_speed_cm_s"] / moves["net_speed_bar"]).to_numpy() == pytest.approx(
        100 * robot.tail_length / robot.time_scale
    )
    assert np.degrees(alone["lag_psi_rad"]).to_numpy() == pytest.approx(alone["lag_psi_deg"].to_numpy())
    assert list(both)[:3] == ["robot", "direction", "before_s"]
    table = sf.response({**CONTROL.group_values(), "N": [3, 2, 3], "C_yr": [2.0, 2.0, 3.0]})  # in any order
    assert table["row"].unique().tolist() == [0, 1, 2]
    of_robot = both.loc[both["robot"] == "paper-control", "lag_z"]
    np.testing.assert_allclose(table.loc[table["row"] == 1, "lag_z"], of_robot, rtol=1e-9, atol=1e-12)
    assert "dwell_s" not in table


def test_a_table_is_the_same_as_its_file_and_its_results_are_replaced(tmp_path: Path) -> None:
    table = pd.DataFrame({**CONTROL.group_values(), "omega_bar": [5.0, 10.0], "dwell_bar": 1.0, "v_x": 7.0})
    table.to_csv(tmp_path / "points.csv", index=False)
    motion = sf.query(tmp_path / "points.csv")
    assert motion.equals(sf.query(table))
    assert (motion["net_speed_bar"] > 0).all()
    assert (motion["v_x"].abs() < 1).all()
    assert motion.attrs["replaced"] == ["v_x"]
    with pytest.raises(sf.InputError, match=r"points\.csv: unknown column 'dwell_bar'"):
        sf.steady(tmp_path / "points.csv")


def test_units_are_those_of_a_data_set() -> None:
    declared = {column.name: column.unit for column in (*INPUTS, *OUTPUTS) if column.unit != "1"}
    assert {name: declared[name] for name in UNITS} == UNITS


def test_units_of_columns() -> None:
    units = {"R_yr_cm": "cm", "omega_yr_rad_s": "rad/s", "lag_psi_rad": "rad", "v_z_low": "EI/(mu0 l^3)"}
    assert with_units(pd.DataFrame(columns=[*units, "note"])).attrs["units"] == units


def test_a_replay_needs_a_file_and_a_tail_length(tmp_path: Path) -> None:
    small = sf.Schedule(CONTROL.group_values(), 1, np.array([0.8, 0.8]), (0.0, 0.0, 0.0), CONTROL.time_scale)
    assert sf.replay(small).attrs["units"]["time_s"] == "s"
    with pytest.raises(sf.InputError, match="no tail length"):
        sf.replay(small, CONTROL)
    with pytest.raises(sf.InputError, match=r"none\.json"):
        sf.replay(tmp_path / "none.json")


def test_a_robot_is_found_by_its_motion() -> None:
    values = CONTROL.group_values()
    motion = sf.query(CONTROL)
    given = {name: value for name, value in values.items() if name not in ("C_t", "C_yr")}
    targets = {name: motion[name].item() for name in ("omega_yr_bar", "v_z")}
    robots = sf.inverse(pd.DataFrame([{**given, **targets}] * 2), free=["C_t", "C_yr"])
    for target in (1, 2):
        found = robots[robots["target"] == target].iloc[0]
        assert (found["C_t"], found["C_yr"]) == pytest.approx((values["C_t"], values["C_yr"]), rel=1e-4)
    with pytest.raises(sf.InputError, match="has no outputs"):
        sf.inverse(given)
    with pytest.raises(sf.InputError, match="N cannot be found"):
        sf.inverse({**given, **targets}, free=["N"])


def test_the_table_of_a_single_robot_answers_for_it(tmp_path: Path) -> None:
    own = own_table(biased=False)
    with pytest.raises(sf.InputError, match="table of a single robot"):
        sf.inverse(pd.DataFrame([CONTROL.group_values()]), lookup=own)
    assert sf.query(CONTROL, lookup=own)["error"].item() < 0.01
    own.save(tmp_path / "own.json")
    assert sf.query(CONTROL, lookup=tmp_path / "own.json").equals(sf.query(CONTROL, lookup=own))


def test_a_sweep_around_a_robot_varies_its_inputs_alone(tmp_path: Path) -> None:
    ranges = {"motor_speed_rpm": (20.0, 40.0), "C_yr": (1.0, 4.0)}
    sf.sweep(CONTROL, tmp_path / "sweep", inputs=ranges, rows=8, jobs=1)
    rows = sf.read_sweep(tmp_path / "sweep")
    values = CONTROL.group_values()
    assert len(rows) == 8
    assert rows["l_over_R"].to_numpy() == pytest.approx(values["l_over_R"])
    assert rows["C_yr"].between(1.0, 4.0).all()
    rpm = rows["omega_bar"] / values["omega_bar"] * CONTROL.motor_speed * 30 / 3.141592653589793
    assert rpm.between(20.0, 40.0).all()
    assert rpm.nunique() == 8


def test_a_sweep_that_cannot_be_says_why(tmp_path: Path) -> None:
    with pytest.raises(sf.InputError, match="inputs are for a sweep around a robot"):
        sf.sweep("sweep.toml", tmp_path, inputs={"tail_length_cm": (6, 11)})
    with pytest.raises(sf.InputError, match="tail_lenght"):
        sf.sweep(CONTROL, tmp_path, inputs={"tail_lenght_cm": (6, 11)})
    with pytest.raises(sf.InputError, match="ordered"):
        sf.sweep(replace(CONTROL, tails=3), tmp_path, inputs={"tail_length_cm": (11, 6)})
