"""Places and regions of jobs as words of a command or as files, and the files of their plans."""

from __future__ import annotations

import json
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
from planner.paths.units import read_length
from sim.arrays import Floats
from sim.io.errors import InputError, naming
from sim.io.files import files_together, write_text
from sim.model.robot import Robot


def read_places(words: Sequence[str], unit: str | None, robot: Robot) -> Floats:
    """Read places (n, 2), in tail lengths.

    Args:
        words: X,Y of each, or one file with a point for each.
        unit: of numbers without one.
        robot: its tail length.

    Raises:
        InputError: a word is no pair of numbers, or the file cannot be read.
    """
    if len(words) == 1 and "," not in Path(words[0]).name:
        with naming(words[0]):
            return read_path(words[0], closed=False).in_tails(robot, unit).points
    for word in words:
        if word.count(",") != 1:
            raise InputError(f"place {word!r}; write X,Y, for example 30cm,15cm")
    return np.array(
        [[read_length(each, unit, robot, f"place {word}") for each in word.split(",")] for word in words]
    )


def write_tour(result: TourPlan, folder: str | Path) -> list[Path]:
    """Write the files of the plan, tour.json and a picture, all or none; return their paths."""
    from planner.files.pictures import draw_tour, write_svg

    with files_together(folder, (*FILES, *EXTRA)) as temporary:
        identity = write_plan_files(result.plan, temporary)
        write_text(temporary / "tour.json", json.dumps({**result.to_dict(), "plan_id": identity}) + "\n")
        write_svg(draw_tour(result), temporary / "tour.svg", identity)
    return [Path(folder, name) for name in (*FILES, "tour.json", "tour.svg")]


def read_field(words: str, holes: Sequence[str], unit: str | None, robot: Robot) -> Field:
    """Read a region with holes, in tail lengths.

    Args:
        words: circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a CSV or SVG outline.
        holes: the same for each hole.
        unit: of numbers without one; a region of which a file says another unit is refused.
        robot: its tail length.

    Raises:
        InputError: the words are no regions.
    """
    if words.partition(":")[0] not in ("circle", "box"):
        with naming(words):
            read_outline(words).in_tails(robot, unit)
    return Field(read_region(words, unit, robot), tuple(read_region(hole, unit, robot) for hole in holes))


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
