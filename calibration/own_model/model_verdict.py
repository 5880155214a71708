"""What a table says about a model of one's own."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from calibration.own_model.declared import Model
from calibration.verdict.verdict import Verdict


@dataclass(frozen=True, repr=False)
class ModelVerdict(Verdict):
    """What a table says about a model: a `Verdict` with the model, its runs, and what is corrected.

    Example:
        >>> from softflagella import calibrate
        >>> verdict = calibrate("falls.csv", MODEL, session="round")  # doctest: +SKIP
        >>> verdict.corrected  # doctest: +SKIP
        {'viscosity': 0.19, 'wall': 1.04}
    """

    model: Model = field(kw_only=True)  # as it was given

    @property
    def corrected(self) -> dict[str, Any]:
        """Numbers, and effects that are kept, fitted to all runs: name -> value, or group -> value of its own."""
        corrected: dict[str, Any] = {}
        for p in self.handed_on:
            value = self.final_refit.parameters[p.name]
            if p.of_group:
                corrected.setdefault(p.of_group[0], {})[p.of_group[1]] = value
            else:
                corrected[p.name] = value
        return corrected
