"""The command for several robots in one tank: plans for each with the command of its job, timed together."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from io import StringIO
from typing import TYPE_CHECKING, Any

from planner.command_line import progress_bar, say_written
from sim.io.commands import Command, Declared, argument, out
from sim.io.errors import InputError, naming

if TYPE_CHECKING:
    from planner.files.fleet_files import FleetFile
    from planner.jobs.fleet import Member

FLEET = (
    argument("fleet", help="TOML with a table [[member]] for each robot: robot, and path, goal, places or region"),
    argument("--apart", help="least distance between bodies, such as 10cm (default: apart of the file)"),
    argument("--feedback", action="store_true", help="the poses will be measured for a tracker"),
    out("folder"),
)


def fleet_command(
    arguments: Namespace,
    commands: Mapping[str, Command | Declared],
    planned: Mapping[str, Callable[[Namespace], Any]],
) -> None:
    """Plan for the robots of a file so that they keep apart, and write the plans.

    Args:
        arguments: of the command.
        commands: of the planner, by name.
        planned: what plans for one robot, by the name of its command.

    Raises:
        InputError: the file or a plan is bad, or the robots cannot keep apart.
    """
    from planner.files.fleet_files import distance_apart, read_fleet, write_fleet
    from planner.jobs.fleet import fleet

    asked = read_fleet(arguments.fleet)
    apart = arguments.apart or asked.apart
    if apart is None:
        raise InputError(f"{arguments.fleet}: how far apart? give --apart 10cm, or apart in the file")
    members = _members(arguments, asked, commands, planned)
    distance = distance_apart(apart, asked.unit, [member.plan.robot for member in members])
    with progress_bar() as progress:
        result = fleet(members, distance, feedback=arguments.feedback or asked.feedback, progress=progress)
    paths = write_fleet(result, arguments.out)
    for warning in result.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    for line in result.lines():
        print(line)
    say_written(paths)


def _members(
    arguments: Namespace,
    asked: FleetFile,
    commands: Mapping[str, Command | Declared],
    planned: Mapping[str, Callable[[Namespace], Any]],
) -> list[Member]:
    """Plan for each robot as if it were alone."""
    from planner.jobs.fleet import Member

    members = []
    for robot in asked.robots:
        with naming(f"{arguments.fleet}: {robot.name}"), redirect_stdout(StringIO()):
            words = [*robot.words[:2], "--out", arguments.out, *robot.words[2:]]
            options = commands[robot.command].parser(robot.command).parse_args(words)
            options.feedback = options.feedback or arguments.feedback
            members.append(Member(robot.name, planned[robot.command](options), robot.delay))
    return members
