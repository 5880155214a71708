"""Runs that would tell explanations apart; and new runs decide, seldom against the true one."""

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

from calibration.findings.next_runs import (
    BATCH,
    GIVEN_UP,
    STOP,
    Decision,
    Explanation,
    Pair,
    Standing,
    _greedy,
    _together,
    new_runs,
    read_explanations,
    standings,
)
from calibration.linear.gls import Noise
from calibration.statistics.statistical_model import Parameter
from common.errors import InputError
from tests.calibration.toy_tables import DRAG, ambiguous, toy_swimmer, toy_table


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "lengths_cm", "given_up", "said"),
    [
        (2, (5.0, 11.0), [False, True], "Decided: head's end-over-end drag."),
        (3, (8.0,), [False, False], "make more runs"),
    ],
    ids=["other lengths", "the old length"],
)
def test_new_runs_decide_for_the_truth_or_nothing(
    seed: int, lengths_cm: tuple[float, ...], given_up: list[bool], said: str, tmp_path: Path
) -> None:
    table = toy_table(1, lengths_cm=(8.0,), **{DRAG: 4.0})
    (tmp_path / "verdict.json").write_text(json.dumps(ambiguous().to_dict()))
    explanations, before = read_explanations(tmp_path / "verdict.json")
    assert len(explanations) == 2
    more = toy_table(seed, lengths_cm=lengths_cm, **{DRAG: 4.0}).assign(session="new")
    chosen = more.sample(8, random_state=1 if seed == 2 else 3)
    model = toy_swimmer(pd.concat([table, chosen], ignore_index=True))
    new = new_runs(model.runs, before)
    assert new.sum() == 8
    standing = standings(model, explanations, new)
    assert [s.given_up for s in standing] == given_up
    assert standing[0].title == "head's end-over-end drag" or not any(given_up)
    assert said in Decision(tuple(standing), 1).sentence
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
        known = tuple(Parameter(name, name, 0.0, (-9.0, 9.0), 1.0) for name in predictions)
        runs = SimpleNamespace(y=y, session=np.zeros(n, int), along=np.ones(n), outputs=outputs or ("a", "b"))
        return SimpleNamespace(
            runs=runs, coefficients=known, nuisances=(), effects=(),
            linearised=lambda at, along, **_: lambda sets: np.array(
                [predictions[(name := along[0].name)] + slopes[..., 0] * (p[name] - at[name]) for p in sets]
            ),
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
    known = tuple(Parameter(name, name, 0.0, (-9.0, 9.0), 1.0) for name in "AB")
    predictions = {"A": 0.0, "B": math.sqrt(2 * math.log(ratio))}
    model: Any = SimpleNamespace(
        runs=SimpleNamespace(y=np.zeros((1, 1)), session=np.zeros(1, int), along=np.ones(1), outputs=("y",)),
        coefficients=known, nuisances=(), effects=(),
        linearised=lambda at, along, **_: lambda sets: np.full((len(sets), 1, 1), predictions[along[0].name]),
    )  # fmt: skip
    both = [Explanation(t, {t: 1.0}, np.eye(1), Noise(np.eye(1), 0.0), ("y",)) for t in predictions]
    first, second = standings(model, both, np.ones(1, bool))
    three = [Standing("A", 0.0), Standing("B", GIVEN_UP - 0.1), Standing("C", GIVEN_UP + 0.1)]
    assert Decision(tuple(three), 1).sentence == "Not decided between A and B: make more runs."
    assert (first.title, first.given_up, second.given_up) == ("A", False, given_up)
    assert second.behind == pytest.approx(2 * math.log(ratio))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"explanations": []}', "no two explanations"),
        ("[1]", "not a verdict.json of this version"),
        ("{", "not a verdict.json"),
        ('{"explanations": [{"title": "A"}]}', "not a verdict.json of this version"),
        (None, "no such file"),
    ],
    ids=["no rivals", "a list", "no JSON", "an old one", "no file"],
)
def test_a_verdict_without_rivals_is_refused(text: str | None, said: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "verdict.json").write_text(text)
    with pytest.raises(InputError, match=said):
        read_explanations(tmp_path / "verdict.json")


def pair(*differences: float) -> Pair:
    """Two rivals that differ by this much at each setting, with nothing that could be fitted again."""
    return Pair(np.array(differences)[:, None], np.zeros((len(differences), 1, 1)), np.eye(1))


def test_a_batch_repeats_the_best_setting_unless_a_parameter_or_a_session_absorbs_it() -> None:
    chosen, strength = _greedy([pair(1.0, 3.0, 2.0)], Noise(np.array([[0.5]]), 0.0), np.ones(3))
    assert chosen == [1] * BATCH
    assert strength == pytest.approx(BATCH * 9 / 0.5)
    shifted = Pair(np.array([[1.0], [-1.0]]), np.ones((2, 1, 1)), np.array([[1e6]]))  # all outputs alike
    assert _together([shifted], Noise(np.eye(1), 0.0), np.ones(2), [0] * 8) == pytest.approx(0, abs=1e-3)
    chosen, strength = _greedy([shifted], Noise(np.eye(1), 0.0), np.ones(2))
    assert chosen == [0] * 4 + [1] * 4
    assert strength == pytest.approx(8, rel=1e-3)
    scatter = Noise(np.eye(1), 10.0)  # of sessions, which shift the runs of a day
    alike, opposite = (_together([pair(1.0, -1.0)], scatter, np.ones(2), places)[0] for places in ([0, 0], [0, 1]))
    assert alike == pytest.approx(2 / 21)
    assert opposite == pytest.approx(2.0)
    of_starts = _together([pair(1.0, -1.0)], scatter, np.zeros(2), [0, 0])  # no session shifts them
    assert of_starts == pytest.approx(2.0)


@pytest.mark.parametrize("apart", [False, True])
def test_what_is_made_again_has_own_numbers_again(apart: bool) -> None:
    """Two traces of three readings with a start of their own, against the same two written out."""
    difference, shared, starts = (np.array(row)[:, None] for row in ([1.0, 2.0, 4.0], [0.5, 1.0, 1.5], [1.0] * 3))
    once = Pair(difference, np.concatenate([shared, starts], 1)[:, None], np.diag([0.3, 100.0]), own=1)
    each = np.kron(np.eye(2), starts)
    J = np.concatenate([np.tile(shared, (2, 1)), each], 1)
    noise = Noise(np.array([[0.25]]), 4.0)
    shift = np.kron(np.eye(2), np.ones((3, 3))) if apart else np.ones((6, 6))
    covariance = 0.25 * (np.eye(6) + 4.0 * shift) + J @ np.diag([0.3, 100.0, 100.0]) @ J.T
    twice = np.tile(difference, (2, 1))[:, 0]
    strength = _together([once], noise, np.ones(3), [0, 1, 2], 2, apart=apart)[0]
    assert strength == pytest.approx(twice @ np.linalg.solve(covariance, twice))


def test_a_batch_serves_all_pairs_of_rivals() -> None:
    """The first setting tells the first two apart, the second the others: a batch for all has both."""
    pairs = [pair(3.0, 0.0), pair(0.0, 2.0), pair(0.0, 2.0)]
    chosen, strength = _greedy(pairs, Noise(np.eye(1), 0.0), np.ones(2))
    assert set(chosen) == {0, 1}
    assert chosen.count(1) > chosen.count(0)
    assert strength == pytest.approx(min(9 * chosen.count(0), 4 * chosen.count(1)))
