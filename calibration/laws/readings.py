"""Inputs on which the factor of a law may depend, and its exponents in words.

The factor is a power of the motor speed, the tail length, the number of tails and the diameter of the tank, and
an exponential of the others:

    m = (ω/ω_m)^p (l/l_m)^q (N/N_m)^r (D/D_m)^s e^(k_t (t − t_m) + k_T (T − T_m) + k_x (x − x_m) + k_y (y − y_m)).

t is the time since the first run, T the temperature, (x, y) the direction of the course. What is noted is an
input if it differs between the runs.

**In words.** A pattern of exponents p of (ω, l, N), with covariance V, agrees with a power s of one quantity ω^g₁
l^g₂ N^g₃ if

    χ² = (p − s g)ᵀ V⁻¹ (p − s g),   s = gᵀ V⁻¹ p/gᵀ V⁻¹ g,

is below the 95 % quantile of χ² with one degree of freedom less than there are exponents. So ω^0.1 l^0.4 is
ω̄^0.1. The quantity may also be one of the robot's motion (`motion_patterns`), which is named if it is nearer
than all of these.

**Motion.** A robot's speed |v| follows its motor speed, tail length and number of tails nearly as a power law,
over the runs of a table:

    ln |v| ≈ c + g₁ ln ω + g₂ ln l + g₃ ln N,

by least squares over the runs, with the motion of the fitted model. So a factor |v|^s and the factor
(ω^g₁ l^g₂ N^g₃)^s are nearly the same one, and exponents that agree with s g agree with a power of the speed.
A quantity is left out if it is no power law to within LARGEST_SCATTER.

Source: Wald (1943) for the test.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.special import chdtri

from calibration.swimmer.measured_table import Measurements
from common.arrays import Floats

EXPONENTS = ("law_speed", "law_length", "law_tails")  # of INPUTS
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
LARGEST_SCATTER = 0.07  # rms of what the power law leaves of the logarithm
_SYMBOLS = {"omega_h": "ω_h", "omega_t": "ω_t", "omega_yr": "ω_yr"}


@dataclass(frozen=True)
class NotedInput:
    """An input that a table notes."""

    words: str
    unit: str  # of an exponential, per which its coefficient is; empty: a power
    symbol: str


NOTED = {  # by the names of `Measurements.noted_names`
    "elapsed_h": NotedInput("time since the first run", "h", "t"),
    "temperature_K": NotedInput("temperature", "K", "T"),
    "tank_diameter": NotedInput("diameter of the tank", "", "D"),
    "course_x": NotedInput("course along x", "1", "x"),
    "course_y": NotedInput("course along y", "1", "y"),
}


def parameter_of(noted: str) -> str:
    """Name the parameter of a noted input: an exponent, or the coefficient in an exponential."""
    return f"law_{noted}"


def logarithms(runs: Measurements) -> Floats:
    """Compute ln ω, ln l, ln N of every run, (n, 3), in rad/s and m."""
    return np.asarray(np.log(np.stack([np.abs(runs.omega), runs.length, runs.tails], 1)))


def noted_values(runs: Measurements, noted: Sequence[str]) -> Floats:
    """Compute that in which the factor's logarithm is linear, (n, q); NaN for what the table does not note."""
    columns = [_noted_value(runs, name) for name in noted]
    return np.stack(columns, 1) if columns else np.empty((len(runs), 0))


def _noted_value(runs: Measurements, name: str) -> Floats:
    if name not in runs.noted_names:
        return np.full(len(runs), np.nan)
    value = runs.noted[:, runs.noted_names.index(name)]
    return value if NOTED[name].unit else np.log(value)


def noted_in_words(noted: Sequence[str], values: Sequence[float], intervals: Sequence[tuple[float, float]]) -> str:
    """Say how a law depends on noted inputs, with 95 % intervals; empty if there are none."""
    parts = []
    for name, value, (low, high) in zip(noted, values, intervals, strict=True):
        of = NOTED[name]
        interval = f"{value:.2g} ({low:.2g} to {high:.2g})"
        per = f" per {of.unit}" if of.unit not in ("", "1") else ""
        if of.unit:
            parts.append(f"an exponential of the {of.words}, {interval}{per}")
        else:
            parts.append(f"a power of the {of.words}, {of.symbol}^{interval}")
    return f"in proportion to {' and '.join(parts)}" if parts else ""


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
    """List the powers of one quantity that agree with exponents (q,) of covariance (q, q), the nearest first."""
    precision = np.linalg.inv(covariance)
    limit = float(chdtri(max(len(inputs) - 1, 1), 1 - _AGREES))
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
    """Say on which inputs a law depends, with 95 % intervals (q, 2); empty if none differs between the runs."""
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


def motion_patterns(
    inputs: Floats, outputs: Sequence[str], prediction: Floats
) -> Mapping[str, tuple[float, float, float]]:
    """Find the exponents g with which the motion follows ω, l and N.

    Args:
        inputs: ln ω, ln l, ln N of every run, (n, 3).
        outputs: names of the columns of `prediction`, of `common.run_columns.MEASURED`.
        prediction: the fitted model's outputs, (n, k); logarithms of all but θ.

    Returns:
        Symbol -> exponents of ω, l and N; zero for an input that does not differ between the runs.
    """
    columns = dict(zip(outputs, prediction.T, strict=True))
    motion = {symbol: columns[name] for name, symbol in _SYMBOLS.items() if name in columns}
    if "v" in columns:
        motion["|v|"] = columns["v"]
    elif {"omega_yr", "R_yr"} <= set(columns):
        motion["|v|"] = columns["omega_yr"] + columns["R_yr"]
    centred = inputs - inputs.mean(0)
    patterns = {}
    for symbol, logarithm in motion.items():
        about_mean = logarithm - logarithm.mean()
        exponents = np.linalg.lstsq(centred, about_mean, rcond=None)[0]
        if np.std(about_mean - centred @ exponents) < LARGEST_SCATTER:
            patterns[symbol] = (float(exponents[0]), float(exponents[1]), float(exponents[2]))
    return patterns
