"""A robot and its swims as a model for the calibration: what was seen of a path tells what the model lacks.

The numbers and effects of the robot are those of `calibration.swimmer`, the poses those of
`calibration.swim.sight`. The noise is that of `calibration.swim.free_vehicle`, which knows no robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from calibration.statistics.budget import count_predictions
from calibration.statistics.forward import central
from calibration.statistics.statistical_model import Parameter, Parameters, Predict, start_values
from calibration.swim.course import Swimming, Vehicles
from calibration.swim.free_vehicle import with_noise
from calibration.swim.measured_swim import MeasuredSwim
from calibration.swim.pose_noise import Sizes
from calibration.swim.possible_swims import PossibleSwim, PossibleSwims, possible_swims
from calibration.swim.sight import Sight
from calibration.swim.swim_runs import SwimRuns, runs_of_swims
from calibration.swimmer.influences import HEADING, TRACKED_POINT
from calibration.swimmer.measured_table import Measurements
from calibration.swimmer.swimmer import SwimmerModel
from common.arrays import Flags, Floats
from common.errors import InputError
from sim.model.robot import Robot

_AS_GIVEN = 0.5  # σ of the logarithm of a coefficient: a swim of two tails hardly tells its scale
_ROUGH = np.array([0.003, 0.01])  # l, rad: a step, with which a fit finds its way from far
_ASKEW = math.radians(3.0)  # σ of the angle of a marker


@dataclass(frozen=True)
class SwimModel:
    """Predicts the poses of swims for a robot with given parameters."""

    robot: SwimmerModel  # at constant motor, in both directions
    sight: Sight
    runs: SwimRuns  # those of the sight
    vehicles: Vehicles = field(default_factory=Vehicles)
    around: bool = False  # whether robots are close to the first that is asked for, see `Vehicles.swimming`
    began: Mapping[str, float] = field(default_factory=dict)  # where fits begin

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        own = (replace(p, sigma=_AS_GIVEN) for p in self.robot.coefficients)
        return (*own, *self.sight.coefficients)

    @property
    def nuisances(self) -> tuple[Parameter, ...]:
        askew = (replace(p, of_these_runs=p.name == HEADING) for p in self.robot.nuisances)
        return (*askew, *self.sight.nuisances)

    @property
    def effects(self) -> tuple[Parameter, ...]:
        return tuple(effect for effect in self.robot.effects if effect.name != TRACKED_POINT)

    @property
    def untestable(self) -> Mapping[str, str]:
        fitted = {p.title for p in self.sight.coefficients}
        return {title: why for title, why in self.robot.untestable.items() if title not in fitted}

    @property
    def rough(self) -> SwimModel | None:
        """The same model with large steps, by which changes of the pose are compared rather than poses.

        The path then is no more than the sum of what each dwell does, and a fit does not crawl along bent valleys.
        """
        runs, noise = self.runs, self.runs.noise_of_poses
        if noise is None or (noise.sizes.step >= _ROUGH).all():
            return None
        runs = runs.in_noise(noise.sizes._replace(step=np.maximum(noise.sizes.step, _ROUGH)), runs.raw(runs.y))
        return replace(self, sight=replace(self.sight, runs=runs), runs=runs)

    def check(self, prediction: Floats) -> None:
        """Accept poses in any units that they name: a start is fitted."""

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """Return where a vehicle that is fitted to the poses begins."""
        return {**start, **self.began}

    def possible(self) -> tuple[PossibleSwims, list[dict[str, Any]]]:
        """Return swims that can be made next (`calibration.swim.possible_swims`), seen as these were."""
        models, settings = [], []
        for each in possible_swims(self.robot.robot, self.runs.swims):
            with suppress(InputError):  # where a robot cannot be simulated
                models.append(self._next(each))
                settings.append(each.settings)
        return PossibleSwims(tuple(models)), settings

    def _next(self, of: PossibleSwim) -> SwimModel:
        """Make the model of a swim, in the noise of these."""
        noise = self.runs.noise_of_poses
        assert noise is not None
        runs, _ = runs_of_swims([of.swim], of.robot.tail_length)
        inner = SwimmerModel(of.robot, both_directions(of.robot), self.robot.jobs)
        vehicles = Vehicles.of([of.swim], of.robot.time_scale)
        if len(vehicles.before) <= len(self.vehicles.before):
            vehicles = self.vehicles
        model = replace(self, robot=inner, sight=Sight(runs), runs=runs, vehicles=vehicles, began={})
        start = start_values(model)
        units = np.array([self.runs.length / of.robot.tail_length, 1.0])
        sizes = noise.sizes._replace(**{name: units * getattr(noise.sizes, name) for name in Sizes._fields[:3]})
        runs = runs.in_noise(sizes, model.predict([start])[0])
        return replace(model, sight=Sight(runs), runs=runs)

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predict (P, n, 3), see `ForwardModel`."""
        return self.sight.predict(zip(sets, self.swimming(sets), strict=True))

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return the linear model, by differences; NaN along effects with which a robot cannot be simulated.

        If `quick`, it is NaN altogether then.
        """
        near = replace(self, around=True)
        try:
            return central(near, at, along, title=title)
        except InputError:
            if quick:
                return lambda sets: np.full((len(sets), *self.runs.y.shape), np.nan)
        effects = {effect.name for effect in self.effects}
        lacking = [p for p in along if p.name in effects and not near._can_change(at, p)]
        known = central(near, at, [p for p in along if p not in lacking], title=title)

        def predict(sets: Sequence[Parameters]) -> Floats:
            changed = [any(one[p.name] != at[p.name] for p in lacking) for one in sets]
            return np.where(np.reshape(changed, (-1, 1, 1)), np.nan, known(sets))

        return predict

    def _can_change(self, at: Parameters, p: Parameter) -> bool:
        """Tell whether robots on both sides of one along a parameter can be simulated."""
        try:
            central(self, at, [p])
        except InputError:
            return False
        return True

    def swimming(self, sets: Sequence[Parameters]) -> list[Swimming]:
        """Make the robots of P parameter sets."""
        inputs, columns, same = self.robot.simulated([self.sight.without(one) for one in sets])
        count_predictions(len(columns["N"]))
        length, time = (np.broadcast_to(x, same.shape)[:, 0] for x in (inputs.view.length, inputs.view.time))
        return self.vehicles.swimming(columns, same, time, length, close=self.around)


def swim_model(robot: Robot, swims: Sequence[MeasuredSwim], *, jobs: int | None = None) -> tuple[SwimModel, Flags]:
    """Make the model of a robot's swims, with the noise of the poses.

    Returns:
        The model, and the poses (n,) that are held out.
    """
    runs, held_out = runs_of_swims(swims, robot.tail_length)
    used = ~runs.left_out(held_out)
    vehicles = Vehicles.of(swims, robot.time_scale)
    model = SwimModel(SwimmerModel(robot, both_directions(robot), jobs), Sight(runs), runs, vehicles)
    start = start_values(model)
    (given,) = model.swimming([start])
    runs, seen = with_noise(model.sight, given, used)
    began = {**start, **seen}
    return replace(model, sight=replace(model.sight, runs=runs), runs=runs, began=began), held_out


def both_directions(robot: Robot) -> Measurements:
    """Make two runs of a robot, one in each direction of its motor."""
    zeros = np.zeros(2)
    return Measurements(
        outputs=("v", "theta"), y=np.zeros((2, 2)), condition=np.arange(2), session=np.zeros(2, dtype=int),
        session_names=("swim",), inputs=np.empty((2, 0)), input_names=(), rows=np.arange(1, 3), excluded=(),
        caveats=(), tails=zeros + robot.tails, length=zeros + robot.tail_length,
        omega=robot.motor_speed * np.array([1.0, -1.0]), noted=np.empty((2, 0)), sigmas={HEADING: _ASKEW},
        noted_names=(),
    )  # fmt: skip
