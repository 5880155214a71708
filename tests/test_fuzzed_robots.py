"""Whatever the input, the answer is a row, a flag with its reason, or one line and exit status 2."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import sim.motion.run
from dataset.rows.simulate import simulate
from sim.effects import catalogue
from sim.inputs import load_robot
from sim.io.errors import InputError, run_command
from sim.model.groups import DWELL, GROUP_COLUMNS
from sim.model.plan_file import FORMAT
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml
from sim.model.schedule import load_schedule
from sim.motion.batches import steady_columns
from sim.motion.replay import replay
from surrogate.table.model_file import load

CONTROL = PRESETS["paper-control"].group_values()
INPUTS = (*GROUP_COLUMNS, "a_over_R")
EXTREMES = [0.0, 1e-300, 1e-9, 1e-3, 0.1, 1.0, 5.01, 64.0, 100.0, 1e4, 1e9, 1e300, math.inf, math.nan]
Main = Callable[[list[str] | None], None]

anything = st.one_of(
    st.sampled_from([sign * value for value in EXTREMES for sign in (1, -1)]), st.floats(), st.floats(1e-3, 1e3)
)
plausible = st.floats(0.3, 3.0)  # times the control example's
quick = settings(
    max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture(autouse=True)
def _little_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Flag robots that ask for more than a second, so that the tests stay short."""
    monkeypatch.setattr(sim.motion.run, "MOST_WORK", 1e5)


@st.composite
def robots(draw: st.DrawFn, *extra: str) -> dict[str, float]:
    """Replace one to three columns of the control example by anything."""
    values: dict[str, float] = {**CONTROL, **dict.fromkeys(extra, 1.0)}
    for name in draw(st.lists(st.sampled_from((*INPUTS, *extra, *catalogue())), min_size=1, max_size=3)):
        values[name] = draw(anything)
    return values


def single_row(values: dict[str, float]) -> dict[str, np.ndarray]:
    return {name: np.array([value]) for name, value in values.items()}


@quick
@given(values=robots())
def test_any_robot_is_solved_flagged_or_refused(values: dict[str, float]) -> None:
    try:
        found = steady_columns(single_row(values), jobs=1, title="")
    except InputError:
        return
    outputs = [found[name][0] for name in ("omega_t_bar", "omega_yr_bar", "v_x", "v_z")]
    assert np.isfinite(outputs).all() or not found["converged"][0]
    assert found["converged"][0] or found["note"][0]


@pytest.mark.rest
@quick
@given(values=robots())
def test_any_row_of_a_sweep_is_simulated_flagged_or_refused(values: dict[str, float]) -> None:
    try:
        found = simulate({**single_row(values), "history": np.array([True])})
    except InputError:
        return
    assert found["failed"][0] or np.isfinite(found["net_speed_bar"][0]).all()


@quick
@given(values=robots(DWELL))
def test_the_look_up_table_answers_or_refuses(values: dict[str, float]) -> None:
    try:
        found = load().query(single_row(values))
    except InputError:
        return
    assert all(np.isfinite(column).all() for column in found.values())


def test_the_worst_robot_of_a_table_leaves_the_others_alone(tmp_path: Path) -> None:
    """ω̄ = 10⁹ asked for 85 GiB."""
    from sim.__main__ import main

    rows = pd.DataFrame([{**CONTROL, "omega_bar": speed} for speed in (10.0, 1e9, 12.0)])
    rows.to_csv(tmp_path / "points.csv", index=False)
    assert run_command(main, ["steady", str(tmp_path / "points.csv"), "--out", str(tmp_path / "out.csv")]) == 0
    found = pd.read_csv(tmp_path / "out.csv")
    assert found["converged"].tolist() == [True, False, True]
    assert "more time steps than a row may ask for" in found["note"][1]


@st.composite
def plans(draw: st.DrawFn) -> object:
    """Replace some entries of a plan.json."""
    plan: dict[str, Any] = {
        "format": FORMAT,
        "robot": {"groups": dict(CONTROL), "time_scale_s": 2.0},
        "first_direction": 1,
        "dwell_bar": [0.7, 0.8],
        "start": {"x_over_l": 0.0, "y_over_l": 0.0, "heading_rad": 0.0},
    }
    value = st.one_of(anything, st.text(max_size=3), st.none(), st.lists(anything, max_size=3), st.booleans())
    for _ in range(draw(st.integers(1, 3))):
        where = draw(st.sampled_from(["robot", "first_direction", "dwell_bar", "start", "groups", "dwell", "N"]))
        if where == "groups":
            plan["robot"] = {"groups": draw(robots()), "time_scale_s": draw(anything)}
        elif where == "dwell":
            plan["dwell_bar"] = [0.7, draw(anything)]
        elif where == "N":
            plan["robot"] = {"groups": {**CONTROL, "N": draw(anything)}, "time_scale_s": 1.0}
        else:
            plan[where] = draw(value)
    return plan if draw(st.booleans()) else draw(value)


@quick
@given(content=plans())
def test_any_plan_is_replayed_or_refused(content: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim.motion.replay.MOST_REPLAY_WORK", 1e5)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(content))
    try:
        track = replay([load_schedule(path)])[0]
    except InputError:
        return
    assert np.isfinite(track[["x_over_l", "y_over_l", "heading_rad"]].to_numpy()).all()


KEYS = [line.split(" = ")[0] for line in robot_toml(PRESETS["paper-control"]).splitlines() if " = " in line]
VALUES = ['"x"', "[]", "{}", "true", "", "1979-05-27", "nan", "-inf", "1e999", "'''\n", "0x10"]


@quick
@given(key=st.sampled_from(KEYS), value=st.one_of(anything.map(repr), st.sampled_from(VALUES)))
def test_any_robot_file_is_read_or_refused(key: str, value: str, tmp_path: Path) -> None:
    lines = robot_toml(PRESETS["paper-control"]).splitlines()
    changed = [f"{key} = {value}" if line.startswith(f"{key} = ") else line for line in lines]
    path = tmp_path / "robot.toml"
    path.write_text("\n".join(changed))
    try:
        robot = load_robot(path)
    except InputError:
        return
    again = tmp_path / "again.toml"
    again.write_text(robot_toml(robot))
    assert load_robot(again) == robot


@pytest.mark.parametrize("name", ['a "quoted" name', "back\\slash", "two\nlines", "Übung", ""])
def test_robots_keep_their_names(name: str, tmp_path: Path) -> None:
    from dataclasses import replace

    robot = replace(PRESETS["paper-control"], name=name)
    (tmp_path / "robot.toml").write_text(robot_toml(robot))
    assert load_robot(tmp_path / "robot.toml") == robot
