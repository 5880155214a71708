"""The commands that go on from where a robot is: track it on a path or a saved plan, plan the rest of its path."""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from io import TextIOWrapper
from typing import TYPE_CHECKING

from planner.command_line import TABLE, say_job
from planner.job_commands import Job
from planner.paths.units import read_length, read_pose
from sim.io.commands import ROBOT, Argument, argument, out
from sim.io.errors import InputError, naming

if TYPE_CHECKING:
    from planner.planning.planned import Plan
    from planner.tracking.tracker import Tracker

START = argument("--start", nargs=3, metavar=("X", "Y", "DEGREES"),
                 help="of the head's centre, at rest; the robot finds its way to the path from there "
                 "(default: a path's start; the first pose that comes in, for a saved plan)")  # fmt: skip
POSES = (
    argument("--noise", metavar="LENGTH", default="0.01l", help="standard deviation of x and y (default: 0.01l)"),
    argument("--noise-rad", type=float, default=0.01, help="standard deviation of the heading"),
    argument("--latency", type=float, default=0.0, help="age of a pose when it comes in, in seconds"),
)
_OF_PLANS = ("path", "unit", "model", "own_table")  # arguments of planning that a saved plan takes, too


def track(arguments: Namespace, planned: Callable[[Namespace], Plan], planning: Sequence[Argument]) -> None:
    """Answer the lines of standard input with orders.

    Args:
        arguments: those of planning, START and POSES.
        planned: plans for a path.
        planning: the arguments of planning; those that differ from their defaults are refused for a saved plan.
    """
    from planner.files.saved_plan import is_plan
    from planner.tracking.pipe import answers
    from planner.tracking.tracker import Tracker

    if not 0 < arguments.noise_rad < math.inf:
        raise InputError(f"--noise-rad {arguments.noise_rad}; give a number above 0")
    if not 0 <= arguments.latency < math.inf:
        raise InputError(f"--latency {arguments.latency}; give a number of seconds, 0 or more")
    if isinstance(sys.stdin, TextIOWrapper):  # a damaged line must not end the tracker
        sys.stdin.reconfigure(errors="replace")
    saved = is_plan(arguments.path)
    with redirect_stdout(sys.stderr):
        if saved:
            refuse_planning(arguments, planning)
            plan = saved_plan(arguments, arguments.path)
        elif arguments.robot is None:
            raise InputError(f"{arguments.path} is no saved plan, so --robot is needed: a robot.toml or a preset")
        else:
            plan = planned(arguments)
    robot = plan.robot
    scale = robot.time_scale
    latency = arguments.latency / scale
    noise = (read_length(arguments.noise, arguments.unit, robot, "--noise", above_zero=True), arguments.noise_rad)

    def begin(pose: tuple[float, float, float], now: float) -> Tracker:
        return Tracker(plan, noise=noise, latency=latency, begin=now, start=pose)

    if arguments.start is not None:
        tracker: Tracker | None = begin(read_pose(arguments.start, arguments.unit, robot, "--start"), 0.0)
    else:
        tracker = None if saved else Tracker(plan, noise=noise, latency=latency)
    for answer in answers(tracker, sys.stdin, robot, begin):
        print(answer, flush=True)


def saved_plan(arguments: Namespace, path: str) -> Plan:
    """Make a plan again, with the look-up table that the command names."""
    from planner.files.saved_plan import restore_plan
    from surrogate.table.model_file import load_table

    lookup = load_table(arguments.lookup) if arguments.lookup else None
    return restore_plan(path, lookup=lookup, own_table=arguments.own_table)


def refuse_planning(arguments: Namespace, planning: Sequence[Argument]) -> None:
    """Refuse options of planning beside a saved plan.

    Raises:
        InputError: one is given.
    """
    for names, options in planning:
        name = options.get("dest", names[-1].lstrip("-").replace("-", "_"))
        default = options.get("default", False if options.get("action") == "store_true" else None)
        if name not in _OF_PLANS and getattr(arguments, name) != default:
            raise InputError(
                f"{names[-1]}: {arguments.path} is planned already; leave {names[-1]} out, or plan again"
            )


def without_robot(arguments: Sequence[Argument]) -> tuple[Argument, ...]:
    """Return arguments with a --robot that may be left out."""
    robot = argument(*ROBOT.names, help=f"{ROBOT.options['help']}; a saved plan has its own")
    return tuple(robot if each is ROBOT else each for each in arguments)


def replan(arguments: Namespace) -> None:
    """Plan the rest of a saved plan from the last pose of a track."""
    from planner.files.replan import replan_from, saved_trip
    from sim.io.tables import read_table
    from surrogate.table.model_file import load_table

    lookup = load_table(arguments.lookup) if arguments.lookup else None
    plan = saved_trip(arguments.plan, lookup=lookup, own_table=arguments.own_table)
    with naming(arguments.track):
        rest = replan_from(plan, read_table(arguments.track))
    say_job(rest, arguments.out)


REPLAN = Job(
    "replan",
    "plan the rest of a saved plan from where a robot is now",
    replan,
    (
        argument("plan", help="plan.json, its folder, or a goal.json, tour.json or cover.json beside it"),
        argument("track", help="table of the robot so far: time_s, x_cm, y_cm, heading_deg; in its last row the "
                 "robot is now, at rest"),
        *TABLE,
        out("folder"),
    ),
)  # fmt: skip
