"""The design of a sweep: which robots are simulated.

The design is a scrambled Sobol sequence over the inputs of `sweep.toml`, of low discrepancy, so that every
projection is covered evenly. A row is an index of that sequence. Its robot depends on the seed, the inputs and the
index, not on the number of rows: a longer sweep begins with the shorter one. A log scale spreads rows evenly over
ratios; an integer scale gives each whole number of the range the same share; with `both_directions` half of the
robots turn their motor the other way.
Source: Sobol (1967); scrambling: Owen (1998), as in scipy.stats.qmc.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sim.arrays import Floats, Integers
from sim.effects import catalogue
from sim.inputs import check_columns
from sim.io.errors import InputError, naming
from sim.io.reading import read_toml
from sim.model.groups import DWELL, GROUP_COLUMNS, MOST_TAILS, OPTIONAL_COLUMNS

_ENTRIES = ("rows", "seed", "history_every", "sensitivities", "inputs")
_SCALES = ("linear", "log", "integer")
SWEEP_TOML = Path(__file__).parents[1] / "sweep.toml"  # the default sweep
MOST_ROWS = 2**30  # points of the sequence in double precision
HISTORY_BLOCK = 256  # rows
# Beyond these limits every robot would only be flagged.
_LIMITS = {
    "C_t": (1e-3, 1e3), "C_r": (1e-3, 1e3), "C_yr": (1e-3, 1e3), "l_over_R": (0.1, 100), "L_over_R": (0.1, 100),
    "l_over_r0": (5, 1e4), "omega_bar": (1e-3, 1e3), "N": (1, MOST_TAILS), "a_over_R": (0.01, 10),
}  # fmt: skip


@dataclass(frozen=True)
class Axis:
    """One input: its range, and how rows are spread over it."""

    low: float
    high: float
    scale: str
    both_directions: bool = False  # half of the rows are mirrored to -high … -low

    def at(self, share: Floats) -> Floats:
        """Return the values at shares in [0, 1)."""
        if self.both_directions:
            half = replace(self, both_directions=False)
            return np.where(share < 0.5, -half.at(2 * share), half.at(2 * share - 1))
        if self.scale == "log":
            return np.asarray(self.low * (self.high / self.low) ** share)
        if self.scale == "integer":
            return np.asarray(self.low + np.floor(share * (self.high - self.low + 1)))
        return np.asarray(self.low + (self.high - self.low) * share)

    def config(self) -> dict[str, Any]:
        """Return the axis as in sweep.toml."""
        mirrored = {"both_directions": True} if self.both_directions else {}
        return {"range": [self.low, self.high], "scale": self.scale, **mirrored}


@dataclass(frozen=True)
class SweepDesign:
    """A sweep: axes by column name, number of rows, seed, and the share of rows with memory and rest."""

    axes: dict[str, Axis]
    rows: int
    seed: int
    history_every: int = 4  # one block of HISTORY_BLOCK rows in so many has them; 0: none
    sensitivities: bool = False  # derivatives of the steady motion in the inputs, as columns

    @staticmethod
    def from_config(config: Mapping[str, Any], rows: int) -> SweepDesign:
        """Return the design that `config` describes."""
        axes = {
            name: Axis(
                spec["range"][0], spec["range"][1], spec.get("scale", "linear"), spec.get("both_directions", False)
            )
            for name, spec in config["inputs"].items()
        }
        seed, every = config.get("seed", 0), config.get("history_every", 4)
        return SweepDesign(axes, rows, seed, every, config.get("sensitivities", False))

    def config(self) -> dict[str, Any]:
        """Return what determines the robot of each index, JSON-like: all but the number of rows."""
        inputs = {name: axis.config() for name, axis in self.axes.items()}
        extra = {"history_every": self.history_every, "sensitivities": self.sensitivities}
        return {"seed": self.seed, **extra, "inputs": inputs}

    @property
    def effects(self) -> list[str]:
        """The effects among the inputs, in alphabetical order."""
        return sorted(set(self.axes) & set(catalogue()))

    def indices(self, start: int = 0, stop: int | None = None) -> Integers:
        """Return the numbers of the rows `start` … `stop` − 1; by default all `rows`."""
        return np.arange(start, self.rows if stop is None else stop)

    def points(self, start: int = 0, stop: int | None = None) -> dict[str, Floats]:
        """Return columns of the robots in the rows `start` … `stop` − 1; by default all `rows`."""
        from scipy.stats import qmc  # slow to import, and only workers need points

        rows = len(self.indices(start, stop))
        names = [name for name in _order() if name in self.axes]
        sampler = qmc.Sobol(len(names), scramble=True, rng=np.random.default_rng(self.seed))
        if start:
            sampler.fast_forward(start)
        first = 0 if start else min(1, rows)  # alone: scipy warns of a first draw that is no power of two
        share = np.concatenate([sampler.random(count) for count in (first, rows - first)])
        columns = {name: self.axes[name].at(np.ascontiguousarray(share[:, i])) for i, name in enumerate(names)}
        return {name: columns[name] for name in self.axes}

    def history(self, start: int = 0, stop: int | None = None) -> np.ndarray:
        """Return whether memory and rest are simulated for the robots in the rows `start` … `stop` − 1.

        They are simulated for whole blocks of the sequence, since each block covers the inputs evenly.
        """
        block = self.indices(start, stop) // HISTORY_BLOCK
        return block % self.history_every == 0 if self.history_every else np.zeros(len(block), dtype=bool)

    def with_rows(self, rows: int | None) -> SweepDesign:
        """Return the same design, longer or shorter."""
        return self if rows is None else replace(self, rows=_check_rows(rows))


def _order() -> tuple[str, ...]:
    """Return all inputs in the order of the sequence's dimensions, whatever the order in sweep.toml."""
    return (*GROUP_COLUMNS, *OPTIONAL_COLUMNS, *catalogue())


