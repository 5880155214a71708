"""A study: a model, its divided runs, and the settings of every test, all fixed before the runs are looked at."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calibration.statistics.forward_model import ForwardModel, Runs, start_values
from calibration.statistics.splits import Split
from sim.arrays import Flags
from sim.io.provenance import fingerprint

LEVEL = 0.04  # α of every claim; below 0.05, because the noise is estimated and false claims must stay below 5 %
DRAWS = 1000  # of the bootstrap


@dataclass(frozen=True)
class Study:
    """What every step of a calibration needs to know, beside the fit that it starts from."""

    model: ForwardModel
    split: Split  # of its runs into fitted and held-out ones
    level: float = LEVEL  # α of every claim
    seed: int = 0  # of the bootstrap
    draws: int = DRAWS  # of the bootstrap
    progress: bool = False  # show progress bars

    @classmethod
    def fitted_to(cls, model: ForwardModel, used: Flags, **settings: Any) -> Study:
        """Study a model on the runs in `used` (n,); all others are held out."""
        return cls(model, Split(~used, np.zeros_like(used)), **settings)

    @property
    def runs(self) -> Runs:
        return self.model.runs

    @property
    def used(self) -> Flags:
        """(n,) runs that are fitted."""
        return self.split.fitted

    @property
    def start(self) -> dict[str, float]:
        """The model as given."""
        return start_values(self.model)

    def title(self, words: str) -> str:
        """Return the title of a progress bar, or none if no progress is shown."""
        return words if self.progress else ""

    def reseeded(self, by: int) -> Study:
        """Return the same study with other random numbers."""
        return replace(self, seed=self.seed + by)

    @property
    def fixed(self) -> str:
        """Hash of everything that was fixed beforehand."""
        catalogue = [effect.name for effect in self.model.effects]
        return fingerprint(
            {"level": self.level, "seed": self.seed, "catalogue": catalogue, "locked": self.split.names}
        )
