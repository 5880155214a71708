"""A vehicle of any kind, whose dwells are alike: it tells the noise of a swim without a model of the robot.

A swim has hundreds of dwells, and those of equal length in one direction are repeats of each other. So whatever
the robot is, its motion in a dwell is a smooth function of the time since the flip, and of the dwell before. To
the vehicle of the robot as given are added, for each direction, forward, to the left and in heading,

    twist       a rate,
    lag         a constant, reached as tails turn over: 1 − exp(−t/0.3),
    memory      the same times exp(−S/0.4), after a dwell of length S, in time units.

What is left is noise (`calibration.swim.pose_noise`): a missing effect is alike in all dwells, so it does not hide
in it. What differs with time or place is taken for random steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from calibration.statistics.fit import fit
from calibration.statistics.forward import central
from calibration.statistics.statistical_model import Parameter, Parameters, Predict, start_values
from calibration.swim.course import Swimming
from calibration.swim.pose_noise import Sizes, estimate_noise
from calibration.swim.sight import Sight
from calibration.swim.swim_runs import SwimRuns
from common.arrays import Flags, Floats
from planner.vehicle.vehicle import BEFORE_KNOTS, TIMES, Vehicle

_TURNING, _REMEMBERED = 0.3, 0.4  # time units
_LAGS = ("lag", "memory")
_SIGMA = 0.3  # l, rad, and these over time units: a vehicle is off by
_ROUGH = Sizes(np.array([0.01, 0.02]), np.array([1e-4, 1e-4]), np.array([0.02, 0.05]), 10.0)  # l, rad, s
_PASSES = 3


@dataclass(frozen=True)
class FreeVehicle:
    """Predicts the poses of swims by a vehicle with free numbers."""

    sight: Sight
    robot: Swimming  # as given

    @property
    def runs(self) -> SwimRuns:
        return self.sight.runs

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        return self.sight.coefficients

    @cached_property
    def nuisances(self) -> tuple[Parameter, ...]:
        names = [f"{kind} {side} {axis}" for kind, side, axis in product(("twist", *_LAGS), (0, 1), range(3))]
        own = (Parameter(name, name, 0.0, (-10.0, 10.0), 0.05, sigma=_SIGMA) for name in names)
        return (*own, *self.sight.nuisances)

    @property
    def effects(self) -> tuple[Parameter, ...]:
        return ()

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predict (P, n, 3), see `ForwardModel`."""
        return self.sight.predict((one, self.robot._replace(vehicle=self._changed(one))) for one in sets)

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return the linear model, by differences."""
        return central(self, at, along, title=title)

    def _changed(self, by: Parameters) -> Vehicle:
        """Change the vehicle by its numbers."""
        twist, lag, memory = (
            np.array([[by[f"{kind} {side} {axis}"] for axis in range(3)] for side in (0, 1)])
            for kind in ("twist", *_LAGS)
        )
        turned = (1 - np.exp(-TIMES / _TURNING))[:, None]
        kept = np.exp(-BEFORE_KNOTS / _REMEMBERED)[:, None, None]
        changed = turned * (lag[:, None, None] + kept * memory[:, None, None])
        given = self.robot.vehicle
        rest = given.rest + turned * lag[:, None]
        return replace(given, twist=given.twist + twist, lag=given.lag + changed, rest=rest)


def with_noise(sight: Sight, robot: Swimming, used: Flags) -> tuple[SwimRuns, dict[str, float]]:
    """Estimate the noise of swims.

    The first fit compares changes of the pose rather than poses, so it finds its way from far.

    Args:
        sight: with runs that are not white.
        robot: as given.
        used: (n,) poses.

    Returns:
        The runs, white; and where each part starts, current, marker and clock.
    """
    plain = sight.runs
    runs = plain.in_noise(_ROUGH, plain.poses)
    model = FreeVehicle(sight, robot)
    at: dict[str, float] = start_values(model)
    names = tuple(at)
    for _ in range(_PASSES):
        model = replace(model, sight=replace(sight, runs=runs))
        fitted = fit(model, at, names, used, title="")
        at, raw = fitted.parameters, runs.raw
        noise, residual = runs.noise_of_poses, raw(runs.y - fitted.prediction)
        assert noise is not None
        estimated = estimate_noise(noise.of(used), residual[used], raw(fitted.jacobian)[used])
        runs = plain.in_noise(estimated.sizes, raw(fitted.prediction))
    own = {p.name for p in (*sight.coefficients, *sight.nuisances)}
    return runs, {name: value for name, value in at.items() if name in own}
