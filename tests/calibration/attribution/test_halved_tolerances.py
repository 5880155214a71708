"""Smallest detectable sizes with one tolerance halved, against a dense covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibration.attribution.wrong_numbers import notable_gains, overall_gains
from calibration.statistics.fit import Fit, fit
from calibration.statistics.residual_tests import TESTABLE, Misfit, directions, examine_residual
from calibration.statistics.statistical_model import parameter, start_values
from calibration.statistics.study import Study
from calibration.swimmer.influences import CAMERA, TACHOMETER
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.record import verdict_record
from sim.arrays import Floats
from tests.calibration.toy_tables import FEW_DRAWS, calibrated_toy, toy_swimmer, toy_table

HALVED = (CAMERA, TACHOMETER, "disc_offset")


def examined(model: SwimmerModel) -> tuple[Fit, Floats, Misfit]:
    """Fit all runs of a model, and score its effects."""
    used = np.ones(len(model.runs), dtype=bool)
    names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    fitted = fit(model, start_values(model), names, used, title="")
    tangents = directions(model, fitted.parameters, model.effects)
    misfit = examine_residual(Study.fitted_to(model, used, seed=1), fitted, tangents, draws=FEW_DRAWS)
    chosen = [
        next(m for m in np.flatnonzero(tangents.owner == j) if tangents.second[m] == second or np.isnan(second))
        for j, second in enumerate(misfit.second)
    ]
    return fitted, tangents.table[..., chosen], misfit


def dense_lengths(model: SwimmerModel, fitted: Fit, D: Floats, halved: str) -> Floats:
    """Length of each direction with Σ + G P Gᵀ formed, and the coefficients projected out; one σ halved, ρ = 1."""
    n, k, _ = fitted.jacobian.shape
    flat = fitted.jacobian.reshape(n * k, -1)
    covariance = replace(fitted.noise, share=1.0).covariance(model.runs.session)
    for p, column in zip(fitted.fitted, flat.T, strict=True):
        if p.sigma is not None:
            covariance += (p.sigma * (0.5 if p.name == halved else 1.0)) ** 2 * np.outer(column, column)
    white = np.linalg.inv(np.linalg.cholesky(covariance))
    free = white @ flat[:, [i for i, p in enumerate(fitted.fitted) if p.sigma is None]]
    seen = white @ D.reshape(n * k, -1)
    return np.asarray(np.linalg.norm(seen - free @ np.linalg.lstsq(free, seen, rcond=None)[0], axis=0))


def test_lengths_are_those_of_a_dense_covariance() -> None:
    """One session, so that ρ is the same for every effect."""
    model = toy_swimmer(toy_table(3).assign(session="one"))
    fitted, D, misfit = examined(model)
    today, seen = dense_lengths(model, fitted, D, ""), np.asarray(misfit.scores.survived) > TESTABLE
    assert seen.sum() > 5
    assert misfit.scores.length[seen] == pytest.approx(today[seen], rel=1e-4)
    for name in HALVED:
        halved = dense_lengths(model, fitted, D, name)
        assert misfit.halved_length[name][seen] == pytest.approx(halved[seen], rel=1e-4), name
        assert (halved[seen] >= today[seen] * (1 - 1e-9)).all()


@pytest.mark.slow
def test_the_best_tolerance_comes_first_in_the_record() -> None:
    result = calibrated_toy(2)
    gains = overall_gains(result.found.candidates)
    assert list(gains.values()) == sorted(gains.values(), reverse=True)
    assert set(gains) == {p.name for p in result.base.fitted if p.sigma is not None}
    assert all(0 <= gain < 0.5 for gain in gains.values())
    listed = notable_gains(result.found.candidates)
    assert listed
    for halved in listed:
        assert halved.effect.detectable_exact < halved.halved < halved.today
        assert halved.halved == min(halved.effect.detectable_halved.values())
    record = verdict_record(result, table="t")
    assert [entry["name"] for entry in record["halved_tolerances"]] == list(gains)
    first = record["candidates"][0]
    assert first["smallest_detectable_with_half_of_a_tolerance"] == result.found.candidates[0].detectable_halved
    assert parameter(toy_swimmer(toy_table(2)), next(iter(gains))).title == record["halved_tolerances"][0]["title"]
