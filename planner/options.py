"""Options, places and regions that the planning functions share, as words of a command or as Python has them.

Numbers are in tail lengths l, time units μ0 l⁴/EI and rad. Words are as in commands: lengths with their units, as
4cm or 0.3l, or in `unit`; times as 12min; regions as circle:X,Y,RADIUS.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from os import PathLike
from pathlib import Path
from typing import Any, TypedDict

from numpy.typing import ArrayLike

from common.errors import InputError, naming
from common.units import LengthUnit
from planner.paths.obstacles import Circle, FreeSpace, Polygon
from planner.paths.path import Path2D, like_a_shape, shape_of
from planner.paths.path_files import Drawing, read_outlines, read_path
from planner.paths.units import Scales, in_tails, read_length, read_pose, read_time, time_in_lab
from planner.planning.request import Camera, Corner, PlanRequest
from planner.vehicle.from_table import table_for
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.tracked_point import Point, TrackedVehicle, tracked_vehicle
from planner.vehicle.zigzag import Objective
from sim.knowledge import CalibratedRobot, CalibrationKnowledge, read_knowledge
from sim.mechanics.planar import POSE
from sim.model.robot import Robot
from sim.robot_rows import OneRobot, one_robot
from surrogate.interface import LookupTable
from surrogate.table_file import load_table

# a `TrackedVehicle` is that of a plan: no table is asked again
AnyVehicle = OneRobot | MeasuredVehicle | TrackedVehicle | CalibratedRobot
Length = float | str
AnyRegion = Circle | Polygon | Path2D | ArrayLike | str
_REQUEST = tuple(field.name for field in fields(PlanRequest))
_FARTHEST = 1e6  # l
_SHAPES = {"circle": "circle:X,Y,RADIUS", "box": "box:LEFT,LOW,RIGHT,HIGH"}


class TableOptions(TypedDict, total=False):
    """Which table knows the robot, and units.

    Attributes:
        lookup: look-up table, or its file (default: the one that comes with the package; where that one does not
            know the robot, the robot's own table is simulated, and kept beside its file).
        own_table: simulate a look-up table of this robot, once, in seconds (minutes where its parts interact); it
            is more accurate on long paths.
        knowledge: what a calibration found besides the robot: covariance, current. Default: that of the file.
        unit: of all lengths in words that are given without one; l for tail lengths. 24cm and 3l, columns x_cm and
            y_cm, and drawings with a size have their own.
    """

    lookup: LookupTable | str | Path | None
    own_table: bool
    knowledge: CalibrationKnowledge | None
    unit: LengthUnit | None


class DwellOptions(TableOptions, total=False):
    """What dwells must keep to.

    Attributes:
        minimum_dwell: shortest dwell that the motor allows, in time units μ0 l⁴/EI (viscosity, tail length,
            bending stiffness).
        minimum_seconds: the same in seconds; the larger one counts.
        tolerance: LENGTH, largest acceptable stated error, such as 5mm; the dwell that the objective chooses is
            shortened until it is kept, down to the minimum, or the plan is refused.
    """

    minimum_dwell: float | None
    minimum_seconds: float | None
    tolerance: Length | None


class SpaceOptions(TypedDict, total=False):
    """What the body must keep clear of, and how sure that is.

    Attributes:
        keep_out: REGION, that the robot's body must not touch: circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a
            file with closed outlines, polygons (GeoJSON) or a map of ROS (map.yaml). Where it is in the way, a way
            around is chosen. In Python also a `Circle`, or corners (n, 2).
        walls: REGION, what the body must stay within: box:…, or a file with one outline. In Python also corners.
        feedback: the pose will be measured for a tracker: the margin around obstacles is the stated error with
            feedback.
        camera: NOISE RAD EVERY LATE LOST, for the stated error with feedback: standard deviations of a place and
            of a heading in rad, seconds between poses, their age in seconds, share that is lost (default: 0.01l
            0.01 1 2 0.2). In Python also a `Camera`.
        seed: of the random robots from which the stated error is computed.
    """

    keep_out: Sequence[AnyRegion]
    walls: AnyRegion | None
    feedback: bool
    camera: Camera | tuple[str, str, str, str, str]
    seed: int


class GoalOptions(DwellOptions, SpaceOptions, total=False):
    """Options of `to_goal`."""


class PointOptions(DwellOptions, total=False):
    """Which point follows, and what decides the dwell.

    Attributes:
        point: which point of the robot follows the declared path, or reaches goals (default: head_centre).
        objective: what decides the dwell: small error, short time, or few flips (default: error).
        dwell: this shortest dwell, in time units, in place of an objective; with a tolerance that it does not keep
            the plan is refused.
    """

    point: Point
    objective: Objective
    dwell: float | None


class CornerOptions(PointOptions, total=False):
    """What is done with places that are too tight.

    Attributes:
        corner: places that are too tight: the nearest path that can be followed, by root mean square (nearest, the
            default) or by its largest distance (minimax); round corners (fillet); or refuse (error).
        time_weight: cut corners to save time: the mean squared distance, in l², that is worth the time of the
            whole path (default: 0; 0.03 cuts a little).
    """

    corner: Corner
    time_weight: float


class JobOptions(PointOptions, SpaceOptions, total=False):
    """Options of `tour` and `hold`.

    Attributes:
        progress: called now and then with the share of what is done.
    """

    progress: Callable[[float], object] | None


class PathOptions(CornerOptions, JobOptions, total=False):
    """Options of `plan`."""


def asked(robot: AnyVehicle, options: Mapping[str, Any], **own: Any) -> tuple[TrackedVehicle, PlanRequest]:
    """Return a robot's vehicle with its tracked point, and what is asked of its plan.

    Args:
        robot: the robot, or a vehicle.
        options: see the classes above.
        own: further fields of `PlanRequest`.

    Raises:
        InputError: an option cannot be, or no table knows the robot.
    """
    swims = swimmer_of(robot)
    request = request_of(options, swims, **own)
    if isinstance(robot, TrackedVehicle):
        if given := [name for name in ("lookup", "own_table", "knowledge", "point") if options.get(name)]:
            raise InputError(f"{given[0]}: the vehicle of a plan has its own; give the robot instead")
        return robot, request
    if isinstance(robot, MeasuredVehicle) or isinstance(swims, MeasuredVehicle):
        if any(options.get(name) for name in ("lookup", "own_table", "knowledge")):
            raise InputError(f"{swims.name!r} is a measured vehicle; it needs no look-up table and no calibration")
        return tracked_vehicle(swims, None, request.point, None), request
    if not isinstance(robot, CalibratedRobot):
        return _vehicle(robot, swims, options, request), request
    tracked, *others = [
        _vehicle(each, each, {**options, "knowledge": known}, request)
        for each, known in ((robot.corrected, robot.knowledge), *robot.alternatives)
    ]
    return tracked._replace(alternatives=tuple(others)), request


def _vehicle(robot: OneRobot, swims: Robot, options: Mapping[str, Any], request: PlanRequest) -> TrackedVehicle:
    """Return the vehicle of a robot that a look-up table knows."""
    table, knowledge = table_of(robot, swims, options)
    return tracked_vehicle(swims, table, request.point, knowledge)


def swimmer_of(robot: AnyVehicle) -> Robot | MeasuredVehicle:
    """Return a robot or a measured vehicle, read from its file where a path or a preset's name is given."""
    if isinstance(robot, TrackedVehicle):
        return robot.robot
    if isinstance(robot, CalibratedRobot):
        return robot.corrected
    if isinstance(robot, str | PathLike) and MeasuredVehicle.is_in(robot):
        return MeasuredVehicle.load(robot)
    return robot if isinstance(robot, MeasuredVehicle) else one_robot(robot)


def table_of(
    robot: OneRobot, swims: Robot, options: Mapping[str, Any]
) -> tuple[LookupTable, CalibrationKnowledge]:
    """Return the look-up table that knows a robot, and what a calibration found besides.

    Args:
        robot: as it was given: the robot's own table is kept beside its file.
        swims: the robot.
        options: see `TableOptions`.
    """
    source = None if isinstance(robot, Robot) else robot
    known = options.get("knowledge") or (CalibrationKnowledge() if source is None else read_knowledge(source))
    lookup = options.get("lookup")
    if isinstance(lookup, str | Path):
        lookup = load_table(lookup)
    return lookup or table_for(swims, source, known, own=options.get("own_table", False)), known


def request_of(options: Mapping[str, Any], robot: Scales, **own: Any) -> PlanRequest:
    """Return what is asked of a plan; `own` are further fields.

    Raises:
        InputError: an option cannot be, such as round walls, or two contradict each other.
    """
    given, unit = {name: options[name] for name in _REQUEST if name in options}, options.get("unit")
    if "camera" in given:
        given["camera"] = camera_of(given["camera"], unit, robot)
    if given.get("tolerance") is not None:
        given["tolerance"] = length_of(given["tolerance"], unit, robot, "--tolerance")
    walls = options.get("walls")
    request = PlanRequest(**given, **own)
    least = request.least_dwell(robot)
    if request.dwell is not None and "objective" in given:
        raise InputError("dwell and objective: the objective chooses the dwell; leave one of them out")
    if request.dwell is not None and least is not None and request.dwell < least:
        raise InputError(
            f"dwell {time_in_lab(request.dwell, robot)} is shorter than the minimum, {time_in_lab(least, robot)}; "
            "give a longer dwell, or allow a shorter one"
        )
    outlines = [None] if walls is None else regions_of(walls, unit, robot)
    if len(outlines) > 1 or isinstance(outlines[0], Circle):
        raise InputError(f"--walls {walls!r}; give a box or an outline")
    regions = tuple(part for each in options.get("keep_out", ()) for part in regions_of(each, unit, robot))
    return replace(request, space=FreeSpace(regions, outlines[0]))


def length_of(given: Length, unit: str | None, robot: Scales, name: str) -> float:
    """Return a length above 0 in l; a number is one."""
    return read_length(given, unit, robot, name, above_zero=True) if isinstance(given, str) else given


def camera_of(given: Camera | Sequence[str], unit: str | None, robot: Scales) -> Camera:
    """Return a camera, or read its words.

    Raises:
        InputError: a word is no number, or cannot be.
    """
    if isinstance(given, Camera):
        return given
    place, *numbers = given
    noise = read_length(place, unit, robot, "--camera-errors", above_zero=True)
    try:
        heading, every_s, delay_s, lost = map(float, numbers)
    except ValueError:
        raise InputError(
            f"--camera-errors {' '.join(given)}: RAD, EVERY, LATE and LOST are numbers without a unit, such as "
            "0.01 1 2 0.2"
        ) from None
    return Camera((noise, heading), every_s, delay_s, lost)


def regions_of(given: AnyRegion, unit: str | None, robot: Scales) -> list[Circle | Polygon]:
    """Return regions, or read their words, see `read_regions`."""
    if isinstance(given, str | Path):
        return read_regions(str(given), unit, robot)
    return [given if isinstance(given, Circle | Polygon) else Polygon.of(given)]


def pose_of(given: Sequence[Length], unit: str | None, robot: Scales, name: str) -> POSE:
    """Return a pose in l and rad, or read its words: X, Y and degrees.

    Raises:
        InputError: it is none, or its heading is more than one turn, as one in degrees would be.
    """
    if len(given) == 3 and any(isinstance(each, str) for each in given):
        given = read_pose([str(each) for each in given], unit, robot, name)
    name = name.removeprefix("--")
    x, y, heading = _finite(given, 3, f"{name}: give x, y and heading")
    if abs(heading) > math.tau:
        raise InputError(
            f"{name}: a heading of {heading:g} is more than one turn; headings are in radians here, so give "
            f"math.radians({heading:g}) if you mean degrees"
        )
    return x, y, heading


def place_of(
    given: Sequence[Length] | str, unit: str | None, robot: Scales, name: str = "place"
) -> tuple[float, float]:
    """Return a place in l, or read its words: X,Y in one or in two; `name` is what messages call it.

    Raises:
        InputError: it is no pair of finite numbers, or a word has no unit.
    """
    parts: list[Any] = list(given) if isinstance(given, Iterable) else [given]
    if isinstance(given, str):
        parts, name = given.split(","), f"place {given}"
        if len(parts) != 2:
            raise InputError(f"place {given!r}; write X,Y, for example 30cm,15cm")
    if len(parts) == 2 and any(isinstance(part, str) for part in parts):
        parts = [read_length(str(part), unit, robot, name) for part in parts]
    x, y = _finite(parts, 2, f"{name}: give x and y")
    return x, y


def places_of(
    given: Sequence[Sequence[float] | str] | str | Path, unit: str | None, robot: Scales
) -> list[tuple[float, float]]:
    """Return places in l, or read their words: X,Y of each, or one file with a point for each.

    Raises:
        InputError: a place is none, or the file cannot be read.
    """
    places = [str(given)] if isinstance(given, str | Path) else list(given)
    if len(places) == 1 and isinstance(file := places[0], str) and "," not in Path(file).name:
        with naming(file):
            points = read_path(file, closed=False).in_tails(robot, unit).points
            return [(x, y) for x, y in points.tolist()]
    return [place_of(each, unit, robot) for each in places]


def _finite(values: Sequence[Any], count: int, wanted: str) -> list[float]:
    """Check that there are `count` finite numbers; the message says what is wanted."""
    try:
        numbers = [float(value) for value in values]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != count or not all(abs(number) < _FARTHEST for number in numbers):
        raise InputError(f"{wanted}, as finite numbers below {_FARTHEST:.0e}; not {values}")
    return numbers


def seconds_of(given: float | str | None, name: str) -> float | None:
    """Return a time in seconds, or read its words."""
    return read_time(given, name) if isinstance(given, str) else given


def read_regions(words: str, unit: str | None, robot: Scales) -> list[Circle | Polygon]:
    """Read regions, in tail lengths.

    Args:
        words: circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a file with closed outlines.
        unit: of numbers without one; a drawing with a size has its own.
        robot: its tail length.

    Raises:
        InputError: the words are no region, or a length has no unit.
    """
    shape, _, numbers = words.partition(":")
    if shape in _SHAPES and numbers:
        values = [read_length(number, unit, robot, words) for number in numbers.split(",")]
        if shape == "circle" and len(values) == 3:
            return [Circle(*values)]
        if shape == "box" and len(values) == 4:
            left, low, right, high = values
            return [Polygon.of([[left, low], [right, low], [right, high], [left, high]])]
        raise InputError(f"{words!r}; write {_SHAPES[shape]}")
    with naming(words):
        return [_polygon_of(drawing, unit, robot) for drawing in _outlines(words)]


def _polygon_of(drawing: Drawing, unit: str | None, robot: Scales) -> Polygon:
    given = drawing.unit or unit
    named = given if isinstance(given, str) else {1.0: "m", 0.001: "mm"}.get(given or 0.0, "cm")
    path = drawing.in_tails(robot, unit if drawing.unit is None else None)
    return Polygon.of(path, 1.0 / in_tails(named, robot), named)


def _outlines(words: str) -> list[Drawing]:
    """Read the closed outlines of a file, or a shape in words.

    Raises:
        InputError: there is no such file, or it has no outline; the words may be a misspelt region.
    """
    if shape_of(words) is not None:
        return [read_path(words)]
    if like_a_shape(words) and not Path(words).exists():
        shape, _, numbers = words.partition(":")
        near = difflib.get_close_matches(shape.lower(), _SHAPES, 1)
        guess = f"is it {near[0]}:{numbers}? " if near else ""
        regions = f"{', '.join(_SHAPES.values())}, or a file with outlines"
        raise InputError(f"{words}: no such file or region; {guess}regions are {regions}")
    paths, unit, no_unit = read_outlines(Path(words))
    return [Drawing(Path2D.of(path.points, closed=True), unit, no_unit) for path in paths.values()]
