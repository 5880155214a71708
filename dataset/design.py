"""The design of a sweep: which robots are simulated.

The design is a scrambled Sobol sequence over the inputs of `sweep.toml`, of low discrepancy, so that every
projection is covered evenly. A row is an index of that sequence. Its robot depends on the seed, the inputs and the
index, not on the number of rows: a longer sweep begins with the shorter one. A log scale spreads rows evenly over
ratios; an integer scale gives each whole number of the range the same share; with `both_directions` half of the
robots turn their motor the other way. With a robot the inputs are its numbers (`dataset.robot_inputs`).
Source: Sobol (1967); scrambling: Owen (1998), as in scipy.stats.qmc.
"""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from common.arrays import Floats, Integers
from common.errors import InputError, naming
from common.reading import read_toml
from dataset.robot_inputs import (
    FIELDS,
    WITH_UNIT,
    column_names,
    converted,
    input_of_robot,
    robot_columns,
    robot_fields,
    robot_of_sweep,
    sweep_toml,
)
from sim.effects import catalogue, is_effect
from sim.inputs import check_columns
from sim.model.groups import DWELL, GROUP_COLUMNS, MOST_TAILS, OPTIONAL_COLUMNS
from sim.model.robot import Robot

_SETTINGS = {"seed": 0, "history_every": 4, "sensitivities": False}
_ENTRIES = ("robot", "rows", *_SETTINGS, "inputs")
_COUNTS = ("N", "tails")
_SCALES = ("linear", "log", "integer")
SWEEP_TOML = Path(__file__).with_name("sweep.toml")  # the default sweep
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
    scale: str = "linear"
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
    robot: dict[str, Any] | None = None  # fields of `Robot` in SI units; then axes are fields, too, and effects

    @staticmethod
    def from_config(config: Mapping[str, Any], rows: int) -> SweepDesign:
        """Return the design that `config` describes."""
        axes = {
            name: Axis(*spec["range"], **{key: value for key, value in spec.items() if key != "range"})
            for name, spec in config["inputs"].items()
        }
        settings = {name: config.get(name, value) for name, value in _SETTINGS.items()}
        return SweepDesign(axes, rows, **settings, robot=config.get("robot"))

    def config(self) -> dict[str, Any]:
        """Return what determines the robot of each index, JSON-like: all but the number of rows."""
        inputs = {name: axis.config() for name, axis in self.axes.items()}
        extra = {"history_every": self.history_every, "sensitivities": self.sensitivities}
        around = {} if self.robot is None else {"robot": self.robot}
        return {"seed": self.seed, **extra, **around, "inputs": inputs}

    @property
    def columns(self) -> list[str]:
        """The columns of the robots."""
        return list(self.axes) if self.robot is None else column_names(self.robot, self.axes)

    @property
    def effects(self) -> list[str]:
        """The effects among the columns, in alphabetical order."""
        return sorted(filter(is_effect, self.columns))

    def ranges(self) -> dict[str, dict[str, Any]]:
        """Return range and scale of each column, as in sweep.toml; around a robot, what its corners span."""
        if self.robot is None:
            return {name: axis.config() for name, axis in self.axes.items()}
        mirrored = {"both_directions": True} if any(axis.both_directions for axis in self.axes.values()) else {}
        extra: dict[str, dict[str, Any]] = {"N": {"scale": "integer"}, "omega_bar": {"scale": "log", **mirrored}}
        return {
            name: {"range": [float(values.min()), float(values.max())], "scale": "linear", **extra.get(name, {})}
            for name, values in _corners(self.axes, self.robot).items()
        }

    def indices(self, start: int = 0, stop: int | None = None) -> Integers:
        """Return the numbers of the rows `start` … `stop` − 1; by default all `rows`."""
        return np.arange(start, self.rows if stop is None else stop)

    def points(self, start: int = 0, stop: int | None = None) -> dict[str, Floats]:
        """Return columns of the robots in the rows `start` … `stop` − 1; by default all `rows`."""
        from scipy.stats import qmc  # slow to import, and only workers need points

        rows = len(self.indices(start, stop))
        names = _ordered(self.axes)
        sampler = qmc.Sobol(len(names), scramble=True, rng=np.random.default_rng(self.seed))
        if start:
            sampler.fast_forward(start)
        first = 0 if start else min(1, rows)  # alone: scipy warns of a first draw that is no power of two
        share = np.concatenate([sampler.random(count) for count in (first, rows - first)])
        shares = {name: np.ascontiguousarray(share[:, i]) for i, name in enumerate(names)}
        columns = {name: axis.at(shares[name]) for name, axis in self.axes.items()}
        return columns if self.robot is None else robot_columns(self.robot, columns)

    def history(self, start: int = 0, stop: int | None = None) -> np.ndarray:
        """Return whether memory and rest are simulated for the robots in the rows `start` … `stop` − 1.

        They are simulated for whole blocks of the sequence, since each block covers the inputs evenly.
        """
        block = self.indices(start, stop) // HISTORY_BLOCK
        return block % self.history_every == 0 if self.history_every else np.zeros(len(block), dtype=bool)

    def with_rows(self, rows: int | None) -> SweepDesign:
        """Return the same design, longer or shorter."""
        return self if rows is None else replace(self, rows=_check_rows(rows))


