"""The commands for jobs of a laboratory: a tour of places, the coverage of a region, a place to hold."""

from __future__ import annotations

import math
from argparse import Namespace
from typing import TYPE_CHECKING, NamedTuple

from planner.command_line import (
    DWELLS,
    OBSTACLES,
    TABLE,
    progress_bar,
    say_job,
    vehicle_and_request,
)
from planner.paths.units import read_length, read_time
from sim.io.commands import ROBOT, UNIT, Argument, Run, argument, out
from sim.io.errors import InputError

if TYPE_CHECKING:
    from planner.jobs.cover import Coverage
    from planner.jobs.tour import Visits
    from planner.planning.planned import Plan


class Job(NamedTuple):
    """A command for a job."""

    name: str
    help: str
    run: Run
    arguments: tuple[Argument, ...]


_COMMON = (
    ROBOT,
    *TABLE,
    UNIT,
    argument("--point", default="head_centre", choices=("head_centre", "head_tip", "pivot"),
             help="which point of the robot does the job (default: head_centre)"),
    argument("--objective", default="error", choices=("error", "time", "flips"),
             help="what decides the dwell: small error, short time, or few flips (default: error)"),
    *DWELLS,
    *OBSTACLES,
    out("folder"),
)  # fmt: skip


def _tour(arguments: Namespace) -> None:
    say_job(planned_tour(arguments), arguments.out)


def planned_tour(arguments: Namespace) -> Plan[Visits]:
    """Plan the tour that the command asks for."""
    from planner.files.regions import read_places
    from planner.jobs.tour import tour
    from sim.inputs import load_robot

    robot = load_robot(arguments.robot)
    places = read_places(arguments.places, arguments.unit, robot)
    tracked, request = vehicle_and_request(arguments, robot)
    with progress_bar() as progress:
        return tour(
            places.tolist(),
            tracked,
            request,
            any_start=arguments.any_start,
            back=arguments.back,
            progress=progress,
        )


def _cover(arguments: Namespace) -> None:
    say_job(planned_cover(arguments), arguments.out)


def planned_cover(arguments: Namespace) -> Plan[Coverage]:
    """Plan the coverage that the command asks for."""
    from planner.files.regions import read_field
    from planner.jobs.cover import cover
    from planner.jobs.region import Field
    from sim.inputs import load_robot

    robot = load_robot(arguments.robot)
    field = read_field(arguments.region, arguments.hole, arguments.unit, robot)
    width = read_length(arguments.width, arguments.unit, robot, "--width", above_zero=True)
    tracked, request = vehicle_and_request(arguments, robot)
    field = Field(field.outline, (*field.holes, *request.space.regions))
    angle = None if arguments.angle is None else math.radians(math.fmod(arguments.angle, 360))
    with progress_bar() as progress:
        return cover(field, width, tracked, request, angle, progress)


def _hold(arguments: Namespace) -> None:
    from planner.files.regions import read_places
    from planner.jobs.hold import hold
    from sim.inputs import load_robot

    seconds = None if arguments.seconds is None else read_time(arguments.seconds, "--for")
    robot = load_robot(arguments.robot)
    if "," not in arguments.place:
        raise InputError(f"place {arguments.place!r}; write X,Y, for example 30cm,15cm")
    (place,) = read_places([arguments.place], arguments.unit, robot)
    tracked, request = vehicle_and_request(arguments, robot)
    with progress_bar() as progress:
        result = hold(place.tolist(), tracked, request, seconds, progress)
    say_job(result, arguments.out)


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
    Job(
        "hold",
        "stay about a place, on the smallest orbit that the robot can keep",
        _hold,
        (
            argument("place", metavar="PLACE", help="X,Y"),
            argument("--for", dest="seconds", metavar="TIME", help="such as 30min (default: until told)"),
            *_COMMON,
        ),
    ),
)  # fmt: skip
