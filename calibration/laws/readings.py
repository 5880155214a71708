"""Exponents of a law in words: as a power of one input or one dimensionless group, where the runs agree with that.

A pattern of exponents p of (ω, l, N), with covariance V, agrees with a power s of one quantity ω^g₁ l^g₂ N^g₃ if

    χ² = (p − s g)ᵀ V⁻¹ (p − s g),   s = gᵀ V⁻¹ p/gᵀ V⁻¹ g,

is below the 95 % quantile of χ² with one degree of freedom less than there are exponents. So ω^0.1 l^0.4 is
ω̄^0.1. The quantity may also be one of the robot's motion (`calibration.laws.motion_readings`), which is named if
it is nearer than all of these.
Source: Wald (1943) for the test.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.stats import chi2

from sim.arrays import Floats

INPUTS = ("ω", "l", "N")
QUANTITIES = {  # symbol -> exponents g of INPUTS, for one material and fluid
    "ω": (1.0, 0.0, 0.0),
    "l": (0.0, 1.0, 0.0),
    "N": (0.0, 0.0, 1.0),
    "ω̄": (1.0, 4.0, 0.0),
    "(ω l)": (1.0, 1.0, 0.0),
    "(N l)": (0.0, 1.0, 1.0),
    "(N ω)": (1.0, 0.0, 1.0),
}
_AGREES = 0.95
_INTERVAL = 1.96


@dataclass(frozen=True)
class Reading:
    """A power of one quantity with which the exponents of a law agree."""

    symbol: str  # of QUANTITIES, or of the motion
    power: float  # s
    error: float  # one standard deviation
    chi2: float

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the power."""
        return self.power - _INTERVAL * self.error, self.power + _INTERVAL * self.error

    @property
    def words(self) -> str:
        """The power with its interval."""
        low, high = self.interval
        return f"{self.symbol}^{self.power:.2f} ({low:.2f} to {high:.2f})"


def readings(
    inputs: Sequence[str],
    exponents: Floats,
    covariance: Floats,
    quantities: Mapping[str, tuple[float, float, float]] = QUANTITIES,
) -> list[Reading]:
    """List the powers of one quantity that agree with exponents, the nearest first.

    Args:
        inputs: of INPUTS, q of them that differ between the runs.
        exponents: (q,)
        covariance: (q, q) of them.
        quantities: symbol -> exponents of INPUTS.
    """
    precision = np.linalg.inv(covariance)
    limit = float(chi2.ppf(_AGREES, max(len(inputs) - 1, 1)))
    agreeing = []
    for symbol, pattern in quantities.items():
        g = np.array([pattern[INPUTS.index(name)] for name in inputs])
        of_varied = {name for name, power in zip(INPUTS, pattern, strict=True) if power}
        if not of_varied <= set(inputs):
            continue
        weight = float(g @ precision @ g)
        power = float(g @ precision @ exponents) / weight
        difference = exponents - power * g
        distance = float(difference @ precision @ difference)
        error = weight**-0.5
        if distance < limit and abs(power) > _INTERVAL * error:
            agreeing.append(Reading(symbol, power, error, distance))
    return sorted(agreeing, key=lambda reading: reading.chi2)


def in_words(
    inputs: Sequence[str],
    exponents: Floats,
    covariance: Floats,
    intervals: Sequence[Sequence[float]],
    of_motion: Mapping[str, tuple[float, float, float]] = MappingProxyType({}),
) -> str:
    """Say on which inputs a law depends; empty if no input differs between the runs.

    Args:
        intervals: (q, 2), 95 % of the exponents.
        of_motion: quantities of the motion, symbol -> exponents of INPUTS.
    """
    if not inputs:
        return ""
    agreeing = readings(inputs, exponents, covariance)
    nearest = agreeing[0].chi2 if agreeing else math.inf
    moving = readings(inputs, exponents, covariance, of_motion)
    as_well = [reading.words for reading in moving if reading.chi2 < nearest]
    if agreeing:
        first, *others = agreeing
        said = f"in proportion to {first.words}"
        as_well = [*(reading.words for reading in others), *as_well]
        absent = [name for name in inputs if not _occurs(name, agreeing)]
    else:
        present = [not low <= 0.0 <= high for low, high in intervals]
        factors = [
            f"{name}^{value:.2f} ({low:.2f} to {high:.2f})"
            for name, value, (low, high), there in zip(inputs, exponents, intervals, present, strict=True)
            if there
        ]
        said = f"in proportion to {' '.join(factors)}" if factors else ""
        absent = [name for name, there in zip(inputs, present, strict=True) if not there]
    if said and as_well:
        said += f", or as well to {_listed(as_well, 'or')}"
    independent = f"independent of {_listed(absent, 'and')} within the intervals" if absent else ""
    return ", ".join(filter(None, (said, independent)))


def _occurs(name: str, agreeing: Sequence[Reading]) -> bool:
    """Tell whether an input is part of one of the quantities."""
    return any(QUANTITIES[reading.symbol][INPUTS.index(name)] for reading in agreeing)


def _listed(words: Sequence[str], between: str) -> str:
    *others, last = words
    return f"{', '.join(others)} {between} {last}" if others else last
