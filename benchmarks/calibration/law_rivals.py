"""A law, sparse regression and a Gaussian process as corrections of one residual: errors on runs left out.

Tables of `hidden_laws` (128 runs, a law on the head at 8, 16 or 32 standard deviations of its score). Coefficients
and nuisance parameters are fitted to some runs, and so is a correction of what they leave in each output:

    sparse regression   products of ω, l and N to the powers −2 to 2 by sequentially thresholded ridge regression;
                        threshold and ridge with the smallest BIC (Brunton, Proctor and Kutz 2016)
    Gaussian process    of ln ω, ln l and ln N, squared exponential with a length scale for each, by marginal
                        likelihood (Rasmussen and Williams 2006, chapter 5)
    law                 `calibration.laws.law_fits.find_laws`; without a law that leaves only noise, nothing
                        is corrected

Errors over the noise of a run are stated on the middle session (N = 4) and on N = 5, each left out of everything.
A place is stated by the law alone. FILE keeps the records, and those that it has are not made again.

Usage: python -m benchmarks law_rivals [TABLES] [FIRST_SEED] [FILE]

Takes two minutes a table.
"""

from __future__ import annotations

import itertools
import time
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from benchmarks.calibration.law_truths import HiddenLaw, Setting, hidden_law
from benchmarks.calibration.planted import ROBOT
from benchmarks.markdown import heading, row
from benchmarks.proportions import per_cent
from benchmarks.records import Records
from calibration.laws.inputs import logarithms
from calibration.laws.law_fits import find_laws
from calibration.statistics.fit import fit
from calibration.statistics.held_out import errors
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import Study, find_outliers, middle_session, split_runs
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from sim.arrays import Flags, Floats
from sim.io.errors import InputError
from sim.model.presets import PRESETS

_LEFT_OUT = ("middle session", "N = 5")
_METHODS = ("none", "sparse regression", "Gaussian process", "law", "law, where there is one")
_STEEPEST = 2  # power in the library of the sparse regression
_THRESHOLDS = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0)  # in standard errors of a single term
_RIDGES = (1e-4, 1e-2, 0.05, 0.3)  # the columns of the library are nearly collinear
_SCALES = (0.3, 30.0)  # length scales of the Gaussian process, in standard deviations of the inputs
_STARTS = ((1.0, 1.0, 1.0), (4.0, 4.0, 4.0))


def main(tables: str = "20", first_seed: str = "6000", file: str = "") -> None:
    setting, records = Setting.of(), Records(file)
    for seed in range(int(first_seed), int(first_seed) + int(tables)):
        if seed in records:
            continue
        began = time.process_time()
        truth = hidden_law(setting, seed, nothing=False)
        try:
            record = _compared(truth, seed)
        except InputError as reason:
            print(f"{seed}: {truth.effects}: not made: {reason}", flush=True)
            continue
        records.add(record)
        for where in _LEFT_OUT:
            figures = ", ".join(f"{name} {record[where][name]:.2f}" for name in _METHODS[:4])
            print(f"{seed} λ = {abs(truth.score):g} {truth.place.name}, {where} left out: {figures}; "
                  f"places: {', '.join(record[where]['kept']) or 'none'}")  # fmt: skip
        print(f"     {time.process_time() - began:.0f} s", flush=True)
    print("\n" + heading("left out", "correction", "tables", "error over noise, median", "90 %", "largest"))
    for where in _LEFT_OUT:
        for name in _METHODS:
            ones = [one[where] for one in records.all if name != _METHODS[-1] or one[where]["kept"]]
            found = [one[name if name in one else "law"] for one in ones]
            middle, most = np.quantile(found, (0.5, 0.9)) if found else (np.nan, np.nan)
            print(
                row(where, name, len(found), f"{middle:.2f}", f"{most:.2f}", f"{max(found, default=np.nan):.2f}")
            )
    for where in _LEFT_OUT:
        stated = [one for one in records.all if one[where]["kept"]]
        if stated:
            in_set = sum(one["place"] in one[where]["kept"] for one in stated)
            first = sum(one["place"] == one[where]["kept"][0] for one in stated)
            print(f"{where} left out: a law in {per_cent(len(stated), len(records.all))}")
            print(f"  the true place is among those named in {per_cent(in_set, len(stated))} of them, first in "
                  f"{per_cent(first, len(stated))}")  # fmt: skip


def _compared(truth: HiddenLaw, seed: int) -> dict[str, Any]:
    """Make the table of a truth and correct it in all ways, each time without some of its runs."""
    data = read_measurements(make_table(replace(ROBOT, effects=truth.effects), seed=seed, title=""))
    model = SwimmerModel(PRESETS["paper-measured"], data)
    record: dict[str, Any] = {"seed": seed, "place": truth.place.name, "score": truth.score}
    for where, held_out in zip(_LEFT_OUT, (middle_session(data), data.tails == 5), strict=True):
        record[where] = _corrected(model, held_out, seed)
    return record


