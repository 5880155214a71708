"""Motions close to ones that were simulated, to first order in the columns of the simulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from common.arrays import Floats, Integers
from sim.motion.sensitivity import Sensitivities


@dataclass(frozen=True)
class Tangent:
    """Motions of n runs, linear about those of `found`."""

    columns: Mapping[str, Floats]  # (1, n), at which they were simulated
    found: Sensitivities  # of n robots

    @classmethod
    def of_runs(cls, columns: Mapping[str, Floats], found: Sensitivities, place: Integers) -> Tangent:
        """Make it from the motions of robots, and each run's place among these."""
        values, slopes = ({k: table[place] for k, table in of.items()} for of in (found.values, found.derivatives))
        return cls(columns, replace(found, values=values, derivatives=slopes))

    @property
    def is_known(self) -> bool:
        """Whether every motion and derivative was found."""
        return all(np.isfinite(t).all() for t in (*self.found.values.values(), *self.found.derivatives.values()))

    def motions(self, columns: Mapping[str, Floats]) -> dict[str, Floats]:
        """Compute the motions (P, n) of columns (P, n)."""
        motions = {name: values + 0 * columns["N"] for name, values in self.found.values.items()}
        for j, parameter in enumerate(self.found.parameters):
            change = columns[parameter] - self.columns[parameter]
            moved = change.any(1)  # a slope that is not known does not reach the others
            for name, slopes in self.found.derivatives.items():
                motions[name][moved] += slopes[:, j] * change[moved]
        return motions
