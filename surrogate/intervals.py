"""Split-conformal prediction intervals for each output of the table, wider where the table is less certain.

    answer ± q s(x),   s(x) = exp(c · features(x)),   q: quantile of |error|/s over robots that training did not
    see

s is fitted to the logarithm of errors by least squares. Its features are the inputs of the tails and their
squares, the robot's distance from the middle of the training data, the spread of the ensemble, and N. q makes the
intervals cover 90 % however well s fits. Each group of robots has a q of its own. Groups differ in the number of
tails, in whether the tails' spin exerts a couple in yaw, in the third of the motor speeds, and in whether a robot
is nearer to the middle of the training data than half of the others. A group of few robots takes the q of a wider
one. s and q are fitted to different robots. Sources: Lei et al., J. Am. Stat. Assoc. 113, 1094 (2018), section
5.2; Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World (2005), section 4.5, for the groups.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from common.arrays import Floats, Integers
from sim.jit import compiled_fast
from surrogate.domain import MOST_TAILS
from surrogate.held_out import ITSELF, ONE, OUTPUTS, SCALES, SPEED, SURGE
from surrogate.tails import COUPLE, PLACES, ROBOT_NUMBERS

COVERAGE = 0.90
_TINY = 1e-9  # of the scale of an output
_RIDGE = 1e-3
NOVELTY = 7  # among the features
THIRDS = 2 * MOST_TAILS * 3  # couple or not × number of tails × third of the motor speeds
GROUPS = 2 * THIRDS  # the nearer half of each, and the other
_PER_NUMBER = 2 * 3  # groups of a number of tails
_WIDER = (1, 2, _PER_NUMBER)  # so many groups together, where each has few robots
_FEWEST = 60  # robots of a group, for a q of its own
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
    speeds: Floats  # (2,): the thirds of |ω̄| meet here
    middle: Floats  # (THIRDS,): the halves of the novelty meet here
    factor: Mapping[str, Floats]  # output -> q of each group, (GROUPS,), or of all robots, (1,)

    def ends(self, features: Floats, robots: Floats, outputs: Floats) -> dict[str, Floats]:
        """Return `<name>_low` and `<name>_high`, (M,) each, of the outputs that have intervals.

        Args:
            features, robots: see `half_widths`.
            outputs: OUTPUTS, (12, M).
        """
        low, high, _ = self._ask(*self._of_outputs, features, robots, outputs)
        lows, highs = self._names
        return {**dict(zip(lows, low, strict=True)), **dict(zip(highs, high, strict=True))}

    def half_widths(self, names: Sequence[str], features: Floats, robots: Floats | None = None) -> Floats:
        """Return half-widths of the intervals of some outputs, (O, M), over what errors are relative to.

        Args:
            names: of the outputs.
            features: (M, F), see `surrogate.table`.
            robots: (M, ROBOT_NUMBERS), see `surrogate.tails.pack_robots`; not needed where all robots have one q.
        """
        none = np.zeros(len(self.factor), dtype=np.int64)
        _, half, _ = self._ask(none + ONE, none, features, robots, np.zeros((1, len(features))))
        return half[[list(self.factor).index(name) for name in names]]

    def groups(self, features: Floats, robots: Floats) -> Integers:
        """Return which group each robot belongs to, (M,)."""
        none = np.zeros(len(self.factor), dtype=np.int64)
        return self._ask(none, none, features, robots, np.zeros((1, len(features))))[2]

    def _ask(
        self, kinds: Integers, places: Integers, features: Floats, robots: Floats | None, outputs: Floats
    ) -> tuple[Floats, Floats, Integers]:
        """Return ends (O, M) and groups (M,), see `intervals_of`."""
        own = np.zeros((len(features), ROBOT_NUMBERS)) if robots is None else robots
        of_robots = map(np.ascontiguousarray, (features, own, outputs))  # one type of array, compiled once
        arguments: Any = (*self._stacked, kinds, places, *of_robots)
        return intervals_of(*arguments)

    @cached_property
    def _stacked(self) -> Any:
        """The numbers of the outputs that have a q, for the compiled loops."""
        count, size = len(self.factor), len(self.shift)
        weights = np.array([self.weights[name] for name in self.factor]).reshape(
            count, 1 + size + size * (size + 1) // 2
        )
        bounds = np.array([self.bounds[name] for name in self.factor]).reshape(count, 2).T.copy()
        factors = np.array([np.resize(part, GROUPS) for part in self.factor.values()]).reshape(count, GROUPS)
        return self.shift, self.scale, weights, bounds, self.speeds, self.middle, factors

    @cached_property
    def _of_outputs(self) -> tuple[Integers, Integers]:
        """What errors are relative to, and places among OUTPUTS, (O,) each."""
        kinds, places = [SCALES[name] for name in self.factor], [OUTPUTS.index(name) for name in self.factor]
        return np.array(kinds), np.array(places)

    @cached_property
    def _names(self) -> tuple[list[str], list[str]]:
        return [f"{name}_low" for name in self.factor], [f"{name}_high" for name in self.factor]

    @staticmethod
    def learned(features: Floats, errors: Mapping[str, Floats]) -> Intervals:
        """Learn s from relative errors by output, (M,), of robots; `calibrated` learns q from others."""
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
        return Intervals(shift, scale, weights, bounds, np.zeros(2), np.zeros(THIRDS), {})

    def calibrated(
        self, features: Floats, errors: Mapping[str, Floats], robots: Floats | None = None
    ) -> Intervals:
        """Return the intervals with q for these robots.

        Args:
            features: (M, F) of robots that s was not learned from.
            errors: relative errors by output, (M,); NaN where unknown.
            robots: (M, ROBOT_NUMBERS), see `half_widths`; None for one q of all.
        """
        found = replace(self, factor=dict.fromkeys(errors, np.ones(1)))
        cells = [np.zeros((1, len(features)), dtype=bool)]
        if robots is not None:
            found = replace(found, speeds=np.quantile(robots[:, PLACES.speed], [1 / 3, 2 / 3]))
            group, novelty = found.groups(features, robots), features[:, NOVELTY]
            thirds = [novelty[group // 2 == k] for k in range(THIRDS)]
            middle = np.array([np.median(third if len(third) else novelty) for third in thirds])
            found = replace(found, middle=middle)
            group = found.groups(features, robots)
            number, every = group // _PER_NUMBER % MOST_TAILS, np.arange(GROUPS)[:, None]
            cells = [every // wider == group // wider for wider in _WIDER]
            cells.append(every // _PER_NUMBER % MOST_TAILS == number)
        sizes, factor = found.half_widths(list(errors), features), {}
        for (name, error), size in zip(errors.items(), sizes, strict=True):
            known, scores = np.isfinite(error), np.abs(error) / size
            pools = [[own & known for own in cell] for cell in zip(*cells, strict=True)]
            chosen = [next((pool for pool in cell if pool.sum() >= _FEWEST), known) for cell in pools]
            factor[name] = np.array([_conformal_quantile(scores[pool]) for pool in chosen])
        return replace(found, factor=factor)


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
    count, index = len(x), 1 + len(x)
    design[0] = 1.0
    for i in range(count):
        x[i] = min(max((features[i] - shift[i]) / scale[i], -_CLIPPED), _CLIPPED)
        design[1 + i] = x[i]
    for i in range(count):
        for j in range(i, count):
            design[index] = x[i] * x[j]
            index += 1


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
    shift: Floats, scale: Floats, weights: Floats, bounds: Floats, speeds: Floats, middle: Floats, factors: Floats,
    kinds: Integers, places: Integers, features: Floats, robots: Floats, outputs: Floats,
) -> tuple[Floats, Floats, Integers]:  # fmt: skip
    """Return the ends of intervals, (O, M) each, and the group of each robot, (M,).

    Args:
        shift, scale, weights, bounds, speeds, middle, factors: as in `Intervals`, stacked over O outputs.
        kinds: what errors are relative to, (O,).
        places: of these among the outputs, (O,).
        features: (M, F).
        robots: (M, ROBOT_NUMBERS).
        outputs: their intervals have no width where they are not finite.
    """
    count, size = features.shape
    low, high = np.empty((len(places), count)), np.empty((len(places), count))
    groups, design, x = np.empty(count, dtype=np.int64), np.empty(weights.shape[1]), np.empty(size)
    for row in range(count):
        own, speed = features[row], robots[row, PLACES.speed]
        number = min(max(int(robots[row, PLACES.number]), 1), MOST_TAILS)
        number += MOST_TAILS * int(robots[row, COUPLE] != 0)
        third = 3 * (number - 1) + int(speed > speeds[0]) + int(speed > speeds[1])
        group = 2 * third + int(own[NOVELTY] > middle[third])
        groups[row] = group
        _put_design(own, shift, scale, x, design)
        for o in range(len(places)):
            value, total = outputs[places[o], row], 0.0
            for p in range(len(design)):
                total += weights[o, p] * design[p]
            half = factors[o, group]
            half *= np.exp(min(max(total, bounds[0, o]), bounds[1, o]))
            if kinds[o] == ITSELF:
                half *= abs(value)
            elif kinds[o] == SPEED:
                half *= np.hypot(outputs[_V_X, row], outputs[_V_Z, row])
            elif kinds[o] != ONE:
                half *= abs(outputs[_V_Z if kinds[o] == SURGE else _YAW_RATE, row])
            half = half if abs(value) < np.inf else 0.0
            low[o, row], high[o, row] = value - half, value + half
    return low, high, groups
