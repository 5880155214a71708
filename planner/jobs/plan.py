"""plan(path, robot): from a path to a frozen plan, without simulating.

The look-up table gives the vehicle: both directions, and the memory of the last dwell
(`planner.vehicle.from_table`). The path that the robot can follow and that is nearest to the drawn one is declared
(`planner.planning.declared_path`). Its tractrix is the pivot's reference (`planner.paths.tractrix`).
`planner.planning.solve` follows it. What is not asked for is not loaded.
"""

from __future__ import annotations

from functools import cache
from typing import Unpack

from numpy.typing import ArrayLike

from planner.paths.path import Path2D
from planner.paths.tractrix import Drift
from planner.paths.units import check_size
from planner.planning.declared_path import Declared, declare
from planner.planning.feasible import Feasibility
from planner.planning.planned import Plan
from planner.planning.progress import Progress
from planner.planning.request import PlanRequest, RequestOptions
from planner.planning.solve import Change, Task, solve
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from sim.io.errors import InputError
from sim.model.robot import Robot
from surrogate.interface import LookupTable


def plan(
    path: Path2D | ArrayLike,
    robot: Robot | MeasuredVehicle,
    *,
    lookup: LookupTable | None = None,
    knowledge: CalibrationKnowledge | None = None,
    progress: Progress | None = None,
    **options: Unpack[RequestOptions],
) -> Plan[None]:
    """Plan the motor's switching times for a path.

    Args:
        path: (n, 2) points or a Path2D, lengths in tail lengths l.
        robot: the robot; its motor speed is used in both directions. Or a measured vehicle.
        lookup: trained table, or the table of this one robot; default the shipped one.
        knowledge: what a calibration found besides the robot: covariance, current.
        progress: called now and then with the share of the path that is done.
        options: fields of `PlanRequest`; `softflagella.plan` explains them.

    Raises:
        InputError: the path is bad or too tight, the dwell too short, the tolerance too small, or the robot
            outside the table's domain.

    Example:
        >>> from softflagella import circle, load_robot, plan
        >>> result = plan(circle(2.0), load_robot("paper-control"))
        >>> len(result.dwells) > 100, result.predicted_rms < 0.03
        (True, True)
    """
    request = PlanRequest(**options)
    tracked = tracked_vehicle(robot, lookup, request.point, knowledge)
    return make_plan(path if isinstance(path, Path2D) else Path2D.of(path), tracked, request, progress)


def make_plan(
    drawn: Path2D, tracked: TrackedVehicle, request: PlanRequest, progress: Progress | None = None
) -> Plan[None]:
    """Plan for a path, a vehicle and a request; see `plan`.

    Args:
        drawn: the path as drawn.
        tracked: the vehicle and its tracked point.
        request: what is asked of the plan.
        progress: called now and then with the share of the path that is done.

    Raises:
        InputError: the path cannot be planned as asked.
    """
    if request.loop and not drawn.closed:
        raise InputError("a path that repeats is closed; join its end to its start (--closed), or plan it once")
    check_size(drawn, tracked.robot, tracked.vehicle.turn_radius)

    @cache
    def nearest(drift: Drift) -> Declared:
        vehicle, corner = tracked.vehicle, request.corner
        feasibility = Feasibility(tracked.robot, vehicle, tracked.rod, drift, corner, request.time_weight)
        return declare(drawn, feasibility, progress)

    changes: list[Change] = []
    if request.arrive_seconds is not None:
        from planner.goal.swings import Delay

        changes.append(Delay(request.space, drawn))
    if not request.space.empty:
        from planner.jobs.detours import Around  # loads SciPy's graphs

        changes.append(Around(tracked, request.space, drawn))
    task = Task(
        source=lambda setting: nearest(setting.drift), changes=tuple(changes), drawn=drawn, quickest=not changes
    )
    once = solve(task, tracked, request, progress)
    if not request.loop:
        return once
    from planner.jobs.laps import looped

    return looped(once, progress)