def _ordered(inputs: Iterable[str]) -> list[str]:
    """Order inputs as the sequence's dimensions, whatever the order in sweep.toml; laws come last."""
    known = [*GROUP_COLUMNS, *OPTIONAL_COLUMNS, "tails", *WITH_UNIT, *catalogue()]
    return sorted(inputs, key=lambda name: (known.index(name) if name in known else len(known), name))


def load_design(path: str | Path = SWEEP_TOML) -> SweepDesign:
    """Load the design in a sweep.toml, by default the one that comes with the package.

    Raises:
        InputError: an input is missing or unknown, or its range contains impossible robots.
    """
    with naming(path):
        content = read_toml(path)
        if not isinstance(content.get("robot", ""), str):
            raise InputError(f"robot = {content['robot']!r}; give the name of a robot.toml or of a preset")
        return checked_design(content, str(path))


def design_around(
    robot: Robot, inputs: Mapping[str, tuple[float, float]] | None = None, rows: int = 1024
) -> SweepDesign:
    """Make the design of a sweep around a robot.

    Args:
        robot: what is not in `inputs` is as in this robot.
        inputs: lowest and highest value by name, such as {"tail_length_cm": (7, 13)}; default: those that
            `softflagella dataset config --robot` writes.
        rows: number of robots.

    Raises:
        InputError: an input is unknown, or its range contains impossible robots.
    """
    content = tomllib.loads(sweep_toml(robot, "robot"))
    if inputs is not None:
        content["inputs"] = {name: {"range": list(ends)} for name, ends in inputs.items()}
    read = {field: spec for field, (_, spec) in _inputs_of_robot(content["inputs"], False).items()}
    around = {**content, "robot": robot_fields(robot), "rows": rows, "inputs": read}
    return checked_design(around, f"sweep around robot {robot.name!r}")


def checked_design(content: Mapping[str, Any], path: str) -> SweepDesign:
    """Make the design of the content of a sweep.toml.

    Args:
        content: the entries. In a sweep.json the robot is a table of its fields in SI units, inputs are fields.
        path: name of the file, for messages.

    Raises:
        InputError: an entry is missing, unknown or impossible.
    """
    with naming(path):
        return _design(content, Path(path).parent)


def _design(content: Mapping[str, Any], folder: Path) -> SweepDesign:
    for name in set(content) - set(_ENTRIES):
        raise InputError(f"unknown entry {name!r}; allowed are {', '.join(_ENTRIES)}")
    inputs = content.get("inputs", {})
    if not isinstance(inputs, dict):
        raise InputError(f"inputs = {inputs!r}; write a table [inputs]")
    robot = robot_of_sweep(content["robot"], folder) if "robot" in content else None
    read = _inputs(inputs) if robot is None else _inputs_of_robot(inputs, isinstance(content["robot"], dict))
    axes = {name: _axis(*read[name]) for name in _ordered(read)}
    _check_ends(axes, robot)
    seed, every, slopes = (content.get(name, value) for name, value in _SETTINGS.items())
    if type(seed) is not int or seed < 0:
        raise InputError(f"seed = {seed!r}; give a whole number from 0")
    if type(every) is not int or not 0 <= every <= MOST_ROWS:
        raise InputError(f"history_every = {every!r}; give a whole number to {MOST_ROWS}, 0 for none")
    if type(slopes) is not bool:
        raise InputError(f"sensitivities = {slopes!r}; give true or false")
    return SweepDesign(axes, _check_rows(content.get("rows", 1024)), seed, every, slopes, robot)


