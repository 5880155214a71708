"""Places and regions of jobs as words of a command or as files, and the files of their plans."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from planner.files.plan_files import EXTRA, FILES, write_plan_files
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
