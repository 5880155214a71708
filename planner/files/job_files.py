"""Places and regions of jobs as words of a command or as files, and the files of their plans."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from planner.files.goal_files import read_outline, read_region
from planner.files.plan_files import EXTRA, FILES, write_plan_files
from planner.jobs.coverage_plan import CoveragePlan
from planner.jobs.hold_plan import HoldPlan
from planner.jobs.region import Field
from planner.jobs.tour_plan import TourPlan
from planner.paths.path_files import read_path
from planner.paths.units import in_tails
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.files import files_together, write_text
from sim.model.robot import Robot


def read_places(words: Sequence[str], unit: str | None, robot: Robot) -> tuple[Floats, float]:
    """Read places (n, 2) in tail lengths, and return the length of one unit of their numbers in l.

    Args:
        words: X,Y of each, or one file with a point for each.
        unit: of the numbers; None: that of the file, or tail lengths.
        robot: its tail length.

    Raises:
        InputError: a word is no pair of numbers, or the file cannot be read.
    """
    scale = in_tails(unit or "l", robot)
    if len(words) == 1 and "," not in Path(words[0]).name:
        drawing = read_path(words[0], closed=False)
        if drawing.unit is not None:
            if unit is not None:
                raise InputError(f"--unit {unit}: {words[0]} has a unit of its own; leave --unit out")
            scale = drawing.unit / robot.tail_length
        return scale * drawing.path.points, scale
    places = []
    for word in words:
        try:
            x, y = (float(number) for number in word.split(","))
        except ValueError:
            raise InputError(f"place {word!r}; write X,Y, for example 3,1.5") from None
        places.append((x, y))
    return scale * np.array(places), scale


def write_tour(result: TourPlan, folder: str | Path) -> list[Path]:
    """Write the files of the plan, tour.json and a picture, all or none; return their paths."""
    from planner.files.pictures import draw_tour, write_svg

    with files_together(folder, (*FILES, *EXTRA)) as temporary:
        identity = write_plan_files(result.plan, temporary)
        write_text(temporary / "tour.json", json.dumps({**result.to_dict(), "plan_id": identity}) + "\n")
        write_svg(draw_tour(result), temporary / "tour.svg", identity)
    return [Path(folder, name) for name in (*FILES, "tour.json", "tour.svg")]


def read_field(words: str, holes: Sequence[str], unit: str | None, robot: Robot) -> tuple[Field, float]:
    """Read a region with holes, in tail lengths, and return the length of one unit of its numbers in l.

    Args:
        words: circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a CSV or SVG outline.
        holes: the same for each hole.
        unit: of the numbers; None: that of the file, or tail lengths.
        robot: its tail length.

    Raises:
        InputError: the words are no regions.
    """
    scale = in_tails(unit or "l", robot)
    if words.partition(":")[0] not in ("circle", "box"):
        drawing = read_outline(words)
        if drawing.unit is not None:
            if unit is not None:
                raise InputError(f"--unit {unit}: {words} has a unit of its own; leave --unit out")
            scale = drawing.unit / robot.tail_length
    return Field(read_region(words, scale, robot), tuple(read_region(hole, scale, robot) for hole in holes)), scale


def read_length(words: str, scale: float, robot: Robot, name: str) -> float:
    """Read a length such as 4cm in tail lengths; a bare number has the unit `scale`.

    Raises:
        InputError: the words are no length above 0; the message begins with `name`.
    """
    unit = next((unit for unit in ("mm", "cm", "m", "l") if words.endswith(unit)), "")
    try:
        value = float(words.removesuffix(unit)) * (in_tails(unit, robot) if unit else scale)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise InputError(f"{name} {words}; write a length above 0, such as 4cm")
    return value


def write_cover(result: CoveragePlan, folder: str | Path) -> list[Path]:
    """Write the files of the plan, cover.json and a picture, all or none; return their paths."""
    from planner.files.pictures import draw_cover, write_svg

    with files_together(folder, (*FILES, *EXTRA)) as temporary:
        identity = write_plan_files(result.plan, temporary)
        write_text(temporary / "cover.json", json.dumps({**result.to_dict(), "plan_id": identity}) + "\n")
        write_svg(draw_cover(result), temporary / "cover.svg", identity)
    return [Path(folder, name) for name in (*FILES, "cover.json", "cover.svg")]


def write_hold(result: HoldPlan, folder: str | Path) -> list[Path]:
    """Write the files of the plan, hold.json and a picture, all or none; return their paths."""
    from planner.files.pictures import draw_hold, write_svg

    with files_together(folder, (*FILES, *EXTRA)) as temporary:
        identity = write_plan_files(result.plan, temporary)
        write_text(temporary / "hold.json", json.dumps({**result.to_dict(), "plan_id": identity}) + "\n")
        write_svg(draw_hold(result), temporary / "hold.svg", identity)
    return [Path(folder, name) for name in (*FILES, "hold.json", "hold.svg")]
