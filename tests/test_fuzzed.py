"""Whatever the input, the answer is a result, a flag with its reason, or one line and exit status 2."""

from __future__ import annotations

import json
import math
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import calibration.verdict.explain
import sim.motion.run
from common.errors import InputError, run_command
from dataset.simulate import simulate
from sim.effects import catalogue
from sim.model.groups import DWELL, GROUP_COLUMNS
from sim.model.presets import PRESETS
from sim.model.schedule import FORMAT, load_schedule
from sim.motion.batches import steady_columns
from sim.motion.replay import replay
from softflagella.__main__ import main
from surrogate.table_file import load
from tests.calibration.toy_tables import on_the_toy, toy_table

CONTROL = PRESETS["paper-control"].group_values()
INPUTS = (*GROUP_COLUMNS, "a_over_R")
NUMBERS = [0.0, -0.0, 1e-300, 1e-9, 1e-3, 0.5, 1.0, 2.5, 7.0, 1e3, 1e9, 1e300, math.inf, math.nan]
WORDS = ["", "x", "three", "1,5", "0x10", "1e999", "-", "é", '"', "1 2", "None", "true"]

extremes = st.sampled_from([sign * n for n in NUMBERS for sign in (1, -1)])
number = st.one_of(extremes, st.floats(), st.floats(0.1, 10))
cell = st.one_of(number, st.sampled_from(WORDS))
few, more = (
    settings(
        max_examples=count, deadline=None, derandomize=True,
        suppress_health_check=[HealthCheck.function_scoped_fixture],
    )
    for count in (25, 50)
)  # fmt: skip


def answered(words: list[object], capsys: pytest.CaptureFixture[str]) -> bool:
    """Tell whether a command worked; where it did not, it must have said why in one line."""
    capsys.readouterr()
    status = run_command(main, [str(word) for word in words])
    said = capsys.readouterr().err.splitlines()
    assert "Traceback" not in " ".join(said)
    if status == 0:
        return True
    assert status == 2
    refusals = [line for line in said if line.startswith("error: ")]
    assert refusals == said[-1:]
    assert len(refusals[0]) > len("error: ") + 10
    return False


@st.composite
def changed(draw: st.DrawFn, table: pd.DataFrame) -> pd.DataFrame:
    """Replace some cells, columns or rows of a table by anything."""
    altered = table.copy()
    for _ in range(draw(st.integers(1, 3))):
        name = draw(st.sampled_from(list(table.columns)))
        if name not in altered:
            continue
        kind = draw(st.sampled_from(["cell", "cells", "column", "scale", "lost", "renamed", "rows"]))
        column = altered[name].astype(object)
        if kind == "cell":
            column.iloc[draw(st.integers(0, len(column) - 1))] = draw(cell)
            altered[name] = column
        elif kind == "cells":
            column.iloc[:: draw(st.integers(2, 9))] = draw(cell)
            altered[name] = column
        elif kind == "column":
            altered[name] = draw(cell)
        elif kind == "scale" and pd.api.types.is_numeric_dtype(altered[name]):
            altered[name] = altered[name] * draw(number)
        elif kind == "lost":
            altered = altered.drop(columns=name)
        elif kind == "renamed":
            altered = altered.rename(columns={name: draw(st.sampled_from(["N", "run", "x", f"{name}s", ""]))})
        elif kind == "rows":
            altered = altered.iloc[: draw(st.integers(0, len(altered)))]
        if altered.empty or not len(altered.columns) or altered.columns.duplicated().any():
            break
    return altered


CIRCLE = pd.DataFrame({"x": 2 * np.cos(np.linspace(0, 5, 60)), "y": 2 * np.sin(np.linspace(0, 5, 60))})


def planned(folder: Path, path: object, *options: object, capsys: pytest.CaptureFixture[str]) -> None:
    words = f"--robot paper-control --objective flips --out {folder / 'p'}".split()
    answered(["planner", "plan", path, *words, *options], capsys)


@pytest.mark.rest
@few
@given(table=changed(CIRCLE), options=st.dictionaries(
    st.sampled_from(["--scale", "--minimum-dwell", "--tolerance"]), number, max_size=2))  # fmt: skip
