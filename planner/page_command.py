"""The command that writes the page."""

from __future__ import annotations

from argparse import Namespace

from planner.command_line import DWELLS, TABLE, request_of, table_of
from planner.job_commands import Job
from planner.paths.units import UNITS, in_tails
from sim.io.commands import argument, out
from sim.io.errors import InputError


def _write(arguments: Namespace) -> None:
    """Write the page that the command asks for."""
    from planner.page.first_state import NamedPath
    from planner.page.write_page import TITLE, write_page
    from planner.paths.path_files import read_path
    from planner.vehicle.calibration_table import read_knowledge
    from sim.inputs import load_robot

    robot = load_robot(arguments.robot)
    unit = in_tails(arguments.unit or "l", robot) * robot.tail_length
    paths = []
    for name in arguments.path:
        drawing = read_path(name)
        if drawing.unit is not None and arguments.unit is not None:
            raise InputError(f"--unit {arguments.unit}: {name} has a size of its own; leave --unit out")
        paths.append(NamedPath(_short(name), drawing.path.scaled(unit if drawing.unit is None else drawing.unit)))
    knowledge = read_knowledge(arguments.robot)
    page = write_page(
        arguments.out,
        robot,
        table_of(arguments, robot, knowledge),
        request_of(arguments),
        knowledge=knowledge,
        paths=paths,
        smooth=arguments.smooth,
        title=arguments.title or TITLE,
    )
    print(f"{page.stat().st_size / 1e6:.2f} MB, opens in a browser -> {page}")


def _short(name: str) -> str:
    """Return the name under which the page offers a path: a shape's words, or a file without folder and ending."""
    from pathlib import Path

    from planner.paths.shapes import shape_of

    return Path(name).stem if shape_of(name) is None else name


PAGE = Job(
    "page",
    "write one HTML file that plans: draw a path in the browser, take the schedule along",
    _write,
    (
        argument("--robot", default="paper-control",
                 help="robot.toml or the name of a preset (default: paper-control)"),
        *TABLE,
        argument("--path", action="append", default=[], metavar="PATH",
                 help="a path that the page offers: CSV, SVG, or a shape such as circle:2; may be given again"),
        argument("--unit", choices=("l", *UNITS), help="unit of the paths' numbers (default: tail lengths)"),
        argument("--title", help="title of the page"),
        argument("--smooth", type=float, help="smooth drawn strokes over this length, in tail lengths"),
        argument("--point", default="head_centre", choices=("head_centre", "head_tip", "pivot"),
                 help="which point follows the path at first (default: head_centre)"),
        argument("--corner", default="nearest", choices=("nearest", "minimax", "fillet", "error"),
                 help="what is done with places that are too tight, at first (default: nearest)"),
        argument("--time-weight", type=float, default=0.0, help="cut corners to save time, at first (default: 0)"),
        argument("--objective", default="error", choices=("error", "time", "flips"),
                 help="what decides the dwell at first (default: error)"),
        *DWELLS,
        out("the page, HTML"),
    ),
)  # fmt: skip
