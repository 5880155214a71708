"""A linear stand-in for the simulator in the paper's design of runs, and what is seen of signals in it.

The stand-in is the simulator's prediction and its derivatives in coefficients, nuisance parameters and effects
at one robot; a table costs a second with it. Noise 2.5 % on every output, session scatter 0.5 %, a session for
each N.
λ is the size of an effect in standard deviations of its score, after what coefficients can absorb, and what
nuisance parameters can absorb within their priors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from calibration.linear.gls import Noise
from calibration.statistics.forward import derivatives, linear
from calibration.statistics.statistical_model import (
    Parameter,
    Parameters,
    Predict,
    Value,
    precisions,
    start_values,
)
from calibration.statistics.study import middle_session
from calibration.swimmer.measured_table import Measurements, read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.table.runs import Runs
from common.arrays import Flags, Floats, Integers
from sim.model.presets import PRESETS

ROBOT = replace(PRESETS["paper-measured"], C_t=2.6, C_r=2.0, C_yr=3.2)
NOISE, SESSION = 0.025, 0.005
LENGTHS_CM = (5.0, 7.0, 9.0, 11.0, 13.0, 15.0)


@dataclass(frozen=True)
class LinearSwimmer:
    """The swimmer near one robot: prediction + J (ln C − ln C0) + G x + D (ε − null), x: nuisance parameters."""

    runs: Runs
    coefficients: tuple[Parameter, ...]
    nuisances: tuple[Parameter, ...]
    effects: tuple[Parameter, ...]
    prediction: Floats  # (n, k)
    J: Floats  # (n, k, 3)
    G: Floats  # (n, k, g)
    D: Floats  # (n, k, e)
    untestable: Mapping[str, str]
    next: LinearSwimmer | None = None  # runs that can be made next; None: the same runs

    def subset(self, rows: Integers) -> LinearSwimmer:
        """The runs at places `rows`, which may come more than once."""
        parts = {k: getattr(self, k)[rows] for k in ("prediction", "J", "G", "D")}
        return replace(self, runs=self.runs.subset(rows), **parts)

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predictions (P, n, k)."""
        every = (*self.coefficients, *self.nuisances, *self.effects)
        table = np.moveaxis(np.concatenate([self.J, self.G, self.D], -1), -1, 0)
        columns = list(zip(every, table, strict=True))
        return np.array([self.prediction + sum(d * _changed(q, p[q.name]) for q, d in columns) for p in sets])

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """The same, in these parameters alone."""
        order = [p.name for p in (*self.coefficients, *self.nuisances, *self.effects)]
        table = np.concatenate([self.J, self.G, self.D], -1)
        return linear(at, along, self.predict([at])[0], table[..., [order.index(p.name) for p in along]])

    def check(self, prediction: Floats) -> None:
        """Nothing to check."""

    def possible(self) -> tuple[LinearSwimmer, list[dict[str, Any]]]:
        """Runs that can be made next, and their places."""
        model = self.next or self
        return model, [{"run": i} for i in range(len(model.runs))]

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """The start as it is."""
        return start


def _changed(parameter: Parameter, value: Value) -> Floats:
    """Change of a parameter on its own scale: one, or one for each run (n, 1)."""
    change = np.log(value / parameter.start) if parameter.logarithmic else value - parameter.start
    return np.reshape(change, (-1, 1))


def design(lengths_cm: Sequence[float] = LENGTHS_CM) -> Measurements:
    """Runs as the paper's, with noise for values."""
    rows = [
        {"N": n, "l_cm": length, "omega_rpm": sign * rpm, "trial": trial, "session": f"N = {n}"}
        for n in (2, 3, 4, 5)
        for length in lengths_cm
        for rpm in (110.0, 150.0)
        for sign in (1, -1)
        for trial in (1, 2)
    ]
    rng = np.random.default_rng(0)
    table = with_values(pd.DataFrame(rows), rng)
    table["elapsed_min"] = 2.0 * rng.permutation(len(table))
    return read_measurements(table)


