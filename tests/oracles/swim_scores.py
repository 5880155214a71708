"""How much of an effect the track of a swim shows.

The size λ of an effect is in standard deviations of its score in the first two thirds of a swim, under the true
covariance of the camera's noise and of the kicks, beside all that is fitted anyway. It is that of the linear model
about the truth: in replays the phase of the disc at each flip changes with everything, and with three tails a
robot whose coefficients are 7 % off can be 4.7 standard deviations from all that are like it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from calibration.linear.gls import schur_complement
from calibration.statistics.forward import derivatives
from calibration.statistics.statistical_model import precisions, start_values
from calibration.swim.course import Vehicles
from calibration.swim.measured_swim import read_swims
from calibration.swim.pose_noise import Sizes
from calibration.swim.sight import Sight
from calibration.swim.swim_model import SwimModel, both_directions
from calibration.swim.swim_runs import runs_of_swims
from calibration.swimmer.influences import SLIP, influences
from calibration.swimmer.swimmer import SwimmerModel
from sim.model.robot import Robot
from tests.oracles.drawn_swims import LabSwim
from tests.oracles.swims import CameraNoise, make_track


def strengths(swim: LabSwim, names: Sequence[str]) -> dict[str, float]:
    """Compute λ for a unit of each of some effects, on its scale."""
    truth, camera = swim.truth, swim.disturbed["camera"]
    exact = CameraNoise(camera.every, (0.0, 0.0), (0.0, 0.0))
    swims = read_swims(make_track(truth, swim.plan, seed=0, camera=exact), swim.plan)
    runs, held_out = runs_of_swims(swims, truth.tail_length)
    units = np.array([truth.tail_length, 1.0])
    white, slow, kick = (np.array(each) / units for each in (camera.white, camera.slow, swim.disturbed["kick"]))
    runs = runs.in_noise(Sizes(white, slow, kick, camera.memory), runs.poses)
    inner = SwimmerModel(truth, both_directions(truth), 1)
    model = SwimModel(inner, Sight(runs), runs, Vehicles.of(swims, truth.time_scale))
    fitted, effects = (*model.coefficients, *model.nuisances), [influences()[name].parameter for name in names]
    derivative = derivatives(model, start_values(model), [*fitted, *effects])[1]
    table = derivative[~runs.left_out(held_out)].reshape(-1, len(fitted) + len(effects))
    normal = table.T @ table
    normal[range(len(fitted)), range(len(fitted))] += precisions(fitted)
    squares = np.diag(schur_complement(normal, len(fitted)))
    return dict(zip(names, np.sqrt(np.maximum(squares, 0.0)).tolist(), strict=True))


def with_influence(robot: Robot, name: str, value: float) -> Robot:
    """Return a robot with an effect or another influence of one size."""
    influence, part = influences()[name], 1 - value / robot.tails
    if influence.effect is not None:
        return replace(robot, effects={influence.effect: value})
    if name == SLIP:
        return replace(robot, motor_speed=robot.motor_speed * (1 - value))
    numbers: dict[str, Any] = {n: getattr(robot, n) * part**power for n, power in influence.one_tail.items()}
    return replace(robot, **numbers)


def sized(truth: Robot, name: str, size: float) -> Robot | None:
    """Return a robot with an effect of a size on its scale; None if that is not plausible."""
    effect = influences()[name].parameter
    low, high = effect.plausible or effect.bounds
    value = effect.changed(effect.start, size)
    return with_influence(truth, name, value) if low <= value <= high else None
