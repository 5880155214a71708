"""What `calibrate` needs of its subject beside the forward model: units, a start, runs that can be made next."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from calibration.statistics.statistical_model import ForwardModel
from sim.arrays import Flags, Floats


class Experiment(ForwardModel, Protocol):
    """A forward model of runs that were made somewhere, and can be made again."""

    @property
    def untestable(self) -> Mapping[str, str]:
        """Effects that these runs cannot test: title -> what is missing."""
        ...

    def check(self, prediction: Floats) -> None:
        """Reject measurements that are inconsistent with their stated units.

        Args:
            prediction: (n, k) of the model as given.

        Raises:
            InputError: a column is wrong by a factor that is not possible.
        """
        ...

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """Find a better start for the coefficients, from the runs in `used` (n,), if there is a cheap one."""
        ...

    def possible(self) -> tuple[ForwardModel, list[dict[str, Any]]]:
        """Return a model of runs that can be made next, and their settings."""
        ...


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
