"""Robots as people give them, and tables in lab units."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
import surrogate.__main__
from sim.io.tables import read_table
from sim.motion.lab_units import LAB_COLUMNS
from softflagella.api.robots import robot_rows, with_units

ROBOT = sf.load_robot("paper-control")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    sf.save_robot(replace(ROBOT, name="mine", viscosity=2.0), tmp_path / "robot.toml")
    return tmp_path / "robot.toml"


def test_a_robot_its_name_and_its_values_are_the_same_rows(file: Path) -> None:
    for robots in (ROBOT, "paper-control", [ROBOT], ["paper-control"], ROBOT.group_values(),
                   pd.DataFrame([ROBOT.group_values()])):  # fmt: skip
        columns = robot_rows(robots).columns
        assert {name: values.item() for name, values in columns.items()} == pytest.approx(ROBOT.group_values())
    for path in (file, str(file), [file]):
        assert robot_rows(path).robots == (sf.load_robot(file),)


def test_a_list_fills_in_the_null_of_an_effect_that_a_robot_lacks() -> None:
    odd = replace(ROBOT, effects={"anisotropic_head_drag": 1.5})
    null = sf.effects()["anisotropic_head_drag"].null
    assert robot_rows([ROBOT, odd]).columns["anisotropic_head_drag"].tolist() == [null, 1.5]


def test_columns_that_differ_in_length_and_no_robots_are_refused() -> None:
    with pytest.raises(sf.InputError, match="differ in length"):
        robot_rows({**ROBOT.group_values(), "C_t": [1.0, 2.0], "C_r": [1.0, 2.0, 3.0]})
    with pytest.raises(sf.InputError, match="no robots"):
        robot_rows([])
    with pytest.raises(sf.InputError, match="no robot 'paper'"):
        robot_rows("paper")


def test_a_table_begins_with_names_and_lab_units(file: Path) -> None:
    for motion in (sf.steady([ROBOT, file]), sf.query([ROBOT, file])):
        assert list(motion)[: 1 + len(LAB_COLUMNS)] == ["robot", *LAB_COLUMNS]
        assert motion["robot"].tolist() == ["paper-control", "mine"]
        assert not motion.columns.duplicated().any()
        units = motion.attrs["units"]
        assert {units[name] for name in LAB_COLUMNS} == {"rpm", "rad/s", "cm", "degrees", "cm/s", "s"}
        assert units["omega_yr_bar"] == "EI/(mu0 l^4)"
        assert (motion["error"] < 0.01).all()


def test_dimensionless_robots_have_no_lab_units() -> None:
    motion = sf.steady({**ROBOT.group_values(), "omega_bar": [5.0, 10.0]})
    assert len(motion) == 2
    assert not {"robot", *LAB_COLUMNS} - {"theta_deg"} & set(motion)
    assert motion["omega_yr_bar"].iloc[1] == sf.steady(ROBOT)["omega_yr_bar"].item()


RUNS = pd.DataFrame({"Tails": [2, 3], "l_mm": [90.0, 110.0], "rpm": [60.0, -40.0], "R_yr_cm": 1.0, "day": "=a"})


def test_runs_of_a_robot_come_back_with_their_inputs(tmp_path: Path) -> None:
    """The columns of `calibrate` were unknown to `steady` and `query`."""
    alone = [
        replace(ROBOT, tails=n, tail_length=length, motor_speed=rpm * np.pi / 30)
        for n, length, rpm in ((2, 0.09, 60.0), (3, 0.11, 40.0))
    ]
    motion, expected = sf.query(RUNS, robot=ROBOT), sf.query(alone)
    assert list(motion)[:5] == ["Tails", "l_mm", "rpm", "day", "omega_h_rpm"]
    assert motion["omega_yr_rad_s"].to_numpy() == pytest.approx(expected["omega_yr_rad_s"].to_numpy() * [1, -1])
    assert motion["R_yr_cm"].to_numpy() == pytest.approx(expected["R_yr_cm"].to_numpy())
    RUNS.to_csv(tmp_path / "runs.csv", index=False)
    command = ["query", str(tmp_path / "runs.csv"), "--robot", "paper-control", "--out", str(tmp_path / "o.csv")]
    surrogate.__main__.main(command)
    written = read_table(tmp_path / "o.csv")
    assert written["R_yr_cm"].to_numpy() == pytest.approx(expected["R_yr_cm"].to_numpy(), rel=1e-6)
    assert written["day"].tolist() == ["=a", "=a"]
    columns = {**ROBOT.group_values(), "omega_bar": [5.0, 10.0]}
    assert list(sf.query(columns))[: len(columns)] == list(columns)


@pytest.mark.parametrize(
    ("runs", "words"),
    [
        (RUNS.assign(Tails=[2.5, 3]), "the table, row 1: N = 2.5; give a whole number"),
        (RUNS.assign(l_mm=["long", 3]), "the table, row 1: tail_length"),
        (RUNS[["day"]], "the table: no column N, l_cm, omega_rpm"),
        ([ROBOT], "robot goes with a table of runs"),
    ],
)
def test_runs_that_cannot_be_are_refused(runs: pd.DataFrame, words: str) -> None:
    with pytest.raises(sf.InputError, match=words):
        robot_rows(runs, ROBOT)


def test_a_response_in_lab_units(file: Path) -> None:
    both = sf.response([ROBOT, file])
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


def test_a_response_of_dimensionless_robots_names_rows() -> None:
    """Robots with different numbers of tails in any order."""
    table = sf.response({**ROBOT.group_values(), "N": [3, 2, 3], "C_yr": [2.0, 2.0, 3.0]})
    assert table["row"].unique().tolist() == [0, 1, 2]
    alone = sf.response(ROBOT)
    np.testing.assert_allclose(table.loc[table["row"] == 1, "lag_z"], alone["lag_z"], rtol=1e-9, atol=1e-12)
    assert "dwell_s" not in table


def test_units_of_columns() -> None:
    units = {
        "R_yr_cm": "cm",
        "omega_yr_rad_s": "rad/s",
        "lag_psi_rad": "rad",
        "v_z_low": "EI/(mu0 l^3)",
        "x_s": "s",
    }
    assert with_units(pd.DataFrame(columns=[*units, "note"])).attrs["units"] == units


def test_a_replay_of_a_file_and_by_another_robot(tmp_path: Path, file: Path) -> None:
    result = sf.plan(sf.circle(1.2), ROBOT)
    sf.write_plan(result, tmp_path)
    small = sf.Schedule(ROBOT.group_values(), 1, result.dwells[:2], result.start, ROBOT.time_scale)
    assert sf.replay(small).attrs["units"]["time_s"] == "s"
    with pytest.raises(sf.InputError, match="no tail length"):
        sf.replay(small, ROBOT)
    with pytest.raises(sf.InputError, match=r"none\.json"):
        sf.replay(tmp_path / "none.json")
