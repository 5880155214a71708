"""The command that writes the page."""

from __future__ import annotations

from argparse import Namespace

from planner.command_line import DWELLS, TABLE, length_of, request_of, table_of
from planner.job_commands import Job
from sim.io.commands import UNIT, argument, out
from sim.io.errors import naming


def _write(arguments: Namespace) -> None:
    """Write the page that the command asks for."""
    from planner.page.first_state import NamedPath
    from planner.page.write_page import TITLE, write_page
    from planner.paths.path_files import read_path
    from planner.vehicle.calibration_table import read_knowledge
    from sim.inputs import load_robot

    robot = load_robot(arguments.robot)
    paths = []
    for name in arguments.path:
        with naming(name):
            path = read_path(name).in_tails(robot, arguments.unit).scaled(robot.tail_length)
        paths.append(NamedPath(_short(name), path))
    knowledge = read_knowledge(arguments.robot)
    page = write_page(
        arguments.out,
        robot,
        table_of(arguments, robot, knowledge),
        request_of(arguments, robot),
        knowledge=knowledge,
        paths=paths,
        smooth=length_of(arguments, "smooth", robot),
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
                 help="a path that the page offers: CSV, SVG, or a shape such as circle:20cm; may be given again"),
        UNIT,
        argument("--title", help="title of the page"),
        argument("--smooth", metavar="LENGTH", help="smooth drawn strokes over this length, such as 1cm"),
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
