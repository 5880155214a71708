"""Split-conformal prediction intervals for each output of the table, wider where the table is less certain.

    answer ± q s(x),   s(x) = exp(c · features(x)),   q: quantile of |error|/s over robots that training did not
    see

s is fitted to the logarithm of errors by least squares. Its features are the inputs of the tails and their
squares, the robot's distance from the middle of the training data, the spread of the ensemble, and N. q makes the
intervals cover 90 % however well s fits. There is one q for robots with one tail, and one for each octant of the
others: low or high drag number, deflection and forward motion. Robots on which the tails' spin exerts a couple in
yaw have a q of their own in each part. So the intervals cover 90 % in each of these parts, with and without
couples. s makes them cover about 90 % in smaller parts as well. s and q are fitted to different robots. Sources:
Lei et al., J. Am. Stat. Assoc. 113, 1094 (2018), section 5.2; Vovk, Gammerman and Shafer, Algorithmic Learning in
a Random World (2005), section 4.5, for the parts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from sim.arrays import Flags, Floats, Integers
from sim.jit import compiled_fast
from surrogate.errors import ITSELF, ONE, OUTPUTS, SCALES, SPEED, SURGE

COVERAGE = 0.90
_TINY = 1e-9  # of the scale of an output
_RIDGE = 1e-3
HALVED = (0, 3, 5)  # features whose halves make the octants: drag number, deflection, forward motion
_ONE_TAIL = -1  # the width feature that is 1 for one tail
PARTS = 2 ** len(HALVED) + 1
GROUPS = 2  # robots without and with a couple
_FEWEST = 40  # robots in a part or group, for a q of its own
_CLIPPED = 5.0  # standard deviations of a feature
_YAW_RATE, _V_X, _V_Z = 2, 3, 4  # among the outputs
_FIRMEST, _SOFTEST = 0.002, 0.998  # s is held between these quantiles of itself


@dataclass(frozen=True)
class Intervals:
    """Half-widths of the outputs, as learned."""

    shift: Floats  # (F,)
    scale: Floats  # (F,)
    weights: Mapping[str, Floats]  # output -> (P,)
    bounds: Mapping[str, tuple[float, float]]  # output -> smallest and largest ln s
    middle: Floats  # (3,), the halves meet here
    factor: Mapping[str, Floats]  # output -> q of each part, (PARTS,) for all robots or (GROUPS PARTS,)

    def ends(self, features: Floats, couples: Flags, outputs: Floats) -> dict[str, Floats]:
        """Return `<name>_low` and `<name>_high`, (M,) each, of the outputs that have intervals.

        Args:
            features, couples: see `half_widths`.
            outputs: OUTPUTS, (12, M).
        """
        low, high, _ = self._ask(*self._of_outputs, features, couples, outputs)
        lows, highs = self._names
        return {**dict(zip(lows, low, strict=True)), **dict(zip(highs, high, strict=True))}

    def half_widths(self, names: Sequence[str], features: Floats, couples: Flags | bool = False) -> Floats:
        """Return half-widths of the intervals of some outputs, (O, M), over what errors are relative to.

        Args:
            names: of the outputs.
            features: (M, F), see `surrogate.table`.
            couples: (M,), which robots have a couple in yaw from the spin of their tails.
        """
        none = np.zeros(len(self.factor), dtype=np.int64)
        _, half, _ = self._ask(none + ONE, none, features, couples, np.zeros((1, len(features))))
        return half[[list(self.factor).index(name) for name in names]]

    def part(self, features: Floats) -> Integers:
        """Return which part each robot belongs to, (M,): 0 to 7 for octants, 8 for one tail."""
        none = np.zeros(len(self.factor), dtype=np.int64)
        return self._ask(none, none, features, False, np.zeros((1, len(features))))[2]

    def _ask(
        self, kinds: Integers, places: Integers, features: Floats, couples: Flags | bool, outputs: Floats
    ) -> tuple[Floats, Floats, Integers]:
        """Return ends (O, M) and parts (M,), see `intervals_of`."""
        own = np.ascontiguousarray(features), np.zeros(len(features), dtype=bool) | couples
        arguments: Any = (*self._stacked, kinds, places, *own, outputs)
        return intervals_of(*arguments)

    @cached_property
    def _stacked(self) -> Any:
        """The numbers of the outputs that have a q, for the compiled loops."""
        count, size = len(self.factor), len(self.shift)
        weights = np.array([self.weights[name] for name in self.factor]).reshape(
            count, 1 + size + size * (size + 1) // 2
        )
        bounds = np.array([self.bounds[name] for name in self.factor]).reshape(count, 2).T.copy()
        factors = np.array([np.resize(part, GROUPS * PARTS) for part in self.factor.values()])
        return self.shift, self.scale, weights, bounds, self.middle, factors.reshape(count, GROUPS * PARTS)

    @cached_property
    def _of_outputs(self) -> tuple[Integers, Integers]:
        """What errors are relative to, and places among OUTPUTS, (O,) each."""
        kinds, places = [SCALES[name] for name in self.factor], [OUTPUTS.index(name) for name in self.factor]
        return np.array(kinds), np.array(places)

    @cached_property
    def _names(self) -> tuple[list[str], list[str]]:
        return [f"{name}_low" for name in self.factor], [f"{name}_high" for name in self.factor]

    @staticmethod
    def learned(
        features: Floats,
        errors: Mapping[str, Floats],
        more_features: Floats,
        more_errors: Mapping[str, Floats],
        more_couples: Flags | bool = False,
    ) -> Intervals:
        """Learn from relative errors by output, (M,), of robots for s and of more robots, (M',), for q."""
        features = np.ascontiguousarray(features)
        shift, scale = features.mean(0), np.maximum(features.std(0, ddof=1), 1e-6)
        design: Floats = designs_of(features, shift, scale)
        weights, bounds = {}, {}
        for name, error in errors.items():
            known = np.isfinite(error)
            if not known.any():  # nothing to learn from: the interval is infinite
                weights[name] = np.zeros(design.shape[1])
                bounds[name] = (0.0, 0.0)
                continue
            logs, rows = np.log(np.abs(error[known]) + _TINY), design[known]
            matrix = rows.T @ rows + _RIDGE * len(rows) * np.eye(rows.shape[1])
            weights[name] = np.asarray(np.linalg.solve(matrix, rows.T @ logs), dtype=float)
            low, high = np.quantile(rows @ weights[name], [_FIRMEST, _SOFTEST])
            bounds[name] = (float(low), float(high))
        several = features[features[:, _ONE_TAIL] < 0.5]
        middle = np.quantile((several if len(several) else features)[:, list(HALVED)], 0.5, axis=0, method="lower")
        plain = Intervals(shift, scale, weights, bounds, middle, {})
        return plain.calibrated(more_features, more_errors, more_couples)

    def calibrated(
        self, features: Floats, errors: Mapping[str, Floats], couples: Flags | bool = False
    ) -> Intervals:
        """Return the intervals with q for these robots.

        Args:
            features: (M, F) of robots that s was not learned from.
            errors: relative errors by output, (M,); NaN where unknown.
            couples: (M,), see `half_widths`; with too few robots of either group both have the same q.
        """
        part, factor = self.part(features), {}
        couples = np.broadcast_to(couples, part.shape)
        groups = [~couples, couples]
        if min(map(np.count_nonzero, groups)) < _FEWEST:
            groups = [~couples | couples]
        local = replace(self, factor=dict.fromkeys(errors, np.ones(PARTS))).half_widths(list(errors), features)
        for (name, error), size in zip(errors.items(), local, strict=True):
            known, scores = np.isfinite(error), np.abs(error) / size
            cells = [[group & (part == k) & known, group & known, known] for group in groups for k in range(PARTS)]
            pools = [next((c for c in cell if c.sum() >= _FEWEST), known) for cell in cells]
            factor[name] = np.array([_conformal_quantile(scores[pool]) for pool in pools])
        return replace(self, factor=factor)


def _conformal_quantile(scores: Floats) -> float:
    """Return the smallest score that covers a new row with a probability of at least COVERAGE."""
    count = len(scores)
    if not count:
        return math.inf
    rank = min(math.ceil((count + 1) * COVERAGE), count)
    return float(np.sort(scores)[rank - 1])


@compiled_fast
def _put_design(features: Floats, shift: Floats, scale: Floats, x: Floats, design: Floats) -> None:
    """Write 1, x and all products of two, (P,), for features as x (F,), held to five standard deviations."""
    count, place = len(x), 1 + len(x)
    design[0] = 1.0
    for i in range(count):
        x[i] = min(max((features[i] - shift[i]) / scale[i], -_CLIPPED), _CLIPPED)
        design[1 + i] = x[i]
    for i in range(count):
        for j in range(i, count):
            design[place] = x[i] * x[j]
            place += 1


@compiled_fast
def designs_of(features: Floats, shift: Floats, scale: Floats) -> Floats:
    """Return the terms of the logarithm of a local width, (M, P), for features (M, F)."""
    count, size = features.shape
    designs, x = np.empty((count, 1 + size + size * (size + 1) // 2)), np.empty(size)
    for row in range(count):
        _put_design(features[row], shift, scale, x, designs[row])
    return designs


@compiled_fast
def intervals_of(
    shift: Floats, scale: Floats, weights: Floats, bounds: Floats, middle: Floats, factors: Floats,
    kinds: Integers, places: Integers, features: Floats, couples: Flags, outputs: Floats,
) -> tuple[Floats, Floats, Integers]:  # fmt: skip
    """Return the ends of intervals, (O, M) each, and the part of each robot, (M,).

    Args:
        shift, scale, weights, bounds, middle, factors: as in `surrogate.intervals`, stacked over O outputs.
        kinds: what errors are relative to, (O,).
        places: of these among the outputs, (O,).
        features: (M, F).
        couples: (M,).
        outputs: their intervals have no width where they are not finite.
    """
    count, size = features.shape
    low, high = np.empty((len(places), count)), np.empty((len(places), count))
    parts, design, x = np.empty(count, dtype=np.int64), np.empty(weights.shape[1]), np.empty(size)
    for row in range(count):
        own, part = features[row], 0
        for i, feature in enumerate(HALVED):
            part += int(own[feature] > middle[i]) << i
        part = PARTS - 1 if own[size - 1] > 0.5 else part
        parts[row] = part
        _put_design(own, shift, scale, x, design)
        for o in range(len(places)):
            value, total = outputs[places[o], row], 0.0
            for p in range(len(design)):
                total += weights[o, p] * design[p]
            half = factors[o, part + PARTS * int(couples[row])]
            half *= np.exp(min(max(total, bounds[0, o]), bounds[1, o]))
            if kinds[o] == ITSELF:
                half *= abs(value)
            elif kinds[o] == SPEED:
                half *= np.hypot(outputs[_V_X, row], outputs[_V_Z, row])
            elif kinds[o] != ONE:
                half *= abs(outputs[_V_Z if kinds[o] == SURGE else _YAW_RATE, row])
            half = half if abs(value) < np.inf else 0.0
            low[o, row], high[o, row] = value - half, value + half
    return low, high, parts
