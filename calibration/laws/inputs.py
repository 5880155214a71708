"""Inputs on which the factor of a law may depend: those of every run, and those that a table notes.

The factor is a power of the motor speed, the tail length, the number of tails and the diameter of the tank, and
an exponential of the others:

    m = (ω/ω_m)^p (l/l_m)^q (N/N_m)^r (D/D_m)^s e^(k_t (t − t_m) + k_T (T − T_m) + k_x (x − x_m) + k_y (y − y_m)).

t is the time since the first run, T the temperature, (x, y) the direction of the course. What is noted is an
input if it differs between the runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.swimmer.measured_table import Measurements
from sim.arrays import Floats

EXPONENTS = ("law_speed", "law_length", "law_tails")  # of INPUTS


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
