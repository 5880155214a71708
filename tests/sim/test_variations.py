"""Varied numbers of a robot: `steady --vary`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from common.errors import InputError
from sim.api import steady
from sim.motion import batches
from sim.robot_rows import RobotRows
from sim.variations import doubts, draw_variations, read_variation, vary
from softflagella.__main__ import main

SPEEDS = "motor.speed_rpm=20:120:3"
REFUSALS = {
    "motor.speed=1,2": "--vary motor.speed: a robot has no such entry; is it motor.speed_rpm?",
    "motor.speed_rpm": "write KEY=FROM:TO:COUNT",
    "motor.speed_rpm=20": "of 2 to 10000 values",
    "motor.speed_rpm=20:120:1": "write KEY=FROM:TO:COUNT",
    "motor.speed_rpm=20:120:2.5": "write KEY=FROM:TO:COUNT",
    "motor.speed_rpm=0:120:5log": "FROM:TO:COUNTlog above 0",
    "motor.speed_rpm=20,fast": "write KEY=FROM:TO:COUNT",
    "motor.speed_rpm=20,nan": "write KEY=FROM:TO:COUNT",
    "motor.speed_rpm=20:120:10001": "of 2 to 10000 values",
    f"{SPEEDS}00 --vary drag.C_t=1:2:99": "10000 robots at most",
    "tails.count=2.1,2.5": "none of these robots can be: N = 2.1",
    f"{SPEEDS} --vary {SPEEDS}": "vary one number or two different ones",
    f"{SPEEDS} --vary motor.speed_rad_s=2:3:2": "vary one number or two different ones",
    "name=1:2:3": "vary one number or two different ones",
    " --vary ".join(f"{key}=1:2:10000" for key in ("drag.C_t", "drag.C_r", "drag.C_yr")): "10000 robots at most",
    f"{SPEEDS} --vary tails.count=2,3 --vary drag.C_t=2,3": "vary one number or two different ones",
    f"{SPEEDS} --plot out.txt": "a name that ends with .svg, .png, .pdf",
    f"{SPEEDS} --shapes out.npz": "without --robot and --shapes",
}


@pytest.mark.parametrize("words", REFUSALS)
def test_what_cannot_be_varied_is_refused(words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as refusal:
        main(["steady", "paper-control", "--vary", *words.split(" ")])
    assert REFUSALS[words] in str(refusal.value)
    assert not [*tmp_path.iterdir()]


def test_a_figure_needs_a_variation_and_a_variation_one_robot() -> None:
    with pytest.raises(InputError, match="add --vary"):
        main(["steady", "paper-control", "--plot", "out.svg"])
    with pytest.raises(InputError, match="changes one robot"):
        main(["steady", "points.csv", "--vary", SPEEDS])


@pytest.mark.parametrize(
    ("words", "values"),
    [
        ("drag.C_t=1:2:3", [1, 1.5, 2]),
        ("drag.C_t=2:1:3", [1, 1.5, 2]),
        ("drag.C_t=1:100:3log", [1, 10, 100]),
        ("drag.C_t=2,1,2,-1e-3", [-1e-3, 1, 2]),
    ],
)
def test_values_are_spaced_or_listed(words: str, values: list[float]) -> None:
    assert read_variation(words).values == pytest.approx(values)


def test_two_variations_are_a_family_solved_in_one_batch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    calls: list[int] = []
    solve = batches.steady
    monkeypatch.setattr(batches, "steady", lambda groups, **options: calls.append(1) or solve(groups, **options))
    further = ["--vary", "fluid.viscosity_mPa_s=700,1490", "--set", "tails.count=3", "--jobs", "1"]
    main(["steady", "paper-control", "--vary", SPEEDS, *further, "--plot", "out.svg"])
    assert calls == [1]
    table = pd.read_csv("out.csv")
    assert table["motor.speed_rpm"].tolist() == [20, 70, 120] * 2
    assert table["fluid.viscosity_mPa_s"].tolist() == [700] * 3 + [1490] * 3
    main(["robot", "paper-control", "--set", "tails.count=3", "--set", "motor.speed_rpm=70", "--out", "r.toml"])
    assert table["v_cm_s"][4] == pytest.approx(steady("r.toml")["v_cm_s"][0], rel=1e-6)
    words = Path("out.svg").read_text()
    for title in ("speed [cm/s]", "yaw rate [rad/s]", "turn radius [cm]", "slip angle [degrees]",
                  "motor.speed [rpm]", "fluid.viscosity [mPa s]"):  # fmt: skip
        assert title in words


def test_values_that_cannot_be_simulated_are_marked_and_the_others_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    main(["steady", "paper-control", "--vary", "motor.speed_rpm=-20:60:5", "--plot", "out.svg"])
    assert "5 robots, 2 that cannot be simulated -> out.svg, out.csv" in capsys.readouterr().out
    table = pd.read_csv("out.csv")
    assert table["v_cm_s"].isna().tolist() == [True, True, False, False, False]
    assert table["note"][0] == "[motor] speed_rpm = -20; it must be above 0"
    assert "cannot be simulated" in Path("out.svg").read_text()
    main(["steady", "paper-control", "--vary", "motor.speed_rpm=-20:60:5"])
    assert "it must be above 0" in capsys.readouterr().out


def test_each_point_is_drawn_where_the_table_has_it() -> None:
    variations = [read_variation("motor.speed_rpm=20,40"), read_variation("drag.C_t=2,3,4")]

    def solve(rows: RobotRows) -> dict[str, Any]:
        drag = rows.columns["C_t"]
        names = ("omega_h_bar", "omega_t_bar", "omega_yr_bar", "R_yr_over_l", "v_x", "v_z")
        angle = drag + np.round([robot.motor_speed for robot in rows.robots])
        return {**dict.fromkeys(names, drag), "theta_deg": angle, "error": np.where(drag == 3, 0.3, 0.0),
                "converged": drag != 4}  # fmt: skip

    table = vary("paper-control", variations, solve)
    assert doubts(table)[0].tolist() == [False, False, True, True, True, True]
    figure = draw_variations("a robot", variations, table)
    assert "no reliable answer" in [text.get_text() for text in figure.legends[0].get_texts()]
    angle = figure.axes[3]
    curves = [line for line in angle.lines if line.get_linestyle() == "-"]
    assert [np.asarray(line.get_ydata()).tolist() for line in curves] == [[4, 6], [5, 7], [6, 8]]
    assert [line.get_label() for line in curves] == ["2", "3", "4"]
