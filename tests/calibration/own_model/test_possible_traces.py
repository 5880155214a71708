"""Which traces are proposed to tell explanations apart, and what a new one says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from calibration.findings.next_runs import Explanation
from calibration.own_model.model_verdict import ModelVerdict
from calibration.own_model.table_of_runs import Roles, read_runs_of
from calibration.statistics.traces import whitened
from common.arrays import Floats
from common.errors import InputError
from softflagella.__main__ import main
from tests.shared import shared

SHORT = np.arange(0, 1.001, 0.05)


def place(columns: Any, p: Any) -> dict[str, Floats]:
    """Of a point on its way; both effects are the same to second order in time."""
    t, load = columns["t_s"], np.asarray(columns["load"])
    curved = p["square"] * t**2 + 2 * p["growth"] * (np.cosh(t) - 1)
    return {"x": p["x0"] + load * (p["v"] * t + curved)}


MODEL = sf.Model(
    place,
    outputs={"x": sf.Output("place", kind="difference")},
    numbers=[sf.Number("x0", 0.1, low=-5, high=5, per="trace"), sf.Number("v", 1.0, low=0.1, high=10)],
    effects=[sf.Effect("square", "acceleration", low=-5, high=5), sf.Effect("growth", "growth", low=-5, high=5)],
    settings=["load"],
    time="t_s",
)


def traces(days: str, effect: str, *, time: Floats = SHORT, loads: tuple[float, ...] = (1.0, 2.0)) -> pd.DataFrame:
    rng, tables = np.random.default_rng(len(time)), []
    for day in days:
        for load in (*loads, *loads):
            p = {"v": 1.2, "square": 0.0, "growth": 0.0, effect: 1.0, "x0": 0.1 * rng.normal()}
            x = place({"t_s": time, "load": load}, p)["x"] + 0.05 * rng.normal(size=len(time))
            known = {"run": f"{day}{len(tables)}", "day": day, "load": load, "t_s": time}
            tables.append(pd.DataFrame({**known, "x": x}))
    return pd.concat(tables, ignore_index=True)


@shared
def verdict() -> ModelVerdict:
    found = sf.calibrate(traces("abc", "square"), MODEL, trace="run", session="day", progress=False)
    assert isinstance(found, ModelVerdict)
    return found


def model_of(table: pd.DataFrame, model: sf.Model = MODEL, **own: Any) -> Any:
    return read_runs_of(table, model, Roles(trace="run", session="day"), own=own)[0]


def test_traces_are_proposed_as_they_were_and_more_often_and_longer() -> None:
    model, settings = model_of(traces("abc", "square"), load=(3.0,)).possible()
    assert [(s["load"], s["t_s"], s["readings"], s["read"]) for s in settings] == [
        *2 * [(3.0, "0 to 1", 21, "as often")],
        *2 * [(3.0, "0 to 1", 41, "twice as often")],
        *2 * [(3.0, "0 to 2.05", 42, "twice as long")],
    ]
    rows = np.flatnonzero(model.runs.trace == 5)
    np.testing.assert_allclose(model.runs.time[rows], np.arange(42) * 0.05)
    start = {"v": 1.2, "square": 0.0, "growth": 0.5, "x0 of next 5": 0.3}
    expected = place({"t_s": np.arange(42) * 0.05, "load": 3.0}, {**start, "x0": 0.3})["x"]
    np.testing.assert_allclose(model.predict([start])[0, rows, 0], expected)
    white = whitened(model, 0.5, 0.2)
    assert white.runs.memory is not None
    np.testing.assert_allclose(white.runs.memory.colour(white.predict([start])[0])[rows, 0], expected)


def test_what_is_driven_along_a_trace_is_driven_as_it_was() -> None:
    table = traces("abc", "square")
    table["load"] += 0.1 * np.sin(3 * table["t_s"])
    settings = model_of(table).possible()[1]
    assert [(s["readings"], s["read"]) for s in settings] == 2 * [(21, "as often")]
    assert "load" not in settings[0]


def test_many_traces_are_a_few_templates() -> None:
    settings = model_of(traces("abc", "square", loads=tuple(np.arange(1.0, 11)))).possible()[1]
    loads = [s["load"] for s in settings if s["read"] == "as often"]
    assert loads == [1.0, 3.0, 5.0, 6.0, 8.0, 10.0]


def test_a_longer_trace_decides_where_these_cannot() -> None:
    found = verdict()
    assert found.verdict == "ambiguous"
    best, other = found.next_batch, [run for run in found.next_runs if run.settings["read"] != "twice as long"]
    assert best is not None
    assert best.settings[0]["read"] == "twice as long"
    assert best.decides > 0.99
    assert len(other) == 4
    assert all(run.repeats == 4 and run.decides < 0.5 for run in other)


def test_where_one_trace_is_not_enough_several_are_proposed() -> None:
    """What is driven cannot be longer, so only more of the same tells the effects apart."""
    time = np.arange(0, 1.201, 0.05)
    table = traces("abc", "square", time=time)
    table["load"] += 0.01 * np.sin(3 * table["t_s"])
    found = sf.calibrate(table, MODEL, trace="run", session="day", progress=False)
    assert found.verdict == "ambiguous"
    assert found.next_batch is not None
    assert len(found.next_batch.settings) == found.next_runs[0].repeats > 1
    assert found.next_batch.worth_making
    step = next(step for step in found.to_dict()["next_steps"] if "Measure" in step)
    assert f"Measure {found.next_runs[0].repeats} traces, each with" in step


@pytest.mark.parametrize(("effect", "title"), [("square", "acceleration"), ("growth", "growth")])
def test_a_new_trace_decides_for_the_truth(effect: str, title: str, tmp_path: Path) -> None:
    """With the table before or without it, and as verdict.json has it."""
    new, records = traces("d", effect, time=np.arange(0, 2.051, 0.05)), []
    for table in (new, pd.concat([traces("abc", "square"), new], ignore_index=True)):
        decision = sf.decide(table, verdict(), MODEL, trace="run", session="day")
        assert decision.decided == title
        assert decision.new_runs == 4
        records.append(decision.standings[1].behind)
    assert records[0] == pytest.approx(records[1])
    verdict().save(tmp_path)
    saved = sf.decide(new, tmp_path / "verdict.json", MODEL, trace="run", session="day")
    assert saved.standings[1].behind == pytest.approx(records[0])


def test_noise_along_a_trace_is_part_of_an_explanation() -> None:
    explanation = verdict().explanations[0]
    assert explanation.memory is not None
    assert Explanation.read(explanation.record()).memory == explanation.memory
    for wrong in ([1.5, 1.0], [0.5, 0.0]):
        with pytest.raises(ValueError):  # noqa: PT011 (it has no words)
            Explanation.read({**explanation.record(), "memory": wrong})


def test_the_report_says_what_to_measure(tmp_path: Path) -> None:
    steps = " ".join(verdict().to_dict()["next_steps"])
    assert "Measure a trace: load" in steps
    assert "read twice as long. It tells the explanations apart in 100 % of cases" in steps
    verdict().save(tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "Traces that can be measured next" in page
    assert "Runs to make next" not in page


def test_keywords_of_the_other_kind_are_refused() -> None:
    table = traces("abc", "square")
    with pytest.raises(InputError, match="plan is not for a model"):
        sf.decide(table, verdict(), MODEL, trace="run", plan="plan.json")
    with pytest.raises(InputError, match="not for a robot"):
        sf.decide(table, verdict(), "paper-control", trace="run")
    with pytest.raises(InputError, match="all sessions of this table were there before"):
        sf.decide(table, verdict(), MODEL, trace="run", session="day")
    found = sf.calibrate(table, MODEL.without("growth"), trace="run", session="day", progress=False)
    with pytest.raises(InputError, match="no two explanations"):
        sf.decide(table, found, MODEL, trace="run", session="day")
    with pytest.raises(InputError, match="give --robot, or --model"):
        main(["calibration", "decide", "runs.csv", "verdict.json"])
