"""A model with numbers for what differs between repeats: an offset of one output in some of the runs.

With x the number and c_i what the note says of run i (1 for operator B, 0 for operator A),

    f_i = f_i(model) + x c_i

for that output, on the scale of y: x is the logarithm of a factor, or a difference. It has no prior, since nothing
is known of it, and no next run has it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from calibration.statistics.forward import stacked
from calibration.statistics.statistical_model import Experiment, Parameter, Parameters, Predict, Wrapped, with_runs
from calibration.statistics.study import middle_session
from calibration.table.between_repeats import Difference, find_differences
from calibration.table.between_traces import differences_of_traces
from common.arrays import Flags, Floats

_LARGEST = 5.0  # of y
_TYPICAL = 0.1


@dataclass(frozen=True)
class Offsets(Wrapped):
    """A model with offsets."""

    of: Mapping[str, tuple[str, Floats]]  # number -> output, and what the note says of each run (n,)

    @cached_property
    def coefficients(self) -> tuple[Parameter, ...]:
        ends = -_LARGEST, _LARGEST
        own = (Parameter(name, f"offset of {name}", 0.0, ends, _TYPICAL, of_these_runs=True) for name in self.of)
        return (*self.inner.coefficients, *own)

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predict (P, n, k), see `ForwardModel`."""
        return self.inner.predict([self._within(p) for p in sets], title=title) + self._offsets(sets)

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return the linear model, see `ForwardModel`."""
        inner = [p for p in along if p.name not in self.of]
        predict = self.inner.linearised(self._within(at), inner, title=title, quick=quick)
        return lambda sets: predict([self._within(p) for p in sets]) + self._offsets(sets)

    def _within(self, parameters: Parameters) -> dict[str, Any]:
        return {name: value for name, value in parameters.items() if name not in self.of}

    def _offsets(self, sets: Sequence[Parameters]) -> Floats:
        """Compute what is added to a prediction, (P, n, k)."""
        runs = self.runs
        added = np.zeros((len(sets), *runs.y.shape))
        for name, (output, column) in self.of.items():
            added[..., runs.outputs.index(output)] += stacked(sets, name) * column
        return runs.completed(added)

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """Find a better start as the model within does."""
        return {**start, **self.inner.guess(self._within(start), used)}

    def possible(self) -> tuple[Offsets, list[dict[str, Any]]]:
        """Return runs that can be made next, without offsets."""
        model, settings = self.inner.possible()
        none = np.zeros(len(model.runs))
        return Offsets(model, {name: (k, none) for name, (k, _) in self.of.items()}), settings  # type: ignore[arg-type]


def with_differences(
    model: Experiment, held_out: Flags | None, *, level: float, **settings: Any
) -> tuple[Experiment, tuple[Difference, ...]]:
    """Find what differs between the repeats of a model's runs, and give the model a number for each.

    Args:
        held_out: (n,); default `middle_session`. What shows in these runs alone has no number.
        level: of a claim.
        settings: of `find_differences`.
    """
    if model.runs.trace is not None:
        return model, differences_of_traces(model.runs, level=level)
    found = find_differences(model.runs, level=level, **settings)
    used = ~(middle_session(model.runs) if held_out is None else held_out)
    numbers = {name: (d.output, c) for d in found for name, c in d.numbers.items() if np.ptp(c[used]) > 0}
    if not numbers:
        return model, found
    differing = np.column_stack([column for _, column in numbers.values()])
    return Offsets(with_runs(model, differing=differing), numbers), found
