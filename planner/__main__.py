"""Command line of the planner.

python -m planner plan PATH.{csv,svg} --robot robot.toml --out DIR     plan.json, plan.csv, schedule.h, plan.svg
python -m planner check PLAN.json TRACK.csv [--out OVERLAY.png]        tracking error of a replayed track
"""

from __future__ import annotations

import sys
from argparse import Namespace
from typing import TYPE_CHECKING

from sim.io.commands import MODEL, ROBOT, Program, argument, out
from sim.io.errors import InputError

if TYPE_CHECKING:
    from planner.path import Path2D
    from sim.model.robot import Robot

program = Program("planner", "Plan switching schedules for paths, without simulating.")
main = program.main
_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_SHAPES = {"circle": 0, "triangle": 3, "square": 4}  # number of corners


@program.command(
    "plan",
    "plan the switching times for a path",
    argument("path", help="CSV with x, y; SVG; or circle:RADIUS, square:SIDE, triangle:SIDE"),
    ROBOT,
    out("folder"),
    MODEL,
    argument("--unit", choices=("l", *_UNITS), help="unit of the path (default: the drawing's, or tail lengths)"),
    argument("--scale", type=float, default=1.0, help="multiply the path's coordinates"),
    argument("--shape", help="which path of an SVG with several"),
    argument("--closed", action="store_true", help="join the path's end to its start"),
    argument("--point", default="head_centre", choices=("head_centre", "head_tip", "pivot"),
             help="which point follows the path (default: head_centre)"),
    argument("--corner", default="fillet", choices=("fillet", "error"), help="round corners, or refuse them"),
    argument("--min-dwell", type=float, help="shortest dwell, in time units μ0 l⁴/EI"),
    argument("--tolerance", type=float, help="largest guaranteed error, in tail lengths"),
)  # fmt: skip
def _plan(arguments: Namespace) -> None:
    from planner.export import write_plan
    from planner.plan import plan
    from sim.inputs import load_robot
    from surrogate.export import load_table

    robot = load_robot(arguments.robot)
    result = plan(
        _path(arguments, robot),
        robot,
        lookup=load_table(arguments.model),
        point=arguments.point,
        corner=arguments.corner,
        minimum_dwell=arguments.min_dwell,
        tolerance=arguments.tolerance,
    )
    paths = write_plan(result, arguments.out)
    for warning in result.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    print(
        f"{len(result.dwells)} dwells, {result.seconds.sum():.1f} s; predicted error "
        f"{result.predicted_rms:.4f} l rms, stated error {result.stated_error:.3f} l "
        f"(guaranteed {result.guaranteed:.3f} + table {result.tube:.3f})"
    )
    if result.fillet_radius:
        print(f"corners rounded to {result.fillet_radius:.3f} l, which cuts {result.corner_cut:.3f} l")
    print(f"-> {', '.join(map(str, paths))}")


def _path(arguments: Namespace, robot: Robot) -> Path2D:
    """The path that the command asks for, in tail lengths."""
    from planner.drawings import Drawing, read_path
    from planner.path import circle, polygon

    shape, _, size = arguments.path.partition(":")
    if shape in _SHAPES and size:
        try:
            length = float(size)
        except ValueError:
            raise InputError(f"{arguments.path!r}; write for example circle:2 or square:3") from None
        if not 0 < length < float("inf"):
            raise InputError(f"{arguments.path!r}; its size must be above 0")
        drawing = Drawing(polygon(_SHAPES[shape], length) if _SHAPES[shape] else circle(length), None)
    else:
        closed = True if arguments.closed else None
        drawing = read_path(arguments.path, closed=closed, shape=arguments.shape)
    unit = drawing.unit if arguments.unit is None else _UNITS.get(arguments.unit)
    scale = arguments.scale * (1.0 if unit is None else unit / robot.tail_length)
    if not 0 < scale < float("inf"):
        raise InputError(f"--scale {arguments.scale}; give a number above 0")
    return drawing.path.scaled(scale)


@program.command(
    "check",
    "tracking error of a replayed track",
    argument("plan", help="plan.json"),
    argument("track", help="CSV written by python -m sim replay"),
    out("overlay picture, PNG", default=None),
)
def _check(arguments: Namespace) -> None:
    from planner.check import draw_overlay, load_plan, tracking_error
    from sim.io.files import whole_file
    from sim.io.tables import read_table

    content = load_plan(arguments.plan)
    error = tracking_error(content, read_table(arguments.track))
    print(error.line)
    if arguments.out:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6, 6))
        axes = figure.add_subplot()
        draw_overlay(axes, content, error, content["robot"]["name"])
        axes.legend(fontsize=8, frameon=False)
        with whole_file(arguments.out) as part:
            figure.savefig(part, format="png", dpi=130, bbox_inches="tight")
        print(f"-> {arguments.out}")


if __name__ == "__main__":
    program.exit()
