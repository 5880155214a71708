"""Nuisance parameters have Gaussian priors, which are rows of every least-squares fit.

A parameter with σ was given before the runs were made. It counts as one more measurement of itself: a row with
derivative 1/σ and residual −x/σ, where x is its change from the value as given, on its own scale. With such rows
in every least-squares fit, the covariance of the runs is Σ + J P Jᵀ in every test (P = diag σ²), without being
formed. Source: priors as rows, e.g. Gelman et al. (2013), section 14.8.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.statistics.forward_model import Parameter, Parameters
from calibration.statistics.noise import Sums
from sim.arrays import Floats

WRONG = 3.0  # pull beyond which a nuisance parameter is taken to be wrong
_LEARNT = 0.02  # share of the prior's variance that the runs must remove before a pull means anything


@dataclass(frozen=True)
class Pull:
    """What the runs say about one nuisance parameter, on its own scale (`calibration.statistics.pulls`)."""

    parameter: Parameter
    change: float  # fitted, with its prior
    error: float
    alone: float  # from the runs alone, with the other nuisance parameters as far as their priors allow
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
        given = self.parameter
        size = abs(math.expm1(change)) * 100 if given.logarithmic else abs(change) * given.shown
        return f"{size:.2g} {'%' if given.logarithmic else given.unit} {'below' if change < 0 else 'above'}"


def precisions(fitted: Sequence[Parameter]) -> Floats:
    """Return 1/σ² of each parameter, 0 for those that are free, (p,)."""
    return np.array([0.0 if p.sigma is None else p.sigma**-2 for p in fitted])


def changes(fitted: Sequence[Parameter], parameters: Parameters) -> Floats:
    """Return the change of each parameter from its value as given; 0 for those that are free, (p,)."""
    return np.array([0.0 if p.sigma is None else change(p, parameters[p.name]) for p in fitted])


def change(given: Parameter, value: float) -> float:
    """Return the change from a parameter's value as given, on its own scale."""
    return math.log(value / given.start) if given.logarithmic else value - given.start


def prior_rows(fitted: Sequence[Parameter], parameters: Parameters) -> tuple[Floats, Floats]:
    """Write the priors as measurements: derivatives (q, p) and residuals (q,)."""
    root = np.sqrt(precisions(fitted))
    rows = np.flatnonzero(root)
    return np.diag(root)[rows], -(root * changes(fitted, parameters))[rows]


def with_prior(products: Sums, fitted: Sequence[Parameter], parameters: Parameters) -> Sums:
    """Add the priors to `products` of the derivatives and the residual (p + 1 columns)."""
    rows, residual = prior_rows(fitted, parameters)
    table = np.column_stack([rows, residual])
    return replace(products, within=products.within + table.T @ table)
