"""Films of what the simulator does, and what is found from them alone: poses, spins, a plan's error."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.interpolate import CubicSpline

from calibration.swimmer.synthetic_table import make_table
from common.arrays import Floats
from common.errors import run_command
from planner.files.plan_files import write_plan
from planner.jobs.plan import plan
from sim.inputs import save_robot
from sim.model.presets import PRESETS
from sim.motion.shapes import scheduled_shapes
from softflagella.__main__ import main
from tests.calibration.toy_tables import DRAG, START, install_few_candidates
from tests.oracles.tank import TAIL, Motion, Tank, circling
from tests.shared import FOLDER, shared

RATE, SECONDS = 12.0, 30.0
ORIGIN = 0.12, 0.1  # m, of the plan's frame in the tank
FILM_RATE, FILMED = 10.0, 8.0  # of a run
BEGIN, FLIP = 2.0, 22.0  # s, of a run at constant motor speed; the motor flips after 22.08 s
CONTROL = PRESETS["paper-control"]
ROBOT = replace(CONTROL, motor_speed=2 * CONTROL.motor_speed)


def run(*words: object, status: int = 0) -> None:
    assert run_command(main, [str(word) for word in words]) == status


@shared
def replayed() -> tuple[Path, Floats, Floats]:
    """Film how a plan begins, in a folder with plan.json, view.toml and robot.toml.

    Returns:
        The folder, times (F,) [s], and (F, 5) x, y [m], heading, angles of head and tails [rad].
    """
    folder = FOLDER / "replay"
    folder.mkdir(exist_ok=True)
    save_robot(ROBOT, folder / "robot.toml")
    result = plan([(0.0, 0.0), (1.0, 0.0)], ROBOT, dwell=10.0)
    write_plan(result, folder)
    schedule = result.schedule()
    count = int(np.searchsorted(np.cumsum(schedule.dwells) * schedule.time_scale, SECONDS)) + 1
    times = np.arange(0, SECONDS, 1 / RATE)
    begun = replace(schedule, dwells=schedule.dwells[:count])
    shapes = scheduled_shapes(begun, times / schedule.time_scale)
    poses = np.column_stack([shapes.heads * [TAIL, TAIL, 1], shapes.angles])
    tank = Tank(width=320, height=240, scale=0.0008, shade=0.3)
    (folder / "view.toml").write_text(tank.view_toml(origin=ORIGIN))
    tank.film(folder / "swim.mp4", motion_of(times, poses + np.array([*ORIGIN, 0, 0, 0])), SECONDS, RATE)
    return folder, times, poses


def motion_of(times: Floats, poses: Floats) -> Motion:
    curve = CubicSpline(times, poses)
    return lambda t: tuple(curve(t))


def tracked(out: Path, *words: object) -> pd.DataFrame:
    folder = replayed()[0]
    known = ("--robot", folder / "robot.toml", "--view", folder / "view.toml")
    run("tracks", folder / "swim.mp4", *known, "--out", out, *words)
    return pd.read_csv(out)


def test_the_poses_of_a_replay_are_found_with_errors_that_hold_and_its_plan_is_checked_as_by_the_replay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tracked(tmp_path / "tracks.csv")
    assert len(table) > 0.98 * RATE * SECONDS
    folder, times, poses = replayed()
    truth = CubicSpline(times, poses)(table["time_s"])
    off = np.abs(table[["x_cm", "y_cm"]].to_numpy() / 100 - truth[:, :2])
    turned = np.abs((table["heading_deg"] - np.degrees(truth[:, 2]) + 180) % 360 - 180)
    for error, most in ((np.hypot(*off.T), 0.02 * TAIL), (turned, 1.0)):
        assert np.sqrt((error**2).mean()) < most
        assert np.quantile(error, 0.95) < most
    assert (100 * off < 1.96 * table[["x_error_cm"]].to_numpy()).mean() > 0.95
    assert (turned < 1.96 * table["heading_error_deg"]).mean() > 0.95
    assert table["x_error_cm"].median() < 0.005 * 100 * TAIL
    assert table["heading_error_deg"].median() < 0.7
    true = np.column_stack([table["time_s"], 100 * truth[:, :2], np.degrees(truth[:, 2])])
    pd.DataFrame(true, columns=["time_s", "x_cm", "y_cm", "heading_deg"]).to_csv(
        tmp_path / "true.csv", index=False
    )
    capsys.readouterr()
    said = []
    for name in ("true.csv", "tracks.csv"):
        run("check", folder / "plan.json", tmp_path / name, status=3)  # the film ends before the path does
        said.append(capsys.readouterr().out.partition("tracking error ")[2].split())
    simulated, seen = (float(words[0]) for words in said)  # 2.27 cm (0.206 l) rms
    assert seen == pytest.approx(simulated, abs=0.02)
    assert "within" in said[1]


def test_the_spins_of_a_replay_are_found_within_half_a_percent(tmp_path: Path) -> None:
    folder, times, poses = replayed()
    tracked(tmp_path / "tracks.csv", "--start", BEGIN, "--end", FLIP)
    runs = {"run": ["swim"], "N": [2], "l_cm": [100 * TAIL], "omega_rpm": [ROBOT.motor_speed * 30 / math.pi]}
    pd.DataFrame(runs).to_csv(tmp_path / "runs.csv", index=False)
    run("calibration", "tracks", tmp_path / "tracks.csv", tmp_path / "runs.csv", "--robot", folder / "robot.toml",
        "--out", tmp_path / "table.csv")  # fmt: skip
    row = pd.read_csv(tmp_path / "table.csv").iloc[0]
    steady = (times >= BEGIN) & (times <= FLIP)
    rates = np.polyfit(times[steady], poses[steady], 1)[0]
    for column, truth in (("omega_h", rates[3]), ("omega_t", rates[4])):
        error = row[f"{column}_rpm"] * math.pi / 30 / truth - 1
        assert abs(error) < 0.005
        assert abs(error) < 1.96 * row[f"{column}_error"] * math.pi / 30 / abs(truth) < 0.015
    assert row["omega_yr_rad_s"] == pytest.approx(rates[2], rel=0.02)


def filmed_runs(table: pd.DataFrame, folder: Path) -> Path:
    """Film each run of a table, at its spins along its circle; return the table of the films."""
    for index, row in enumerate(table.to_dict("records")):
        tank = Tank(width=256, height=192, scale=0.00125, fine=1, seed=index)
        rate, radius, start = row["omega_yr_rad_s"], row["R_yr_cm"] / 100, 0.7 * index
        middle = start + rate * FILMED / 2
        centre = 0.16 - radius * math.cos(middle), 0.12 - radius * math.sin(middle)
        head, tails = (row[name] * math.pi / 30 for name in ("omega_h_rpm", "omega_t_rpm"))
        motion = circling(rate, radius, math.radians(row["theta_deg"]), head, tails, centre, start)
        tank.film(folder / f"{index}.mp4", motion, FILMED, FILM_RATE)
    (folder / "view.toml").write_text(tank.view_toml())
    noted = table[["N", "l_cm", "session", "omega_rpm"]].assign(film=[f"{index}.mp4" for index in table.index])
    noted.to_csv(folder / "runs.csv", index=False)
    return folder / "runs.csv"


@pytest.mark.rest
def test_an_effect_is_named_from_films_as_from_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_few_candidates(monkeypatch)
    truth = replace(START, C_t=3.6, C_r=2.2, C_yr=5.4, effects={DRAG: 4.0})
    table = make_table(truth, seed=5, tails=(2, 4), lengths_cm=(6.0, 9.0), noise=0.01, title="")
    table.to_csv(tmp_path / "table.csv", index=False)
    given = ("--robot", "paper-measured", "--no-path")
    run("calibrate", tmp_path / "table.csv", *given, "--out", tmp_path / "by-table")
    films = filmed_runs(table, tmp_path)
    run("calibrate", "--films", films, "--view", tmp_path / "view.toml", *given, "--out", tmp_path / "by-films")
    verdicts = [json.loads((tmp_path / name / "verdict.json").read_text()) for name in ("by-table", "by-films")]
    measured = pd.read_csv(tmp_path / "by-films" / "table.csv")
    for column in ("omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg"):
        off = (measured[column] / table[column] - 1).abs()
        assert off.notna().all()
        assert off.max() < 0.015
    assert [verdict["effects"] for verdict in verdicts] == [[DRAG], [DRAG]]
