"""New runs decide between explanations that a table could not tell apart, and seldom against the true one."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom

from calibration.statistics.statistical_model import Noise
from calibration.verdict.next_runs import GIVEN_UP, STOP
from calibration.verdict.sequential_test import (
    Decision,
    Explanation,
    Standing,
    new_runs,
    read_explanations,
    standings,
)
from calibration.verdict.verdict_json import verdict_record
from sim.io.errors import InputError
from tests.calibration.toy_tables import calibrated_toy, install_toy, toy_swimmer, toy_table


@pytest.fixture(scope="module")
def undecided(tmp_path_factory: pytest.TempPathFactory) -> tuple[pd.DataFrame, Path]:
    """A table of one tail length, and its verdict.json."""
    with pytest.MonkeyPatch.context() as patch:
        install_toy(patch)
        table = toy_table(1, lengths_cm=(8.0,), end_over_end_drag=4.0)
    verdict = calibrated_toy(1, lengths_cm=(8.0,), end_over_end_drag=4.0)
    path = tmp_path_factory.mktemp("decide") / "verdict.json"
    path.write_text(json.dumps(verdict_record(verdict, table="t")))
    return table, path


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_new_runs_of_other_lengths_decide_for_the_truth(undecided: tuple[pd.DataFrame, Path]) -> None:
    table, path = undecided
    explanations, before = read_explanations(path)
    assert len(explanations) == 2
    more = toy_table(2, lengths_cm=(5.0, 11.0), end_over_end_drag=4.0).assign(session="new")
    model = toy_swimmer(pd.concat([table, more.sample(8, random_state=1)], ignore_index=True))
    new = new_runs(model.runs, before)
    assert new.sum() == 8
    standing = standings(model, explanations, new)
    assert [s.given_up for s in standing] == [False, True]
    assert standing[0] == Standing("head's end-over-end drag", 0.0)
    assert Decision(tuple(standing), 1).sentence.startswith("Decided: head's end-over-end drag.")


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_eight_runs_like_the_old_ones_decide_nothing(undecided: tuple[pd.DataFrame, Path]) -> None:
    table, path = undecided
    explanations, before = read_explanations(path)
    more = toy_table(3, lengths_cm=(8.0,), end_over_end_drag=4.0).assign(session="new")
    model = toy_swimmer(pd.concat([table, more.sample(8, random_state=3)], ignore_index=True))
    standing = standings(model, explanations, new_runs(model.runs, before))
    assert not any(s.given_up for s in standing)
    assert "make more runs" in Decision(tuple(standing), 1).sentence
    with pytest.raises(InputError, match="a session of their own"):
        new_runs(toy_swimmer(table).runs, before)


def test_the_true_explanation_is_seldom_given_up() -> None:
    """At most one time in `STOP`; runs of one session are shifted together."""
    rng = np.random.default_rng(0)
    n, k = 6, 2
    slopes = rng.normal(size=(n, k, 1))
    predictions = {"A": np.zeros((n, k)), "B": rng.normal(size=(n, k))}
    run, covariance = np.array([[1.0, 0.3], [0.3, 2.0]]), np.array([[0.5]])
    both = [Explanation(title, {title: 1.0}, covariance, Noise(run, 0.4), ("a", "b")) for title in predictions]

    def model(y: np.ndarray, *outputs: str) -> Any:
        """Its parameter's name says which prediction is meant."""
        known = tuple(SimpleNamespace(name=name, start=0.0) for name in predictions)
        runs = SimpleNamespace(y=y, session=np.zeros(n, int), outputs=outputs or ("a", "b"))
        return SimpleNamespace(
            runs=runs, coefficients=known, nuisances=(), effects=(),
            derivatives=lambda parameters, names: (predictions[names[0]], slopes),
        )  # fmt: skip

    spread = np.kron(np.eye(n) + 0.4, run) + slopes.reshape(-1, 1) @ covariance @ slopes.reshape(1, -1)
    root, draws = np.linalg.cholesky(spread), 3000
    lost, won = 0, 0
    for _ in range(draws):
        y = predictions["A"] + (root @ rng.normal(size=n * k)).reshape(n, k)
        standing = {s.title: s for s in standings(model(y), both, np.ones(n, bool))}
        lost += standing["A"].given_up
        won += standing["B"].given_up
    assert lost <= binom.isf(0.01, draws, 1 / STOP)
    assert won > 0.1 * draws
    with pytest.raises(InputError, match="has the outputs a, c; the verdict was made from a, b"):
        standings(model(np.zeros((n, k)), "a", "c"), both, np.ones(n, bool))
    lost_column = [replace(both[0], parameters={"viscosity_with_time": 0.1})]
    with pytest.raises(InputError, match="A: these runs cannot test viscosity_with_time"):
        standings(model(np.zeros((n, k))), lost_column, np.ones(n, bool))


@pytest.mark.parametrize(("ratio", "given_up"), [(24.0, False), (26.0, True)])
def test_an_explanation_is_given_up_where_another_is_25_times_as_likely(ratio: float, given_up: bool) -> None:
    """One run with an error of variance 1 where the first predicts 0, and is there: e^(d²/2) to one."""
    known = tuple(SimpleNamespace(name=name, start=0.0) for name in "AB")
    predictions = {"A": 0.0, "B": math.sqrt(2 * math.log(ratio))}
    model: Any = SimpleNamespace(
        runs=SimpleNamespace(y=np.zeros((1, 1)), session=np.zeros(1, int), outputs=("y",)),
        coefficients=known, nuisances=(), effects=(),
        derivatives=lambda _, names: (np.array([[predictions[names[0]]]]), np.zeros((1, 1, 1))),
    )  # fmt: skip
    both = [Explanation(t, {t: 1.0}, np.eye(1), Noise(np.eye(1), 0.0), ("y",)) for t in predictions]
    first, second = standings(model, both, np.ones(1, bool))
    assert (first.title, first.given_up, second.given_up) == ("A", False, given_up)
    assert second.behind == pytest.approx(2 * math.log(ratio))


def test_a_verdict_without_rivals_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "verdict.json"
    for text, said in (
        ('{"explanations": []}', "no two explanations"),
        ("[1]", "no two explanations"),
        ("{", "is not a verdict"),
        ('{"explanations": [{"title": "A"}]}', "no verdict.json of this version"),
        (None, "no such file"),
    ):
        if text is not None:
            path.write_text(text)
        with pytest.raises(InputError, match=said):
            read_explanations(path if text is not None else tmp_path / "none.json")


def test_what_is_left_is_said() -> None:
    three = [Standing("A", 0.0), Standing("B", GIVEN_UP - 0.1), Standing("C", GIVEN_UP + 0.1)]
    assert Decision(tuple(three), 1).sentence == "Not decided between A and B: make more runs."
