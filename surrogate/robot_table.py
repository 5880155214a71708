"""A table of one robot: its motion and its response to flips in both directions of the motor, simulated.

The look-up table that comes with the package covers a domain of robots without odd effects. A corrected robot may
lie outside this domain, or turn left and right at different rates. For the planner, the curves of that one robot
are enough (`surrogate.tabulate`). Planning simulates nothing.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.files import write_text
from common.notebook import Shown, given_axes
from common.reading import expecting, read_json
from sim.model.response import DWELLS, Responses
from sim.motion.steady_motion import STEADY_OUTPUTS, net_speeds, twists
from surrogate.domain import ROBOT
from surrogate.error_modes import error_modes
from surrogate.interface import NOTE, ErrorModes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT = 3
_LARGEST = 1e100  # of a number
_CURVES = {"lag": (2, len(DWELLS), 3), "memory": (2, -1, len(DWELLS), 3),
           "rest": (2, len(DWELLS), 3), "spread": (2, len(DWELLS), 3)}  # fmt: skip


@dataclass(frozen=True, repr=False)
class RobotTable(Shown):
    """Motion and response of one robot, with the interface of `surrogate.interface.LookupTable`.

    Curves are those of `sim.model.response`; index 0 is the positive direction of the motor, index 1 the reversed
    one.
    """

    robot: dict[str, float]  # dimensionless groups, effects among them
    steady: dict[str, list[float]]  # columns of `softflagella steady`, both directions
    lag: list[Any]  # (2, D, 3)
    before: list[float]  # (K,), of `memory`
    memory: list[Any]  # (2, K, D, 3)
    rest: list[Any]  # (2, D, 3)
    spread: list[Any]  # (2, D, 3)
    slopes: dict[str, Any]  # d twist/d ln of a group, or /d size of an effect, (2, 3): forward, left, yaw rate
    errors: dict[str, dict[str, float]]  # output -> {"rms"}, relative, see `surrogate.tabulate`
    provenance: dict[str, Any]
    error_curves: list[Any] = field(default_factory=list)  # (P, K + 1, D, 3): modes of errors of the lags

    @property
    def domain(self) -> dict[str, tuple[float, float]]:
        """Range of every input: a single value."""
        return {name: (value, value) for name, value in self.robot.items()}

    @property
    def identity(self) -> str:
        """Hash of everything in the table."""
        return _digest(asdict(self))[:16]

    def query(self, columns: Mapping[str, Floats], *, mark: bool = False) -> dict[str, Any]:
        """Return outputs (M,) of this robot; the sign of `omega_bar` is the direction of the motor.

        Args:
            columns: robots by column name, each (M,).
            mark: as for `NeuralTable.query`: rows of another robot have NaN, and a note.

        Raises:
            InputError: the columns are another robot's.
        """
        side, notes = self._sides(columns, mark=mark)
        gaps = np.where([not note for note in notes], 0.0, np.nan)
        outputs = {name: np.array(values)[side] + gaps for name, values in self.steady.items()}
        return {**outputs, NOTE: np.array(notes)} if mark else outputs

    def response(self, columns: Mapping[str, Floats]) -> Responses:
        """Return the response of this robot to a flip, for M rows; see `LookupTable.response`.

        Raises:
            InputError: the columns are another robot's.
        """
        (side, _), before = self._sides(columns), np.array(self.before)
        lag, memory, rest, spread = (np.array(getattr(self, name))[side] for name in _CURVES)
        outputs, sense = self.query(columns), np.where(side == 0, 1.0, -1.0)
        twist = twists(outputs["v_z"], outputs["v_x"], outputs["omega_yr_bar"], sense)
        speed = net_speeds(twist, lag, memory, before)
        none = np.zeros(len(side), dtype=bool)
        return Responses(lag, memory, rest, spread, speed, none, none, before)

    def error_modes(self, columns: Mapping[str, Floats]) -> ErrorModes:
        """Return the errors of this robot's motion and response; see `LookupTable.error_modes`."""
        self._sides(columns)
        motion = {name: values[0] for name, values in self.steady.items()}
        return error_modes(self.errors, motion, np.array(self.error_curves) if self.error_curves else None)

    def save(self, path: str | Path) -> None:
        """Write the table as JSON, with a hash over everything in it."""
        content = asdict(self)
        write_text(path, json.dumps({"format": FORMAT, "hash": _digest(content), **content}) + "\n")

    def __repr__(self) -> str:
        of = self.provenance.get("config", {}).get("robot", "one robot")
        radius, slip = (self.steady[name][0] for name in ("R_yr_over_l", "theta_deg"))
        worst, error = max(self.errors.items(), key=lambda item: item[1]["rms"], default=("", {"rms": math.nan}))
        return (
            f"Look-up table {self.identity} of {of}, both directions of the motor\n"
            f"  turn radius {radius:.4g} l, slip angle {slip:.1f} degrees; response to a flip for dwells of "
            f"{DWELLS[0]:g} to {DWELLS[-1]:g} time units\n"
            f"  largest error {100 * error['rms']:.2g} % ({worst})"
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the net speed over equal dwells, with a positive and a negative motor first.

        Args:
            ax: default: axes of a new figure.
        """
        ax = given_axes(ax)
        columns = {name: np.array([value, value]) for name, value in self.robot.items()}
        columns["omega_bar"] = columns["omega_bar"] * [1.0, -1.0]
        for speed, label in zip(self.response(columns).net_speed, ("motor + first", "motor − first"), strict=True):
            ax.plot(DWELLS, speed, label=label)
        ax.set_xlabel("dwell [μ0 l⁴/EI]")
        ax.set_ylabel("net speed [EI/(μ0 l³)]")
        ax.legend(frameon=False)
        return ax

    def to_dict(self) -> dict[str, Any]:
        """Return everything in the table as plain content."""
        return asdict(self)

    def _sides(self, columns: Mapping[str, Floats], *, mark: bool = False) -> tuple[Any, list[str]]:
        """Return for every row 0 or 1, by the direction of its motor, and why it is another robot; empty if not.

        Raises:
            InputError: a row is of another robot; with `mark`, all are.
        """
        notes = [""] * len(next(iter(columns.values())))
        for name, values in columns.items():
            expected = self.robot.get(name, 0.0)
            given = np.abs(values) if name == "omega_bar" else np.asarray(values, dtype=float)
            for row in np.flatnonzero(~(np.abs(given - expected) <= 1e-9 * max(abs(expected), 1.0))).tolist():
                notes[row] = (
                    notes[row] or f"{name} = {given[row]:g} is outside this robot's table ({expected:g} only)"
                )
        for note in filter(None, notes if all(notes) or not mark else ()):
            raise InputError(f"{note}; make its own table with softflagella surrogate robot")
        return np.where(np.asarray(columns.get("omega_bar", np.ones(len(notes)))) < 0, 1, 0), notes


def load_robot_table(path: str | Path) -> RobotTable:
    """Read a table of one robot.

    Raises:
        InputError: the file is not such a table, or one of another version, or it was changed.
    """
    remedy = "make one with softflagella surrogate robot"
    with expecting("a table of a robot", path, remedy):
        content = read_json(path)
        version = content.pop("format", 1)
        if version != FORMAT:
            raise InputError(f"{path} has format {str(version)[:20]}, this version reads {FORMAT}; {remedy}")
        if content.pop("hash", "") != _digest(content):
            raise InputError(f"{path} was changed after it was written; {remedy}")
        if wrong := _wrong(RobotTable(**content)):
            raise InputError(f"{path} is no table of a robot: {wrong}; {remedy}")
    return RobotTable(**content)


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _wrong(table: RobotTable) -> str:
    """Return what is wrong with the numbers of a table; empty if nothing is."""
    count, gap = len(table.before), "tail_gap"  # the gap of one tail is infinite
    parts: dict[str, tuple[Any, tuple[int, ...]]] = {
        "before": (table.before, (count,)),
        **{name: (getattr(table, name), tuple(count if n < 0 else n for n in _CURVES[name])) for name in _CURVES},
        **{name: (table.steady.get(name), (2,)) for name in dict.fromkeys((*STEADY_OUTPUTS, *table.steady))},
        **{name: (table.robot.get(name), ()) for name in dict.fromkeys((*ROBOT, *table.robot))},
        **{f"slope in {name}": (slope, (2, 3)) for name, slope in table.slopes.items()},
        **{f"error of {name}": (list(error.values()), (len(error),)) for name, error in table.errors.items()},
    }
    if table.error_curves:
        parts["error_curves"] = table.error_curves, (len(table.error_curves), count + 1, len(DWELLS), 3)
    for name, (content, shape) in parts.items():
        numbers = np.array(None if _has_words(content) else content, dtype=float)
        if name == gap:
            numbers = np.where(numbers == np.inf, 1.0, numbers)
        if numbers.shape != shape or not (np.abs(numbers) < _LARGEST).all():
            return f"its {name!r} is not finite numbers, {' × '.join(map(str, shape)) or 'one'}"
    return ""


def _has_words(content: Any) -> bool:
    """Whether lists and dictionaries have, at any depth, a word or a truth value; numpy takes "1" for a number."""
    if isinstance(content, dict | list | tuple):
        return any(map(_has_words, content.values() if isinstance(content, dict) else content))
    return isinstance(content, str | bool)