def _inputs(inputs: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
    """Check the names of dimensionless inputs; return name and entry of each."""
    groups = {*GROUP_COLUMNS, *OPTIONAL_COLUMNS}
    for name in inputs:
        if name == DWELL:
            raise InputError(f"{name} is no longer an input, rows hold all dwells; remove the line")
        if name not in groups and not is_effect(name):
            allowed = ", ".join(sorted({*groups, *catalogue()}))
            raise InputError(
                f"unknown input {name!r}; allowed are {allowed}; with an entry robot, the numbers of a robot"
            )
    for name in GROUP_COLUMNS:
        if name not in inputs:
            raise InputError(f"missing input {name!r} in [inputs]")
    return {name: (name, spec) for name, spec in inputs.items()}


def _inputs_of_robot(inputs: Mapping[str, Any], fields_in_si: bool) -> dict[str, tuple[str, Any]]:
    """Convert the inputs of a sweep around a robot to SI units; return name and entry by field or effect."""
    if not inputs:
        raise InputError("no inputs; give at least one in a table [inputs], such as tail_length_cm")
    fields: dict[str, tuple[str, Any]] = {}
    for name, spec in inputs.items():
        field, unit = (name, "") if fields_in_si and name in FIELDS else input_of_robot(name)
        if field in fields:
            raise InputError(f"{fields[field][0]} and {name} are the same input; drop one")
        fields[field] = (name, converted(spec, unit))
    return fields


def _axis(name: str, spec: Any) -> Axis:
    try:
        low, high = (float(v) for v in [*spec["range"]] if not isinstance(spec["range"], str))
        scale, mirrored = spec.get("scale", "linear"), spec.get("both_directions", False)
        unknown = set(spec) - {"range", "scale", "both_directions"}
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
        raise InputError(
            f'{name} = {spec!r}; write {name} = {{ range = [low, high], scale = "linear" }}'
        ) from None
    for key in sorted(unknown):
        raise InputError(f"{name} has an entry {key!r}; allowed are range, scale and both_directions")
    if scale not in _SCALES:
        raise InputError(f"{name} has scale {scale!r}; allowed are {', '.join(_SCALES)}")
    if not isinstance(mirrored, bool) or (mirrored and not name.startswith(("omega_bar", "motor_speed"))):
        raise InputError(f"{name} has both_directions = {mirrored!r}; only the motor speed takes true or false")
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise InputError(f"{name} has range [{low:g}, {high:g}]; it must be finite and ordered")
    if low <= 0 and not is_effect(name):
        raise InputError(f"{name} starts at {low:g}; it must be above 0")
    if scale == "log" and low <= 0:
        raise InputError(f"{name} starts at {low:g}; a log scale needs a low end above 0")
    if (name in _COUNTS or scale == "integer") and (low != int(low) or high != int(high)):
        raise InputError(f"{name} has range [{low:g}, {high:g}]; give whole numbers")
    return Axis(low, high, "integer" if name in _COUNTS else scale, mirrored)


def _check_ends(axes: dict[str, Axis], robot: dict[str, Any] | None) -> None:
    """Reject ranges with robots that cannot be simulated; each number is smallest and largest at some ends."""
    try:
        if robot is None:
            columns = {name: np.array([axis.low, axis.high]) for name, axis in axes.items()}
        else:
            columns = _corners(axes, robot)
        for name, (least, most) in _LIMITS.items():
            low, high = (float(end(columns.get(name, least))) for end in (np.min, np.max))
            if not least <= low <= high <= most:
                raise InputError(f"{name} from {low:.3g} to {high:.3g}; a sweep takes {least:g} to {most:g}")
        check_columns(columns)
    except InputError as refusal:
        raise InputError(f"the ends of the ranges make an impossible robot: {refusal}") from None


def _corners(axes: dict[str, Axis], robot: dict[str, Any]) -> dict[str, Floats]:
    """Return the columns of the robots at all corners of the ranges."""
    corners = np.array(list(itertools.product(*((axis.low, axis.high) for axis in axes.values()))))
    return robot_columns(robot, dict(zip(axes, corners.T, strict=True)))


def _check_rows(rows: object) -> int:
    if type(rows) is not int or not 1 <= rows <= MOST_ROWS:
        raise InputError(f"rows = {rows}; give a whole number from 1 to {MOST_ROWS}")
    return rows
