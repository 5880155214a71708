"""Paths from files: tables, drawings (`planner.paths.svg_drawing`, `planner.paths.dxf_drawing`), GeoJSON
(`planner.paths.geojson`) and what other robots follow (`planner.paths.robot_messages`)."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from common.errors import InputError, naming
from common.keywords import checks_keywords
from common.units import split, to_si
from planner.paths.dxf_drawing import read_dxf
from planner.paths.geojson import read_geojson, read_regions
from planner.paths.named_paths import NamedPaths
from planner.paths.path import SHAPES, Path2D, like_a_shape, nearest_shape, shape_of
from planner.paths.robot_messages import of_messages, read_messages, read_pathplanner
from planner.paths.units import NO_UNIT, Scales, in_tails

if TYPE_CHECKING:
    import pandas as pd

KINDS = {  # of files that are neither tables nor drawings: their endings, and how they begin
    "GeoJSON": ("geojson topojson",
                r'\{[\s\S]*?"type"\s*:\s*"(?:Feature|Topology|Geometry|(?:Multi)?(?:Point|Line|Poly))'),
    "a path of PathPlanner": ("", r'\{[\s\S]*?"waypoints"\s*:\s*\[\s*\{\s*"anchor'),
    "a bag of ROS": ("bag db3 mcap", r"#ROSBAG|SQLite format 3|\x89MCAP"),
    "a map of ROS": ("", r"(?:[^\n]*\n)*?(?:image|resolution):\s"),
    "the picture of a map of ROS": ("pgm pbm ppm", r"P[1-6]\s+(?:#[^\n]*\n\s*)*\d+\s+\d+\s"),
    "a message of ROS": ("",
                         r'\{[\s\S]*?\bposes?"?:|(?:[^\n]*\n)*?(?:[\s-]*poses?:|[^\n]*(?:nav|geometry)_msgs/)'),
    "YAML": ("yaml yml", r"---\s"),
    "a script": ("sh py m", r"#!"),
    "JSON": ("json", r"\{|\[\s*[\[{\d-]"),
    "GPX": ("gpx", r"<[\s\S]*?<gpx[\s>]|<gpx[\s>]"),
    "KML": ("kml kmz", r"<[\s\S]*?<kml[\s>]|<kml[\s>]"),
    "a drawing with another ending than .svg": ("svgz", r"<[\s\S]*?<svg[\s/>]|<svg[\s/>]"),
    "XML": ("xml gml", r"<"),
    "G-code": ("gcode gco ngc cnc tap", r"(?:[%;(O][^\n]*\n|\s)*(?:N\d+\s*)?[GM]\d+(?:\.\d+)?(?:\s|[A-Z;(]|$)"),
    "WKT": ("wkt ewkt", r"(?:[^\n]*\n)?[^\n(]*?(?:POINT|LINESTRING|RING|POLYGON|COLLECTION)[\sZM]*\(+[\s\d.+-]"),
    "DXF": ("dxf", r"(?:999[^\S\n]*\n[^\n]*\n\s*)*0\s*\n\s*SECTION"),
    "a shapefile": ("shp shx dbf", r"\x00\x00\x27\x0a"),
    "a vector format": ("dwg plt hpgl eps ps ai step stp stl obj", r"%!PS|AC10\d\d"),
    "PDF": ("pdf", r"%PDF"),
    "a picture": ("png jpg jpeg gif bmp tif tiff webp heic", r"\x89PNG|\xff\xd8\xff|GIF8|II\*|MM\x00\*|RIFF"),
}  # fmt: skip
ADVICE = {  # other than that of a table or a drawing
    "GPX": "its degrees of longitude and latitude span kilometres; give x and y in a unit of length",
    "KML": "its degrees of longitude and latitude span kilometres; give x and y in a unit of length",
    "a map of ROS": "a path has an order; give --keep-out map.yaml, and the path in another file",
    "the picture of a map of ROS": "give its map.yaml as --keep-out",
    "a bag of ROS": "print the topic of the path: ros2 topic echo --full-length TOPIC > path.yaml",
}
_POSE, _PLACE = re.compile(r"poses\W?(\d+)"), re.compile(r"\bposition\W([xy])$")  # /plan/poses[0]/pose/position/x
_HEAD = 4096  # bytes that tell


def _read_svg(path: Path) -> NamedPaths:
    from planner.paths.svg_drawing import read_svg  # loads svgelements, which only a drawing needs

    return read_svg(path)


READERS: dict[str, Callable[[Path], NamedPaths]] = {
    "GeoJSON": read_geojson,
    "a path of PathPlanner": read_pathplanner,
    "a message of ROS": read_messages,
    "DXF": read_dxf,
    "an SVG drawing": _read_svg,
}


@dataclass(frozen=True)
class Drawing:
    """A path, and its unit, if the file has one.

    Example:
        >>> from softflagella import Drawing, load_robot, plan, polygon
        >>> robot = load_robot("paper-control")
        >>> square = Drawing(polygon(4, side=33.0), unit="cm")  # a side of 33 cm
        >>> round(plan(square, robot).drawn.length, 9)  # four sides of three tail lengths
        12.0
    """

    path: Path2D  # in the unit of the file
    unit: float | str | None  # its size in m, or "m", "cm", "mm", "l"; None: the numbers have no unit
    no_unit: str = NO_UNIT  # what a message then asks for

    def in_tails(self, robot: Scales, unit: str | None = None) -> Path2D:
        """Return the path in tail lengths of a robot.

        Args:
            robot: its tail length.
            unit: of numbers that have none; one of their own must agree with it.

        Raises:
            InputError: there is no unit, or there are two.
        """
        if self.unit is None and unit is None:
            raise InputError(self.no_unit)
        given, own = (
            in_tails(each, robot) if isinstance(each, str) else each and each / robot.length_scale
            for each in (unit, self.unit)
        )
        if given and own and not math.isclose(given, own):
            metres = self.path.length * own * robot.length_scale
            raise InputError(
                f"--unit {unit}: it has a size of its own, it is {metres:.3g} m long; leave --unit out"
            )
        return self.path.scaled(own or given or 1.0)


@checks_keywords
def read_path(source: str | Path, *, closed: bool | None = None, shape: str | None = None) -> Drawing:
    """Read a path from a table with columns x, y (or x_mm, y_mm and so on), from a drawing, or from words.

    Args:
        source: the file, or a shape: circle:RADIUS, square:SIDE, triangle:SIDE or polygon:CORNERS:SIDE, with the
            unit of its size, as in square:24cm or square:3l.
        closed: join the end to the start; by default as in the file.
        shape: name of the path, of several; without it the error message lists the names.

    Raises:
        InputError: the file has no path, or several and none is chosen; or there is no such file or shape.

    Example:
        >>> import tempfile
        >>> from softflagella import read_path
        >>> with tempfile.NamedTemporaryFile("w", suffix=".svg") as file:
        ...     _ = file.write('<svg><path d="M 0 0 h 3 v -4" transform="scale(2)"/></svg>')
        ...     file.flush()
        ...     read_path(file.name).path.points.tolist()
        [[0.0, 0.0], [6.0, 0.0], [6.0, 8.0]]
    """
    words = str(source)
    path = shape_of(words)
    if path is not None:
        return Drawing(*path)
    if like_a_shape(words) and not Path(source).exists():
        near = nearest_shape(words)
        raise InputError(f"{words}: no such file or shape; {f'is it {near}? ' if near else ''}shapes are {SHAPES}")
    with naming(source):
        named = read_paths(Path(source))
        return Drawing(named.chosen(source, shape, closed), named.unit, named.no_unit)


def read_paths(path: Path) -> NamedPaths:
    """Read all paths of a file.

    Raises:
        InputError: it has none, or is of a kind that is not read.
    """
    return _read(path, READERS)


def read_outlines(path: Path) -> NamedPaths:
    """Read all outlines of obstacles of a file, without holes.

    Raises:
        InputError: it has none, or is of a kind that is not read.
    """
    from planner.paths.ros_map import read_map

    return _read(path, {**READERS, "GeoJSON": read_regions, "a map of ROS": read_map})


def _read(path: Path, readers: Mapping[str, Callable[[Path], NamedPaths]]) -> NamedPaths:
    kind = _kind_of(path)
    if kind is None:
        return _read_columns(path)
    if kind not in readers:
        advice = ADVICE.get(kind, "give a table with columns x and y, such as CSV, or an SVG drawing")
        raise InputError(f"{path}: {kind} is not read; {advice}")
    return readers[kind](path)


def _kind_of(path: Path) -> str | None:
    """Tell what a file is, by its content or its ending; None: a table. A pipe is not looked into."""
    ending = path.suffix.lower().removeprefix(".")
    if ending == "svg":
        return "an SVG drawing"
    if not path.is_file():
        return None
    with path.open("rb") as file:
        head = file.read(_HEAD).decode("latin-1").removeprefix("\xef\xbb\xbf").lstrip()
    by_content = [kind for kind, (_, start) in KINDS.items() if re.match(start, head, re.IGNORECASE)]
    by_ending = [kind for kind, (endings, _) in KINDS.items() if ending in endings.split()]
    return next(iter([*by_content, *by_ending]), None)


def _read_columns(source: Path) -> NamedPaths:
    """Read x and y, and the size of their unit; without names the first two columns.

    Raises:
        InputError: the table has no x and y, only one of them has a unit, or a value is no number.
    """
    from pandas import Series

    from common.quantities import numbers_of  # these load pandas, and a drawing or a circle needs none of it
    from common.tables import read_table

    table = read_table(source, names=False)
    if columns := _of_bag(table):
        numbers = numbers_of(Series(table[columns].to_numpy().ravel())).to_numpy()
        poses = numbers.reshape(len(table), 2, -1).transpose(0, 2, 1)
        return of_messages([each[np.isfinite(each).all(axis=1)] for each in poses])
    if all(isinstance(column, int) for column in table):
        names, units = list(table.columns[:2]), []
    else:
        names = [_column(source, table, axis) for axis in ("x", "y")]
        units = [unit for unit in (split(name).unit for name in names) if unit]
    if len(names) != 2 or len(units) == 1:
        raise InputError(f"{source}: give x and y, both with a unit (x_mm and y_mm) or both without")
    points = table[names].apply(numbers_of).to_numpy(dtype=float)
    broken = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(broken):
        line = f" (line {table.index[broken[0]]})" if table.index.name else ""
        raise InputError(f"{source}: x or y of point {broken[0] + 1}{line} is no number; correct the file")
    factors = np.array([to_si(1.0, unit.suffix) for unit in units] or [1.0, 1.0])
    path = Path2D(points * (factors / factors[0]))
    return NamedPaths({source.stem: path}, float(factors[0]) if units else None)


def _of_bag(table: pd.DataFrame) -> list[str]:
    """List the columns of places of a bag of ROS, a message a row: x of each pose, then y of each; or none."""
    places = [(place[1], _POSE.search(name), name) for name in map(str, table) if (place := _PLACE.search(name))]
    columns = sorted((axis, int(pose[1]) if pose else 0, name) for axis, pose, name in places)
    x, y = ([number for axis, number, _ in columns if axis == wanted] for wanted in "xy")
    return [name for _, _, name in columns] if x == y and len(set(x)) == len(x) else []


def _column(source: Path, table: pd.DataFrame, axis: str) -> str:
    """Choose the column of a coordinate, a bare number or a length."""
    columns = []
    for column in map(str, table):
        quantity, unit = split(column)
        if quantity.lower() == axis and (unit is None or unit.kind == "length"):
            columns.append(column)
    if len(columns) > 1:
        raise InputError(f"{source}: {' and '.join(columns)} are the same coordinate; drop all but one")
    if not columns:
        names = ", ".join(map(str, table))
        raise InputError(f"{source} has columns {names}; give x and y, or with a unit x_mm, y_mm")
    return columns[0]
