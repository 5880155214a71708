"""Design of a sweep: which robots are simulated.

A scrambled Sobol sequence over the inputs of `sweep.toml`: low discrepancy, so that every projection is
covered evenly, and any number of rows from the same seed is the start of a longer sweep. A log scale spreads
rows evenly over ratios; an integer scale gives each whole number of the range the same share.
Source: Sobol (1967); scrambling: Owen (1998), as in scipy.stats.qmc.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from sim.arrays import Floats
from sim.effects import catalogue
from sim.io.errors import InputError
from sim.model.groups import DWELL, GROUP_COLUMNS, OPTIONAL_COLUMNS

_SCALES = ("linear", "log", "integer")
_MOST_ROWS = 2**24


@dataclass(frozen=True)
class Axis:
    """One input: its range and how rows are spread over it."""

    low: float
    high: float
    scale: str

    def at(self, share: Floats) -> Floats:
        """Values at shares in [0, 1)."""
        if self.scale == "log":
            return np.asarray(self.low * (self.high / self.low) ** share)
        if self.scale == "integer":
            return np.asarray(self.low + np.floor(share * (self.high - self.low + 1)))
        return np.asarray(self.low + (self.high - self.low) * share)


@dataclass(frozen=True)
class Design:
    """A sweep: axes by column name, number of rows, seed."""

    axes: dict[str, Axis]
    rows: int
    seed: int

    def config(self) -> dict[str, Any]:
        """What determines the robots, JSON-like (without the number of rows)."""
        axes = {n: {"range": [a.low, a.high], "scale": a.scale} for n, a in self.axes.items()}
        return {"seed": self.seed, "inputs": axes}

    def points(self) -> dict[str, Floats]:
        """Columns of the first `rows` robots of the sequence."""
        sampler = qmc.Sobol(len(self.axes), scramble=True, rng=np.random.default_rng(self.seed))
        share = sampler.random_base2(math.ceil(math.log2(max(self.rows, 2))))[: self.rows]
        return {name: axis.at(share[:, i]) for i, (name, axis) in enumerate(self.axes.items())}

    def with_rows(self, rows: int | None) -> Design:
        """The same design, longer or shorter."""
        return self if rows is None else replace(self, rows=_check_rows(rows))


def load_design(path: str | Path) -> Design:
    """The design in a sweep.toml.

    Raises:
        InputError: an input is missing, unknown, or its range makes no robots.
    """
    try:
        content = tomllib.loads(Path(path).read_text())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as broken:
        raise InputError(f"{path} is not TOML: {broken}") from None
    required = (*GROUP_COLUMNS, DWELL)
    inputs = content.get("inputs", {})
    known = {*required, *OPTIONAL_COLUMNS, *catalogue()}
    for name in inputs:
        if name not in known:
            raise InputError(f"{path}: unknown input {name!r}; allowed are {', '.join(sorted(known))}")
    for name in required:
        if name not in inputs:
            raise InputError(f"{path}: missing input {name!r} in [inputs]")
    axes = {name: _axis(str(path), name, spec) for name, spec in inputs.items()}
    seed = content.get("seed", 0)
    if not isinstance(seed, int) or seed < 0:
        raise InputError(f"{path}: seed = {seed!r}; give a whole number from 0")
    return Design(axes, _check_rows(content.get("rows", 1024)), seed)


def _axis(path: str, name: str, spec: Any) -> Axis:
    try:
        low, high = (float(v) for v in spec["range"])
        scale = spec.get("scale", "linear")
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError(
            f'{path}: {name} = {spec!r}; write {name} = {{ range = [low, high], scale = "linear" }}'
        ) from None
    if scale not in _SCALES:
        raise InputError(f"{path}: {name} has scale {scale!r}; allowed are {', '.join(_SCALES)}")
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise InputError(f"{path}: {name} has range [{low:g}, {high:g}]; it must be finite and ordered")
    if low <= 0 and name not in catalogue():
        raise InputError(f"{path}: {name} starts at {low:g}; it must be above 0")
    if scale == "log" and low <= 0:
        raise InputError(f"{path}: {name} starts at {low:g}; a log scale needs a low end above 0")
    if name == "N" and (low != int(low) or high != int(high)):
        raise InputError(f"{path}: N has range [{low:g}, {high:g}]; give whole numbers")
    return Axis(low, high, "integer" if name == "N" else scale)


def _check_rows(rows: object) -> int:
    if not isinstance(rows, int) or not 1 <= rows <= _MOST_ROWS:
        raise InputError(f"rows = {rows}; give a whole number from 1 to {_MOST_ROWS}")
    return rows