def _corrected(model: SwimmerModel, held_out: Flags, seed: int) -> dict[str, Any]:
    """Compute the error over the noise of each correction on runs (n,) that are held out."""
    data, start = model.runs, start_values(model)
    study = Study(model, split_runs(data, held_out, find_outliers(data, model.predict([start])[0])), seed=seed)
    used, test = study.split.fitted, study.split.test
    names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    base = fit(model, model.guess(start, used), names, used, title="")
    noise = float(np.sqrt(np.diag(base.noise.run).mean()))
    inputs, residual = logarithms(data) - logarithms(data).mean(0), data.y - base.prediction
    predictions = {
        "none": base.prediction,
        "sparse regression": base.prediction + _by_output(_sparse, inputs, residual, used),
        "Gaussian process": base.prediction + _by_output(_gaussian_process, inputs, residual, used),
        "law": base.prediction,
    }
    kept: list[str] = []
    none = Directions.plain(np.empty((*data.y.shape, 0)))
    if examine_residual(study, base, none).general_p < study.level:
        laws = find_laws(study, base)
        if laws.complete:
            kept = [law.place.name for law in laws.kept]
            predictions["law"] = laws.kept[0].fit.prediction
    return {name: errors(data, table, test)[0] / noise for name, table in predictions.items()} | {"kept": kept}


def _by_output(method: Any, inputs: Floats, residual: Floats, used: Flags) -> Floats:
    """Predict the residual (n, k) of all runs by a method that learns from those in `used`, output by output."""
    return np.stack([method(inputs, column, used) for column in residual.T], 1)


def _sparse(inputs: Floats, residual: Floats, used: Flags) -> Floats:
    """Fit a sparse sum of power laws to a residual (n,), and predict it for all runs."""
    powers = range(-_STEEPEST, _STEEPEST + 1)
    library = np.exp(inputs @ np.array(list(itertools.product(powers, repeat=inputs.shape[1]))).T)
    scale = np.linalg.norm(library[used], axis=0)
    table, values = library[used] / scale, residual[used]
    best, smallest = np.zeros(library.shape[1]), len(values) * np.log(values @ values)
    for ridge, threshold in itertools.product(_RIDGES, np.array(_THRESHOLDS) * values.std()):
        active = np.ones(table.shape[1], dtype=bool)
        while active.any():
            part = table[:, active]
            weights = np.linalg.solve(part.T @ part + ridge * np.eye(part.shape[1]), part.T @ values)
            if (np.abs(weights) > threshold).all():
                break
            active[active] = np.abs(weights) > threshold
        weights = np.zeros(table.shape[1])
        weights[active] = np.linalg.lstsq(table[:, active], values, rcond=None)[0]
        left = values - table @ weights
        bic = len(values) * np.log(left @ left) + active.sum() * np.log(len(values))
        if bic < smallest:
            best, smallest = weights, bic
    return np.asarray(library @ (best / scale))


def _gaussian_process(inputs: Floats, residual: Floats, used: Flags) -> Floats:
    """Fit a Gaussian process to a residual (n,), and predict its mean for all runs."""
    x = inputs / inputs[used].std(0)
    level = residual[used].std()
    values = residual[used] / level
    squares = (x[:, None, :] - x[None, used, :]) ** 2

    def covariance(logs: Floats) -> Floats:
        return np.asarray(np.exp(2 * logs[0] - (squares / np.exp(2 * logs[2:])).sum(-1) / 2))

    def negative_log_likelihood(logs: Floats) -> float:
        whole = covariance(logs)[used] + np.exp(2 * logs[1]) * np.eye(len(values))
        factor = cho_factor(whole, lower=True)
        return float(values @ cho_solve(factor, values) / 2 + np.log(np.diag(factor[0])).sum())

    low, high = np.log(_SCALES)
    limits = [(np.log(1e-3), np.log(10.0)), (np.log(0.05), np.log(2.0)), *[(low, high)] * x.shape[1]]
    fits = [
        minimize(negative_log_likelihood, [0.0, np.log(0.5), *np.log(scales)], bounds=limits, method="L-BFGS-B")
        for scales in _STARTS
    ]
    best = min(fits, key=lambda result: result.fun).x
    whole = covariance(best)[used] + np.exp(2 * best[1]) * np.eye(len(values))
    return np.asarray(level * covariance(best) @ cho_solve(cho_factor(whole, lower=True), values))
