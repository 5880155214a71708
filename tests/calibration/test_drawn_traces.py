"""Drawn traces have the truth that they claim: memory of the noise, and the size λ of a planted term."""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracles.drawn_traces import (
    FAMILIES,
    HELD_OUT,
    Design,
    covariance,
    draw_traces,
    fitted_traces,
    left_of,
    size_at,
    traces_of,
    whitened_change,
)

TERMS = [(name, term) for name, f in FAMILIES.items() for term in (*(e.name for e in f.effects), *f.mimics)]


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9, 0.99])
def test_neighbours_have_the_correlation(rho: float) -> None:
    """Of noise about the truth that is known, over many tables."""
    cups, products, squares = FAMILIES["cups"], [], []
    for seed in range(200):
        table = draw_traces(cups, (design := Design(3, rho)), seed)
        for (_, rows), trace in zip(table.groupby("trace"), traces_of(cups, design, seed), strict=True):
            noise = rows["T"] - cups.function(trace.columns, trace.truth)["T"]
            products.append((noise.to_numpy()[1:] * noise.to_numpy()[:-1]).mean())
            squares.append((noise**2).mean())
    assert np.mean(products) / np.mean(squares) == pytest.approx(rho, abs=0.02)
    # Of readings with much memory, a trace counts as little more than one.
    assert np.mean(squares) == pytest.approx(cups.noise**2, rel=0.06 if rho < 0.99 else 0.25)


def test_the_covariance_is_that_of_white_and_slow_noise() -> None:
    cups = FAMILIES["cups"]
    K = covariance(cups.step * np.array([0.0, 1.0, 3.0]), cups, 0.5) / cups.noise**2
    np.testing.assert_allclose(K, [[1, 0.5, 0.75 * (2 / 3) ** 3], [0.5, 1, 0.75 * (2 / 3) ** 2],
                                   [0.75 * (2 / 3) ** 3, 0.75 * (2 / 3) ** 2, 1]])  # fmt: skip


@pytest.mark.parametrize(("name", "term"), TERMS)
def test_the_score_of_a_planted_term_has_mean_lambda_and_deviation_one(name: str, term: str) -> None:
    """With the true K, in drawn tables; what numbers absorb is that at the truth."""
    family, design, scores = FAMILIES[name], Design(6, 0.9), []
    traces = fitted_traces(family, design, 0)
    size = size_at(family, design, 0, term, 8.0)
    change = whitened_change(family, traces, design.rho, **{term: size})
    left = left_of(family, traces, design.rho, change)
    roots = [np.linalg.cholesky(covariance(each.columns["t_s"], family, design.rho)) for each in traces]
    for seed in range(150):
        table = draw_traces(family, design, 0, noise_seed=seed, **{term: size})
        fitted = table[table["day"] != HELD_OUT].groupby("trace", sort=False)
        values = [rows[family.output].to_numpy() for _, rows in fitted]
        known = [family.function(each.columns, each.truth)[family.output] for each in traces]
        residual = [np.linalg.solve(root, v - k) for root, v, k in zip(roots, values, known, strict=True)]
        scores.append(left @ np.concatenate(residual) / np.linalg.norm(left))
    assert np.mean(scores) == pytest.approx(8.0, abs=0.3)
    assert np.std(scores) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("name", FAMILIES)
def test_numbers_leave_nothing_of_themselves(name: str) -> None:
    family, design = FAMILIES[name], Design(6, 0.9)
    traces = fitted_traces(family, design, 0)
    for number, value in family.shared.items():
        change = whitened_change(family, traces, design.rho, **{number: value * (1 + 1e-5)})
        assert np.linalg.norm(left_of(family, traces, design.rho, change)) < 1e-3 * np.linalg.norm(change)
