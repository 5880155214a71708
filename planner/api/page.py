"""Write the page that plans: `softflagella.write_page`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Unpack

from numpy.typing import ArrayLike

from planner.api.options import CornerOptions, Length, length_of, request_of, table_of
from planner.page.first_state import NamedPath
from planner.page.write_page import TITLE
from planner.page.write_page import write_page as write
from planner.paths.path import Path2D, shape_of
from planner.paths.path_files import read_path
from sim.io.errors import naming
from sim.io.keywords import checks_keywords
from sim.robot_rows import OneRobot, one_robot


@checks_keywords
def write_page(
    path: str | Path,
    robot: OneRobot = "paper-control",
    *,
    paths: Mapping[str, Path2D | ArrayLike] | Sequence[str] = (),
    smooth: Length | None = None,
    title: str | None = None,
    **options: Unpack[CornerOptions],
) -> Path:
    """Write one HTML file in which a path is drawn and planned, without a server or a network.

    Args:
        path: the file.
        robot: robot.toml or the name of a preset, or the robot, that the page begins with. Robots with effects or
            a calibration cannot be changed in the page.
        paths: PATH, that the page offers: CSV, SVG, or a shape such as circle:20cm; or points (n, 2) or a Path2D
            by name, in tail lengths l. The first one is planned when the page opens.
        smooth: LENGTH, smooth drawn strokes over this length, such as 1cm.
        title: of the page.
        options: of the first plan, see `CornerOptions`.

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
    swims, unit = one_robot(robot), options.get("unit")
    named = []
    if isinstance(paths, Mapping):
        for name, each in paths.items():
            drawn = each if isinstance(each, Path2D) else Path2D.of(each)
            named.append(NamedPath(name, drawn.scaled(swims.tail_length)))
    else:
        for name in paths:
            with naming(name):
                drawn = read_path(name).in_tails(swims, unit)
            short = Path(name).stem if shape_of(name) is None else name
            named.append(NamedPath(short, drawn.scaled(swims.tail_length)))
    table, known = table_of(robot, swims, options)
    over = None if smooth is None else length_of(smooth, unit, swims, "--smooth")
    request = request_of(options, swims)
    return write(path, swims, table, request, knowledge=known, paths=named, smooth=over, title=title or TITLE)
