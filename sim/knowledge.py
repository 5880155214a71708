"""What a calibration knows besides the corrected robot: the covariance of its coefficients, and a current.

In a robot.toml it is the table

    [calibration]
    names = ["C_t", "C_r", "C_yr", "viscosity"]  # coefficients and numbers of the robot, as their logarithms;
    covariance = [[...], [...], [...], [...]]    # effects, as sizes
    current_m_s = [0.0, 0.0]                     # along x and y of the lab
    current_error_m_s = [0.0, 0.0]               # one standard deviation

Every entry may be left out. A calibration writes this table into corrected.toml. Numbers of the robot are
fields of `Robot`: E, μ0, r0, l, R, L and a. Their errors are correlated with those of the coefficients.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from common.arrays import Floats
from common.changes import RobotSource, changes_of
from common.errors import InputError, InputWarning, naming
from common.reading import read_toml
from sim.effects import is_effect
from sim.model.robot import Robot
from sim.model.robot_toml import field_of
from sim.model.uncertainty import DEFAULTS

COEFFICIENTS = ("C_t", "C_r", "C_yr")
_LARGEST = 1e50  # of a covariance
NUMBERS = tuple(DEFAULTS)  # fields of `Robot` that are not exact


@dataclass(frozen=True)
class CalibrationKnowledge:
    """Covariance (p, p) of ln C, ln numbers and effect sizes; current and its standard deviation [m/s].

    Example:
        >>> import softflagella as sf
        >>> known = sf.CalibrationKnowledge(current=(1e-4, 0.0))
        >>> robot = sf.load_robot("paper-control")
        >>> sf.plan(sf.circle(2.0), robot, knowledge=known).tracked.vehicle.current.round(4).tolist()
        [0.002, 0.0]
    """

    names: tuple[str, ...] = ()  # coefficients, fields of `Robot` and effects, p of them
    covariance: Floats = field(default_factory=lambda: np.zeros((0, 0)))  # (p, p)
    current: tuple[float, float] = (0.0, 0.0)  # along x and y [m/s]
    current_error: tuple[float, float] = (0.0, 0.0)  # [m/s]

    def __post_init__(self) -> None:
        numbers = (*COEFFICIENTS, *NUMBERS)
        unknown = [name for name in self.names if name not in numbers and not is_effect(name)]
        if unknown:
            allowed = ", ".join(numbers)
            raise InputError(f"calibration: unknown name {unknown[0]!r}; give {allowed} or an effect")
        V = self.covariance
        if V.shape != (len(self.names),) * 2 or not (np.abs(V) < _LARGEST).all() or not np.allclose(V, V.T):
            raise InputError(f"calibration: covariance must be symmetric, {len(self.names)} by {len(self.names)}")
        if len(V) and np.linalg.eigvalsh(V).min() < -1e-9 * np.abs(V).max():
            raise InputError("calibration: covariance has a negative eigenvalue; copy it from the calibration")
        if not np.isfinite([*self.current, *self.current_error]).all() or min(self.current_error) < 0:
            raise InputError(
                "calibration: the current and its error must be finite numbers, the error not below 0"
            )

    @property
    def empty(self) -> bool:
        """Whether nothing is known."""
        return not (self.names or any((*self.current, *self.current_error)))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the table [calibration]."""
        return {
            "names": self.names,
            "covariance": self.covariance.tolist(),
            "current_m_s": self.current,
            "current_error_m_s": self.current_error,
        }

    @staticmethod
    def from_dict(table: Any, source: object) -> CalibrationKnowledge:
        """Read the content of a table [calibration]; `source` names it in messages.

        Raises:
            InputError: the table is not as described above.
        """
        try:
            names = tuple(str(name) for name in table.get("names", ()))
            covariance = np.array(table.get("covariance", []), dtype=float).reshape(len(names), len(names))
            current, error = (_pair(table.get(key, (0.0, 0.0))) for key in ("current_m_s", "current_error_m_s"))
        except (TypeError, ValueError, AttributeError, OverflowError) as broken:
            raise InputError(f"{source}: [calibration] cannot be read: {broken}") from None
        with naming(source):
            return CalibrationKnowledge(names, covariance, current, error)


@runtime_checkable
class CalibratedRobot(Protocol):
    """What a calibration makes of a robot."""

    @property
    def corrected(self) -> Robot:
        """The robot, corrected."""

    @property
    def knowledge(self) -> CalibrationKnowledge:
        """How sure that is."""

    @property
    def alternatives(self) -> Sequence[tuple[Robot, CalibrationKnowledge]]:
        """Robots that the measured runs cannot tell from the corrected one."""


UNMEASURED = CalibrationKnowledge(COEFFICIENTS, np.diag(np.square([0.35, 0.22, 0.48])))
"""Coefficients of another robot: rms differences of ln C between two of the eight robots whose coefficients were
found (docs/results-calibration.md and the paper's two)."""


def read_knowledge(path: RobotSource) -> CalibrationKnowledge:
    """Read the table [calibration] of a robot.toml; nothing is known where there is no such file or table.

    What a command gives with --set is no longer what was fitted, so it loses its row and column of the covariance.

    Raises:
        InputError: the table is not as described above.
    """
    if not Path(path).is_file():
        return CalibrationKnowledge()
    known = CalibrationKnowledge.from_dict(read_toml(Path(path)).get("calibration", {}), path)
    given = {field_of(key): key for key in changes_of(path)}
    kept = [k for k, name in enumerate(known.names) if name not in given]
    if lost := [given[name] for name in known.names if name in given]:
        warnings.warn(
            f"{path}: --set replaces {', '.join(lost)}, which the calibration fitted: taken as exact, its "
            "uncertainty is left out",
            InputWarning,
            stacklevel=1,
        )
    names = tuple(known.names[k] for k in kept)
    return replace(known, names=names, covariance=known.covariance[np.ix_(kept, kept)])


def knowledge_toml(knowledge: CalibrationKnowledge) -> str:
    """Write the table [calibration] that `read_knowledge` reads back."""
    rows = ",\n".join(f"    {[float(f'{value:.12g}') for value in row]}" for row in knowledge.covariance.tolist())
    known = zip(knowledge.names, knowledge.covariance.diagonal().tolist(), strict=True)
    vague = " and ".join(name for name, variance in known if name in COEFFICIENTS and variance > math.log(2) ** 2)
    notes = [f"# The runs do not determine {vague}, but what they have in common with the others."] * bool(vague)
    lines = [
        "[calibration]",
        *notes,
        f"names = {json.dumps(knowledge.names)}",
        f"covariance = [\n{rows},\n]",
    ]
    if any((*knowledge.current, *knowledge.current_error)):
        lines += [
            f"current_m_s = {list(knowledge.current)}",
            f"current_error_m_s = {list(knowledge.current_error)}",
        ]
    return "\n".join(lines) + "\n"


def _pair(values: Any) -> tuple[float, float]:
    x, y = values
    return float(x), float(y)
