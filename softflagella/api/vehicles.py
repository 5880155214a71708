"""What every planning function does first: find the robot's look-up table and what a calibration found."""

from __future__ import annotations

from planner.files.own_table import table_for
from planner.vehicle.calibration_table import CalibrationKnowledge, read_knowledge
from planner.vehicle.tracked_point import Point, TrackedVehicle, tracked_vehicle
from sim.model.robot import Robot
from sim.robot_rows import OneRobot, one_robot
from surrogate.interface import LookupTable


def robot_with_table(
    robot: OneRobot, lookup: LookupTable | None, knowledge: CalibrationKnowledge | None, *, own_table: bool
) -> tuple[Robot, LookupTable, CalibrationKnowledge]:
    """Return a robot with the look-up table that knows it, and what a calibration found besides."""
    swims = one_robot(robot)
    source = None if isinstance(robot, Robot) else str(robot)
    known = knowledge or (CalibrationKnowledge() if source is None else read_knowledge(source))
    return swims, lookup or table_for(swims, source, known, own=own_table), known


def vehicle_of(
    robot: OneRobot,
    lookup: LookupTable | None,
    knowledge: CalibrationKnowledge | None,
    point: Point,
    *,
    own_table: bool,
) -> TrackedVehicle:
    """Return a robot's vehicle with its tracked point."""
    swims, table, known = robot_with_table(robot, lookup, knowledge, own_table=own_table)
    return tracked_vehicle(swims, table, point, known)
