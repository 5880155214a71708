"""What the commands of the planner share: options, the look-up table that they load, and what they print."""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from planner.paths.units import in_lab, place_in_lab
from sim.io.commands import MODEL, argument
from sim.io.units import format_time

if TYPE_CHECKING:
    from planner.planning.planned import Plan
    from planner.vehicle.calibration_table import CalibrationKnowledge
    from sim.model.robot import Robot
    from surrogate.interface import LookupTable

DWELLS = (
    argument("--min-dwell", type=float, help="shortest dwell, in time units μ0 l⁴/EI"),
    argument("--min-dwell-s", type=float, help="shortest dwell that the motor allows, in seconds"),
    argument("--tolerance", type=float, help="largest stated error, in tail lengths"),
)
TABLE = (
    MODEL,
    argument("--own-table", action="store_true",
             help="simulate a look-up table of this robot, once; it is more accurate on long paths"),
)  # fmt: skip
OBSTACLES = (
    argument("--keep-out", action="append", default=[], metavar="REGION",
             help="circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a CSV or SVG outline; may be given again"),
    argument("--walls", metavar="REGION", help="what the robot must stay within: box:…, or a CSV or SVG outline"),
    argument("--feedback", action="store_true",
             help="the pose will be measured every 20 flips: the margin around obstacles is the stated error with "
             "feedback"),
)  # fmt: skip


def say(result: Plan) -> None:
    """Print warnings, start, dwells and errors."""
    for warning in result.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    robot = result.robot
    x, y, heading = result.start
    place = place_in_lab(x, y, robot)
    print(f"start: put the head's centre at {place}, heading {math.degrees(heading):.1f} degrees, at rest")
    shortest = format_time(result.minimum_dwell * robot.time_scale)
    print(
        f"{len(result.dwells)} dwells of {shortest} ({result.minimum_dwell:.2f} time units) or more, "
        f"{format_time(float(result.seconds.sum()))} in all"
    )
    rms, largest, stated, feedback = (
        in_lab(value, robot)
        for value in (result.predicted_rms, result.predicted_max, result.stated_error, result.feedback_error)
    )
    print(f"predicted error {rms} rms, {largest} at most; stated error {stated}, with feedback {feedback}")
    for line in () if result.kept_clear is None else result.kept_clear.lines(robot):
        print(line)


def table_of(arguments: Namespace, robot: Robot, knowledge: CalibrationKnowledge) -> LookupTable:
    """Load the table that the command names, or the one that fits the robot."""
    from planner.files.own_table import table_for
    from surrogate.table.model_file import load_table

    if arguments.model:
        return load_table(arguments.model)
    return table_for(robot, arguments.robot, knowledge, own=arguments.own_table)


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
