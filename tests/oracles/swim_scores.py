"""How much of an effect the track of a swim shows.

The size λ of an effect is the root of the deviance that it leaves in the first two thirds of a swim without
noise, under the true covariance of the camera's noise and of the kicks, when all that is fitted anyway is fitted.
The swim is that of vehicles: in replays the phase of the disc at each flip changes with everything, and with three
tails a robot whose coefficients are 7 % off can be 4.7 standard deviations from all that are like it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from calibration.statistics.fit import beyond_its_ends, fit
from calibration.statistics.statistical_model import start_values
from calibration.swim.course import Vehicles
from calibration.swim.measured_swim import MeasuredSwim, read_swims
from calibration.swim.pose_noise import Sizes
from calibration.swim.sight import Sight
from calibration.swim.swim_model import SwimModel, both_directions
from calibration.swim.swim_runs import runs_of_swims
from calibration.swimmer.influences import SLIP, influences
from calibration.swimmer.swimmer import SwimmerModel
from common.arrays import Flags
from sim.model.robot import Robot
from tests.oracles.drawn_swims import LabSwim
from tests.oracles.swims import CameraNoise, make_track

_TYPICAL, _TRIES, _CLOSE = 0.2, 6, 0.08  # of an effect's typical size; of sizes; of λ


def model_in_noise(robot: Robot, swims: Sequence[MeasuredSwim], sizes: Sizes) -> tuple[SwimModel, Flags]:
    """Make the model of a robot's swims in a noise that is known; return the poses (n,) that are held out, too."""
    runs, held_out = runs_of_swims(swims, robot.tail_length)
    runs = runs.in_noise(sizes, runs.poses)
    inner = SwimmerModel(robot, both_directions(robot), 1)
    return SwimModel(inner, Sight(runs), runs, Vehicles.of(swims, robot.time_scale)), held_out


class SwimScores:
    """The model of a true robot's swim in the true noise."""

    def __init__(self, swim: LabSwim):
        self.truth, camera = swim.truth, swim.disturbed["camera"]
        exact = CameraNoise(camera.every, (0.0, 0.0), (0.0, 0.0))
        swims = read_swims(make_track(self.truth, swim.plan, seed=0, camera=exact), swim.plan)
        units, kick = np.array([self.truth.tail_length, 1.0]), swim.disturbed["kick"]
        white, slow, step = (np.array(each) / units for each in (camera.white, camera.slow, kick))
        self.model, held_out = model_in_noise(self.truth, swims, Sizes(white, slow, step, camera.memory))
        self.used = ~self.model.runs.left_out(held_out)

    def strength(self, name: str, value: float, *, lowest: bool = True) -> float:
        """Compute λ of an effect of some value; of the `lowest` minimum, or of the first that a search finds."""
        start, model = start_values(self.model), self.model
        names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
        runs = replace(model.runs, y=model.predict([{**start, name: value}])[0])
        without = replace(model, runs=runs, sight=replace(model.sight, runs=runs))
        fitted = fit(without, start, names, self.used, title="")
        if lowest:
            fitted = beyond_its_ends(fitted, self.used)
        return math.sqrt(max(fitted.deviance, 0.0))

    def sized(self, name: str, side: int, strength: float) -> Robot | None:
        """Return the robot with an effect at λ = `strength` on one side of its null, if that is plausible.

        Raises:
            InputError: it cannot be simulated.
        """
        effect = influences()[name].parameter
        low, high = effect.plausible or effect.bounds
        size = side * _TYPICAL * abs(effect.typical)
        for _ in range(_TRIES):
            if not low <= effect.start + size <= high:
                return None
            level = self.strength(name, effect.start + size, lowest=False)
            if abs(level / strength - 1) < _CLOSE:
                level = self.strength(name, effect.start + size)
            if abs(level / strength - 1) < _CLOSE:
                return with_influence(self.truth, name, effect.start + size)
            size *= min(strength / max(level, 1e-3), 10.0)
        return None


def with_influence(robot: Robot, name: str, value: float) -> Robot:
    """Return a robot with an effect or another influence of one size."""
    influence, part = influences()[name], 1 - value / robot.tails
    if influence.effect is not None:
        return replace(robot, effects={influence.effect: value})
    if name == SLIP:
        return replace(robot, motor_speed=robot.motor_speed * (1 - value))
    numbers: dict[str, Any] = {n: getattr(robot, n) * part**power for n, power in influence.one_tail.items()}
    return replace(robot, **numbers)
