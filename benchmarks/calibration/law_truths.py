"""Truths for the benchmarks of laws: a design of runs, the score of a signal in it, and laws drawn at random.

The score λ is what coefficients and nuisance parameters leave of a signal in the linear model, in standard
deviations. Truths are drawn from the places of the search (`calibration.laws.places`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.calibration.planted import NOISE, ROBOT, SESSION
from calibration.laws.inputs import EXPONENTS
from calibration.laws.law_model import LEVER, lever_arms
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
_LEVERS = {"l": (-0.9, -0.2), "L": (0.3, 1.0)}


@dataclass(frozen=True)
class Setting:
    """The runs of a design with the model that is fitted to them, where nothing is missing."""

    table: pd.DataFrame
    study: Study
    model: SwimmerModel
    base: Fit
    design: Mapping[str, Any]  # arguments of `make_table`

    @classmethod
    def of(cls, **design: Any) -> Setting:
        """Fit the model to a table of a design (`make_table`) in which nothing is missing."""
        table = make_table(ROBOT, seed=NULL, title="", **design)
        model = SwimmerModel(ROBOT, read_measurements(table))
        used = ~middle_session(model.runs)
        names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
        base = fit(model, start_values(model), names, used, title="")
        return cls(table, Study.fitted_to(model, used), model, base, design)

    def score(self, signal: Floats) -> float:
        """Compute λ of a signal (n, k)."""
        column = Directions.plain(signal[..., None])
        return float(examine_residual(self.study, self.base, column, draws=50).scores.length[0])

    def slope(self, place: Place, lever: float = 0.0) -> Floats:
        """Compute the derivative (n, k) along the term, or the logarithm of the factor, of a place."""
        moved = [name for name, _ in place.moves]
        parameters = {**self.base.parameters, **(dict.fromkeys(moved, 1.0) if place.is_term else {})}
        slopes = self.model.derivatives(parameters, moved)[1]
        if place.lever_unit:
            arms = lever_arms(self.model.robot, self.model.runs, place.lever_unit)
            return np.asarray(slopes[..., 0] + lever * arms[:, None] * slopes[..., 1])
        return np.asarray(slopes @ [float(power) for _, power in place.moves])

    def logarithm(self, powers: Powers) -> Floats:
        """Compute ln m of every run (n,), as `sim.model.power_law` has it."""
        robots, of_run = self.model.robots(self.base.parameters)
        logs = [powers.logarithm(Groups.from_columns(group_columns([robot])))[0] for robot in robots]
        return np.array(logs)[of_run]


@dataclass(frozen=True)
class HiddenLaw:
    """A law, or nothing."""

    place: Place
    powers: Powers
    lever: float
    score: float
    effects: dict[str, float]  # empty: nothing

    @property
    def exponents(self) -> dict[str, float]:
        """True exponents and lever, by the names that a fit has."""
        powers = zip(EXPONENTS, (self.powers.speed, self.powers.length, self.powers.tails), strict=True)
        return {**dict(powers), **({LEVER: self.lever} if self.place.lever_unit else {})}


def head_places() -> list[Place]:
    """List the places at the disc that are even in the direction of the motor."""
    at_disc = [place for place in places(both_directions=False) if place.part != "tails" and not place.lever_unit]
    assert all(place.is_term or place.name in COEFFICIENTS for place in at_disc)
    return at_disc


def hidden_law(setting: Setting, seed: int, *, nothing: bool, scores: Sequence[float] = SCORES) -> HiddenLaw:
    """Draw place, exponents, lever and sign of a law; one seed after the other has each of the scores in turn.

    One place in two is one at the disc, odd ones included; the others are side forces elsewhere and laws of the
    tails.
    """
    rng = np.random.default_rng(seed)
    kinds = [place.part != "tails" and not place.lever_unit for place in places()]
    at_disc = bool(rng.integers(2))
    drawn = [place for place, of_head in zip(places(), kinds, strict=True) if of_head == at_disc]
    place = drawn[rng.integers(len(drawn))]
    powers = Powers(*rng.uniform(-_STEEP, _STEEP, 3))
    score = scores[seed % len(scores)] * rng.choice([-1, 1])
    lever = round(float(rng.uniform(*_LEVERS[place.lever_unit])), 3) if place.lever_unit else 0.0
    if nothing:
        return HiddenLaw(place, powers, lever, 0.0, {})
    logs = setting.logarithm(powers)
    factor = np.exp(logs) if place.is_term else logs
    size = score / setting.score(setting.slope(place, lever) * factor[:, None])
    if place.is_term:
        return HiddenLaw(place, powers, lever, score, {place.effect(powers, lever).name: size})
    powers = Powers(*(np.clip(size * p, -4, 4) for p in (powers.speed, powers.length, powers.tails)))
    return HiddenLaw(place, powers, lever, score, {place.effect(powers).name: 1.0})


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
        "named": [one.place.name for law in kept for one in (law, *law.elsewhere)],
        "words": kept[0].words if kept else "",
        "left": kept[0].p_value if kept else math.nan,
        "before": described.error_without / described.noise,
        "after": kept[0].error / described.noise if kept else math.nan,
    }
