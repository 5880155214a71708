"""Paths of other robots: messages of ROS as it prints them, and .path files of PathPlanner; lengths in m."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.reading import decode, expecting, read_bytes, read_json
from planner.paths.named_paths import NamedPaths
from planner.paths.path import Path2D

_POSITION = re.compile(r'\bposition"?:[\s{]*+"?x"?:\s*+([^\s,}]++)[\s,]++"?y"?:\s*+([^\s,}]++)')
_CUT = re.compile(r"^[ \t]*+-[ \t]*+'?\.\.\.'?[ \t\r]*+$", re.M)  # where `ros2 topic echo` leaves poses out


def read_messages(path: Path) -> NamedPaths:
    """Read nav_msgs/Path, or PoseArray, as `rostopic echo` and `ros2 topic echo` print it.

    Raises:
        InputError: the file has no poses, or a part of them was left out when it was printed.
    """
    with expecting("a message of ROS", path, "give nav_msgs/Path as ros2 topic echo prints it"):
        text = decode(read_bytes(path))
        if _CUT.search(text):
            raise InputError(
                "poses were left out when it was printed; print it with ros2 topic echo --full-length"
            )
        printed = [_POSITION.findall(message) for message in re.split("^---", text, flags=re.M)]
        return of_messages([np.array(poses, dtype=float) for poses in printed if poses])


def of_messages(messages: list[Floats]) -> NamedPaths:
    """Name the paths of messages, poses (n, 2) of each.

    Messages of one pose each, such as PoseStamped and Odometry, are one path. One that comes again is left out.

    Raises:
        InputError: there are no poses.
    """
    if all(len(poses) <= 1 for poses in messages):
        messages = [np.concatenate([np.empty((0, 2)), *messages])]
    different = {poses.tobytes(): poses for poses in messages if len(poses)}.values()
    if not different:
        raise InputError("its messages have no poses with x and y; give nav_msgs/Path, PoseStamped or Odometry")
    return NamedPaths({f"message{k + 1}": Path2D(poses) for k, poses in enumerate(different)}, 1.0)


def read_pathplanner(path: Path) -> NamedPaths:
    """Read the Bézier curves through the waypoints of PathPlanner.

    Raises:
        InputError: the file is not as PathPlanner writes it.
    """
    from svgelements import CubicBezier, Matrix, Move
    from svgelements import Path as Curves

    from planner.paths.svg_drawing import polyline_of

    with expecting("a path of PathPlanner", path, "save it from PathPlanner"):
        knots = read_json(path)["waypoints"]
        anchors = [knot.get("anchor") or knot["anchorPoint"] for knot in knots]  # the latter until 2022
        curves = Curves(Move(end=_place(anchors[0])))
        for k, (start, end) in enumerate(pairwise(anchors)):
            places = start, knots[k]["nextControl"], knots[k + 1]["prevControl"], end
            curves.append(CubicBezier(*map(_place, places)))
        return NamedPaths({path.stem: polyline_of(curves, Matrix())}, 1.0)


def _place(place: dict[str, float]) -> complex:
    return complex(place["x"], place["y"])
