"""A verdict is saved whatever its figures are; what cannot be told apart is said."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from calibration.report import figures
from common.errors import InputError, run_command
from softflagella.__main__ import main
from tests.calibration.own_model.test_faults import MODEL, TABLE, fall, of, said

NUMBER = MODEL.numbers[0]
SCALE = sf.Effect("k", "scale", low=-0.5, high=2)


def level(columns: Any, p: Any) -> Any:
    return {"v": p["v1"] + 0 * columns["d"]}


def vague(columns: Any, p: Any) -> Any:
    return {"v": fall(columns, {**p, "wall": 1.0})["v"] * (1 + 1e-9 * p["m"] * columns["d"])}


@pytest.mark.parametrize(
    ("model", "table"),
    [
        (replace(of(lambda v, p: v / (1 + p["k"])), effects=[SCALE]), TABLE),
        (replace(MODEL, function=level, effects=[]), TABLE),
        (replace(MODEL, effects=[]), TABLE[:4]),
        (MODEL, TABLE[TABLE["d"] == TABLE["d"][0]]),
        (replace(MODEL, function=vague, effects=[], numbers=[NUMBER, sf.Number("m", 1.0)]), TABLE),
        (replace(MODEL, numbers=[replace(NUMBER, sigma="1 %")]), TABLE.assign(v=TABLE["v"] / 3)),
        (replace(MODEL, numbers=[replace(NUMBER, sigma="1 %")], effects=[]), TABLE),
    ],
    ids=["an effect like the number", "a level", "four rows", "one setting", "vague", "tolerances", "no effect"],
)
@pytest.mark.filterwarnings("error")
def test_a_verdict_has_a_report(model: sf.Model, table: pd.DataFrame, tmp_path: Path) -> None:
    if "wall" not in {effect.name for effect in model.effects}:
        model = replace(model, function=lambda c, p, of=model.function: of(c, {"wall": 0.0, **p}))
    sf.calibrate(table, model, session="round", progress=False).save(tmp_path)
    assert "<svg" in (tmp_path / "report.html").read_text()


def test_a_figure_that_fails_is_left_out_and_the_reason_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: Any) -> Any:
        raise ValueError("no ticks")

    result = sf.calibrate(TABLE, MODEL, session="round", progress=False)
    monkeypatch.setattr(figures, "draw_summary", fails)
    with pytest.warns(UserWarning, match="without its figure 'summary': no ticks"):
        result.save(tmp_path)
    assert "<svg" in (tmp_path / "report.html").read_text()
    monkeypatch.undo()
    monkeypatch.setattr("calibration.report.report.rendered", fails)
    with pytest.raises(ValueError, match="no ticks"):
        result.save(tmp_path)
    assert json.loads((tmp_path / "verdict.json").read_text())["verdict"] == "effect"


@pytest.mark.parametrize(
    "together", [lambda p: p["v1"] * p["b"], lambda p: p["v1"] / p["b"] ** 2, lambda p: p["v1"] + 2 * p["b"]]
)
def test_numbers_that_act_together_only_are_named(together: Any) -> None:
    function = lambda c, p: fall(c, {**p, "v1": together(p)})  # noqa: E731
    model = replace(MODEL, function=function, numbers=[NUMBER, sf.Number("b", 2.0, low=0.1, high=10)])
    assert said(model).startswith("v1 and b cannot be told apart")
    known = replace(model, numbers=[NUMBER, replace(model.numbers[1], sigma="1 %")])
    assert sf.calibrate(TABLE, known, session="round", progress=False).effects == ("wall",)


def test_an_effect_that_acts_as_a_number_does_is_said() -> None:
    model = replace(of(lambda v, p: v / (1 + p["k"])), effects=[SCALE, *MODEL.effects])
    result = sf.calibrate(TABLE, model, session="round", progress=False)
    assert result.effects == ("wall",)
    assert "these runs cannot tell scale (k) from v1 (v1)" in result.caveats


def test_numbers_that_act_apart_are_fitted() -> None:
    model = replace(MODEL, function=lambda c, p: {"v": p["v1"] * c["d"] ** p["power"]}, effects=[])
    numbers = [NUMBER, sf.Number("power", 2.0, low=1, high=3)]
    result = sf.calibrate(TABLE, replace(model, numbers=numbers), session="round", progress=False)
    assert np.isfinite(list(result.corrected.values())).all()


@pytest.mark.parametrize("given", [["--model", "no.py"], ["--robot", "paper-control"]])
@pytest.mark.parametrize("place", ["file", "file/below"])
def test_a_place_that_cannot_be_written_is_refused_first(
    given: list[str], place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    for name in ("runs.csv", "no.py"):
        (tmp_path / name).write_text("no table and no model")
    arguments = [str(tmp_path / word) if word == "no.py" else word for word in given]
    assert (
        run_command(main, ["calibrate", str(tmp_path / "runs.csv"), *arguments, "--out", f"{tmp_path}/{place}"])
        == 2
    )
    assert f"{tmp_path}/file is a file; give a folder" in capsys.readouterr().err


def test_a_verdict_is_not_saved_into_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot make the folder"):
        sf.calibrate(TABLE, MODEL, session="round", progress=False).save(tmp_path / "file")