def with_values(settings: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """A table of runs with noise for values, so that it can be read."""
    sign = np.sign(settings["omega_rpm"])
    values = {"omega_h_rpm": -sign, "omega_t_rpm": sign, "omega_yr_rad_s": sign, "R_yr_cm": 1.0, "theta_deg": 1.0}
    spread = np.exp(rng.normal(scale=NOISE, size=(len(settings), len(values))))
    return settings.assign(**{name: v * f for (name, v), f in zip(values.items(), spread.T, strict=True)})


def linearised(data: Measurements) -> LinearSwimmer:
    """Derivatives of the simulator at ROBOT and the runs of a table."""
    model = SwimmerModel(ROBOT, data)
    names = [p.name for p in (*model.coefficients, *model.nuisances, *model.effects)]
    prediction, table = derivatives(model, start_values(model), names)
    J, G, D = np.split(table, np.cumsum([len(model.coefficients), len(model.nuisances)]), -1)
    effects = tuple(replace(e, second=None) for e in model.effects)  # it is linear in the sizes alone
    return LinearSwimmer(model.runs, model.coefficients, model.nuisances, effects, prediction, J, G, D, {})


def restated(model: LinearSwimmer, sigmas: Mapping[str, float]) -> LinearSwimmer:
    """The same with other standard deviations; numbers with none are exact."""
    given = tuple(replace(p, sigma=sigmas[p.name]) for p in model.nuisances if sigmas.get(p.name))
    keep = [i for i, p in enumerate(model.nuisances) if sigmas.get(p.name)]
    return replace(model, nuisances=given, G=model.G[..., keep])


def scatter(runs: Runs, outputs: int, seed: int) -> Floats:
    """Noise of runs and sessions, (n, k)."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(len(runs), outputs))
    shift = rng.normal(scale=SESSION, size=(len(runs.session_names), outputs))[runs.session]
    return NOISE * noise + shift


def measured(model: LinearSwimmer, signal: Floats, seed: int) -> LinearSwimmer:
    """Return the model with data: its prediction, a signal (n, k), and the noise of a seed."""
    noise = scatter(model.runs, model.prediction.shape[1], seed)
    return replace(model, runs=replace(model.runs, y=model.prediction + signal + noise))


def in_days(model: LinearSwimmer, days: int, seed: int) -> LinearSwimmer:
    """Return the model with runs of every kind in each of some sessions; repeats are in different ones."""
    rng = np.random.default_rng(seed)
    session = np.concatenate([rng.permutation(days)[:2] for _ in range(len(model.runs) // 2)])
    places = np.argsort(np.argsort(model.runs.condition, kind="stable"))
    names = tuple(f"day {i + 1}" for i in range(days))
    return replace(model, runs=replace(model.runs, session=session[places], session_names=names))


class Signals:
    """What is seen of signals in this design."""

    def __init__(self, model: LinearSwimmer, used: Flags | None = None):
        k = model.prediction.shape[1]
        self.used = ~middle_session(model.runs) if used is None else used
        white = Noise(NOISE**2 * np.eye(k), (SESSION / NOISE) ** 2)
        self.white = white.whitener(model.runs.session[self.used])
        fitted = (*model.coefficients, *model.nuisances)
        rows = np.diag(np.sqrt(precisions(fitted)))
        J = np.concatenate([model.J, model.G], -1)
        self.priors = len(rows)
        self.absorbed = np.linalg.qr(np.concatenate([self.white(J[self.used]), rows]))[0]
        self.effects = self.rest(model.D)

    def rest(self, table: Floats) -> Floats:
        """What coefficients and numbers leave of signals (n, k, q), white, with the priors' rows, (n' k + g,
        q).
        """
        white = self.white(table[self.used])
        white = np.concatenate([white, np.zeros((self.priors, white.shape[1]))])
        return np.asarray(white - self.absorbed @ (self.absorbed.T @ white))

    def survived(self, table: Floats) -> Floats:
        """Share that they leave, (q,)."""
        length = np.linalg.norm(self.white(table[self.used]), axis=0)
        return np.asarray(np.linalg.norm(self.rest(table), axis=0) / np.maximum(length, 1e-300))

    def beyond_catalogue(self, signal: Floats) -> float:
        """Length of what the best pair of the catalogue leaves of a signal (n, k), too."""
        unabsorbed = self.rest(signal[..., None])[:, 0]
        unit = self.effects / np.maximum(np.linalg.norm(self.effects, axis=0), 1e-300)
        projections, between = unit.T @ unabsorbed, unit.T @ unit
        both = projections[:, None] ** 2 + projections**2 - 2 * projections[:, None] * projections * between
        taken = np.triu(both / np.maximum(1 - between**2, 1e-6), 1)
        return float(np.sqrt(max(unabsorbed @ unabsorbed - taken.max(), 0.0)))


def outside(model: LinearSwimmer) -> dict[str, Floats]:
    """Signals that no effect of the catalogue has, unscaled."""
    tails, length = model.runs.inputs[:, 0], model.runs.inputs[:, 1]
    wave, odd = np.zeros_like(model.prediction), np.zeros_like(model.prediction)
    wave[:, 2] = np.sin(6 * (length - length.mean()))
    odd[:, 0] = np.where(tails % 2 == 1, 1.0, -1.0)
    names = [e.name for e in model.effects]
    fast = model.runs.inputs[:, 2] - model.runs.inputs[:, 2].mean()
    mimic = model.D[..., names.index("end_over_end_drag")].copy()
    mimic[:, 2] *= np.exp(1.5 * (length - length.mean()))
    spin = model.D[..., names.index("tail_spin_drag")] * np.exp(3 * fast)[:, None]
    sag = model.D[..., names.index("tail_sag")] * np.exp(-1.5 * (length - length.mean()))[:, None]
    bump = np.zeros_like(model.prediction)
    bump[:, 3] = np.exp(-((length - length.mean()) ** 2) / 0.05) * np.where(tails > 3, 1.0, 0.5)
    return {
        "yaw rate wavy in the tails' length": wave,
        "head spin by the parity of N": odd,
        "turn radius with a bump in the tails' length": bump,
        "mimic of tail spin drag, steeper in speed": spin,
        "mimic of sag, flatter in l": sag,
        "mimic of end-over-end drag, steeper in l": mimic,
    }
