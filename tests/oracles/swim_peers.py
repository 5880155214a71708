"""A swim as least squares have it: poses with white noise, of which effects are chosen by a criterion.

The simulator is that of the loop, so what is compared are noise and criteria. Sets of effects are compared where
the model is linear near the fit without effects; sizes outside their range do not count. The set that is chosen
is fitted again. Coefficients, starts and a current are fitted, too, without priors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from calibration.statistics.fit import fit
from calibration.statistics.forward import derivatives
from calibration.statistics.statistical_model import Parameter, start_values
from calibration.swim.measured_swim import read_swims
from calibration.swim.pose_noise import Sizes
from calibration.swim.swim_model import SwimModel
from common.arrays import Floats
from common.errors import InputError
from sim.knowledge import COEFFICIENTS
from tests.oracles.drawn_swims import LabSwim
from tests.oracles.peers import TAIL, Finding, by_criteria, sets_of
from tests.oracles.swim_scores import model_in_noise
from tests.oracles.swims import CameraNoise

_NONE = np.full(2, 1e-9)  # of a noise that nobody assumes: l, rad


class LinearFit(NamedTuple):
    """Least squares with some columns; numbers as a result of lmfit has them."""

    chisqr: float
    ndata: int
    nvarys: int
    sizes: Floats  # (p,) of the columns
    errors: Floats  # (p,)

    @property
    def aic(self) -> float:
        return self.ndata * math.log(self.chisqr / self.ndata) + 2 * self.nvarys

    @property
    def bic(self) -> float:
        return self.ndata * math.log(self.chisqr / self.ndata) + self.nvarys * math.log(self.ndata)


def linear_fit(columns: Floats, y: Floats) -> LinearFit:
    """Fit y (n,) by columns (n, p)."""
    length = np.linalg.norm(columns, axis=0)
    q, r = np.linalg.qr(columns / length)
    sizes = np.linalg.solve(r, q.T @ y)
    left = y - columns / length @ sizes
    variance = left @ left / (len(y) - len(sizes))
    errors = np.sqrt(variance * (np.linalg.inv(r) ** 2).sum(1))
    return LinearFit(float(left @ left), len(y), len(sizes), sizes / length, errors / length)


def swim_by_least_squares(swim: LabSwim, track: pd.DataFrame) -> dict[str, Finding]:
    """Choose effects of a swim by each of the criteria."""
    white = np.array(CameraNoise().white) / [swim.given.tail_length, 1.0]
    model, _ = model_in_noise(swim.given, read_swims(track, swim.plan), Sizes(white, _NONE, _NONE, 1.0))
    free, effects = [p.name for p in model.coefficients], {p.name: p for p in model.effects}
    at = _fitted(model, start_values(model), free)
    columns, left = _near(model, at, [*free, *effects])
    places = {name: len(free) + k for k, name in enumerate(effects)}
    fits = {
        some: linear_fit(columns[:, [*range(len(free)), *(places[name] for name in some)]], left)
        for some in sets_of(list(effects))
    }
    chosen = by_criteria({some: of for some, of in fits.items() if _in_range(effects, some, of)})
    intervals = {some: _intervals(model, at, [*free, *some]) for some in set(chosen.values())}
    return {how: Finding(frozenset(some), intervals[some]) for how, some in chosen.items()}


def _fitted(model: SwimModel, start: Mapping[str, float], names: Sequence[str]) -> dict[str, float]:
    used = np.ones(len(model.runs), dtype=bool)
    return fit(model, dict(start), tuple(names), used, title="").parameters


def _near(model: SwimModel, at: Mapping[str, float], names: Sequence[str]) -> tuple[Floats, Floats]:
    """Return the columns of numbers by name, and what is left of the poses."""
    seen, slopes = derivatives(model, at, names, title="")
    return slopes.reshape(seen.size, -1), (model.runs.y - seen).ravel()


def _in_range(effects: Mapping[str, Parameter], some: tuple[str, ...], of: LinearFit) -> bool:
    sizes = of.sizes[len(of.sizes) - len(some) :]
    ends = [(effects[name].bounds, effects[name].start + size) for name, size in zip(some, sizes, strict=True)]
    return all(low <= size <= high for (low, high), size in ends)


def _intervals(model: SwimModel, at: Mapping[str, float], names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Fit again with some effects, and compute 95 % intervals of the coefficients, which are logarithms.

    There are none where the fit leads to robots that cannot be simulated.
    """
    try:
        again = _fitted(model, at, names)
        errors = linear_fit(*_near(model, again, names)).errors
    except (InputError, ValueError):  # of the simulator; of SciPy, for what is not finite
        return {}
    each = {name: TAIL * float(errors[names.index(name)]) for name in COEFFICIENTS}
    return {name: (again[name] * math.exp(-e), again[name] * math.exp(e)) for name, e in each.items()}
