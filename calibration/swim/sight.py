"""The poses of swims as a camera sees them, for any vehicle.

Fitted as well as what the vehicle is, since no swim is without them:

    start       the pose at the start of each part
    current     constant, in the lab
    marker      its place on the robot, ahead and to the left of the head's centre
    camera      its scale, and the angle of the marker to the axis; its rotation is that of the start
    clock       how much later than the clock of the poses that of the motor is
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from calibration.statistics.statistical_model import Parameter, Parameters
from calibration.swim.course import Moments, Swimming, course
from calibration.swim.swim_runs import SwimRuns, first_of_last
from calibration.swimmer.influences import CAMERA, CURRENT, HEADING
from common.arrays import Floats
from sim.mechanics import planar

AHEAD, LEFT, CLOCK = "marker_ahead", "marker_left", "clock_offset"
STARTS = ("start_x", "start_y", "start_heading")
_BESIDE, _FARTHEST = 0.05, 0.5  # of the place of a marker, in tail lengths: σ, and bound
_LATE = {True: 0.1, False: 1.0}  # σ of the clock [s], by whether it is that of the poses
_FASTEST = 0.05  # m/s, of a current
_OWN: dict[str, Any] = {"of_these_runs": True}


@dataclass(frozen=True)
class Sight:
    """How the swims of some runs are seen."""

    runs: SwimRuns

    @cached_property
    def coefficients(self) -> tuple[Parameter, ...]:
        """Currents and starts."""
        ends = -_FASTEST, _FASTEST
        currents = [
            Parameter(name, f"current in the tank along {axis}", 0.0, ends, 1e-4, unit="cm/s", shown=100.0, **_OWN)
            for name, axis in zip(CURRENT, "xy", strict=True)
        ]
        places = enumerate(self.runs.part_names)
        return (*currents, *(start for place, name in places for start in self._starts(place, name)))

    @cached_property
    def nuisances(self) -> tuple[Parameter, ...]:
        """Marker and clock."""
        length, far = self.runs.length, _FARTHEST * self.runs.length
        known = all(swim.clock_known for swim in self.runs.swims)
        metre: dict[str, Any] = {"unit": "cm", "shown": 100.0, "sigma": _BESIDE * length, **_OWN}
        title = "marker {} the head's centre"
        return (
            Parameter(AHEAD, title.format("ahead of"), 0.0, (-far, far), 1e-3, **metre),
            Parameter(LEFT, title.format("left of"), 0.0, (-far, far), 1e-3, **metre),
            Parameter(
                CLOCK, "motor later than the poses", 0.0, (-5.0, 5.0), 0.05, unit="s", sigma=_LATE[known], **_OWN
            ),
        )

    def without(self, parameters: Parameters) -> dict[str, Any]:
        """Return the parameters of the vehicle alone."""
        own = {p.name for p in (*self.coefficients, *self.nuisances)}
        return {name: value for name, value in parameters.items() if name not in own}

    def predict(self, sets: Iterable[tuple[Parameters, Swimming]]) -> Floats:
        """Predict the poses (P, n, 3) of robots, white in the noise of the runs."""
        poses = np.stack([self._seen(*each) for each in sets])
        poses[..., :2] /= self.runs.length
        return np.moveaxis(self.runs.whitened(np.moveaxis(poses, 0, -1)), -1, 0)

    def _starts(self, place: int, name: str) -> list[Parameter]:
        """Make the start of a part, as it was seen."""
        swim, starts = self.runs.swims[place // 2], []
        at = swim.flips[first_of_last(swim) * (place % 2)]
        metre: dict[str, Any] = {"typical": 1e-3, "unit": "cm", "shown": 100.0}
        angle: dict[str, Any] = {"typical": 0.01, "unit": "°", "shown": 180 / math.pi}
        for number, column, of in zip(STARTS, swim.poses.T, (metre, metre, angle), strict=True):
            value, room = float(np.interp(at, swim.time, column)), 5 * (self.runs.length if of is metre else 1.0)
            title, ends = f"{number.replace('_', ' ')}, {name}", (value - room, value + room)
            own: dict[str, Any] = {"of_group": (number, name), **_OWN}
            starts.append(Parameter(f"{number}: {name}", title, value, ends, **own, **of))
        return starts

    def _seen(self, at: Parameters, robot: Swimming) -> Floats:
        """Compute the poses (n, 3) that a camera sees [m, rad]."""
        runs, value = self.runs, {p.name: p.start for p in (*self.coefficients, *self.nuisances)} | dict(at)
        current = np.array([value[name] for name in CURRENT])
        marker = np.array([value[AHEAD], value[LEFT], value.get(HEADING, 0.0)])
        seen = np.empty((len(runs), 3))
        for place, swim in enumerate(runs.swims):
            own, moment = runs.session == place, swim.time - value[CLOCK]
            moments, whole = Moments.of(swim, moment), Moments.whole(swim)
            changes, ends = (of.changes(robot) for of in (moments, whole))
            for each in (changes, ends):
                each[:, :2] *= robot.length
            poses, flips = course(robot.vehicle, changes, ends, moments)
            for part in (2 * place, 2 * place + 1):
                rows, first = runs.part[own] == part, first_of_last(swim) * (part % 2)
                start = np.array([value[f"{number}: {runs.part_names[part]}"] for number in STARTS])
                moved = planar.compose(start, planar.between(flips[first], poses[rows]))
                moved[:, :2] += current * (moment[rows] - swim.flips[first])[:, None]
                poses[rows] = planar.compose(moved, marker)
            seen[own] = poses
        seen[:, :2] *= value.get(CAMERA, 1.0)
        return seen
