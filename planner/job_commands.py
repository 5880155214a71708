"""The commands for jobs of a laboratory: a tour of places, the coverage of a region."""

from __future__ import annotations

import math
from argparse import Namespace
from typing import TYPE_CHECKING, NamedTuple

from planner.command_line import DWELLS, OBSTACLES, TABLE, progress_bar, say, table_of
from planner.paths.units import UNITS
from sim.io.commands import ROBOT, Argument, Run, argument, out

if TYPE_CHECKING:
    from planner.planning.request import PlanRequest
    from planner.vehicle.tracked_point import TrackedVehicle
    from sim.model.robot import Robot


class Job(NamedTuple):
    """A command for a job."""

    name: str
    help: str
    run: Run
    arguments: tuple[Argument, ...]


_COMMON = (
    ROBOT,
    *TABLE,
    argument("--unit", choices=("l", *UNITS), help="unit of all lengths (default: the file's, or tail lengths)"),
    argument("--point", default="head_centre", choices=("head_centre", "head_tip", "pivot"),
             help="which point of the robot does the job (default: head_centre)"),
    argument("--objective", default="error", choices=("error", "time", "flips"),
             help="what decides the dwell: small error, short time, or few flips (default: error)"),
    *DWELLS,
    *OBSTACLES,
    out("folder"),
)  # fmt: skip


def _tour(arguments: Namespace) -> None:
    from planner.files.goal_files import read_free_space
    from planner.files.job_files import read_places, write_tour
    from planner.jobs.tour import tour
    from sim.inputs import load_robot

    robot = load_robot(arguments.robot)
    places, scale = read_places(arguments.places, arguments.unit, robot)
    space = read_free_space(arguments.keep_out, arguments.walls, scale, robot)
    tracked, request = _tracked(arguments, robot)
    with progress_bar() as progress:
        result = tour(
            places.tolist(),
            tracked,
            request,
            space,
            any_start=arguments.any_start,
            back=arguments.back,
            feedback=arguments.feedback,
            progress=progress,
        )
    paths = write_tour(result, arguments.out)
    say(result.plan)
    for line in result.lines():
        print(line)
    print(f"-> {', '.join(map(str, paths))}")


def _cover(arguments: Namespace) -> None:
    from planner.files.goal_files import read_free_space
    from planner.files.job_files import read_field, read_length, write_cover
    from planner.jobs.cover import cover
    from planner.jobs.region import Field
    from sim.inputs import load_robot

    robot = load_robot(arguments.robot)
    field, scale = read_field(arguments.region, arguments.hole, arguments.unit, robot)
    space = read_free_space(arguments.keep_out, arguments.walls, scale, robot)
    field = Field(field.outline, (*field.holes, *space.regions))
    width = read_length(arguments.width, scale, robot, "--width")
    tracked, request = _tracked(arguments, robot)
    angle = None if arguments.angle is None else math.radians(math.fmod(arguments.angle, 360))
    with progress_bar() as progress:
        result = cover(
            field, width, tracked, request, space, angle=angle, feedback=arguments.feedback, progress=progress
        )
    paths = write_cover(result, arguments.out)
    say(result.plan)
    for line in result.lines():
        print(line)
    print(f"-> {', '.join(map(str, paths))}")


def _tracked(arguments: Namespace, robot: Robot) -> tuple[TrackedVehicle, PlanRequest]:
    """Load the table of the robot, and make the vehicle and the request."""
    from planner.planning.request import PlanRequest
    from planner.vehicle.calibration_table import read_knowledge
    from planner.vehicle.tracked_point import tracked_vehicle

    request = PlanRequest(
        point=arguments.point,
        objective=arguments.objective,
        minimum_dwell=arguments.min_dwell,
        minimum_seconds=arguments.min_dwell_s,
        tolerance=arguments.tolerance,
    )
    knowledge = read_knowledge(arguments.robot)
    return tracked_vehicle(robot, table_of(arguments, robot, knowledge), request.point, knowledge), request


JOBS = (
    Job(
        "tour",
        "visit places in the order that takes the robot the least time",
        _tour,
        (
            argument("places", nargs="+", metavar="PLACE",
                     help="X,Y of each, or one CSV or SVG with a point for each; the tour begins at the first"),
            argument("--return", dest="back", action="store_true", help="end where the tour began"),
            argument("--any-start", action="store_true", help="begin at any of the places"),
            *_COMMON,
        ),
    ),
    Job(
        "cover",
        "sweep a region with a camera, magnet or sampler under the robot",
        _cover,
        (
            argument("region", help="circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a CSV or SVG outline"),
            argument("--width", required=True, help="width of what is swept, such as 4cm"),
            argument("--hole", action="append", default=[], metavar="REGION",
                     help="a part that need not be swept, and may be crossed; may be given again"),
            argument("--angle", type=float, help="direction of the lanes, in degrees (default: the quickest)"),
            *_COMMON,
        ),
    ),
)  # fmt: skip
