"""What a table says about a model of one's own, and what comes of it: corrected.json."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from calibration.own_model.declared import Model
from calibration.report.saved_verdict import SavedVerdict
from calibration.statistics.statistical_model import Parameter
from common.provenance import provenance

_NORMAL = 1.959964  # standard deviations to the ends of a 95 % interval


@dataclass(frozen=True, repr=False)
class ModelVerdict(SavedVerdict):
    """What a table says about a model: a `Verdict` with the model, its runs, and what is corrected.

    Example:
        >>> from softflagella import calibrate
        >>> verdict = calibrate("falls.csv", MODEL, session="round")  # doctest: +SKIP
        >>> verdict.corrected  # doctest: +SKIP
        {'viscosity': 0.19, 'wall': 1.04}
    """

    model: Model = field(kw_only=True)  # as it was given

    @property
    def corrected(self) -> dict[str, float]:
        """Numbers, and effects that are kept, fitted to all runs: name -> value."""
        return {p.name: self.final_refit.parameters[p.name] for p, _ in self._declared}

    @cached_property
    def _declared(self) -> list[tuple[Parameter, int]]:
        """What was fitted of the model's own parameters, with its place in the covariance."""
        names = {p.name for p in self.model.parameters}
        return [(p, place) for place, p in enumerate(self.final_refit.fitted) if p.name in names]

    def _corrected_file(self) -> tuple[str, str]:
        places, effects = [place for _, place in self._declared], {e.name for e in self.model.effects}
        values: dict[str, dict[str, Any]] = {"numbers": {}, "effects": {}}
        for parameter, place in self._declared:
            half = _NORMAL * float(np.sqrt(self.final_refit.covariance[place, place]))
            value = self.corrected[parameter.name]
            alone = [float(parameter.changed(value, end)) for end in (-half, half)]
            values["effects" if parameter.name in effects else "numbers"][parameter.name] = {
                "title": parameter.title,
                "unit": parameter.unit,
                "value": value,
                "interval": list(self.final_intervals.get(parameter.name, alone)),
                "given": parameter.start,
                "scale": "logarithm" if parameter.logarithmic else "as it is",
            }
        covariance = self.final_refit.covariance[np.ix_(places, places)].tolist()
        record = {
            **values,
            "covariance": {"names": [*self.corrected], "on_their_scales": covariance},
            "forms": [form.record() for form in self.forms],
            "verdict": self.verdict,
            "table": self.table,
            "provenance": provenance({"table": self.table}),
        }
        return "corrected.json", json.dumps(record, indent=1) + "\n"
