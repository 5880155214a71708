"""Laws that the search for laws does not contain, at four motor speeds; one seed after the other has

    two places   two terms on the head, each with a power law of its own, each of score λ
    resonance    a term on the head times γ²/((ω − ω0)² + γ²), ω0 from 90 to 140 rpm, γ from 5 to 15 rpm
    threshold    a term on the head times (ω/ω0 − 1) above ω0, from 85 to 130 rpm, and nothing below
    drift        a term on the head that grows fourfold in four steps in the course of each session
    tail load    a steady force per length on the tails along the axis, times a power law

For a resonance the place of its term is true, for a load on the tails along the axis every force along the axis.
"""

from __future__ import annotations

import math
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd

from benchmarks.calibration.law_truths import NULL, Design, Truth
from benchmarks.calibration.planted import NOISE, ROBOT, SESSION
from calibration.laws.places import places
from calibration.statistics.forward import derivatives
from calibration.swimmer.swimmer import SwimmerModel
from common.arrays import Floats
from sim.effects import catalogue
from sim.model.body import Body
from sim.model.effect import Effect
from sim.model.groups import Groups
from sim.model.laws import Powers

DESIGN: dict[str, Any] = {"lengths_cm": (5.0, 7.5, 10.0), "motor_rpm": (80.0, 100.0, 125.0, 150.0)}
KINDS = ("two places", "resonance", "threshold", "drift", "tail load")
_SCORES = (16.0, 32.0)
_STEPS = 4  # of a drift
_MULTIPLIED = ["omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm"]  # outputs with relative noise


def foreign(setting: Design, seed: int) -> Truth:
    """Draw the truth of a seed."""
    rng, kind = np.random.default_rng(seed), KINDS[seed % len(KINDS)]
    score = _SCORES[seed // len(KINDS) % len(_SCORES)]
    at_disc = [one for one in places(both_directions=False) if one.part != "tails" and not one.lever_unit]
    terms = [place for place in at_disc if place.is_term]
    chosen = [terms[i] for i in rng.choice(len(terms), 2, replace=False)]
    sign = rng.choice([-1.0, 1.0], 2)
    powers = [Powers(*rng.uniform(-1, 1, 3)) for _ in chosen]
    if kind == "two places":
        sizes = {}
        for place, law, way in zip(chosen, powers, sign, strict=True):
            signal = setting.slope(place) * np.exp(setting.logarithm(law))[:, None]
            sizes[place.law(law).name] = way * score / setting.score(signal)
        return Truth(kind, score, [place.name for place in chosen], lambda: setting.table(sizes, seed))
    if kind == "tail load":
        load = tail_load(powers[0])
        with patch.dict(catalogue(), {load.name: load}):
            model = SwimmerModel(ROBOT, setting.model.runs)
            slope = derivatives(model, {**setting.base.parameters, load.name: 0.0}, [load.name])[1][..., 0]
            table = setting.table({load.name: sign[0] * score / setting.score(slope)}, seed)
        return Truth(kind, score, [place.name for place in terms if place.wrench == "Fz"], lambda: table)
    factor = _factor(kind, setting, rng)
    size = sign[0] * score / setting.score(setting.slope(chosen[0]) * factor[:, None])
    name = chosen[0].law(Powers()).name
    return Truth(kind, score, [chosen[0].name], lambda: _with_sizes(setting, name, size * factor, seed))


def _factor(kind: str, setting: Design, rng: np.random.Generator) -> Floats:
    """Compute the factor of every run (n,), which is no power law."""
    speed = setting.made["omega_rpm"].abs().to_numpy()
    if kind == "resonance":
        middle, width = rng.uniform(90, 140), rng.uniform(5, 15)
        return np.asarray(width**2 / ((speed - middle) ** 2 + width**2))
    if kind == "threshold":
        return np.maximum(speed / rng.uniform(85, 130) - 1, 0.0)
    place = setting.made.groupby("session").cumcount().to_numpy()
    count = setting.made.groupby("session")["run"].transform("count").to_numpy()
    return np.asarray(1.0 + _STEPS * place // count) / _STEPS


def _with_sizes(setting: Design, name: str, sizes: Floats, seed: int) -> pd.DataFrame:
    """Make a table in which an effect has a size of its own in every run (n,), with the noise of `make_table`."""
    table = setting.made.copy()
    for size in np.unique(sizes):
        exact = setting.table({name: float(size)}, NULL, noise=0.0, session_noise=0.0)
        table[sizes == size] = exact[sizes == size]
    rng = np.random.default_rng(seed)
    session = table["N"].to_numpy() - table["N"].min()
    shift = rng.normal(scale=SESSION, size=(session.max() + 1, len(_MULTIPLIED)))[session]
    table[_MULTIPLIED] *= np.exp(rng.normal(scale=NOISE, size=shift.shape) + shift)
    table["theta_deg"] += rng.normal(scale=math.degrees(NOISE), size=len(table))
    return table


def tail_load(powers: Powers) -> Effect:
    """Make an effect b = ε (EI/l³) m e_z, a force per length on the tails along the axis, with a power law m."""

    def add_load(size: Floats, groups: Groups, body: Body) -> Body:
        load = size * powers.factor(groups)
        return body.plus(tail_load=np.stack([0.0 * load, 0.0 * load, load]))

    return Effect(
        name="tail_load_along_the_axis", title="load on the tails along the axis",
        equation="b = ε (EI/l³) m e_z", source="none: a truth for a benchmark", unit="EI/l³",
        bounds=(-100.0, 100.0), typical=0.1, adds=add_load,
    )  # fmt: skip