def test_any_table_of_a_path(
    table: pd.DataFrame, options: dict[str, float], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table.to_csv(tmp_path / "path.csv", index=False)
    given_options = (f"{name}={value!r}" for name, value in options.items())
    planned(tmp_path, tmp_path / "path.csv", "--unit", "l", *given_options, capsys=capsys)


@few
@given(table=changed(pd.DataFrame([{**CONTROL, "dwell_bar": 1.0, "omega_bar": w} for w in (8.0, 10.0, 12.0)])))
def test_any_question_to_the_look_up_table(
    table: pd.DataFrame, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table.to_csv(tmp_path / "points.csv", index=False)
    if answered(["surrogate", "query", tmp_path / "points.csv", "--out", tmp_path / "out.csv"], capsys):
        found = pd.read_csv(tmp_path / "out.csv")
        assert len(found) == len(table)
        assert np.isfinite(found[["omega_t_bar", "omega_yr_bar", "v_x", "v_z"]].to_numpy()).all()


@pytest.mark.rest
@few
@given(data=st.data())
def test_any_table_of_runs(
    data: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is searched and no path planned here: that takes seconds a table, and other tests do it."""
    runs = toy_table(3, lengths_cm=(6.0, 9.0)).head(32)
    runs = runs.assign(elapsed_min=4.0 * np.arange(len(runs)), v_cm_s=1.0 + 0.01 * np.arange(len(runs)))
    data.draw(changed(runs)).to_csv(tmp_path / "runs.csv", index=False)
    for name in ("examine", "pairs"):
        monkeypatch.setattr(calibration.verdict.explain, name, lambda *_, **__: [])
    words = ["calibrate", tmp_path / "runs.csv", "--robot", "paper-measured", "--out", tmp_path / "out"]
    with on_the_toy(few=True):
        answered(["calibration", *words, "--no-laws", "--no-path"], capsys)


@pytest.fixture(autouse=True)
def _little_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Flag robots that ask for more than a second, so that the tests stay short."""
    monkeypatch.setattr(sim.motion.run, "MOST_WORK", 1e5)


@st.composite
def robots(draw: st.DrawFn, *extra: str) -> dict[str, float]:
    """Replace one to three columns of the control example by anything."""
    values: dict[str, float] = {**CONTROL, **dict.fromkeys(extra, 1.0)}
    for name in draw(st.lists(st.sampled_from((*INPUTS, *extra, *catalogue())), min_size=1, max_size=3)):
        values[name] = draw(number)
    return values


def single_row(values: dict[str, float]) -> dict[str, np.ndarray]:
    return {name: np.array([value]) for name, value in values.items()}


@pytest.mark.slow
@more
@given(values=robots())
def test_any_robot_is_solved_flagged_or_refused(values: dict[str, float]) -> None:
    with suppress(InputError):
        found = steady_columns(single_row(values), jobs=1, title="")
        outputs = [found[name][0] for name in ("omega_t_bar", "omega_yr_bar", "v_x", "v_z")]
        assert np.isfinite(outputs).all() or not found["converged"][0]
        assert found["converged"][0] or found["note"][0]


@pytest.mark.rest
@more
@given(values=robots())
def test_any_row_of_a_sweep_is_simulated_flagged_or_refused(values: dict[str, float]) -> None:
    with suppress(InputError):
        found = simulate({**single_row(values), "history": np.array([True])})
        assert found["failed"][0] or np.isfinite(found["net_speed_bar"][0]).all()


@pytest.mark.slow
@more
@given(values=robots(DWELL))
def test_the_look_up_table_answers_or_refuses(values: dict[str, float]) -> None:
    with suppress(InputError):
        found = load().query(single_row(values))
        finite = all(np.isfinite(column).all() for column in found.values())
        assert finite or values["C_yr"] == 0  # such a robot does not turn, and the table has no lags for it


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
    value = st.one_of(number, st.text(max_size=3), st.none(), st.lists(number, max_size=3), st.booleans())
    for _ in range(draw(st.integers(1, 3))):
        where = draw(st.sampled_from(["robot", "first_direction", "dwell_bar", "start", "groups", "dwell", "N"]))
        if where == "groups":
            plan["robot"] = {"groups": draw(robots()), "time_scale_s": draw(number)}
        elif where == "dwell":
            plan["dwell_bar"] = [0.7, draw(number)]
        elif where == "N":
            plan["robot"] = {"groups": {**CONTROL, "N": draw(number)}, "time_scale_s": 1.0}
        else:
            plan[where] = draw(value)
    return plan if draw(st.booleans()) else draw(value)


@more
@given(content=plans())
def test_any_plan_is_replayed_or_refused(content: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim.motion.replay.MOST_REPLAY_WORK", 1e5)
    (tmp_path / "plan.json").write_text(json.dumps(content))
    with suppress(InputError):
        track = replay(load_schedule(tmp_path / "plan.json"))
        assert np.isfinite(track[["x_over_l", "y_over_l", "heading_rad"]].to_numpy()).all()
