"""Commands given anything: they do their work, or say why not in one line with exit status 2."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import calibration.verdict.calibrate
from calibration.swimmer.measured_table import OUTPUTS
from sim.io.errors import run_command
from sim.model.presets import PRESETS
from softflagella.__main__ import main
from tests.calibration.toy_tables import install_toy, toy_table
from tests.calibration.track import track

CONTROL = PRESETS["paper-control"].group_values()
NUMBERS = [0.0, -0.0, 1e-300, 1e-9, 1e-3, 0.5, 1.0, 2.5, 7.0, 1e3, 1e9, 1e300, math.inf, math.nan]
WORDS = ["", "x", "three", "1,5", "0x10", "1e999", "-", "é", '"', "1 2", "None", "true"]

number = st.one_of(
    st.sampled_from([sign * n for n in NUMBERS for sign in (1, -1)]), st.floats(), st.floats(0.1, 10)
)
cell = st.one_of(number, st.sampled_from(WORDS))
few = settings(
    max_examples=25, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


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


@pytest.mark.rest
@few
@given(table=changed(CIRCLE), options=st.dictionaries(
    st.sampled_from(["--scale", "--minimum-dwell", "--tolerance"]), number, max_size=2))  # fmt: skip
def test_any_table_of_a_path(
    table: pd.DataFrame, options: dict[str, float], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table.to_csv(tmp_path / "path.csv", index=False)
    words: list[object] = [
        "planner",
        "plan",
        tmp_path / "path.csv",
        "--unit",
        "l",
        "--robot",
        "paper-control",
        "--out",
        tmp_path / "p",
    ]
    answered([*words, *(f"{name}={value!r}" for name, value in options.items())], capsys)


@few
@given(shape=st.sampled_from(["circle", "square", "triangle", "star", ""]),
       size=st.one_of(number.map(repr), st.sampled_from(WORDS)),
       unit=st.sampled_from(["l", "m", "cm", "mm"]))  # fmt: skip
def test_any_shape_by_name(
    shape: str, size: str, unit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["planner", "plan", f"{shape}:{size}", "--robot", "paper-control", "--out", tmp_path / "p"]
    answered([*words, "--unit", unit], capsys)


PATHS = [
    "M 0 0 h 300 v 300",
    "M 0 0 C 100 0 200 100 300 300",
    "M 0 0 A 300 300 0 0 1 300 300",
    "M 0 0 L 0 0",
    "M nan 0 L 1 1",
]
ENDS = ["", " z", " L 1e999 0", " L nan nan", " M 5 5 l 3 3", " Q", " 7", " A 0 0 0 0 0 1 1", " h 1e300"]


SIZES = ["", 'width="30mm" viewBox="0 0 300 300"', 'width="0mm"', 'viewBox="0 0 0 0"', 'width="x"']
TURNS = st.one_of(number.map(lambda v: f"scale({v!r})"), st.sampled_from(["", "rotate(x)", "matrix(1)"]))


@pytest.mark.slow
@few
@given(body=st.sampled_from(PATHS), end=st.sampled_from(ENDS), transform=TURNS, size=st.sampled_from(SIZES))
def test_any_drawing(
    body: str, end: str, transform: str, size: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f'<svg xmlns="http://www.w3.org/2000/svg" {size}><path d="{body}{end}" transform="{transform}"/></svg>'
    (tmp_path / "path.svg").write_text(text)
    answered(
        [
            "planner",
            "plan",
            tmp_path / "path.svg",
            "--scale",
            "0.01",
            "--robot",
            "paper-control",
            "--out",
            tmp_path / "p",
        ],
        capsys,
    )


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


@pytest.fixture(scope="module")
def runs() -> pd.DataFrame:
    with pytest.MonkeyPatch.context() as patch:
        install_toy(patch)
        found = toy_table(3, lengths_cm=(6.0, 9.0)).head(32)
    return found.assign(elapsed_min=4.0 * np.arange(len(found)), v_cm_s=1.0 + 0.01 * np.arange(len(found)))


@pytest.mark.rest
@few
@given(data=st.data())
def test_any_table_of_runs(
    data: Any,
    runs: pd.DataFrame,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Effects are not refitted here: that takes seconds a table, and other tests do it."""
    install_toy(monkeypatch)
    for name in ("examine", "pairs"):
        monkeypatch.setattr(calibration.verdict.calibrate, name, lambda *_, **__: [])
    table = data.draw(changed(runs))
    table.to_csv(tmp_path / "runs.csv", index=False)
    out = tmp_path / "out"
    answered(
        ["calibration", "calibrate", tmp_path / "runs.csv", "--robot", "paper-measured", "--out", out], capsys
    )


SAMPLES = pd.concat([track(0, seconds=6.0), track(1, seconds=6.0).assign(run=2)], ignore_index=True)
NOTED = pd.DataFrame({"run": [1, 2], "N": 2, "l_cm": 11.0, "omega_rpm": -150.0})


@few
@given(samples=st.one_of(st.just(SAMPLES), changed(SAMPLES)), noted=st.one_of(st.just(NOTED), changed(NOTED)))
def test_any_tracks(
    samples: pd.DataFrame, noted: pd.DataFrame, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    samples.to_csv(tmp_path / "tracks.csv", index=False)
    noted.to_csv(tmp_path / "runs.csv", index=False)
    words = [
        "calibration",
        "tracks",
        tmp_path / "tracks.csv",
        tmp_path / "runs.csv",
        "--out",
        tmp_path / "out.csv",
    ]
    if answered(words, capsys):
        runs = pd.read_csv(tmp_path / "out.csv")
        assert len(runs) == len(noted)
        for name in {column for column, _, _ in OUTPUTS.values()} & set(runs) - set(noted):
            assert not np.isinf(runs[name]).any()
