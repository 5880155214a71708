"""What the commands of the planner share: options, the look-up table that they load, and what they print."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from planner.paths.units import heading_in_degrees, place_in_lab, read_length, read_time
from sim.io.commands import LOOKUP, argument
from sim.io.errors import InputError
from sim.io.units import format_time

if TYPE_CHECKING:
    from planner.planning.camera import Camera
    from planner.planning.planned import Plan
    from planner.planning.request import PlanRequest
    from planner.vehicle.calibration_table import CalibrationKnowledge
    from planner.vehicle.tracked_point import TrackedVehicle
    from sim.model.robot import Robot
    from surrogate.interface import LookupTable

DWELLS = (
    argument("--minimum-dwell", old="--min-dwell", type=float, help="shortest dwell, in time units μ0 l⁴/EI"),
    argument(
        "--minimum-seconds",
        old="--min-dwell-s",
        type=float,
        help="shortest dwell that the motor allows, in seconds",
    ),
    argument("--tolerance", metavar="LENGTH", help="largest stated error, such as 5mm"),
)
ARRIVE = argument(
    "--arrive",
    metavar="TIME",
    help="when the robot is at the end, such as 12min: dwells are changed, or waiting circles added",
)
TABLE = (
    LOOKUP,
    argument("--own-table", action="store_true",
             help="simulate a look-up table of this robot, once; it is more accurate on long paths"),
)  # fmt: skip
OBSTACLES = (
    argument("--keep-out", action="append", default=[], metavar="REGION",
             help="circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a CSV or SVG outline; may be given again"),
    argument("--walls", metavar="REGION", help="what the robot must stay within: box:…, or a CSV or SVG outline"),
    argument("--feedback", action="store_true",
             help="the pose will be measured for a tracker: the margin around obstacles is the stated error with "
             "feedback"),
    argument("--camera", nargs=5, metavar=("NOISE", "RAD", "EVERY", "LATE", "LOST"),
             help="of the stated error with feedback: standard deviations of a place and of a heading in rad, "
             "seconds between poses, their age in seconds, share that is lost (default: 0.01l 0.01 1 2 0.2)"),
)  # fmt: skip


def say(result: Plan) -> None:
    """Print warnings, start, dwells and errors."""
    for warning in result.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    robot = result.robot
    x, y, heading = result.start
    place = place_in_lab(x, y, robot)
    print(f"start: put the head's centre at {place}, heading {heading_in_degrees(heading)}, at rest")
    shortest = format_time(result.minimum_dwell * robot.time_scale)
    print(
        f"{len(result.dwells)} dwells of {shortest} ({result.minimum_dwell:.2f} time units) or more, "
        f"{format_time(float(result.seconds.sum()))} in all"
    )
    print(result.error_line)
    for line in result.lines():
        print(line)


def say_job(result: Plan, folder: str) -> None:
    """Print a plan with its job, and write its files."""
    from planner.files.plan_files import write_plan

    paths = write_plan(result, folder)
    say(result)
    say_written(paths)


def say_written(paths: Iterable[Path]) -> None:
    """Print the files that were written."""
    print(f"-> {', '.join(map(str, paths))}")


def table_of(arguments: Namespace, robot: Robot, knowledge: CalibrationKnowledge) -> LookupTable:
    """Load the table that the command names, or the one that fits the robot."""
    from planner.files.own_table import table_for
    from surrogate.table.model_file import load_table

    if arguments.lookup:
        return load_table(arguments.lookup)
    return table_for(robot, arguments.robot, knowledge, own=arguments.own_table)


def length_of(arguments: Namespace, name: str, robot: Robot) -> float | None:
    """Read the option of a name, a length above 0, in tail lengths; None where it is not given.

    Raises:
        InputError: it is no such length, or has no unit.
    """
    words = getattr(arguments, name)
    option = f"--{name.replace('_', '-')}"
    return None if words is None else read_length(words, arguments.unit, robot, option, above_zero=True)


def camera_of(arguments: Namespace, robot: Robot) -> Camera:
    """Read --camera; default: the camera as documented.

    Raises:
        InputError: a word is no number, or cannot be.
    """
    from planner.planning.camera import Camera

    if (words := getattr(arguments, "camera", None)) is None:
        return Camera()
    place, *numbers = words
    noise = read_length(place, arguments.unit, robot, "--camera", above_zero=True)
    try:
        heading, every_s, delay_s, lost = map(float, numbers)
    except ValueError:
        raise InputError(
            f"--camera {' '.join(words)}: RAD, EVERY, LATE, LOST are numbers without a unit, such as 0.01 1 2 0.2"
        ) from None
    return Camera((noise, heading), every_s, delay_s, lost)


def request_of(arguments: Namespace, robot: Robot) -> PlanRequest:
    """Return what the command asks of a plan."""
    from planner.files.regions import read_free_space
    from planner.planning.request import PlanRequest

    given = vars(arguments)
    named = ("point", "corner", "time_weight", "objective", "minimum_dwell", "minimum_seconds", "feedback", "loop")
    seconds = None if given.get("arrive") is None else read_time(given["arrive"], "--arrive")
    return PlanRequest(
        **{name: given[name] for name in named if name in given},
        tolerance=length_of(arguments, "tolerance", robot),
        camera=camera_of(arguments, robot),
        space=read_free_space(given.get("keep_out", ()), given.get("walls"), arguments.unit, robot),
        arrive_seconds=seconds,
    )


def vehicle_and_request(arguments: Namespace, robot: Robot) -> tuple[TrackedVehicle, PlanRequest]:
    """Load the table that the command names, and return the robot's vehicle and what is asked of the plan."""
    from planner.vehicle.calibration_table import read_knowledge
    from planner.vehicle.tracked_point import tracked_vehicle

    request, knowledge = request_of(arguments, robot), read_knowledge(arguments.robot)
    return tracked_vehicle(robot, table_of(arguments, robot, knowledge), request.point, knowledge), request


@contextmanager
def progress_bar() -> Iterator[Callable[[float], object]]:
    """Show a bar on a terminal, for plans that take long."""
    from tqdm import tqdm

    from planner.planning.progress import Share

    style = "{desc}: {percentage:3.0f}%|{bar}| {elapsed}"
    with tqdm(
        total=100, leave=False, delay=1.0, miniters=0, bar_format=style, disable=not sys.stderr.isatty()
    ) as bar:

        def show(share: float) -> None:
            if isinstance(share, Share):
                bar.set_description_str(share.stage, refresh=False)
                bar.update(100 * min(share.done, 1.0) - bar.n)

        yield show
