"""Where a robot is at any time of its plan, and how far from there it may be (`planner.jobs.error_in_place`).

The body is a line along the axis, from head to the ends of straight tails, with a width on all sides; it covers
the discs of `planner.paths.obstacles.Footprint`. Robots have different units, so all is in metres and seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.jobs.error_in_place import error_open_loop, error_with_feedback
from planner.paths.obstacles import Footprint
from planner.paths.units import Swimmer
from planner.planning.plan import Plan
from sim.arrays import Floats
from sim.mechanics import planar


@dataclass(frozen=True)
class Body:
    """A line along the robot's axis, with a width. Lengths in m."""

    front: float  # end of the line, forward from the head's centre
    back: float  # other end, negative
    radius: float  # of the body around the line

    @staticmethod
    def of(robot: Swimmer) -> Body:
        """Cover head and straight tails."""
        discs, length = Footprint.of(robot, 0.0), robot.tail_length
        return Body(float(discs.places.max()) * length, float(discs.places.min()) * length, discs.radius * length)

    @property
    def reach(self) -> float:
        """Largest distance of a point of the body from the head's centre."""
        return max(self.front, -self.back) + self.radius

    def ends(self, poses: Floats) -> Floats:
        """Compute the ends (..., 2, 2) of the line at poses (..., 3) of the head's centre."""
        axis = np.stack([np.cos(poses[..., 2]), np.sin(poses[..., 2])], -1)
        return np.asarray(poses[..., None, :2] + np.array([[self.front], [self.back]]) * axis[..., None, :])


@dataclass(frozen=True)
class TimedMotion:
    """A plan in time, from the start of its motor."""

    plan: Plan  # in l and μ0 l⁴/EI
    feedback: bool  # the pose is measured for a tracker

    @property
    def duration(self) -> float:
        """Time until the motor stops [s]."""
        return self.plan.duration * self.plan.robot.time_scale

    @cached_property
    def body(self) -> Body:
        """What must keep apart from other bodies."""
        return Body.of(self.plan.robot)

    def poses(self, times: Floats) -> Floats:
        """Predict the poses (K, 3) of the head's centre [m, rad] at times (K,) [s]; it rests before and after."""
        plan = self.plan
        vehicle, switches, robot = plan.tracked.vehicle, plan.switches, plan.robot
        ends = np.concatenate([[0.0], np.cumsum(plan.dwells)])
        own = np.clip(times / robot.time_scale, 0.0, ends[-1])
        dwell = np.clip(np.searchsorted(ends, own, side="right") - 1, 0, len(plan.dwells) - 1)
        elapsed, before = own - ends[dwell], plan.dwells[dwell - 1]
        changes = np.empty((len(own), 3))
        for parity, sense in enumerate((switches.first_direction, -switches.first_direction)):
            rows = dwell % 2 == parity
            changes[rows] = vehicle.motion(sense, before[rows], elapsed[rows])
        first = dwell == 0
        changes[first] = vehicle.motion(switches.first_direction, None, elapsed[first])
        poses = planar.compose(switches.poses[dwell], changes)
        poses[:, :2] += vehicle.current * elapsed[:, None]
        return np.asarray(poses * [robot.tail_length, robot.tail_length, 1.0])

    def error(self, times: Floats) -> Floats:
        """Return the error in place (K,) [m] at times (K,) [s]; a robot that has not begun is where it was put."""
        known, error = self._band
        return np.where(times <= 0, 0.0, np.interp(times, known, error))

    @cached_property
    def _band(self) -> tuple[Floats, Floats]:
        """Times [s] and errors in place [m]."""
        robot = self.plan.robot
        times, error = (error_with_feedback if self.feedback else error_open_loop)(self.plan)
        return times * robot.time_scale, error * robot.tail_length
