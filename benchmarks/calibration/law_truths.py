"""Truths for the benchmarks of laws: a design of runs, the score of a signal in it, and laws drawn at random.

The score λ is what coefficients and nuisance parameters leave of a signal in the linear model, in standard
deviations. Laws of the tails are not among the truths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.calibration.planted import NOISE, ROBOT, SESSION
from calibration.laws.places import Place, places
from calibration.report.robot_laws import RobotLaws
from calibration.statistics.fit import Fit, fit
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import Study, middle_session
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from sim.arrays import Floats
from sim.inputs import group_columns
from sim.model.groups import Groups
from sim.model.power_law import COEFFICIENTS, Powers

SCORES = (8.0, 16.0, 32.0)
NULL = 1000  # seed of the table in which nothing is missing
_MULTIPLIED = ("omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm")  # outputs with relative noise
_STEEP = 1.0  # largest exponent


@dataclass(frozen=True)
class Setting:
    """The runs of a design with the model that is fitted to them, where nothing is missing."""

    table: pd.DataFrame
    study: Study
    model: SwimmerModel
    base: Fit

    @classmethod
    def of(cls, **design: Any) -> Setting:
        """Fit the model to a table of a design (`make_table`) in which nothing is missing."""
        table = make_table(ROBOT, seed=NULL, title="", **design)
        model = SwimmerModel(ROBOT, read_measurements(table))
        used = ~middle_session(model.runs)
        names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
        base = fit(model, start_values(model), names, used, title="")
        return cls(table, Study.fitted_to(model, used), model, base)

    def score(self, signal: Floats) -> float:
        """Compute λ of a signal (n, k)."""
        column = Directions.plain(signal[..., None])
        return float(examine_residual(self.study, self.base, column, draws=50).scores.length[0])

    def slope(self, place: Place) -> Floats:
        """Compute the derivative (n, k) along the term or the coefficient of a place on the head."""
        moved = [name for name, _ in place.moves]
        return self.model.derivatives({**self.base.parameters, **dict.fromkeys(moved, 1.0)}, moved)[1][..., 0]

    def logarithm(self, powers: Powers) -> Floats:
        """Compute ln m of every run (n,), as `sim.model.power_law` has it."""
        robots, of_run = self.model.robots(self.base.parameters)
        logs = [powers.logarithm(Groups.from_columns(group_columns([robot])))[0] for robot in robots]
        return np.array(logs)[of_run]


@dataclass(frozen=True)
class HiddenLaw:
    """A law on the head, or nothing."""

    place: Place
    powers: Powers
    score: float
    effects: dict[str, float]  # empty: nothing


def head_places() -> list[Place]:
    """List the places on head and disc."""
    return [place for place in places() if place.is_term or place.name in COEFFICIENTS]


def hidden_law(setting: Setting, seed: int, *, nothing: bool, scores: Sequence[float] = SCORES) -> HiddenLaw:
    """Draw place, exponents and sign of a law; one seed after the other has each of the scores in turn."""
    rng = np.random.default_rng(seed)
    on_head = head_places()
    place = on_head[rng.integers(len(on_head))]
    powers = Powers(*rng.uniform(-_STEEP, _STEEP, 3))
    score = scores[seed % len(scores)] * rng.choice([-1, 1])
    if nothing:
        return HiddenLaw(place, powers, 0.0, {})
    logs = setting.logarithm(powers)
    factor = np.exp(logs) if place.is_term else logs
    size = score / setting.score(setting.slope(place) * factor[:, None])
    if place.is_term:
        return HiddenLaw(place, powers, score, {place.effect(powers).name: size})
    powers = Powers(*(np.clip(size * p, -4, 4) for p in (powers.speed, powers.length, powers.tails)))
    return HiddenLaw(place, powers, score, {place.effect(powers).name: 1.0})


def with_noise(exact: pd.DataFrame, seed: int) -> pd.DataFrame:
    """Add noise and session scatter as `make_table` does to a table without them."""
    rng = np.random.default_rng(seed)
    session = exact["N"].to_numpy() - exact["N"].min()
    shift = rng.normal(scale=SESSION, size=(session.max() + 1, len(_MULTIPLIED)))[session]
    factors = np.exp(rng.normal(scale=NOISE, size=shift.shape) + shift)
    table = exact.copy()
    table[[*_MULTIPLIED]] *= factors
    table["theta_deg"] += rng.normal(scale=math.degrees(NOISE), size=len(table))
    return table


def record_of(described: RobotLaws) -> dict[str, Any]:
    """Record what a search says: the places that are not told apart, the best law, and errors over the noise."""
    laws = described.laws
    kept = laws.kept if laws else ()
    return {
        "p_value": described.p_value,
        "complete": bool(laws and laws.complete),
        "kept": [law.place.name for law in kept],
        "words": kept[0].words if kept else "",
        "left": kept[0].p_value if kept else math.nan,
        "before": described.error_without / described.noise,
        "after": kept[0].error / described.noise if kept else math.nan,
    }
