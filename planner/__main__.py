"""Command line of the planner.

python -m planner plan PATH.{csv,svg} --robot robot.toml --out DIR     plan.json, plan.csv, schedule.h, plan.svg
python -m planner check PLAN.json TRACK.csv [--out OVERLAY.png]        tracking error of a replayed track
"""

from __future__ import annotations

import argparse
import sys

from sim.io.errors import InputError, run_command

_UNITS = {"l": None, "m": 1.0, "cm": 0.01, "mm": 0.001}


def _plan(arguments: argparse.Namespace) -> None:
    from planner.export import write_plan
    from planner.path import circle, polygon, read_path
    from planner.plan import plan
    from sim.inputs import load_robot
    from surrogate.export import load_table

    robot = load_robot(arguments.robot)
    unit = _UNITS[arguments.unit]
    scale = arguments.scale * (1.0 if unit is None else unit / robot.tail_length)
    if not 0 < scale < float("inf"):
        raise InputError(f"--scale {arguments.scale}; give a number above 0")
    shape, _, size = arguments.path.partition(":")
    if shape in ("circle", "triangle", "square") and size:
        try:
            length = float(size)
        except ValueError:
            raise InputError(f"{arguments.path!r}; write for example circle:2 or square:3") from None
        if not 0 < length < float("inf"):
            raise InputError(f"{arguments.path!r}; its size must be above 0")
        path = circle(length) if shape == "circle" else polygon(3 if shape == "triangle" else 4, length)
    else:
        path = read_path(arguments.path, closed=True if arguments.closed else None)
    result = plan(
        path.scaled(scale),
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
        f"{result.predicted_rms:.4f} l rms, stated bound {result.bound:.3f} l "
        f"(guaranteed {result.guaranteed:.3f} + table {result.tube:.3f})"
    )
    if result.fillet_radius:
        print(f"corners rounded to {result.fillet_radius:.3f} l, which cuts {result.corner_cut:.3f} l")
    print(f"-> {', '.join(map(str, paths))}")


def _check(arguments: argparse.Namespace) -> None:
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


def main(argv: list[str] | None = None) -> None:
    from surrogate.export import SHIPPED

    parser = argparse.ArgumentParser(prog="python -m planner", description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    plan = commands.add_parser("plan", help="plan the switching times for a path")
    plan.add_argument("path", help="CSV with x, y; SVG; or circle:RADIUS, square:SIDE, triangle:SIDE")
    plan.add_argument("--robot", required=True, help="robot.toml or the name of a preset")
    plan.add_argument("--out", required=True, help="folder to write")
    plan.add_argument("--model", default=SHIPPED, help="look-up table (default: the shipped one)")
    plan.add_argument("--unit", default="l", choices=_UNITS, help="unit of the path (default: tail lengths)")
    plan.add_argument("--scale", type=float, default=1.0, help="multiply the path's coordinates")
    plan.add_argument("--closed", action="store_true", help="join the path's end to its start")
    plan.add_argument("--point", default="head_centre", choices=("head_centre", "head_tip", "pivot"))
    plan.add_argument("--corner", default="fillet", choices=("fillet", "error"))
    plan.add_argument("--min-dwell", type=float, help="shortest dwell, in time units mu0 l^4/EI")
    plan.add_argument("--tolerance", type=float, help="largest guaranteed error, in tail lengths")
    plan.set_defaults(run=_plan)
    check = commands.add_parser("check", help="tracking error of a replayed track")
    check.add_argument("plan", help="plan.json")
    check.add_argument("track", help="CSV written by python -m sim replay")
    check.add_argument("--out", help="overlay picture to write, PNG")
    check.set_defaults(run=_check)
    arguments = parser.parse_args(argv)
    arguments.run(arguments)


if __name__ == "__main__":
    sys.exit(run_command(main))
