"""Directions in which effects move the prediction, at several values of their second numbers.

An effect with a second number (a time, say) has no such number at its null: the prediction does not depend on it
there. So it cannot be estimated without the effect, and a score must be taken at each of several values. The test
takes the largest, and its bootstrap takes the largest, too. Source: Davies (1987), a nuisance parameter that is
present only under the alternative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.statistics.forward_model import ForwardModel, Parameter, Parameters
from sim.arrays import Floats, Integers


@dataclass(frozen=True)
class Directions:
    """∂f/∂ε of e effects in m columns; an effect with a second number has several."""

    table: Floats  # (n, k, m)
    owner: Integers  # (m,) place of each column's effect, 0 to e − 1, in order
    second: Floats  # (m,) value of the second number; NaN where there is none

    @classmethod
    def plain(cls, table: Floats) -> Directions:
        """One column for each effect."""
        count = table.shape[-1]
        return cls(table, np.arange(count), np.full(count, np.nan))

    def without(self, place: int) -> Directions:
        """Without one effect."""
        kept = self.owner != place
        owner = self.owner[kept]
        return Directions(self.table[..., kept], owner - (owner > place), self.second[kept])


def directions(
    model: ForwardModel, parameters: Parameters, effects: Sequence[Parameter], *, title: str = ""
) -> Directions:
    """Compute the directions of effects that are at their null in `parameters`, (n, k, m)."""
    at_null = model.derivatives(parameters, [e.name for e in effects], title=title)[1]
    columns, owner, second = [], [], []
    for place, effect in enumerate(effects):
        values: dict[float, Floats] = {}
        if effect.second is None:
            values[np.nan] = at_null[..., place]
        else:
            name = effect.second.name
            for value in effect.second.grid:
                if value == parameters[name]:
                    values[value] = at_null[..., place]
                else:
                    values[value] = model.derivatives({**parameters, name: value}, [effect.name])[1][..., 0]
        columns += list(values.values())
        owner += [place] * len(values)
        second += list(values)
    table = np.stack(columns, -1) if columns else at_null
    return Directions(table, np.array(owner, dtype=np.int64), np.array(second, dtype=float))
