"""The error on a path, before and after a calibration: what the corrected robot does on two schedules.

A path is planned for the robot as given and for the corrected robot, each with a look-up table of its own. The
corrected robot is what is known best, so both schedules are carried out by it: its steady motion and its response
to a flip after each dwell are simulated (`surrogate.tabulate`) and composed dwell by dwell, and a fitted current
carries it along. Against a replay of the whole schedule in time steps the tracks differ by at
most a few hundredths of l on paths of 12 l, in a tenth of the time.

The covariance of the calibration, the errors of the table, and the unknown phase of the disc give what 95 % of the
robots that the calibration allows do on the same schedules (`planner.planning.stated_error`). Lengths are in
metres, unless a name says l; l is the tail length of the robot as given.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from calibration.report.path_error import WORDS, CarriedOut, Model, PathError
from common.errors import InputError, naming
from planner.jobs.plan import make_plan
from planner.paths.path import Path2D
from planner.paths.path_files import read_path
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from planner.planning.stated_error import carried_out, deviations_open_loop, rms_in_time, stated_error
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from planner.vehicle.vehicle import Switches
from sim.knowledge import CalibrationKnowledge
from sim.model.robot import Robot
from surrogate.tabulate import tabulate

DEFAULT_PATHS = ("square:3l",)  # of the command
_INTERVAL = (0.025, 0.975)


class WantedPath(NamedTuple):
    """A path, and how it was asked for."""

    words: str  # a file or a shape, as it was asked for
    path: Path2D  # in tail lengths of the robot as given


def wanted_paths(words: Sequence[str], robot: Robot, unit: str | None = None) -> tuple[WantedPath, ...]:
    """Read the paths on which the error is asked for.

    Args:
        words: files or shapes, as for `planner.paths.path_files.read_path`.
        robot: as given.
        unit: of numbers without one.

    Raises:
        InputError: there is no such file or shape, or it has no path or no unit.
    """
    wanted = []
    for each in dict.fromkeys(words):
        with naming(each):
            wanted.append(WantedPath(each, read_path(each).in_tails(robot, unit)))
    return tuple(wanted)


def path_errors(
    wanted: Sequence[WantedPath], given: Robot, corrected: Robot, knowledge: CalibrationKnowledge
) -> tuple[PathError, ...]:
    """State the error on every path with a plan for the robot as given and with one for the corrected robot.

    A robot without a table, or a path that cannot be planned, is named among the refusals.

    Args:
        wanted: the paths.
        given: the robot as it was given.
        corrected: the robot that carries out the schedules.
        knowledge: covariance of the corrected robot, and the current.
    """
    if not wanted:
        return ()
    robots: dict[Model, tuple[Robot, CalibrationKnowledge]] = {
        "as_given": (given, CalibrationKnowledge()),
        "corrected": (corrected, knowledge),
    }
    vehicles: dict[Model, TrackedVehicle] = {}
    refusals = []
    for name, (robot, known) in robots.items():
        try:
            vehicles[name] = tracked_vehicle(robot, tabulate(robot), "head_centre", known)
        except InputError as refusal:
            refusals.append(_refused(name, refusal))
    if "corrected" not in vehicles:
        vehicles = {}
    return tuple(_path_error(each, given.tail_length, vehicles, refusals) for each in wanted)


def _path_error(
    wanted: WantedPath, tail_length: float, vehicles: Mapping[Model, TrackedVehicle], refusals: Sequence[str]
) -> PathError:
    carried: dict[Model, CarriedOut] = {}
    reasons = list(refusals)
    for name, tracked in vehicles.items():
        path = wanted.path.scaled(tail_length / tracked.robot.length_scale)
        try:
            carried[name] = carry_out(make_plan(path, tracked, PlanRequest()), vehicles["corrected"])
        except InputError as refusal:
            reasons.append(_refused(name, refusal))
    polyline = wanted.path.scaled(tail_length).polyline()
    return PathError(wanted.words, polyline, tail_length, carried, tuple(reasons))


def _refused(name: Model, refusal: InputError) -> str:
    return f"not planned with {WORDS[name]}: {refusal}"


def carry_out(plan: Plan, swims: TrackedVehicle) -> CarriedOut:
    """Compute what a robot does on a schedule, and how far from the drawn path that leads.

    Args:
        plan: made for any robot.
        swims: the robot that carries it out, from the same start and with the same seconds.
    """
    metres = swims.robot.length_scale
    schedule = plan.schedule(swims.robot if isinstance(swims.robot, Robot) else None)
    path, switches = plan.drawn.polyline(), Switches(plan.first_direction, plan.dwells, plan.poses[:1])
    rollout, predicted, growth = carried_out(swims, plan.robot, path, switches, plan.drawn.closed)
    missed = rollout.track[-1] - plan.robot.length_scale / metres * path[-1]
    ends = np.hypot(*(missed + deviations_open_loop(growth)[:, -1]).T)
    low, high = np.quantile(ends, _INTERVAL).tolist()
    return CarriedOut(
        schedule=schedule,
        track=metres * rollout.track,
        rms=metres * rms_in_time(predicted.distance, schedule.dwells),
        largest=metres * predicted.largest,
        end=metres * float(np.hypot(*missed)),
        end_interval=(metres * low, metres * high),
        within=metres * stated_error(growth, predicted),
    )
