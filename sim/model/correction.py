"""A correction of the load on the head, learnt from runs that no effect explains, and the range of such runs.

    C_t → C_t exp(g_1),   C_r → C_r exp(g_2),   C_yr → C_yr exp(g_3),   ε_k → ε_k + g_k

with ε_k the sizes of two effects, the yaw couple and the anisotropy of the head's drag. Together they can move all
four steady velocities of the robot. It describes what is missing, and does not explain it. Each g is smooth in the
dimensionless inputs x = (N, ln l/R, ln ω̄ (R/l)⁴):

    g = b tanh(Σ_t w_t φ_t/b),   φ_t = Π_i ((x_i − c_i)/s_i)^p_ti,   p_ti = 0, 1, 2 or 3,

where b is the largest size that is allowed. So it changes drag, and the simulator does the rest: the steady
motion, and the response to a flip, which was not measured, with the same drag. Left and right turns stay mirror
images.

A correction and a law (`sim.model.laws`) describe the runs that they were learnt from, and say nothing of
others. So a robot outside the runs, by more than a small margin, is refused. In a robot.toml the range of a law is

    [learnt_from]
    low = [2.0, 1.9, -6.1]     # N, ln l/R, ln ω̄ (R/l)⁴
    high = [5.0, 3.2, -4.7]
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sim.arrays import Floats
from sim.io.errors import InputError

INPUTS = ("N", "ln l/R", "ln ω̄ (R/l)⁴")
_MARGIN = (0.5, 0.1, 0.1)  # of the inputs, beyond the runs
MOST = {"C_t": 1.5, "C_r": 1.5, "C_yr": 1.5, "surface_couple": 2.0, "anisotropic_head_drag": 0.6}  # b
_LARGEST = 1e9  # of any number: powers of larger ones overflow
KNOBS = tuple(MOST)  # what a correction may change
_FACTORS = ("C_t", "C_r", "C_yr")  # what it multiplies; it adds to the others


@dataclass(frozen=True)
class LearntRange:
    """Smallest and largest inputs of the runs, in the order of INPUTS."""

    low: tuple[float, ...]  # three numbers
    high: tuple[float, ...]  # three numbers

    def __post_init__(self) -> None:
        """Refuse numbers that are no range."""
        if {len(self.low), len(self.high)} != {len(INPUTS)}:
            raise InputError(f"the range of the runs needs three numbers each: {', '.join(INPUTS)}")
        if not (np.abs([*self.low, *self.high]) < _LARGEST).all():
            raise InputError(f"the range of the runs: its numbers must be finite, below {_LARGEST:g}")
        if any(low > high for low, high in zip(self.low, self.high, strict=True)):
            raise InputError("the range of the runs: low must not be above high")

    def check(self, values: Mapping[str, float], what: str) -> None:
        """Refuse a robot outside the runs.

        Args:
            values: groups of the robot, by column name.
            what: was learnt, in words, with the table of the robot's file that has it.

        Raises:
            InputError: the robot is outside.
        """
        inputs = inputs_of(values)
        for name, value, low, high, margin in zip(INPUTS, inputs, self.low, self.high, _MARGIN, strict=True):
            if not low - margin <= value <= high + margin:
                raise InputError(
                    f"{name} = {value:.3g} is outside the runs that the robot's {what} was learnt from "
                    f"({low:.3g} to {high:.3g}): make runs there, or leave the {what} out of its file"
                )


def inputs_of(values: Mapping[str, float]) -> tuple[float, float, float]:
    """Compute INPUTS of a robot from its groups."""
    slender = math.log(values["l_over_R"])
    return float(values["N"]), slender, math.log(abs(values["omega_bar"])) - 4 * slender


def learnt_range(robots: Iterable[Mapping[str, float]]) -> LearntRange:
    """Compute the range of robots from their groups, each by column name."""
    inputs = np.array([inputs_of(values) for values in robots])
    return LearntRange(tuple(inputs.min(0).round(6).tolist()), tuple(inputs.max(0).round(6).tolist()))


def read_learnt_range(table: Any) -> LearntRange:
    """Read the table [learnt_from] of a robot.toml.

    Raises:
        InputError: the table is no range.
    """
    try:
        if set(table) != {"low", "high"}:
            raise ValueError("it needs the lines low and high, and no others")
        low, high = (tuple(float(value) for value in table[name]) for name in ("low", "high"))
        return LearntRange(low, high)
    except (TypeError, ValueError, OverflowError) as broken:
        raise InputError(f"[learnt_from] cannot be read: {broken}") from None


@dataclass(frozen=True)
class Correction:
    """Weights w of the terms φ for every knob, and the range of the inputs; tuples, in the order of INPUTS."""

    centre: tuple[float, ...]  # of the inputs, subtracted first
    scale: tuple[float, ...]  # of the inputs, divided by then
    low: tuple[float, ...]  # smallest inputs of the runs
    high: tuple[float, ...]  # largest inputs
    powers: tuple[tuple[int, ...], ...]  # of each term, three numbers
    weights: Mapping[str, tuple[float, ...]]  # knob -> a number for each term
    error: float  # relative rms on runs that it was not learnt from
    error_without: float  # relative error of the runs without it

    def __post_init__(self) -> None:
        """Refuse numbers that are no correction."""
        sizes = {len(part) for part in (self.centre, self.scale, self.low, self.high, *self.powers)}
        if sizes != {len(INPUTS)} or any(len(w) != len(self.powers) for w in self.weights.values()):
            raise InputError("correction: three numbers for each range and term, and a weight for every term")
        if unknown := [name for name in self.weights if name not in KNOBS]:
            raise InputError(f"correction: unknown weights {unknown[0]!r}; allowed are {', '.join(KNOBS)}")
        weights = [w for row in self.weights.values() for w in row]
        numbers = [*self.centre, *self.scale, *self.low, *self.high, *weights, self.error, self.error_without]
        if not (np.abs(numbers) < _LARGEST).all() or min(self.scale) < 1 / _LARGEST:
            raise InputError(
                f"correction: its numbers must be finite, below {_LARGEST:g}, its scales above {1 / _LARGEST:g}"
            )
        if any(power not in (0, 1, 2, 3) for term in self.powers for power in term):
            raise InputError("correction: powers are 0, 1, 2 or 3")

    def applied(self, values: Mapping[str, float]) -> dict[str, float]:
        """Correct the groups and effects of a robot, by column name.

        Raises:
            InputError: the robot is outside the runs that the correction was learnt from.
        """
        LearntRange(self.low, self.high).check(values, "correction")
        terms = self.terms(np.array([inputs_of(values)]))[0]
        corrected = dict(values)
        for name, weights in self.weights.items():
            g = MOST[name] * math.tanh(float(terms @ np.array(weights)) / MOST[name])
            corrected[name] = corrected[name] * math.exp(g) if name in _FACTORS else corrected.get(name, 0.0) + g
        return corrected

    def terms(self, inputs: Floats) -> Floats:
        """Compute φ of inputs (m, 3), (m, t)."""
        return monomials((inputs - np.array(self.centre)) / np.array(self.scale), self.powers)


def monomials(x: Floats, powers: tuple[tuple[int, ...], ...]) -> Floats:
    """Compute products of powers of the columns of x (m, 3), (m, t)."""
    return np.stack([(x ** np.array(term)).prod(1) for term in powers], 1)


def correction_tables(correction: Correction) -> dict[str, Any]:
    """Write the table [correction] of a robot.toml, as plain content."""
    content = asdict(correction)
    return content | content.pop("weights")


def read_correction(table: Any) -> Correction:
    """Read the correction from its table in a robot.toml.

    Raises:
        InputError: the table is no correction.
    """
    try:
        content = dict(table)
        centre, scale, low, high = (
            tuple(map(float, content.pop(name))) for name in ("centre", "scale", "low", "high")
        )
        powers = tuple(tuple(map(int, term)) for term in content.pop("powers"))
        error, without = (float(content.pop(name)) for name in ("error", "error_without"))
        weights = {str(name): tuple(map(float, row)) for name, row in content.items()}
    except KeyError as missing:
        raise InputError(f"[correction] has no entry {missing}; copy it from the calibration") from None
    except (TypeError, ValueError, OverflowError) as broken:
        raise InputError(f"[correction] cannot be read: {broken}") from None
    return Correction(centre, scale, low, high, powers, weights, error, without)
