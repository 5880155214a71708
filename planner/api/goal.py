"""Plan from one pose to another: `softflagella.to_goal`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Unpack

from planner.api.options import AnyVehicle, GoalOptions, Length, asked, pose_of, seconds_of, swimmer_of
from planner.goal.trip import Trip
from planner.goal.trip import to_goal as plan_to_goal
from planner.paths.units import read_length
from planner.planning.plan import Plan
from planner.vehicle.zigzag import Objective
from sim.io.keywords import checks_keywords


@checks_keywords
def to_goal(
    start: Sequence[Length],
    goal: Sequence[Length],
    robot: AnyVehicle,
    *,
    via: Sequence[tuple[Length, Length]] = (),
    arrive: float | str | None = None,
    objective: Objective = "time",
    progress: Callable[[float], object] | None = None,
    **options: Unpack[GoalOptions],
) -> Plan[Trip]:
    """Plan the motor's switching times from one pose to another.

    Args:
        start: x, y [l] and heading [rad] of the head's centre, at rest; or words: X, Y and degrees.
        goal: the same at the end.
        robot: robot.toml or the name of a preset, or the robot, with its motor speed in both directions; or a
            measured vehicle, or its vehicle.toml.
        via: X Y, of a place that the pivot passes on its way.
        arrive: TIME, when the robot is at the goal, such as 12min, or in seconds: dwells are changed, or swings or
            waiting circles added.
        objective: what decides the dwell: small error, short time, or few flips.
        progress: called now and then with the share of what is done.
        options: see `GoalOptions`.

    Raises:
        NoWayError: there is no way to the goal; it is an `InputError`.
        InputError: a pose or a region is bad, or the robot cannot be simulated.

    Example:
        >>> import softflagella as sf
        >>> trip = sf.to_goal((0, 0, 0), (4, 1, 0), "paper-control")
        >>> trip.job.end_error[0] < 0.01
        True
    """
    swims, unit = swimmer_of(robot), options.get("unit")
    ends = (pose_of(start, unit, swims, "--start"), pose_of(goal, unit, swims, "--goal"))
    places = [[read_length(x, unit, swims, "--via") if isinstance(x, str) else x for x in place] for place in via]
    own = {"objective": objective, "arrive_seconds": seconds_of(arrive, "--arrive")}
    return plan_to_goal(*ends, *asked(robot, options, **own), places, progress)
