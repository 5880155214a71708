"""Regions as words of a command or as files, and the files of a plan from pose to pose."""

from __future__ import annotations

import difflib
import json
from collections.abc import Sequence
from pathlib import Path

from planner.files.plan_files import EXTRA, FILES, write_plan_files
from planner.goal.goal_plan import GoalPlan
from planner.paths.obstacles import Circle, FreeSpace, Polygon, Region
from planner.paths.path_files import Drawing, read_path
from planner.paths.shapes import like_a_shape, shape_of
from planner.paths.units import in_tails, read_length
from sim.io.errors import InputError, naming
from sim.io.files import files_together, write_text
from sim.model.robot import Robot

_SHAPES = {"circle": "circle:X,Y,RADIUS", "box": "box:LEFT,LOW,RIGHT,HIGH"}


def read_region(words: str, unit: str | None, robot: Robot) -> Region:
    """Read a region, in tail lengths.

    Args:
        words: circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a CSV or SVG with a closed outline.
        unit: of numbers without one; a drawing with a size has its own.
        robot: its tail length.

    Raises:
        InputError: the words are no region, or a length has no unit.
    """
    shape, _, numbers = words.partition(":")
    if shape in _SHAPES and numbers:
        values = [read_length(number, unit, robot, words) for number in numbers.split(",")]
        if shape == "circle" and len(values) == 3:
            return Circle(*values)
        if shape == "box" and len(values) == 4:
            left, low, right, high = values
            return Polygon.of([[left, low], [right, low], [right, high], [left, high]])
        raise InputError(f"{words!r}; write {_SHAPES[shape]}")
    drawing = read_outline(words)
    with naming(words):
        given = drawing.unit or unit
        named = given if isinstance(given, str) else {1.0: "m", 0.001: "mm"}.get(given or 0.0, "cm")
        path = drawing.in_tails(robot, unit if drawing.unit is None else None)
        return Polygon.of(path, 1.0 / in_tails(named, robot), named)


def read_outline(words: str) -> Drawing:
    """Read a closed outline from a CSV or SVG.

    Raises:
        InputError: there is no such file, or it has no outline; the words may be a misspelt region.
    """
    if like_a_shape(words) and shape_of(words) is None and not Path(words).exists():
        shape, _, numbers = words.partition(":")
        near = difflib.get_close_matches(shape.lower(), _SHAPES, 1)
        guess = f"is it {near[0]}:{numbers}? " if near else ""
        regions = f"{', '.join(_SHAPES.values())}, or a CSV or SVG outline"
        raise InputError(f"{words}: no such file or region; {guess}regions are {regions}")
    return read_path(words, closed=True)


def read_free_space(keep_out: Sequence[str], walls: str | None, unit: str | None, robot: Robot) -> FreeSpace:
    """Read what a robot must keep out of, and what it must stay within; see `read_region`.

    Raises:
        InputError: the words are no regions, or the walls are round.
    """
    outline = None if walls is None else read_region(walls, unit, robot)
    if outline is not None and not isinstance(outline, Polygon):
        raise InputError(f"--walls {walls!r}; give a box or an outline")
    return FreeSpace(tuple(read_region(words, unit, robot) for words in keep_out), outline)


def write_goal_plan(goal_plan: GoalPlan, folder: str | Path) -> list[Path]:
    """Write the files of the plan, goal.json and a picture, all or none; return their paths."""
    from planner.files.pictures import draw_goal_plan, write_svg

    with files_together(folder, (*FILES, *EXTRA)) as temporary:
        identity = write_plan_files(goal_plan.plan, temporary)
        write_text(temporary / "goal.json", json.dumps({**goal_plan.to_dict(), "plan_id": identity}) + "\n")
        write_svg(draw_goal_plan(goal_plan), temporary / "goal.svg", identity)
    return [Path(folder, name) for name in (*FILES, "goal.json", "goal.svg")]
