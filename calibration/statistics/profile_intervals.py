"""How well the runs determine the fitted parameters: profile intervals, and the least determined combination.

The deviance along one parameter, with the others refitted, may differ from a parabola. So the model is run at both
ends of the interval that the covariance gives. Each end moves to where the deviance, as a parabola on its side,
has risen by t². Here t is the quantile of `Fit.interval`.
"""

from __future__ import annotations

import math

import numpy as np

from calibration.statistics.fit import Fit
from calibration.statistics.forward_model import ForwardModel, Parameters, moved, stepped
from calibration.statistics.noise import inverse_root, sums
from calibration.statistics.priors import with_prior
from sim.arrays import Flags, Floats, Integers

_LEAST = 0.05  # share of the expected rise; if the rise is smaller, the deviance is flat and the end stays
_MOST = 5.0  # if it is larger, the others were not refitted along a bent valley, and the end stays


def profile_intervals(
    model: ForwardModel, fitted: Fit, used: Flags, *, title: str = ""
) -> dict[str, tuple[float, float]]:
    """95 % intervals of every fitted parameter, by their profile deviances; of numbers as given by the
    covariance.
    """
    data, count = model.runs, len(fitted.names)
    root = inverse_root(fitted.noise.run)
    sets, ends = [], []
    for i, one in enumerate(fitted.fitted):
        if one.sigma is not None:
            continue
        half = fitted.half_width(i)
        for side in (-1, 1):
            end = moved(one, fitted.parameters[one.name], side * half)
            own = (
                math.log(end / fitted.parameters[one.name])
                if one.logarithmic
                else end - fitted.parameters[one.name]
            )
            along = fitted.covariance[i] / fitted.covariance[i, i] * own  # how the others change with it
            sets.append(stepped(fitted.fitted, fitted.parameters, along))
            ends.append((i, own))
    found = model.predict(sets, title=title)
    here = _deviance(
        fitted, fitted.parameters, root, data.y - fitted.prediction, data.session, used, list(range(count))
    )
    intervals: dict[str, list[float]] = {one.name: [] for one in fitted.fitted if one.sigma is None}
    for (i, own), at, prediction in zip(ends, sets, found, strict=True):
        others = [j for j in range(count) if j != i]
        rise = _deviance(fitted, at, root, data.y - prediction, data.session, used, others) - here
        expected = own**2 / (fitted.covariance[i, i] / fitted.inflation)
        scale = math.sqrt(expected / rise) if _LEAST * expected < rise < _MOST * expected else 1.0
        one = fitted.fitted[i]
        intervals[one.name].append(moved(one, fitted.parameters[one.name], own * scale))
    given = {one.name: fitted.interval(one.name) for one in fitted.fitted if one.sigma is not None}
    return {**{name: (low, high) for name, (low, high) in intervals.items()}, **given}


def _deviance(
    fitted: Fit,
    at: Parameters,
    root: Floats,
    residual: Floats,
    session: Integers,
    used: Flags,
    others: list[int],
) -> float:
    """rᵀ Σ⁻¹ r at parameters `at` with those of `others` refitted (linearised), in the noise of the fit."""
    table = np.concatenate([fitted.jacobian, residual[..., None]], -1)[used]
    products = with_prior(sums(root @ table, session[used], len(root)), fitted.fitted, at)
    columns = [*others, len(fitted.fitted)]
    whole = products.at(np.array(fitted.noise.share))[np.ix_(columns, columns)]
    p = len(others)
    absorbed = whole[:p, p] @ np.linalg.pinv(whole[:p, :p], hermitian=True) @ whole[:p, p] if p else 0.0
    return float(whole[p, p] - absorbed)


def least_determined(fitted: Fit) -> tuple[str, float]:
    """The combination of logarithmic parameters that the runs determine worst, and its standard error (of ln)."""
    own = [i for i, p in enumerate(fitted.fitted) if p.logarithmic and p.sigma is None]
    values, vectors = np.linalg.eigh(fitted.covariance[np.ix_(own, own)])
    vector = vectors[:, -1] * np.sign(vectors[np.argmax(np.abs(vectors[:, -1])), -1])
    parts = [
        f"{fitted.fitted[i].name}^{power:.2f}"
        for i, power in zip(own, vector.tolist(), strict=True)
        if abs(power) > 0.1
    ]
    return " ".join(parts), float(np.sqrt(values[-1]))
