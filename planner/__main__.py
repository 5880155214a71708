"""Command line of the planner: plan a path, go to a goal, track a robot, replay a plan, check a track."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from planner.command_line import (
    ARRIVE,
    DWELLS,
    OBSTACLES,
    TABLE,
    length_of,
    progress_bar,
    say,
    say_job,
    say_written,
    vehicle_and_request,
)
from planner.fleet_command import FLEET, fleet_command
from planner.job_commands import JOBS, planned_cover, planned_tour
from planner.page_command import PAGE
from planner.paths.units import describe, in_lab, read_length, read_pose
from planner.replay_command import REPLAY
from planner.tracking_commands import POSES, REPLAN, START, track, without_robot
from sim.io.commands import ROBOT, UNIT, Program, argument, out
from sim.io.errors import InputError, naming

if TYPE_CHECKING:
    from planner.goal.trip import Trip
    from planner.paths.path import Path2D
    from planner.planning.planned import Plan
    from sim.model.robot import Robot

program = Program("planner", "Plan switching schedules for paths, without simulating.")
main = program.main

_PLANNING = (
    argument("path", help="CSV with x, y; SVG; or circle:RADIUS, square:SIDE, triangle:SIDE, polygon:CORNERS:SIDE "
             "(square:24cm, polygon:6:2l)"),
    ROBOT,
    *TABLE,
    UNIT,
    argument("--scale", type=float, default=1.0, help="multiply the path's coordinates"),
    argument("--shape", help="which path of an SVG with several"),
    argument("--closed", action="store_true", help="join the path's end to its start"),
    argument("--smooth", metavar="LENGTH", help="smooth the path over this length, such as 1cm"),
    argument("--point", default="head_centre", choices=("head_centre", "head_tip", "pivot"),
             help="which point follows the path (default: head_centre)"),
    argument("--corner", default="nearest", choices=("nearest", "minimax", "fillet", "error"),
             help="places that are too tight: the nearest path that can be followed, by root mean square or by "
             "its largest distance (minimax); round corners; or refuse"),
    argument("--time-weight", type=float, default=0.0,
             help="cut corners to save time: the mean squared distance, in l², that is worth the time of the "
             "whole path (default: 0; 0.03 cuts a little)"),
    argument("--objective", default="error", choices=("error", "time", "flips"),
             help="what decides the dwell: small error, short time, or few flips (default: error)"),
    *DWELLS,
    ARRIVE,
    argument("--loop", action="store_true", help="a closed path is followed lap after lap, until told otherwise"),
    *OBSTACLES,
)  # fmt: skip
_TRACKING = (
    argument("path", help="a path to plan for, as for planner plan; or a plan.json, its folder, or a goal.json, "
             "tour.json or cover.json beside it"),
    *without_robot(_PLANNING[1:]),
)  # fmt: skip


@program.command(
    "plan",
    "plan the switching times for a path",
    *_PLANNING,
    argument("--trade-off", action="store_true", help="draw error against time and flips, for ten dwells"),
    out("folder"),
)
def _plan(arguments: Namespace) -> None:
    from planner.files.plan_files import write_plan

    result = _planned(arguments)
    pictures = {}
    if arguments.trade_off:
        from planner.files.trade_off import draw_trade_off, trade_off

        pictures["trade_off.svg"] = draw_trade_off(trade_off(result))
    paths = write_plan(result, arguments.out, pictures=pictures)
    say(result)
    robot, errors = result.robot, result.errors
    rms, largest, missed = (
        in_lab(value, robot) for value in (errors.drawn_rms, errors.drawn_max, result.declared.missed)
    )
    print(
        f"from the path as drawn {rms} rms, {largest} at most; every drawn point is within {missed} of the "
        "declared path"
    )
    say_written(paths)


@program.command(
    "goal",
    "plan the way from one pose to another, around obstacles; exit status 3 where there is none",
    argument("--goal", nargs=3, required=True, metavar=("X", "Y", "DEGREES"),
             help="of the head's centre at the end"),
    argument("--start", nargs=3, default=("0", "0", "0"), metavar=("X", "Y", "DEGREES"),
             help="of the head's centre at the start, at rest (default: 0 0 0)"),
    argument("--via", nargs=2, action="append", default=[], metavar=("X", "Y"),
             help="a place that the pivot passes; may be given again"),
    *OBSTACLES,
    UNIT,
    ROBOT,
    *TABLE,
    argument("--objective", default="time", choices=("error", "time", "flips"),
             help="what decides the dwell: small error, short time, or few flips (default: time)"),
    *DWELLS,
    ARRIVE,
    out("folder"),
)  # fmt: skip
def _goal(arguments: Namespace) -> None:
    say_job(_goal_planned(arguments), arguments.out)


def _goal_planned(arguments: Namespace) -> Plan[Trip]:
    """Plan the way that the command asks for."""
    from planner.goal.to_goal import to_goal
    from sim.inputs import load_robot

    robot, unit = load_robot(arguments.robot), arguments.unit
    start, goal = (read_pose(getattr(arguments, end), unit, robot, f"--{end}") for end in ("start", "goal"))
    via = [tuple(read_length(each, unit, robot, "--via") for each in place) for place in arguments.via]
    tracked, request = vehicle_and_request(arguments, robot)
    with progress_bar() as progress:
        return to_goal(start, goal, tracked, request, via, progress)


@program.command(
    "track",
    "keep a robot on a path or a saved plan: poses come in on a pipe, orders go out (planner.tracking.pipe)",
    *_TRACKING,
    START,
    *POSES,
)
def _track(arguments: Namespace) -> None:
    track(arguments, _planned, _TRACKING)


def _planned(arguments: Namespace) -> Plan[None]:
    """Make the plan that the command asks for."""
    from planner.jobs.plan import make_plan
    from sim.inputs import load_robot

    robot = load_robot(arguments.robot)
    path = _path(arguments, robot)
    print(f"path: {describe(path, robot)}")
    tracked, request = vehicle_and_request(arguments, robot)
    with progress_bar() as progress:
        return make_plan(path, tracked, request, progress)


def _path(arguments: Namespace, robot: Robot) -> Path2D:
    """Make the path that the command asks for, in l."""
    from planner.paths.path import smoothed
    from planner.paths.path_files import read_path

    drawing = read_path(arguments.path, closed=True if arguments.closed else None, shape=arguments.shape)
    if not 0 < arguments.scale < float("inf"):
        raise InputError(f"--scale {arguments.scale}; give a number above 0")
    with naming(arguments.path):
        path = drawing.in_tails(robot, arguments.unit).scaled(arguments.scale)
    length = length_of(arguments, "smooth", robot)
    if length is None:
        return path
    smooth, moved = smoothed(path, length)
    print(f"smoothed over {in_lab(length, robot)}, which moves the path by up to {in_lab(moved, robot)}")
    return smooth


@program.command(
    "check",
    "tracking error of a replayed track",
    argument("plan", help="plan.json"),
    argument("track", help="table written by softflagella replay, or with time_s, x_cm, y_cm, heading_deg"),
    out("overlay picture, PNG", default=None),
)
def _check(arguments: Namespace) -> None:
    from planner.files.plan_json import load_plan
    from planner.files.tracking_error import draw_overlay, tracking_error
    from sim.io.files import whole_file
    from sim.io.tables import read_table

    content = load_plan(arguments.plan)
    with naming(arguments.track):
        error = tracking_error(content, read_table(arguments.track))
    print(error.line)
    if arguments.out:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6, 6))
        axes = figure.add_subplot()
        draw_overlay(axes, content, error, content["robot"]["name"])
        axes.legend(fontsize=8, frameon=False)
        with whole_file(arguments.out) as part:
            figure.savefig(part, format="png", dpi=130, bbox_inches="tight")
        print(f"-> {arguments.out}")


@program.command("fleet", "plan several robots in one tank so that they keep apart", *FLEET)
def _fleet(arguments: Namespace) -> None:
    planned = {
        "plan": _planned,
        "goal": _goal_planned,
        "tour": planned_tour,
        "cover": planned_cover,
    }
    fleet_command(arguments, program.commands, planned)


for job in (*JOBS, PAGE, REPLAN, REPLAY):
    program.command(job.name, job.help, *job.arguments)(job.run)


if __name__ == "__main__":
    program.exit()
