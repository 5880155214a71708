"""Which nuisance parameter, measured better, would show what: smallest detectable sizes with one tolerance halved.

A nuisance parameter with a prior absorbs effects that resemble its change. With half of its σ it absorbs less, and
an effect is found at a smaller size (`calibration.statistics.residual_tests`, Sherman and Morrison). Everything
else stays: the runs, their noise, the other tolerances, and the score that a claim needs.

The parameters are ranked by the mean of ln(size today / size with half of the tolerance) over the effects that
these runs can show within their range. Left out: several tolerances halved at once, which may lower a size
although none alone does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from calibration.attribution.refits import Candidate
from calibration.statistics.residual_tests import TESTABLE

NOTABLE = 0.05  # share by which half of a tolerance must lower a smallest detectable size to be listed


@dataclass(frozen=True)
class HalvedTolerance:
    """What half of the tolerance of one nuisance parameter would do for an effect."""

    effect: Candidate
    nuisance: str  # name of the nuisance parameter

    @property
    def today(self) -> float:
        """Smallest detectable size with the tolerances as they were stated."""
        return self.effect.detectable

    @property
    def halved(self) -> float:
        """Smallest detectable size with half of this tolerance."""
        return self.effect.detectable_halved[self.nuisance]

    @property
    def gain(self) -> float:
        """Share by which the size falls."""
        return 1 - self.halved / self.today


def shown(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Choose the effects that these runs could show within their range if every nuisance parameter were exact."""
    return [
        c
        for c in candidates
        if c.survived >= TESTABLE
        and c.detectable_exact <= max(abs(end - c.effect.start) for end in c.effect.bounds)
    ]


def overall_gains(candidates: Sequence[Candidate]) -> dict[str, float]:
    """Rank the nuisance parameters by the share by which half of their tolerance lowers detectable sizes.

    Returns:
        The geometric mean over the effects that the runs can show, by the name of the parameter; the largest
        first.
    """
    seen = shown(candidates)
    names = seen[0].detectable_halved if seen else {}
    gains = {
        name: -math.expm1(sum(math.log(c.detectable_halved[name] / c.detectable) for c in seen) / len(seen))
        for name in names
    }
    return dict(sorted(gains.items(), key=lambda item: -item[1]))


def notable_gains(candidates: Sequence[Candidate]) -> list[HalvedTolerance]:
    """Find for each effect the tolerance that is best halved, if that lowers its size notably; the best first."""
    best = [
        max((HalvedTolerance(c, name) for name in c.detectable_halved), key=lambda halved: halved.gain)
        for c in shown(candidates)
        if c.detectable_halved
    ]
    return sorted((halved for halved in best if halved.gain > NOTABLE), key=lambda halved: -halved.gain)
