"""The vehicle of a robot with the point of its axis that is to follow a path. Lengths in l, times in μ0 l⁴/EI."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from common.errors import InputError
from planner.paths.obstacles import Footprint
from planner.paths.tractrix import Drift
from planner.paths.units import time_in_lab
from planner.vehicle.from_table import TwistsAndLags, coefficient_modes, default_table, table_vehicle
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.vehicle import Mode, Vehicle
from planner.vehicle.zigzag import Zigzag
from sim.knowledge import COEFFICIENTS, UNMEASURED, CalibrationKnowledge
from sim.model.robot import Robot
from surrogate.interface import LookupTable

Point = Literal["head_centre", "head_tip", "pivot"]


class TrackedVehicle(NamedTuple):
    """A robot, its vehicle, and the tracked point: the point of its axis that follows the path."""

    robot: Robot | MeasuredVehicle  # in SI units
    vehicle: Vehicle  # its motion as the look-up table tells it
    point: Point  # the point that follows the path
    offset: float  # from the head's centre forward to the tracked point
    model: str  # hash of the look-up table
    own_table: bool = True  # whether the table is of this robot alone
    knowledge: CalibrationKnowledge = CalibrationKnowledge()  # what a calibration found besides the robot
    unmeasured: tuple[Mode, ...] = ()  # of a robot whose coefficients are those of another; calibrated: none
    alternatives: tuple[TrackedVehicle, ...] = ()  # that a calibration could not tell from it

    @property
    def rod(self) -> float:
        """Distance from the pivot to the tracked point."""
        return self.vehicle.pivot_distance + self.offset

    @property
    def body(self) -> Footprint:
        """The body about the pivot."""
        return Footprint.of(self.robot, -self.vehicle.pivot_distance)

    def drift(self, straight: Zigzag) -> Drift:
        """Return what carries the robot off its heading in straight motion, as shares of its net speed.

        Raises:
            InputError: with such dwells the robot does not get ahead.
        """
        vehicle = self.vehicle
        if straight.speed <= 0:
            dwell = min(straight.dwells)
            turn = dwell * float(np.abs(vehicle.twist[:, 2]).max())
            remedy = "shorter ones: it turns too far" if turn > 1.0 else "longer ones: it is still accelerating"
            raise InputError(
                f"with dwells of {time_in_lab(dwell, self.robot)} the robot does not get ahead; allow {remedy} in "
                "each dwell"
            )
        sideways = straight.drift / straight.speed
        x, y = (vehicle.current / straight.speed).tolist()
        # A mirror-symmetric robot has no drift: what is left is rounding.
        return Drift(0.0 if abs(sideways) < 1e-9 else sideways, (x, y))

    @property
    def origin(self) -> str:
        """Name the point whose poses count."""
        return "the vehicle's point" if isinstance(self.robot, MeasuredVehicle) else "the head's centre"

    @property
    def calibrated(self) -> bool:
        """Whether the errors are measured: of the coefficients of the head, or of the vehicle itself."""
        return isinstance(self.robot, MeasuredVehicle) or set(COEFFICIENTS) <= set(self.knowledge.names)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about what the model leaves out for this robot."""
        vehicle = self.vehicle
        if vehicle.tail_gap >= vehicle.least_gap:
            return ()
        without = "the model has no contact" if vehicle.least_gap == 1.0 else "contact does not hold them apart"
        return (f"tails touch (predicted gap {vehicle.tail_gap:.2f} diameters): {without}",)


def tracked_vehicle(
    robot: Robot | MeasuredVehicle,
    lookup: LookupTable | None,
    point: Point,
    knowledge: CalibrationKnowledge | None,
) -> TrackedVehicle:
    """Ask a table for the vehicle of a robot, and add the tracked point. Without a table, ask the shipped one.

    A measured vehicle needs no table.

    Raises:
        InputError: the point is unknown, or the robot is outside the table's domain.
    """
    if isinstance(robot, MeasuredVehicle):
        vehicle = robot.motion()
        return TrackedVehicle(robot, vehicle, point, _offset(point, robot, vehicle), robot.MODEL)
    lookup = default_table() if lookup is None else lookup
    vehicle = table_vehicle(robot, lookup, knowledge)
    own = all(low == high for low, high in lookup.domain.values())
    known = knowledge or CalibrationKnowledge()
    offset = _offset(point, robot, vehicle)
    tracked = TrackedVehicle(robot, vehicle, point, offset, lookup.identity, own, known)
    if tracked.calibrated:
        return tracked
    try:
        modes = coefficient_modes(robot, lookup, TwistsAndLags(vehicle.twist, vehicle.lag), UNMEASURED)
    except InputError:  # the table of one robot that does not say what a coefficient changes
        return tracked
    return tracked._replace(unmeasured=tuple(modes))


def _offset(point: Point, robot: Robot | MeasuredVehicle, vehicle: Vehicle) -> float:
    """Compute the distance from the head's centre forward to the tracked point [l]."""
    if point == "head_centre":
        return 0.0
    if point == "head_tip":
        return robot.outline[0]
    if point == "pivot":
        return -vehicle.pivot_distance
    raise InputError(f"point {point!r}; allowed are head_centre, head_tip, pivot")
