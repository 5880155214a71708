"""The pull of a nuisance parameter: how far the runs move it from its stated value."""

from __future__ import annotations

import math
from dataclasses import dataclass

from calibration.statistics.statistical_model import Parameter

WRONG = 3.0  # pull beyond which a nuisance parameter is taken to be wrong
_LEARNT = 0.02  # share of the prior's variance that the runs must remove before a pull means anything
_NOTHING = 0.01  # change in per cent, or in the unit in which it is shown, that is not stated
_LARGEST = 100.0  # change of a logarithm that is stated


@dataclass(frozen=True)
class Pull:
    """What the runs say about one nuisance parameter, on its own scale."""

    parameter: Parameter  # the nuisance parameter
    change: float  # fitted, with its prior
    error: float  # standard error of `change`
    alone: float  # from the runs alone, with the other nuisance parameters as far as their priors allow
    alone_error: float  # standard error of `alone`
    z: float  # `change` over its standard deviation under noise
    freed: bool  # its prior was taken away

    @property
    def learnt(self) -> bool:
        """Whether the runs say anything about it."""
        assert self.parameter.sigma is not None
        return self.freed or self.error**2 < (1 - _LEARNT) * self.parameter.sigma**2

    @property
    def wrong(self) -> bool:
        return self.learnt and abs(self.z) > WRONG

    @property
    def tolerances(self) -> float:
        """How many of its stated standard deviations it is off, by the runs alone."""
        assert self.parameter.sigma is not None
        return abs(self.alone) / self.parameter.sigma

    @property
    def words(self) -> str:
        """What the runs alone say, as in "E is 40 % below what was given (3.7 σ)"."""
        return f"{self.parameter.title} is {self.departure} ({abs(self.z):.1f} σ)"

    @property
    def departure(self) -> str:
        """How far it is from its value, by the runs alone, as in "40 % below what was given"."""
        given, change = self.parameter, self.alone
        size = abs(math.expm1(min(change, _LARGEST))) * 100 if given.logarithmic else abs(change) * given.shown
        if size < _NOTHING:
            return "what was given"
        unit, side = "%" if given.logarithmic else given.unit, "below" if change < 0 else "above"
        digits = f"{size:.2g}" if size < 99.5 else f"{size:.0f}"
        return f"{digits} {unit} {side} what was given"
