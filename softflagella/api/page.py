"""Write the page that plans: `softflagella.write_page`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Unpack

from numpy.typing import ArrayLike

from planner.page.first_state import NamedPath
from planner.page.write_page import TITLE
from planner.page.write_page import write_page as write
from planner.paths.path import Path2D
from planner.planning.request import PlanRequest, RequestOptions
from planner.vehicle.calibration_table import CalibrationKnowledge
from sim.io.keywords import checks_keywords
from sim.robot_rows import OneRobot
from softflagella.api.vehicles import robot_with_table
from surrogate.interface import LookupTable


@checks_keywords()
def write_page(
    path: str | Path,
    robot: OneRobot = "paper-control",
    *,
    paths: Mapping[str, Path2D | ArrayLike] | None = None,
    smooth: float | None = None,
    title: str = TITLE,
    lookup: LookupTable | None = None,
    own_table: bool = False,
    knowledge: CalibrationKnowledge | None = None,
    **options: Unpack[RequestOptions],
) -> Path:
    """Write one HTML file in which a path is drawn and planned, without a server or a network.

    Args:
        path: the file.
        robot: the robot that the page begins with, its robot.toml, or the name of a preset. Robots with effects or
            a calibration cannot be changed in the page.
        paths: paths by name that the page offers, (n, 2) points or a Path2D, lengths in tail lengths l; the first
            one is planned when the page opens.
        smooth: length [l] over which drawn strokes are smoothed.
        title: of the page.
        lookup: trained table, or the table of this one robot; see `plan`.
        own_table: simulate the robot's own table in any case.
        knowledge: what a calibration found besides the robot. Default: that of the file.
        options: of the first plan: point, corner, time_weight, objective, minimum_dwell, minimum_seconds and
            tolerance of `plan`.

    Raises:
        InputError: the table does not know the robot, an option cannot be, or the file cannot be written.

    Example:
        >>> import tempfile
        >>> import softflagella as sf
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     page = sf.write_page(f"{folder}/page.html", paths={"my circle": sf.circle(2.0)})
        ...     0.5e6 < page.stat().st_size < 1.6e6
        True
    """
    swims, table, known = robot_with_table(robot, lookup, knowledge, own_table=own_table)
    named = [
        NamedPath(name, (each if isinstance(each, Path2D) else Path2D.of(each)).scaled(swims.tail_length))
        for name, each in (paths or {}).items()
    ]
    request = PlanRequest(**options)
    return write(path, swims, table, request, knowledge=known, paths=named, smooth=smooth, title=title)
