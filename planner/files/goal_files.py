"""Regions as words of a command or as files, and the files of a plan from pose to pose."""

from __future__ import annotations

import json
from pathlib import Path

from planner.files.plan_files import EXTRA, FILES, write_plan_files
from planner.goal.goal_plan import GoalPlan
from planner.paths.obstacles import Circle, Polygon, Region
from planner.paths.path_files import read_path
from planner.paths.units import in_tails
from sim.io.errors import InputError, naming
from sim.io.files import files_together, write_text
from sim.model.robot import Robot

_SHAPES = {"circle": "circle:X,Y,RADIUS", "box": "box:LEFT,LOW,RIGHT,HIGH"}


def read_region(words: str, unit: str, robot: Robot) -> Region:
    """Read a region, in tail lengths.

    Args:
        words: circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a CSV or SVG with a closed outline.
        unit: of the numbers: "l", "m", "cm" or "mm"; a drawing with physical units has its own.
        robot: its tail length.

    Raises:
        InputError: the words are no region.
    """
    scale = in_tails(unit, robot)
    shape, _, numbers = words.partition(":")
    if shape in _SHAPES and numbers:
        try:
            values = [scale * float(number) for number in numbers.split(",")]
        except ValueError:
            values = []
        if shape == "circle" and len(values) == 3:
            return Circle(*values)
        if shape == "box" and len(values) == 4:
            left, low, right, high = values
            return Polygon.of([[left, low], [right, low], [right, high], [left, high]])
        raise InputError(f"{words!r}; write {_SHAPES[shape]}")
    drawing = read_path(words, closed=True)
    unit_length = scale if drawing.unit is None else drawing.unit / robot.tail_length
    with naming(words):
        return Polygon.of(drawing.path.scaled(unit_length))


def write_goal_plan(goal_plan: GoalPlan, folder: str | Path) -> list[Path]:
    """Write the files of the plan, goal.json and a picture, all or none; return their paths."""
    from planner.files.pictures import draw_goal_plan, write_svg

    with files_together(folder, (*FILES, *EXTRA)) as temporary:
        identity = write_plan_files(goal_plan.plan, temporary)
        write_text(temporary / "goal.json", json.dumps({**goal_plan.to_dict(), "plan_id": identity}) + "\n")
        write_svg(draw_goal_plan(goal_plan), temporary / "goal.svg", identity)
    return [Path(folder, name) for name in (*FILES, "goal.json", "goal.svg")]
