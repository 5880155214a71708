"""Numbers as given are in doubt: Gaussian priors of parameters, and how far the runs move them.

A parameter with σ was given before the runs were made. It counts as one more measurement of itself: a row with
derivative 1/σ and residual −x/σ, where x is its change from the value as given, on its own scale. With such rows
in every least-squares fit, the covariance of the runs is Σ + J P Jᵀ in every test (P = diag σ²), without being
formed.

The pull of such a parameter is

    z = x / √(σ² − V),   V the variance of x after the fit,

which is standard normal if the number was drawn from its prior. Numbers that the runs cannot tell apart (E and μ0)
have the same pull. What the runs alone say of it, with its own prior taken away and the others kept, is
x σ²/(σ² − V), with variance V σ²/(σ² − V). Source: pulls of nuisance parameters as in particle physics, e.g.
Demortier and Lyons (2002); priors as rows, e.g. Gelman et al. (2013), section 14.8.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from calibration.statistics.forward_model import Parameter, Parameters
from calibration.statistics.noise import Sums
from sim.arrays import Floats

if TYPE_CHECKING:
    from calibration.statistics.fit import Fit

WRONG = 3.0  # pull beyond which a number as given is taken to be wrong
_ALIKE = 6.63  # χ² with one degree of freedom, 99 %
_LEARNT = 0.02  # share of the prior's variance that the runs must remove before a pull means anything


@dataclass(frozen=True)
class Pull:
    """What the runs say about one number as given; changes are on the parameter's own scale."""

    parameter: Parameter
    change: float  # fitted, with its prior
    error: float
    alone: float  # from the runs alone, with the other numbers as far as their priors allow
    alone_error: float
    z: float
    freed: bool  # its prior was taken away

    @property
    def learnt(self) -> bool:
        """Whether the runs say anything about it."""
        assert self.parameter.sigma is not None
        return self.freed or self.error**2 < (1 - _LEARNT) * self.parameter.sigma**2

    @property
    def wrong(self) -> bool:
        return self.learnt and abs(self.z) > WRONG

    @property
    def words(self) -> str:
        """What the runs alone say, as in "E is 40 % below what was given (3.7 σ)"."""
        return f"{self.parameter.title} is {self.off(self.alone)} what was given ({abs(self.z):.1f} σ)"

    def off(self, change: float) -> str:
        """A change in words: "40 % below"."""
        one = self.parameter
        size = abs(math.expm1(change)) * 100 if one.logarithmic else abs(change) * one.shown
        return f"{size:.2g} {'%' if one.logarithmic else one.unit} {'below' if change < 0 else 'above'}"


def precisions(fitted: Sequence[Parameter]) -> Floats:
    """1/σ² of each parameter, 0 for those that are free, (p,)."""
    return np.array([0.0 if one.sigma is None else one.sigma**-2 for one in fitted])


def changes(fitted: Sequence[Parameter], parameters: Parameters) -> Floats:
    """Change of each parameter from its value as given, on its own scale; 0 for those that are free, (p,)."""
    return np.array([0.0 if one.sigma is None else _change(one, parameters[one.name]) for one in fitted])


def _change(one: Parameter, value: float) -> float:
    return math.log(value / one.start) if one.logarithmic else value - one.start


def prior_rows(fitted: Sequence[Parameter], parameters: Parameters) -> tuple[Floats, Floats]:
    """The priors as measurements: derivatives (q, p) and residuals (q,)."""
    root = np.sqrt(precisions(fitted))
    rows = np.flatnonzero(root)
    return np.diag(root)[rows], -(root * changes(fitted, parameters))[rows]


def with_prior(products: Sums, fitted: Sequence[Parameter], parameters: Parameters) -> Sums:
    """`products` of the derivatives and the residual (p + 1 columns) with the priors among them."""
    rows, residual = prior_rows(fitted, parameters)
    table = np.column_stack([rows, residual])
    return replace(products, within=products.within + table.T @ table)


def pulls(fitted: Fit, given: Sequence[Parameter]) -> tuple[Pull, ...]:
    """Every number as given, the farthest first; a number whose prior was taken away has its value from the
    runs.
    """
    found = []
    for one in given:
        if one.sigma is None or one.name not in fitted.names:
            continue
        place = fitted.names.index(one.name)
        variance = fitted.covariance[place, place] / fitted.inflation
        x, prior = _change(one, fitted.parameters[one.name]), one.sigma**2
        if fitted.fitted[place].sigma is None:
            freed = math.sqrt(variance)
            found.append(Pull(one, x, freed, x, freed, x / math.sqrt(prior + variance), True))
            continue
        variance = min(variance, prior * (1 - 1e-6))
        rest = prior - variance
        alone, error = x * prior / rest, math.sqrt(variance * prior / rest)
        found.append(Pull(one, x, math.sqrt(variance), alone, error, x / math.sqrt(rest), False))
    return tuple(sorted(found, key=lambda p: -abs(p.z) * p.learnt))


def rivals(found: Sequence[Pull], one: Pull) -> tuple[Pull, ...]:
    """Numbers that may be wrong in the place of `one`, which is among `found`; it comes first.

    To take a number's prior away lowers the deviance by z². Differences below `_ALIKE` are no evidence.
    """
    alike = [p for p in found if p is not one and p.wrong and one.z**2 - p.z**2 < _ALIKE]
    return (one, *sorted(alike, key=_own))


def likeliest(found: Sequence[Pull]) -> Pull | None:
    """Of the numbers that are wrong and as far out as the farthest, the one that is off by the fewest of its
    own σ.
    """
    wrong = [p for p in found if p.wrong]
    if not wrong:
        return None
    return min((p for p in wrong if wrong[0].z ** 2 - p.z**2 < _ALIKE), key=_own)


def _own(pull: Pull) -> float:
    assert pull.parameter.sigma is not None
    return abs(pull.alone) / pull.parameter.sigma
