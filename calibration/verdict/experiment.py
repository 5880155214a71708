"""Two ways to describe what no effect of the catalogue explains: a law, and a correction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from calibration.statistics.fit import Fit
from calibration.statistics.statistical_model import Experiment
from calibration.statistics.study import Study
from sim.arrays import Floats


class LearntCorrection(Protocol):
    """A correction that predicts runs that no effect explains."""

    @property
    def prediction(self) -> Floats:
        """(n, k), learnt without the held-out runs."""
        ...

    @property
    def terms(self) -> tuple[str, ...]:
        """What it depends on, in words."""
        ...


@dataclass(frozen=True)
class Rival:
    """A fitted model that explains or describes the runs as well as others do."""

    title: str  # in words
    fit: Fit
    model: Experiment  # that was fitted
    law: Mapping[str, Any] = field(default_factory=dict)  # what makes this model of one without the law


class Describe(Protocol):
    """Looks for laws that describe a residual."""

    def __call__(self, study: Study, base: Fit, *, beside_claim: bool) -> Description | None:
        """Describe what a fit without effects leaves; `beside_claim`: an effect is claimed for it."""
        ...


class Description(Protocol):
    """Laws that describe runs which no effect explains, or only one that something else could imitate."""

    @property
    def complete(self) -> bool:
        """Whether the best law leaves no more than noise."""
        ...

    @property
    def prediction(self) -> Floats:
        """(n, k) of the best law, fitted without the held-out runs; without a law, of the calibrated model."""
        ...

    @property
    def rivals(self) -> tuple[Rival, ...]:
        """Laws that the runs cannot tell apart, best first; none if there are not two."""
        ...

    def as_good_as(self, claim: Fit) -> tuple[Rival, ...]:
        """Laws that leave no more than noise and fit as well as a claimed effect, best first."""
        ...

    def to_dict(self, claim: Fit | None = None) -> dict[str, Any]:
        """Return the record for verdict.json; beside a claimed effect it has the laws that fit as well."""
        ...
