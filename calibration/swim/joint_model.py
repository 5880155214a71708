"""Swims beside a table of steady runs of the same robot, as one model: what both say of it is fitted at once.

The parameters are the union of both by name: the robot's numbers, the coefficients, the effects, the motor's
tachometer and the camera's scale are shared. Starts, current, marker and clock are those of the swims; where the
table has a number of that name, such as the zero of its headings, it has another one. A current, a temperature or
another note of the table acts on its runs alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from calibration.statistics.statistical_model import ForwardModel, Parameter, Parameters, Predict, start_values
from calibration.swim.joint_runs import JointRuns, joint_runs
from calibration.swim.swim_model import SwimModel
from calibration.swimmer.influences import HEADING
from calibration.swimmer.swimmer import SwimmerModel
from calibration.table.unit_slips import refuse_unit_slips
from common.arrays import Flags, Floats
from common.errors import InputError

_OF_SWIMS = "{} of the swims"


@dataclass(frozen=True)
class JointModel:
    """Predicts the poses of swims and the runs of a table for a robot with given parameters."""

    swim: SwimModel
    table: SwimmerModel
    runs: JointRuns

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        return self._both(lambda model: model.coefficients)

    @property
    def nuisances(self) -> tuple[Parameter, ...]:
        return self._both(lambda model: model.nuisances)

    @property
    def effects(self) -> tuple[Parameter, ...]:
        return self._both(lambda model: model.effects)

    @property
    def untestable(self) -> Mapping[str, str]:
        tested = {p.title for p in (*self.coefficients, *self.effects)}
        every = {**self.swim.untestable, **self.table.untestable}
        return {title: why for title, why in every.items() if title not in tested}

    @property
    def rough(self) -> JointModel | None:
        """The same model with a rough one of the swims, if there is one."""
        rough = self.swim.rough
        return None if rough is None else replace(self, swim=rough, runs=self.runs.with_swims(rough.runs))

    @cached_property
    def _of_swims(self) -> dict[str, str]:
        """Names that numbers of the swims have beside others of the table, by those within the model of swims."""
        sight = self.swim.sight
        own = {HEADING, *(p.name for p in (*sight.coefficients, *sight.nuisances))}
        return {name: _OF_SWIMS.format(name) for name in start_values(self.table) if name in own}

    @cached_property
    def _names(self) -> tuple[dict[str, str], dict[str, str]]:
        """Names of the parameters here -> within the model of swims, and within that of the table."""
        swum = {self._of_swims.get(name, name): name for name in start_values(self.swim)}
        return swum, {name: name for name in start_values(self.table)}

    def _both(self, of: Callable[[ForwardModel], Iterable[Parameter]]) -> tuple[Parameter, ...]:
        """Unite parameters; of two with one name that of the table, which may state its tolerance."""
        theirs = {p.name: p for p in of(self.table)}
        own = [self._renamed(p) for p in of(self.swim)]
        return (*(theirs.pop(p.name, p) for p in own), *theirs.values())

    def _renamed(self, p: Parameter) -> Parameter:
        title = _OF_SWIMS.format(p.title)
        return replace(p, name=self._of_swims[p.name], title=title) if p.name in self._of_swims else p

    def check(self, prediction: Floats) -> None:
        """Refuse a table whose units cannot be those that its columns name."""
        given = prediction[len(self.runs.swum) :, len(self.runs.swum.outputs) :]
        self.table.check(given)
        refuse_unit_slips(self.table.runs, given)

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """Start with coefficients that fit the table, and where a vehicle that is fitted to the poses begins."""
        of_table = self.table.guess(self._within(1, start), used[len(self.runs.swum) :])
        began = {self._of_swims.get(name, name): value for name, value in self.swim.began.items()}
        return {**start, **began, **of_table}

    def possible(self) -> tuple[ForwardModel, list[dict[str, Any]]]:
        """Refuse: next runs are proposed after a swim or a table alone."""
        raise InputError("next runs are proposed for a swim or a table alone")

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predict (P, n, k), see `ForwardModel`."""
        return self._joined([model.predict for model in (self.swim, self.table)], sets, title=title)

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return the linear model, see `ForwardModel`."""
        models: list[tuple[ForwardModel, dict[str, str]]]
        models, parts = [(self.swim, self._names[0]), (self.table, self._names[1])], []
        for place, (model, names) in enumerate(models):
            own = [replace(p, name=names[p.name]) for p in along if p.name in names]
            parts.append(model.linearised(self._within(place, at), own, title=title, quick=quick))
        return lambda sets: self._joined(parts, sets)

    def _within(self, place: int, parameters: Parameters) -> dict[str, Any]:
        """Return the parameters within the model of swims (0) or of the table (1).

        Runs of the table may differ; poses do not.
        """
        rows, names = (0 if place == 0 else slice(len(self.runs.swum), None)), self._names[place]
        return {
            names[name]: value if np.ndim(value) == 0 else value[rows]
            for name, value in parameters.items()
            if name in names
        }

    def _joined(self, parts: Sequence[Callable[..., Floats]], sets: Sequence[Parameters], **words: str) -> Floats:
        """Predict (P, n, k) with a function for each kind."""
        seen = [part([self._within(i, one) for one in sets], **words) for i, part in enumerate(parts)]
        return np.stack([block_diag(*pair) for pair in zip(*seen, strict=True)])


def joint_model(swim: SwimModel, last: Flags, table: SwimmerModel, held_out: Flags) -> tuple[JointModel, Flags]:
    """Put a table beside swims.

    Args:
        last: the poses that are held out.
        held_out: the runs that are held out.

    Returns:
        The model, and the rows that are held out.

    Raises:
        InputError: the noise of the table is unknown, or it has several robots.
    """
    data = table.runs
    if not data.repeated(~held_out):
        raise InputError("too few repeats tell the noise of its runs, which a table beside a swim needs")
    if data.specimen is not None and len(robots := np.unique(data.specimen)) > 1:
        raise InputError(f"it has {len(robots)} robots (column robot); give the runs of the one that swam")
    runs, rows = joint_runs(swim.runs, last, data, held_out, swim.robot.runs)
    return JointModel(swim, replace(table, both=True), runs), rows