def load_design(path: str | Path = SWEEP_TOML) -> SweepDesign:
    """Load the design in a sweep.toml, by default the one that comes with the package.

    Raises:
        InputError: an input is missing or unknown, or its range contains impossible robots.
    """
    with naming(path):
        return checked_design(read_toml(path), str(path))


def checked_design(content: Mapping[str, Any], path: str) -> SweepDesign:
    """Make the design of the content of a sweep.toml.

    Args:
        content: the entries.
        path: name of the file, for messages.

    Raises:
        InputError: an entry is missing, unknown or impossible.
    """
    for name in set(content) - set(_ENTRIES):
        raise InputError(f"{path}: unknown entry {name!r}; allowed are {', '.join(_ENTRIES)}")
    inputs = content.get("inputs", {})
    if not isinstance(inputs, dict):
        raise InputError(f"{path}: inputs = {inputs!r}; write a table [inputs]")
    for name in inputs:
        if name == DWELL:
            raise InputError(f"{path}: {name} is no longer an input, rows hold all dwells; remove the line")
        if name not in _order():
            raise InputError(f"{path}: unknown input {name!r}; allowed are {', '.join(sorted(_order()))}")
    for name in GROUP_COLUMNS:
        if name not in inputs:
            raise InputError(f"{path}: missing input {name!r} in [inputs]")
    axes = {name: _axis(path, name, inputs[name]) for name in _order() if name in inputs}
    _check_ends(path, axes)
    seed = content.get("seed", 0)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise InputError(f"{path}: seed = {seed!r}; give a whole number from 0")
    every = content.get("history_every", 4)
    if not isinstance(every, int) or isinstance(every, bool) or not 0 <= every <= MOST_ROWS:
        raise InputError(f"{path}: history_every = {every!r}; give a whole number to {MOST_ROWS}, 0 for none")
    slopes = content.get("sensitivities", False)
    if not isinstance(slopes, bool):
        raise InputError(f"{path}: sensitivities = {slopes!r}; give true or false")
    return SweepDesign(axes, _check_rows(content.get("rows", 1024)), seed, every, slopes)


def _axis(path: str, name: str, spec: Any) -> Axis:
    try:
        low, high = (float(v) for v in _list(spec["range"]))
        scale, mirrored = spec.get("scale", "linear"), spec.get("both_directions", False)
        unknown = set(spec) - {"range", "scale", "both_directions"}
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
        raise InputError(
            f'{path}: {name} = {spec!r}; write {name} = {{ range = [low, high], scale = "linear" }}'
        ) from None
    for key in sorted(unknown):
        raise InputError(f"{path}: {name} has an entry {key!r}; allowed are range, scale and both_directions")
    if scale not in _SCALES:
        raise InputError(f"{path}: {name} has scale {scale!r}; allowed are {', '.join(_SCALES)}")
    if not isinstance(mirrored, bool) or (mirrored and name != "omega_bar"):
        raise InputError(f"{path}: {name} has both_directions = {mirrored!r}; only omega_bar takes true or false")
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise InputError(f"{path}: {name} has range [{low:g}, {high:g}]; it must be finite and ordered")
    if low <= 0 and name not in catalogue():
        raise InputError(f"{path}: {name} starts at {low:g}; it must be above 0")
    if scale == "log" and low <= 0:
        raise InputError(f"{path}: {name} starts at {low:g}; a log scale needs a low end above 0")
    if (name == "N" or scale == "integer") and (low != int(low) or high != int(high)):
        raise InputError(f"{path}: {name} has range [{low:g}, {high:g}]; give whole numbers")
    return Axis(low, high, "integer" if name == "N" else scale, mirrored)


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError
    return value


def _check_ends(path: str, axes: dict[str, Axis]) -> None:
    """Reject ranges with robots that cannot be simulated."""
    for name, (least, most) in _LIMITS.items():
        if name in axes and not least <= axes[name].low <= axes[name].high <= most:
            a = axes[name]
            raise InputError(
                f"{path}: {name} has range [{a.low:g}, {a.high:g}]; a sweep takes {least:g} to {most:g}"
            )
    for end in ("low", "high"):
        try:
            check_columns({name: np.array([getattr(a, end)]) for name, a in axes.items()})
        except InputError as refusal:
            raise InputError(f"{path}: the {end} ends of the ranges make an impossible robot: {refusal}") from None


def _check_rows(rows: object) -> int:
    if not isinstance(rows, int) or isinstance(rows, bool) or not 1 <= rows <= MOST_ROWS:
        raise InputError(f"rows = {rows}; give a whole number from 1 to {MOST_ROWS}")
    return rows
