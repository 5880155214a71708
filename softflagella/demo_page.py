"""Write the demo's page: its steps, with links to the files and pages that their commands have written.

It links to the demo's folder beside it, and to the documentation where there is a checkout of the repository.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from common.pages import Page
from common.provenance import code_version
from common.units import format_time
from sim.model.presets import INDEPENDENT, PRESETS
from sim.motion.steady_motion import lab_motion
from sim.pictures.robot_views import draw_from_above, scene
from softflagella.demo_steps import Done

_DOCS = Path(__file__).parents[1] / "docs"
_PAGE_PICTURE = _DOCS / "page.png"  # of the page that plans; there is none without a checkout
_PAGES = (  # of the documentation: name without suffix, title, what it is
    ("tutorial/schedule", "From a robot to a schedule", "the first tutorial, ten minutes"),
    ("tutorial/one-swim", "From one swim to a corrected robot", "the second tutorial"),
    ("tutorial/calibration", "Calibrating the model", "the third tutorial, with a table of runs"),
    ("howto/tank", "Calibrate your tank", "which runs to make"),
    ("reference/signs", "Signs and frames", "which way +1 turns, and a check on the bench"),
    ("explanation/lookup", "The look-up table", "what it learns, and how far it is from the simulator"),
    ("howto/tracker", "Keep a robot on its path with a camera", "a schedule with feedback"),
)
_YOURS = (
    "softflagella robot paper-control --out robot.toml",
    "softflagella plan square:30cm --robot robot.toml --out plan",
    "softflagella replay plan/plan.json --out simulated.csv",
)


def write_page(out: Path, steps: Sequence[Done], seconds: float) -> None:
    """Write the page; the files of the steps are in the folder `demo` beside it."""
    page = Page(
        "A soft flagellated robot, from a robot.toml to a schedule, in simulation",
        "A motor in a cylindrical head turns straight elastic tails just below the surface of a viscous fluid. "
        "Its only control input is the direction of the motor. On this page the robot is simulated, its motion "
        "learned, three paths are planned without simulating and replayed in the simulator, and the model is "
        "corrected from one swim, or from runs. The commands were run in the folder `demo` beside this page.",
    )
    for done in steps:
        step = done.step
        page.section(step.title)
        page.text(step.words)
        if done is steps[0]:
            page.figure(_robot_from_above(), "the robot from above, to scale, with its axes, heading and path")
            page.text(_independent())
        picture = out.parent / "demo" / step.picture if step.picture else _PAGE_PICTURE
        if step.picture or ("page.html" in step.files and picture.is_file()):
            page.picture(picture.read_bytes(), step.title)
        page.commands(done.lines())
        page.links([(f"demo/{path}", path, what) for path, what in step.files.items()])
    page.section("With your own robot: three commands")
    page.commands(_YOURS)
    page.text(
        "The first writes an example: put in the numbers of your robot and of your fluid. The second plans a "
        "square with sides of 30 cm; a path can be a circle, a polygon, a table of points or an SVG drawing. The "
        "third simulates the schedule. With a track of your robot, `softflagella calibrate track.csv --robot "
        "robot.toml --plan plan/plan.json --out calibrated` says what the model lacks, and corrects it."
    )
    page.links(documentation(out.parent))
    page.write(out, f"code {code_version()}, made in {format_time(seconds)}")


def _robot_from_above() -> Figure:
    """Draw the robot to scale, with its frame and the motor at +1."""
    figure = Figure(figsize=(4.9, 3.6))
    axes = figure.add_subplot()
    draw_from_above(axes, scene(PRESETS["paper-control"]))
    axes.set_aspect("equal")
    axes.axis("off")
    return figure


def _independent() -> str:
    """Say how the robot moves according to an independent solver."""
    numbers = {name: np.array([value]) for name, value in INDEPENDENT.items()}
    lab = {name: float(values[0]) for name, values in lab_motion([PRESETS["paper-control"]], numbers).items()}
    return (
        f"Another program for the same equations finds a turn radius of {lab['R_yr_cm']:.4g} cm and a speed of "
        f"{lab['v_cm_s']:.4g} cm/s."
    )


def documentation(folder: Path) -> list[tuple[str, str, str]]:
    """List pages of the documentation, relative to a folder: HTML if it was built; none without a checkout."""
    built = _DOCS / "_build" / "html"
    root, suffix = (built, ".html") if (built / "index.html").is_file() else (_DOCS, ".md")
    return [
        (os.path.relpath(path, folder), title, words)
        for name, title, words in _PAGES
        if (path := root / f"{name}{suffix}").is_file()
    ]
