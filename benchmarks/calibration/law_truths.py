"""Truths for the benchmark of laws: a design of runs, the score of a signal in it, and laws drawn at random.

The score λ is what coefficients and nuisance parameters leave of a signal in the linear model, in standard
deviations. Truths are drawn from the places of the search (`calibration.laws.places`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.calibration.planted import ROBOT
from calibration.laws.law_model import LEVER, lever_arms, moved_parameter
from calibration.laws.places import Place, places
from calibration.laws.readings import EXPONENTS
from calibration.statistics.fit import Fit, fit
from calibration.statistics.forward import derivatives
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import Study, middle_session
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from common.arrays import Floats
from sim.inputs import group_columns
from sim.model.groups import Groups
from sim.model.laws import Powers

SCORES = (8.0, 16.0, 32.0)
NULL = 1000  # seed of the table in which nothing is missing
_STEEP = 1.0  # largest exponent
_LEVERS = {"l": (-0.9, -0.2), "L": (0.3, 1.0)}


@dataclass(frozen=True)
class Truth:
    """What a table hides."""

    kind: str
    score: float
    places: list[str]  # those that are true; empty: nothing is hidden
    table: Callable[[], pd.DataFrame]
    exponents: dict[str, float] = field(default_factory=dict)  # and lever, by the names that a fit has


@dataclass(frozen=True)
class Design:
    """The runs of a design with the model that is fitted to them, where nothing is missing."""

    made: pd.DataFrame
    study: Study
    model: SwimmerModel
    base: Fit
    design: Mapping[str, Any]  # arguments of `make_table`

    @classmethod
    def of(cls, **design: Any) -> Design:
        """Fit the model to a table of a design (`make_table`) in which nothing is missing."""
        table = make_table(ROBOT, seed=NULL, title="", **design)
        model = SwimmerModel(ROBOT, read_measurements(table))
        used = ~middle_session(model.runs)
        names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
        base = fit(model, start_values(model), names, used, title="")
        return cls(table, Study.fitted_to(model, used), model, base, design)

    def table(self, effects: Mapping[str, float], seed: int, **noise: Any) -> pd.DataFrame:
        """Simulate the table of the robot with effects."""
        return make_table(replace(ROBOT, effects=dict(effects)), seed=seed, title="", **self.design, **noise)

    def score(self, signal: Floats) -> float:
        """Compute λ of a signal (n, k)."""
        column = Directions.plain(signal[..., None])
        return float(examine_residual(self.study, self.base, column, draws=50).scores.length[0])

    def slope(self, place: Place, lever: float = 0.0) -> Floats:
        """Compute the derivative (n, k) along the term, or the logarithm of the factor, of a place."""
        along = [moved_parameter(self.model.robot, name) for name, _ in place.moves]
        slopes = derivatives(self.model, self.base.parameters, along)[1]
        if place.lever_unit:
            arms = lever_arms(self.model.robot, self.model.runs, place.lever_unit)
            return np.asarray(slopes[..., 0] + lever * arms[:, None] * slopes[..., 1])
        return np.asarray(slopes @ [float(power) for _, power in place.moves])

    def logarithm(self, powers: Powers) -> Floats:
        """Compute ln m of every run (n,), as `sim.model.laws` has it."""
        robots = self.model.robots(self.base.parameters)
        return np.array([powers.logarithm(Groups.from_columns(group_columns([robot])))[0] for robot in robots])


def hidden_law(setting: Design, seed: int, *, nothing: bool) -> Truth:
    """Draw place, exponents, lever and sign of a law; one seed after the other has each of `SCORES` in turn.

    One place in two is one at the disc, odd ones included; the others are side forces elsewhere and laws of the
    tails.
    """
    rng = np.random.default_rng(seed)
    if nothing:
        return Truth("nothing", 0.0, [], lambda: setting.table({}, seed))
    kinds = [place.part != "tails" and not place.lever_unit for place in places()]
    at_disc = bool(rng.integers(2))
    drawn = [place for place, of_head in zip(places(), kinds, strict=True) if of_head == at_disc]
    place = drawn[rng.integers(len(drawn))]
    powers = Powers(*rng.uniform(-_STEEP, _STEEP, 3))
    score = SCORES[seed % len(SCORES)]
    signed = score * rng.choice([-1, 1])
    lever = round(float(rng.uniform(*_LEVERS[place.lever_unit])), 3) if place.lever_unit else 0.0
    logs = setting.logarithm(powers)
    factor = np.exp(logs) if place.is_term else logs
    size = signed / setting.score(setting.slope(place, lever) * factor[:, None])
    if place.is_term:
        effects = {place.law(powers, lever).name: size}
    else:
        powers = Powers(*(np.clip(size * p, -4, 4) for p in (powers.speed, powers.length, powers.tails)))
        effects = {place.law(powers).name: 1.0}
    exponents = dict(zip(EXPONENTS, (powers.speed, powers.length, powers.tails), strict=True))
    exponents |= {LEVER: lever} if place.lever_unit else {}
    return Truth("hidden", score, [place.name], lambda: setting.table(effects, seed), exponents)
